"""An angle that jumps while the gyro does not turn: the sensor slipped on its mount, or was set to zero, during the recording."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import cumulative_trapezoid
from scipy.ndimage import maximum_filter1d, median_filter
from scipy.stats import median_abs_deviation

from boom_checks.check import IntervalValue, RecordingCheck
from boom_checks.readings import PRIOR, Z_90
from boom_checks.sampling import independent
from boom_input.channels import BY_NAME
from boom_input.turns import TURN, turns_away, without_turns
from boom_model.machine import Machine
from boom_recording.measurement import without_repeats
from boom_recording.recording import Recording

Array = NDArray[np.float64]

LEAST = 500
"""Samples without which nothing is said."""
CLEAR = 12.0
"""Standard deviations of what angle and integrated rate differ by from sample to sample: no noise reaches that."""
FINEST = 1e-5
"""rad. Of an encoder of 19 bits: a simulated angle without noise is no finer."""
FASTER = 2.0
"""Times the largest rate about it at which the angle would have to turn: what a gyro's filter smooths is less."""
STAYS, SHARE = 0.3, 0.7
"""s before and after over which a jump must stay, and the share of it that must: a single wrong sample comes back."""
AROUND = 11
"""Samples about a jump that it stands out from."""
SHOWN = 3
"""Jumps that the sentence gives the time of."""
SURE = 50.0
"""Log odds of a jump by a whole turn within a sample."""
GAP = 3.0
"""Sample times. What happened in a longer gap is not known."""


def jump_checks(recording: Recording) -> list[RecordingCheck]:
    """Instants at which the angle jumps and stays, and the integral of the rate does not.

    d_k = (a_k - a_{k-1}) - integral of the rate from t_{k-1} to t_k [rad], less the median of those around it.
    """
    if not {"angle", "rate"} <= set(recording.signals):
        return []
    signals = without_repeats(independent(recording)).signals
    angle, rate = signals["angle"], signals["rate"]
    if min(angle.valid.sum(), rate.valid.sum()) < LEAST:
        return []
    time, values, turning = angle.time[angle.valid], angle.values[angle.valid], rate.values[rate.valid]
    turned = cumulative_trapezoid(turning, rate.time[rate.valid], initial=0)
    left = values - np.interp(time, rate.time[rate.valid], turned)
    apart, step = np.diff(time), np.diff(left)
    step -= median_filter(step, AROUND)  # a gyro with another gain or sign drifts, and does not jump
    noise, usual = (
        max(float(median_abs_deviation(step, scale="normal")), _resolution(values), FINEST),
        float(np.median(apart)),
    )
    fastest = maximum_filter1d(
        np.interp(time[1:], rate.time[rate.valid], np.abs(turning)), 2 * round(STAYS / usual) + 1
    )
    largest = np.maximum(CLEAR * noise, FASTER * fastest * apart)
    jumped = np.flatnonzero((np.abs(step) > largest) & (apart < GAP * usual))
    found = [k for k in jumped if _stays(time, left, int(k), float(step[k]))]
    if not found:
        return []
    worst = max(found, key=lambda k: abs(float(step[k])))
    size, half = float(step[worst]), Z_90 * noise
    measure = IntervalValue("jump", size, "rad", (size - half, size + half))
    more = f" and {len(found) - SHOWN} times more" if len(found) > SHOWN else ""
    where = ", ".join(f"{time[k + 1]:.2f} s" for k in found[:SHOWN]) + more
    sentence = (
        f"the angle jumps at {where} ({measure.text}) and stays there, while the gyro does not turn: the sensor slipped on its "
        "mount or was set to zero. Cut the recording there, or correct the angle from there on"
    )
    odds = 0.5 * min(float(np.abs(step[found]).min()) / noise, 2.0 * CLEAR) ** 2 - math.log(len(step)) + PRIOR
    intervals = tuple((float(time[k]), float(time[k + 1])) for k in found)
    return [RecordingCheck("jump", angle.topic, intervals, sentence, measure, odds)]


def turn_checks(recording: Recording, machine: Machine) -> tuple[list[RecordingCheck], Recording]:
    """Whether the angle jumps by whole turns, or lies one away from where the boom can be; and the recording without them."""
    angle = recording.signals.get("angle")
    if angle is None:
        return [], recording
    told = np.isfinite(angle.values)  # what lies far out is not valid, and told all the same
    if told.sum() < 2:
        return [], recording
    time, values = angle.time[told], angle.values.copy()
    values[told], jumps = without_turns(angle.values[told])
    low, high = machine.angle_limits
    away = turns_away(values[told])
    values -= away * TURN
    if len(jumps):
        more = f" and {len(jumps) - SHOWN} times more" if len(jumps) > SHOWN else ""
        where = ", ".join(f"{time[k]:.2f} s" for k in jumps[:SHOWN]) + more
        said = f"jumps by whole turns at {where}: its sensor counts from 0 to a turn"
    elif away and low <= float(np.median(values[told])) <= high:
        larger = "larger" if away > 0 else "smaller"
        said = f"is {larger} by a whole turn than the boom's"
    else:
        return [], recording
    at = float(np.abs(angle.values[told]).max())
    check = RecordingCheck(
        "jump", angle.topic, tuple((float(time[k - 1]), float(time[k])) for k in jumps),
        f"the angle {said}. Take whole turns out: ./boom import does",
        IntervalValue("largest angle, as recorded", at, "rad", (at, at)), SURE,
    )  # fmt: skip
    channel = BY_NAME["angle"]
    inside = (angle.values >= channel.low) & (angle.values <= channel.high)
    masked = inside & ~angle.valid  # for another reason than its size
    repaired = replace(angle, values=values, valid=told & ~masked & (values >= channel.low) & (values <= channel.high))
    return [check], replace(recording, signals={**recording.signals, "angle": repaired})


def _resolution(values: Array) -> float:
    """Smallest step [rad] between values that stay for two samples: of an encoder; 0 where none does.

    One that slips leaves the grid that ``measurement`` looks for, and where an import puts the angle on the stamps of the rate
    there are values between two steps, which do not stay.
    """
    levels = values[1:][np.abs(np.diff(values)) <= FINEST]
    steps = np.abs(np.diff(levels))
    steps = steps[steps > FINEST]
    return float(steps.min()) if len(steps) else 0.0


def _stays(time: Array, left: Array, k: int, step: float) -> bool:
    """Whether what jumps between samples ``k`` and ``k + 1`` stays, by the medians before and after."""
    first, last = np.searchsorted(time, [time[k] - STAYS, time[k] + STAYS], side="right")
    before, after = left[first : k + 1], left[k + 1 : last]
    if min(len(before), len(after)) < 3:
        return False
    return (float(np.median(after)) - float(np.median(before))) / step > SHARE
