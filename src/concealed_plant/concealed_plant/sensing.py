"""Sensors and bus of chapters 4 and 6.4: turn a run into a recording.

Angle quantised to 360 deg / 2^14, pressures with 0.17 bar of noise quantised to 0.1 bar, rate with 1.5 mrad/s of noise, currents
with 0.8 mA of noise quantised to 1 mA and clipped at zero. Every topic has its own phase, every stamp a jitter of +-0.1 ms, and
single samples are lost.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from boom_input.channels import BY_NAME, REQUIRED, SENSOR_TOPICS
from boom_recording.recording import Configuration, Recording, Signal
from boom_recording.writing import START_NS
from concealed_plant.hidden import Sensing

Array = NDArray[np.float64]

ANGLE_QUANTUM = 2 * np.pi / 2**14
RATE_SIGMA = 1.5e-3
PRESSURE_SIGMA, PRESSURE_QUANTUM = float(np.sqrt(3.0e6 / 0.01)), 1.0e4
CURRENT_SIGMA, CURRENT_QUANTUM = 0.8e-3, 1.0e-3
PERIOD = 10  # ms
SEEN = ("angle", "rate", "hose_pressure", "rod_pressure")
"""What this plant shows; of its own, like all its physics."""
_TOPICS = tuple(tuple(c.name for c in REQUIRED if c.topic == topic) for topic in SENSOR_TOPICS)


@dataclass(frozen=True)
class Bus:
    """Share of lost samples of each topic; jitter of the stamps [s]; largest phase of a topic [s]."""

    loss: float = 0.002
    jitter: float = 1.0e-4
    phase: float = 2.0e-4


def seen(outputs: Array, sensing: Sensing) -> Array:
    """``SEEN`` (n, 4) of every millisecond as the sensors see them, before noise."""
    angle, rate, hose, rod = outputs.T
    drift = 1.0 + sensing.bias_drift * np.linspace(0.0, 1.0, len(angle))
    hose, rod = hose + sensing.hose_bias * drift, rod + sensing.rod_bias * drift
    pressures = [_late(_filtered(p, sensing.pressure_lag), sensing.pressure_dead_time) for p in (hose, rod)]
    shown = angle + sensing.angle_offset + sensing.angle_skew * np.sin(2.0 * angle)
    return np.stack([shown, sensing.rate_gain * _filtered(rate, sensing.rate_lag), *pressures], axis=-1)


def record(
    name: str, outputs: Array, currents: Array, configuration: Configuration, bus: Bus, rng: np.random.Generator
) -> Recording:
    """A recording of what the sensors see, outputs (n, 4), and of true currents (n, 2) [A], in every millisecond."""
    table = dict(zip(SEEN, outputs.T, strict=True))
    table |= {"retract_current": currents[:, 0], "extend_current": currents[:, 1]}
    duration = len(outputs) / 1000.0
    signals = {}
    for topic in _TOPICS:
        times = np.arange(0, len(outputs), PERIOD) / 1000.0 + bus.jitter + rng.uniform(0.0, bus.phase)
        times += rng.uniform(-bus.jitter, bus.jitter, len(times))
        times = np.clip(times, 0.0, duration - 1e-3)
        kept = rng.uniform(size=len(times)) >= bus.loss
        times = times[kept]
        stamps = START_NS + np.rint(times * 1e9).astype(np.int64)
        for signal in topic:
            values = _measured(signal, table[signal], times, rng)
            channel = BY_NAME[signal]
            valid = np.ones(len(times), dtype=np.bool_)
            signals[signal] = Signal(signal, channel.unit, channel.topic, stamps, times, values, valid)
    return Recording(name, Path(name), START_NS, duration, signals, stored_configuration=configuration)


def _measured(signal: str, values: Array, times: Array, rng: np.random.Generator) -> Array:
    noise = rng.standard_normal(len(times))
    if signal.endswith("current"):  # held by the controller: no value in between
        held = values[np.minimum((times * 1000.0 + 1e-6).astype(np.int64), len(values) - 1)]
        return np.asarray(np.maximum(_quantised(held + CURRENT_SIGMA * noise, CURRENT_QUANTUM), 0.0))
    # a row of the run is the state at the end of its millisecond
    true = np.interp(times, np.arange(1, len(values) + 1) / 1000.0, values)
    if signal == "angle":
        return _quantised(true, ANGLE_QUANTUM)
    if signal == "rate":
        return np.asarray(true + RATE_SIGMA * noise)
    return _quantised(true + PRESSURE_SIGMA * noise, PRESSURE_QUANTUM)


def _quantised(values: Array, quantum: float) -> Array:
    return np.asarray(np.round(values / quantum) * quantum, dtype=np.float64)


def _late(values: Array, dead_time: float) -> Array:
    """Values of every millisecond ``dead_time`` [s] later, with the first one held."""
    if dead_time == 0.0:
        return values
    index = np.arange(len(values), dtype=np.float64)
    return np.asarray(np.interp(index - 1000.0 * dead_time, index, values), dtype=np.float64)


def _filtered(values: Array, lag: float) -> Array:
    """First order with the time constant ``lag`` [s], started at rest."""
    if lag == 0.0:
        return values
    from scipy.signal import lfilter, lfiltic

    pole = float(np.exp(-1e-3 / lag))
    filtered, _ = lfilter([1.0 - pole], [1.0, -pole], values, zi=lfiltic([1.0 - pole], [1.0, -pole], [values[0]]))
    return np.asarray(filtered, dtype=np.float64)
