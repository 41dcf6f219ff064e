"""A command that was logged and not applied, and one that chatters.

Latched: an open valve moves the boom, or its supplied side stands at supply pressure. Where the logged command asks for a speed and
neither happens, the valve did not get it. The answer to be expected is the recording's own, so nothing need be known of the valve:

    log odds of a stretch = sum over its seconds of log(1 + (v' / s)^2),  s^2 = (scatter v')^2 + (k dc)^2 + s_v^2

v' the speed that the same command brings elsewhere in the recording, dc an uncertain dead zone; Cauchy's law, because speeds
depend on loads as well. A command smaller than those that moved the boom elsewhere is within a dead zone, as far as anybody knows.

Frozen: a log that repeats a command to the last bit while the boom comes to rest and then moves as that command does not move it.
The same law with v - v' in the place of v', and the rule of succession: if the operator's command stood still in k seconds of n,
one more is to be expected with (k + 1) / (n + 2).
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter1d

from boom_checks.check import IntervalValue, RecordingCheck
from boom_checks.even_series import PERIOD, EvenSeries
from boom_checks.mechanics import Mechanics
from boom_checks.readings import PRIOR, mean_measure
from boom_checks.relations import response
from boom_identification.signals import stretches
from boom_input.channels import BY_NAME

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

STILL = 3.0e-3
"""rad/s. Smoothed rate of a boom at rest: a gyro's noise and offset."""
CREEP = 5.0e5
"""Pa/s, mean over half a second. Pressures behind a closed valve: accumulators and seals."""
BLOCKED = 0.85
"""Share of the supply pressure from which the supplied side may hold a boom that cannot move."""
DEAD_ZONE = 0.03
"""Share of the largest command by which the dead zone found is uncertain: half a step of those tried."""
SHORTEST = 0.5
"""s. Spool and boom need that long to begin."""
NOISE = 0.01
"""A. Below it a current is zero."""
FEWEST = 0.01
"""Share of the samples in motion whose commands may be smaller than what moves the boom: it runs out, and a valve closes late."""
FASTEST_HAND = 0.2
"""s. Nobody and no boom turns round more often."""
LEAST_REVERSALS = 6
_TOPIC = BY_NAME["extend_current"].topic


def latched_checks(series: EvenSeries, boom: Mechanics, supply: float) -> list[RecordingCheck]:
    """Stretches in which the command was not applied; ``supply`` [Pa]: of the machine file, where none is measured.

    A pump that follows the load is at its limit where the boom cannot move: the largest pressure seen then stands for it.
    """
    expected, spread, lag = _expected(series, boom)
    unanswered = _unanswered(series, supply) & (np.abs(expected) > 0.0) & _moves_elsewhere(series, lag)
    with np.errstate(divide="ignore", invalid="ignore"):
        odds = np.where(unanswered, np.log1p((expected / spread) ** 2), 0.0)
    intervals, total, kept = [], 0.0, np.zeros(len(series.time), bool)
    for first, end in stretches(unanswered):
        gain = PERIOD * float(np.nansum(odds[first:end]))
        if (end - first) * PERIOD >= SHORTEST and gain > 1.0:
            intervals.append((float(series.time[first]), float(series.time[end - 1])))
            total += gain
            kept[first:end] = True
    if total + PRIOR <= 0.0:
        return []
    seconds = sum(end - start for start, end in intervals)
    start, stop = max(intervals, key=lambda part: part[1] - part[0])
    word = "" if len(intervals) == 1 else "longest "
    measure = mean_measure("piston speed that this command brings elsewhere", "m/s", np.abs(expected[kept]))
    sentence = (
        f"the command was logged and not applied for {seconds:.1f} s ({word}{start:.1f} to {stop:.1f} s): the boom stands and "
        "no pressure answers "
        f"({measure.text}); the valve was shut, as after a soft stop"
    )
    return [RecordingCheck("latched_command", _TOPIC, tuple(intervals), sentence, measure, total + PRIOR)]


