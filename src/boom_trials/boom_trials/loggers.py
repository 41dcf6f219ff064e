"""How a recording looks from other loggers: coarse pressures, values that a bus repeats, late stamps, no gyro."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from boom_recording.recording import Recording

Array = NDArray[np.float64]

CAN_BIT = 2.0e5
"""Pa: pressure per bit on some CAN buses."""
JITTER = 0.1
FILTER_TIME = 0.03
"""s: of the filter behind a derivative."""


def coarse(recording: Recording, quantum: float = CAN_BIT) -> None:
    """Pressures in steps of ``quantum`` [Pa]."""
    for name, signal in recording.signals.items():
        if signal.unit == "Pa":
            _replace(recording, name, np.round(signal.values / quantum) * quantum)


def repeated(recording: Recording, every: int) -> None:
    """Pressures of a source slower than the bus: each value is sent ``every`` times."""
    for name, signal in recording.signals.items():
        if signal.unit == "Pa":
            _replace(recording, name, signal.values[np.arange(len(signal.values)) // every * every])


def without_gyro(recording: Recording) -> None:
    """The rate [rad/s] as the derivative of the angle behind a low-pass filter of ``FILTER_TIME``."""
    angle = recording.signals["angle"]
    raw = np.gradient(angle.values, angle.time)
    step = float(np.median(np.diff(angle.time)))
    share, rate, value = step / (FILTER_TIME + step), np.empty_like(raw), 0.0
    for k, slope in enumerate(raw):
        value += share * (slope - value)
        rate[k] = value
    _replace(recording, "rate", rate)


def jittered(recording: Recording, rng: np.random.Generator) -> None:
    """Stamps of a busy sender: each topic's off by up to ``JITTER`` of its period."""
    for topic in {signal.topic: None for signal in recording.signals.values()}:
        own = [signal for signal in recording.signals.values() if signal.topic == topic]
        step = float(np.median(np.diff(own[0].time)))
        off = np.rint(1e9 * step * JITTER * rng.uniform(0.0, 1.0, len(own[0].time))).astype(np.int64)
        for signal in own:
            moved = replace(signal, stamps_ns=signal.stamps_ns + off, time=signal.time + 1e-9 * off)
            recording.signals[signal.name] = moved


def _replace(recording: Recording, name: str, values: Array) -> None:
    recording.signals[name] = replace(recording.signals[name], values=values)
