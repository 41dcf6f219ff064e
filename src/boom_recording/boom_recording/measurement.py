"""What the channels of a recording can tell: which are there, how noisy, how coarse, how often repeated, and which say the same.

The noise of a channel is that of its third differences, the resolution the smallest step between its values.
A rate that a logger computes from the angle has the angle's own noise in it: both count as one measurement.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import hypot, sqrt

import numpy as np
from numpy.typing import NDArray

from boom_input.channels import PREDICTED, SENSORS
from boom_recording.recording import Floats, Recording, Signal

FEWEST = 200
"""Samples, from which noise can be told."""
WINDOW = 50
"""Samples of a window. The noise is told by the quieter windows: in others an oscillation may add to third differences."""
QUIET, OF_QUIET = 0.25, 0.886
"""The quantile over the windows, and what it is of the standard deviation of white noise (by simulation)."""
DERIVED = 0.5
"""Coherence of angle and rate in ``BAND`` from which the rate is a derivative: a gyro has 0.02 there, a filtered derivative 0.9."""
BAND = (0.15, 0.45)
"""Of the sample rate: where a boom does not move."""
SEGMENT = 128
"""Samples of one spectrum; the coherence is that of the mean of all."""
COARSE = 20
"""A resolution is told where at least so many steps between values are multiples of it."""


@dataclass(frozen=True)
class ChannelMeasurement:
    """What one channel of a recording can tell.

    Attributes:
        name: of the channel.
        samples: valid ones. period: median time between them [s], NaN without any.
        sigma: standard deviation of its noise [SI], NaN where there are too few samples.
        quantum: resolution [SI], 0 where it is finer than the numbers tell.
        repeats: how often a value is sent on average before the next one is measured, 1: never again.
        derived_from: channel whose derivative it is; its noise is that one's, and both count as one. Empty: independent.
    """

    name: str
    samples: int
    period: float
    sigma: float
    quantum: float
    repeats: float
    derived_from: str = ""

    @property
    def independent(self) -> bool:
        """Whether it is there and tells what no other channel does."""
        return self.samples > 0 and not self.derived_from

    @property
    def deviation(self) -> float:
        """Standard deviation of noise and rounding together [SI]."""
        return hypot(self.sigma, self.quantum / sqrt(12.0))


def measurements(recording: Recording) -> dict[str, ChannelMeasurement]:
    """What the sensors of a recording can tell, by name of the channel; one that was not recorded has no samples."""
    result = {}
    for sensor in SENSORS:
        signal = recording.signals.get(sensor.name)
        if signal is not None or sensor in PREDICTED:
            result[sensor.name] = _nothing(sensor.name) if signal is None else channel_measurement(signal)
    angle, rate = recording.signals.get("angle"), recording.signals.get("rate")
    if angle is not None and rate is not None and _is_derivative(angle, rate):
        own = result["rate"]
        result["rate"] = ChannelMeasurement(
            "rate", own.samples, own.period, own.sigma, own.quantum, own.repeats, "angle"
        )
    return result


def without_repeats(recording: Recording) -> Recording:
    """The recording without the samples of sensors that say again what was measured before; the first of each is kept."""
    fresh = {}
    for sensor in PREDICTED:
        signal = recording.signals.get(sensor.name)
        if signal is not None and channel_measurement(signal).repeats > 1.0:
            new = np.concatenate(([True], np.diff(signal.values) != 0))
            fresh[sensor.name] = replace(signal, valid=signal.valid & new)
    return replace(recording, signals={**recording.signals, **fresh}) if fresh else recording


def _nothing(name: str) -> ChannelMeasurement:
    return ChannelMeasurement(name, 0, float("nan"), float("nan"), 0.0, 1.0)


def channel_measurement(signal: Signal) -> ChannelMeasurement:
    """What one signal can tell by itself."""
    if not signal.valid.any():
        return _nothing(signal.name)
    values, time = signal.values[signal.valid], signal.time[signal.valid]
    period = float(np.median(np.diff(time))) if len(time) > 1 else float("nan")
    quantum, repeats = _quantum(values), _repeats(values)
    fresh = values[np.concatenate(([True], np.diff(values) != 0))] if repeats > 1.0 else values
    return ChannelMeasurement(signal.name, len(values), period, _noise(fresh, quantum), quantum, repeats)


def _quantum(values: Floats) -> float:
    """The step of which all steps between values are multiples; 0 if there is none."""
    steps = np.diff(np.unique(values))
    scale = float(np.abs(values).max())
    steps = steps[steps > 1e-9 * max(scale, 1e-12)]  # what a double does not tell apart is one value
    if len(steps) < 2:
        return float(steps[0]) if len(steps) else 0.0
    quantum = float(np.median(steps[steps < 1.5 * steps.min()]))
    multiples = steps / quantum
    fits = np.abs(multiples - np.round(multiples)) < 0.02 * np.maximum(1.0, multiples)
    few = len(steps) < len(values) / 2  # of random numbers nearly all differ
    return quantum if fits.mean() > 0.95 and (few or (len(steps) >= COARSE and np.median(multiples) < 1.5)) else 0.0


def _repeats(values: Floats) -> float:
    """Mean length of the runs of one value, where values come in runs whose lengths do not look like chance."""
    edges = np.flatnonzero(np.concatenate(([True], np.diff(values) != 0, [True])))
    lengths = np.diff(edges)
    if len(lengths) < COARSE:
        return 1.0
    typical = float(np.median(lengths))
    # chance makes runs of all lengths, most of them of one; a bus makes runs of one length and hardly any shorter
    regular = typical >= 2 and np.mean(lengths >= typical - 1) > 0.9 and np.mean(np.abs(lengths - typical) <= 1) > 0.6
    return float(np.mean(lengths[lengths <= 2 * typical])) if regular else 1.0


def _noise(values: Floats, quantum: float) -> float:
    """Standard deviation of white noise beside the rounding, by third differences; NaN: too few samples."""
    if len(values) < FEWEST:
        return float("nan")
    third = np.diff(values, 3)[: (len(values) - 3) // WINDOW * WINDOW].reshape(-1, WINDOW) / sqrt(20.0)
    spread = np.sqrt(np.mean(third**2, axis=1))
    alive = spread[spread > 0.0]  # a value that stays is a coarse or a dead one, and tells no noise
    if len(alive) == 0:
        return 0.0
    total = float(np.quantile(alive, QUIET)) / OF_QUIET
    return sqrt(max(total**2 - quantum**2 / 12, 0.0))


def _is_derivative(angle: Signal, rate: Signal) -> bool:
    """Whether the noise of the rate is that of the angle, through some filter."""
    if not np.array_equal(angle.stamps_ns, rate.stamps_ns):
        return False
    both = angle.valid & rate.valid
    if both.sum() < 4 * SEGMENT or not (np.diff(angle.values[both]) != 0).any():
        return False
    return _coherence(angle.values[both], rate.values[both]) > DERIVED


def _coherence(a: Floats, b: Floats) -> float:
    """Median over ``BAND`` of |S_ab|^2 / (S_aa S_bb), spectra of half-overlapping segments (Welch) without their straight lines."""
    ramp = np.linspace(-1.0, 1.0, SEGMENT)
    line = np.stack((np.full(SEGMENT, SEGMENT**-0.5), ramp / np.linalg.norm(ramp)))

    def spectra(values: Floats) -> NDArray[np.complex128]:
        rows = np.lib.stride_tricks.sliding_window_view(values, SEGMENT)[:: SEGMENT // 2]
        return np.fft.rfft((rows - rows @ line.T @ line) * np.hanning(SEGMENT))

    one, other = spectra(a), spectra(b)
    power = (np.abs(one) ** 2).mean(axis=0) * (np.abs(other) ** 2).mean(axis=0)
    share = np.fft.rfftfreq(SEGMENT)
    inside = (share > BAND[0]) & (share < BAND[1]) & (power > 0.0)
    alike = np.abs((one * other.conj()).mean(axis=0)[inside]) ** 2 / power[inside]
    return float(np.median(alike)) if len(alike) else 0.0