def frozen_checks(series: EvenSeries, boom: Mechanics) -> list[RecordingCheck]:
    """Stretches in which the log of the command stood still and the valve got another one."""
    command, still = series.command, np.abs(series.smooth("rate")) < STILL
    expected, spread, _ = _expected(series, boom)
    speed = boom.lever(series.smooth("angle")) * series.smooth("rate")
    active = np.abs(command) > NOISE
    least = round(2.0 * SHORTEST / PERIOD)
    repeats = np.append(np.diff(command) == 0.0, False) & active
    frozen = [run for run in stretches(repeats) if run[1] - run[0] >= least]
    seconds = (np.count_nonzero(active) - sum(end - first for first, end in frozen)) * PERIOD
    alone = math.log((seconds + 2.0) / (len(frozen) + 1.0))
    intervals, total, against = [], 0.0, np.zeros(len(series.time), bool)
    for first, end in frozen:
        rests = [
            run
            for run in stretches(_within(still, first + least // 2, end))
            if run[1] - run[0] >= FASTEST_HAND / PERIOD
        ]
        again = _within(~still, rests[0][1] if rests else end, end)
        gain = PERIOD * float(np.nansum(np.log1p(((speed - expected) / spread)[again] ** 2)))
        if gain + alone + PRIOR > 0.0:
            intervals.append((float(series.time[first]), float(series.time[end - 1])))
            total += gain
            against |= again
    if not intervals:
        return []
    measure = mean_measure(
        "speed of the piston beside what this command brings elsewhere", "m/s", (speed - expected)[against]
    )
    sentence = (
        f"the log of the command stands still for {sum(end - start for start, end in intervals):.1f} s, and the boom does not: it "
        f"stops and moves again ({measure.text}); what the valve got was not logged"
    )
    return [RecordingCheck("latched_command", _TOPIC, tuple(intervals), sentence, measure, total + alone + PRIOR)]


def _within(flags: Flags, first: int, end: int) -> Flags:
    """The flags (n,) from ``first`` to ``end``, and none outside."""
    result = np.zeros(len(flags), bool)
    result[first:end] = flags[first:end]
    return result


def _expected(series: EvenSeries, boom: Mechanics) -> tuple[Array, Array, int]:
    """The speed (n,) that the command brings by the rest of the recording, its spread (n,) [m/s], and its lag [samples]."""
    speed = boom.lever(series.smooth("angle")) * series.smooth("rate")
    moving = np.abs(series.smooth("rate")) > STILL
    answer = response(np.where(moving, series.command, np.nan), speed)  # what may be latched must not weaken the answer
    expected = answer.speed(series.command)
    largest = float(np.nanmax(np.abs(expected), initial=0.0))
    asked = moving & (np.abs(expected) > 0.2 * largest)
    scatter = float(np.nanmedian(np.abs(speed[asked] / expected[asked] - 1.0))) / 0.6745 if asked.any() else 1.0
    zone = DEAD_ZONE * float(np.nanmax(np.abs(series.command), initial=0.0))
    uncertain = np.maximum(*(np.abs(answer.speed(series.command + shift) - expected) for shift in (-zone, zone)))
    return expected, np.sqrt((scatter * expected) ** 2 + uncertain**2 + (STILL * 0.3) ** 2), answer.lag


def _moves_elsewhere(series: EvenSeries, lag: int) -> Flags:
    """Where the command is at least as large as those of the same sign that moved the boom, which follows by ``lag`` [samples]."""
    late = series.command[np.maximum(0, np.arange(len(series.time)) - lag)]
    rate, result = series.smooth("rate"), np.zeros(len(series.time), bool)
    for sign in (1.0, -1.0):
        moved = sign * late[(sign * rate > STILL) & (sign * late > NOISE)]
        if len(moved):
            result |= sign * series.command >= np.quantile(moved, FEWEST)
    return result


def _unanswered(series: EvenSeries, supply: float) -> Flags:
    """Where the boom stands, the pressures stand, and the supplied side is not at supply pressure."""
    seen = max(float(np.nanmax(series.smooth(name), initial=0.0)) for name in ("hose_pressure", "rod_pressure"))
    top = (
        series.smooth("supply_pressure")
        if "supply_pressure" in series
        else np.full(len(series.time), min(supply, seen))
    )
    supplied = np.where(series.command > 0.0, series.smooth("hose_pressure"), series.smooth("rod_pressure"))
    with np.errstate(invalid="ignore"):
        still = np.abs(series.smooth("rate")) < STILL
        for name in ("hose_pressure", "rod_pressure"):
            still &= np.abs(uniform_filter1d(np.nan_to_num(series.smooth(name, 1)), round(SHORTEST / PERIOD))) < CREEP
        return np.asarray(still & (supplied < BLOCKED * top))


def chatter_checks(series: EvenSeries) -> list[RecordingCheck]:
    """Stretches in which the command turns round faster than any hand, boom or spool: a dead-band compensation at rest."""
    command = series.columns["extend_current"] - series.columns["retract_current"]
    active = np.flatnonzero(np.abs(command) > NOISE)
    turns = series.time[active[1:][np.diff(np.sign(command[active])) != 0]] if len(active) > 1 else np.empty(0)
    if len(turns) < LEAST_REVERSALS:
        return []
    cuts = np.flatnonzero(np.diff(turns) > FASTEST_HAND)
    runs = [run for run in np.split(turns, cuts + 1) if len(run) >= LEAST_REVERSALS]
    if not runs:
        return []
    count, seconds = sum(len(run) - 1 for run in runs), sum(float(run[-1] - run[0]) for run in runs)
    rate, half = count / seconds, 1.645 * math.sqrt(count) / seconds
    measure = IntervalValue("turns", rate, "1/s", (rate - half, rate + half))
    sentence = (
        f"the command turns round {rate:.0f} times a second for {seconds:.1f} s: a dead-band compensation chatters, the spool "
        "cannot follow, and its currents tell little there"
    )
    intervals = tuple((float(run[0]), float(run[-1])) for run in runs)
    return [RecordingCheck("chatter", _TOPIC, intervals, sentence, measure, count * math.log(2.0) + PRIOR)]
