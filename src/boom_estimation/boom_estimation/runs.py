"""Where free runs through a recording begin and end: at gaps in the currents, at voids of the head side, at ends of the range.

At a void the oil evaporates; at an end the boom stands while the lever is held on. How far it moves meanwhile follows from the size
of the void, which no sensor shows, or from a stop, which the model does not have. Behind it a run starts from what is measured.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter1d, minimum_filter1d

from boom_estimation.currents import HeldCurrents
from boom_model.derived import valve_currents
from boom_model.machine import Machine
from boom_recording.recording import Recording

Array = NDArray[np.float64]

EVAPORATES, RARELY = 0.5e5, 0.1
"""Pa gauge: hose pressure below which the head side's oil evaporates. Share of the samples from which so low a pressure is none."""
REFILLED = 0.5
"""s. Behind the last sample that shows a void."""
NEAR_END = 0.05
"""rad. An end of the range lies no further from the file's: a sensor's mount, the last centimetre of a cylinder."""
DRIVEN, STANDS, STILL = 0.25, 0.5, 3e-3
"""Share of the way from the opening current to the full one from which a boom that is free moves, at a quarter of its speed; s for
which it stands then, and rad within which: eight steps of an encoder of 14 bits, a tenth of that speed."""
BEFORE, LEFT = 0.02, 5e-3
"""rad before the end from which the model's error may bring it there first; rad by which the boom has left it."""


def evaporating(recording: Recording) -> list[tuple[float, float]]:
    """(first, last) [s] samples of each time that the head side's oil evaporates; none where so low a pressure is the rule."""
    signal = recording.signals["hose_pressure"]
    low = signal.time[signal.valid & (signal.values < EVAPORATES)]
    if len(low) == 0 or len(low) > RARELY * np.sum(signal.valid):
        return []
    return [(float(t[0]), float(t[-1])) for t in np.split(low, np.flatnonzero(np.diff(low) > REFILLED) + 1)]


def at_an_end(recording: Recording, machine: Machine) -> list[tuple[float, float]]:
    """(first, last) [s] of each time that the boom stands at an end of its range while the valve drives it on."""
    signal = recording.signals["angle"]
    time, angle = signal.time[signal.valid], signal.values[signal.valid]
    span = float(time[-1] - time[0]) if len(time) else 0.0
    if span <= STANDS or not {"retract_current", "extend_current"} <= recording.signals.keys():
        return []
    opens, full = valve_currents(machine)
    window = max(2, round(STANDS * len(time) / span))  # a median would be 0 where stamps come in pairs
    stands = maximum_filter1d(angle, window) - minimum_filter1d(angle, window) < STILL
    result = []
    for name, end in (("retract_current", machine.angle_limits[0]), ("extend_current", machine.angle_limits[1])):
        current = recording.signals[name]
        driven = np.interp(time, current.time, current.values) > opens + DRIVEN * (full - opens)
        rows = np.flatnonzero(stands & driven & (np.abs(angle - end) < NEAR_END))
        for k in np.split(rows, np.flatnonzero(np.diff(rows) > 1) + 1):
            if len(k) > window:
                apart = np.abs(angle - np.median(angle[k]))
                before, after = np.flatnonzero(apart[: k[0]] > BEFORE), np.flatnonzero(apart[k[-1] :] > LEFT)
                first = int(before[-1]) + 1 if len(before) else 0
                result.append((float(time[first]), float(time[k[-1] + after[0]] if len(after) else time[-1])))
    return result


def free_stretches(
    recording: Recording, currents: HeldCurrents, machine: Machine, holds: bool
) -> list[tuple[float, float]]:
    """(start, end) [s] of the free runs, in order; ``holds``: behind a valve that holds the load the hose tells of no void."""
    result = []
    left_out = [] if holds else [(first, last + REFILLED) for first, last in evaporating(recording)]
    left_out = _merged([*left_out, *at_an_end(recording, machine)])
    for start, end in currents.stretches(recording.duration):
        inside = [(first, last) for first, last in left_out if start < last and first < end]
        begins, ends = [start, *(refilled for _, refilled in inside)], [*(first for first, _ in inside), end]
        result += [(b, e) for b, e in zip(begins, ends, strict=True) if e > b]
    return result


def _merged(stretches: list[tuple[float, float]]) -> list[tuple[float, float]]:
    """In order, those that overlap as one."""
    result: list[tuple[float, float]] = []
    for first, last in sorted(stretches):
        if result and first <= result[-1][1]:
            result[-1] = (result[-1][0], max(last, result[-1][1]))
        else:
            result.append((first, last))
    return result
