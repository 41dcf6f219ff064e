"""The recorded currents as the model's input: held from stamp to stamp, and the stretches in which they are known."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from boom_recording.recording import Recording

Array = NDArray[np.float64]

GAP = 0.05
"""s. Between currents further apart than this they are unknown (contract)."""


@dataclass(frozen=True)
class HeldCurrents:
    """Both currents: time (m,) [s] from which each acts, values (m, 2) [A] (retract, extend)."""

    time: Array
    values: Array

    def at(self, time: float) -> tuple[float, float]:
        """The currents [A] that act at a time [s]; before the first sample the first."""
        k = max(0, int(np.searchsorted(self.time, time, side="right")) - 1)
        return float(self.values[k, 0]), float(self.values[k, 1])

    def first_above(self, current: float, start: float) -> float:
        """When one of them first exceeds ``current`` [A] at or after ``start`` [s]; infinity if never."""
        later = self.time >= start
        above = np.flatnonzero(later & (self.values.max(axis=1) > current))
        return float(self.time[above[0]]) if len(above) else float("inf")

    def stretches(self, end: float) -> list[tuple[float, float]]:
        """(start, end) [s] of the stretches without a gap, none without samples; the last ends at ``end`` at the latest."""
        if len(self.time) == 0:
            return []
        cuts = np.flatnonzero(np.diff(self.time) > GAP)
        starts = np.concatenate(([0], cuts + 1))
        ends = np.concatenate((self.time[cuts], [min(end, self.time[-1] + GAP)]))
        return [(float(self.time[k]), float(e)) for k, e in zip(starts, ends, strict=True) if e > self.time[k]]


def held_currents(recording: Recording) -> HeldCurrents:
    """The currents of a recording at times when both are valid."""
    retract, extend = recording.signals["retract_current"], recording.signals["extend_current"]
    valid = retract.valid & extend.valid
    return HeldCurrents(retract.time[valid], np.column_stack((retract.values[valid], extend.values[valid])))
