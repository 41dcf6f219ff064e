"""Samples that are no samples: a bus that repeats its last value, and a rate that is the derivative of the angle."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from boom_checks.check import IntervalValue, RecordingCheck
from boom_checks.readings import PRIOR, Z_90
from boom_input.channels import SENSORS, Sensor
from boom_recording.recording import Recording, Signal

Array = NDArray[np.float64]

LEAST = 500
"""Samples without which nothing is said."""
TAPS = 41
"""Length of the filter that may make a rate of the angle."""
BAND = 0.6
"""Of the Nyquist frequency: above, a boom does not move, and what a rate shows is its own noise."""


def independent(recording: Recording) -> Recording:
    """The recording without a rate that was computed from its angle: it tells nothing more, and errs by what it smooths."""
    if not {"angle", "rate"} <= set(recording.signals):
        return recording
    rate = recording.signals["rate"]
    if _derived(recording.signals["angle"], rate) is None:
        return recording
    return replace(recording, signals={**recording.signals, "rate": replace(rate, valid=np.zeros_like(rate.valid))})


def sampling_checks(recording: Recording) -> list[RecordingCheck]:
    """Repeated samples of each sensor, and a rate without a gyro."""
    found = [_repeated(recording.signals[s.name], s) for s in SENSORS if s.name in recording.signals]
    if {"angle", "rate"} <= set(recording.signals):
        found.append(_derived(recording.signals["angle"], recording.signals["rate"]))
    return [check for check in found if check is not None]


def _repeated(signal: Signal, sensor: Sensor) -> RecordingCheck | None:
    """A repeat in the rhythm of a slower source, which coarse steps do not have.

    With independent noise a repeat is as likely behind a repeat as behind a change, or likelier where the signal rests. A bus that
    hands on each value m times never changes behind a change: log odds of that against chance.
    """
    values = signal.values[signal.valid]
    if len(values) < LEAST:
        return None
    same = np.diff(values) == 0.0
    share = float(np.mean(same))
    if not 0.0 < share < 1.0:
        return None
    changes = np.flatnonzero(~same)
    chance = 1.0 - share  # of a change, whatever was before
    after = int(np.sum(~same[1:] & ~same[:-1]))
    count = len(changes)
    odds = _binomial(after, count, max(after / count, 1e-3)) - _binomial(after, count, chance)
    if after / count >= chance or odds + PRIOR <= 0.0 or share < 0.4:
        return None
    period = float(np.median(np.diff(signal.time[signal.valid])))
    gaps = np.diff(changes).astype(float) * period
    half = Z_90 * float(np.std(gaps)) / math.sqrt(len(gaps))
    middle = float(np.mean(gaps))
    measure = IntervalValue("time between new values", middle, "s", (middle - half, middle + half))
    sentence = (
        f"{100 * share:.0f} % of the samples of the {sensor.label} repeat the one before ({measure.text}): the bus repeats a "
        "slower source"
    )
    return RecordingCheck("repeated", signal.topic, ((0.0, float(signal.time[-1])),), sentence, measure, odds + PRIOR)


def _binomial(hits: int, count: int, chance: float) -> float:
    return hits * math.log(chance) + (count - hits) * math.log1p(-min(chance, 1 - 1e-9))


def _derived(angle: Signal, rate: Signal) -> RecordingCheck | None:
    """A filter of the angle predicts the rate's noise: log odds of that filter against noise of its own, on the second half."""
    both = angle.valid & rate.valid if len(angle.values) == len(rate.values) else np.zeros(0, bool)
    if both.sum() < LEAST or not both.any():
        return None
    position, noise = np.diff(angle.values[both]), _fast(rate.values[both])[1:]
    window = np.lib.stride_tricks.sliding_window_view(_fast(position), TAPS)
    target = noise[TAPS // 2 : len(noise) - TAPS // 2]  # a derivative may be smoothed with what comes later, too
    half = len(target) // 2
    gram = window[:half].T @ window[:half]  # the normal equations: hundreds of thousands of rows, 41 columns
    taps = np.linalg.lstsq(gram, window[:half].T @ target[:half], rcond=None)[0]
    left, own = float(np.var(target[half:] - window[half:] @ taps)), float(np.var(target[half:]))
    if not own > 0.0 or not left < own:
        return None
    share = 1.0 - left / own  # a gyro's noise is its own: the angle explains none of it
    odds = -0.5 * (len(target) - half) * math.log(max(left / own, 1e-6)) + PRIOR
    if share < 0.5:
        return None
    spread = 2.0 * Z_90 * (1.0 - share) * math.sqrt(share / (len(target) - half))
    measure = IntervalValue(
        "share of the rate's noise that the angle explains", share, "-", (share - spread, min(share + spread, 1.0))
    )
    sentence = (
        f"the rate is the derivative of the angle, there is no gyro: {100 * share:.0f} % of its noise is the angle's"
    )
    return RecordingCheck("derived_rate", rate.topic, ((0.0, float(rate.time[-1])),), sentence, measure, odds)


def _fast(values: Array) -> Array:
    """What changes faster than a boom can."""
    from scipy.signal import butter, sosfiltfilt

    return np.asarray(sosfiltfilt(butter(4, BAND, "highpass", output="sos"), values))
