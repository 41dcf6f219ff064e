"""Where free runs through a recording begin and end: at gaps in the currents, and where the head side's oil evaporates.

How far the boom moves meanwhile follows from neither: from the size of a void, for instance, which no sensor shows. Behind it a
run starts from what is measured.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from boom_estimation.currents import HeldCurrents
from boom_recording.recording import Recording

Array = NDArray[np.float64]

EVAPORATES, RARELY = 0.5e5, 0.1
"""Pa gauge: hose pressure below which the head side's oil evaporates. Share of the samples from which so low a pressure is none."""
REFILLED = 0.5
"""s. Behind the last sample that shows a void."""


def evaporating(recording: Recording) -> list[tuple[float, float]]:
    """(first, last) [s] samples of each time that the head side's oil evaporates; none where so low a pressure is the rule."""
    signal = recording.signals["hose_pressure"]
    low = signal.time[signal.valid & (signal.values < EVAPORATES)]
    if len(low) == 0 or len(low) > RARELY * np.sum(signal.valid):
        return []
    return [(float(t[0]), float(t[-1])) for t in np.split(low, np.flatnonzero(np.diff(low) > REFILLED) + 1)]


def free_stretches(recording: Recording, currents: HeldCurrents, holds: bool) -> list[tuple[float, float]]:
    """(start, end) [s] of the free runs, in order; ``holds``: behind a valve that holds the load the hose tells of no void."""
    result = []
    voids = [] if holds else evaporating(recording)
    for start, end in currents.stretches(recording.duration):
        inside = [(first, last + REFILLED) for first, last in voids if start < last + REFILLED and first < end]
        begins, ends = [start, *(refilled for _, refilled in inside)], [*(first for first, _ in inside), end]
        result += [(b, e) for b, e in zip(begins, ends, strict=True) if e > b]
    return result
