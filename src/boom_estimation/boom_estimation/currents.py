"""The recorded inputs of the model: currents, held from stamp to stamp, and pressures that drive it where they were recorded."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from boom_model.machine import Machine
from boom_model.structure import CURRENTS, DRIVING
from boom_recording.recording import Recording

Array = NDArray[np.float64]

GAP = 0.05
"""s. Between currents further apart than this they are unknown (contract)."""
MEASURED = 0.9
"""Share of valid samples from which a pressure drives the model."""


@dataclass(frozen=True)
class HeldCurrents:
    """Inputs: time (m,) [s] from which each acts, values (m, NU): retract, extend [A], then pressures [Pa] that drive the model."""

    time: Array
    values: Array

    def at(self, time: float) -> tuple[float, ...]:
        """The inputs that act at a time [s]; before the first sample the first."""
        k = max(0, int(np.searchsorted(self.time, time, side="right")) - 1)
        return tuple(self.values[k].tolist())

    def first_above(self, current: float, start: float) -> float:
        """When one of them first exceeds ``current`` [A] at or after ``start`` [s]; infinity if never."""
        later = self.time >= start
        above = np.flatnonzero(later & (self.values[:, : len(CURRENTS)].max(axis=1) > current))
        return float(self.time[above[0]]) if len(above) else float("inf")

    def stretches(self, end: float) -> list[tuple[float, float]]:
        """(start, end) [s] of the stretches without a gap, none without samples; the last ends at ``end`` at the latest."""
        if len(self.time) == 0:
            return []
        cuts = np.flatnonzero(np.diff(self.time) > GAP)
        starts = np.concatenate(([0], cuts + 1))
        ends = np.concatenate((self.time[cuts], [min(end, self.time[-1] + GAP)]))
        return [(float(self.time[k]), float(e)) for k, e in zip(starts, ends, strict=True) if e > self.time[k]]


def driven(machine: Machine, recording: Recording) -> Machine:
    """The machine, driven by those of its pressures that the recording holds nearly throughout."""
    signals = recording.signals
    return machine.driven_by([name for name in DRIVING if name in signals and signals[name].valid.mean() > MEASURED])


def held_inputs(recording: Recording, inputs: Sequence[str]) -> HeldCurrents:
    """The inputs (``Structure.inputs``) of a recording where both currents are valid; pressures between their samples by lines."""
    held = held_currents(recording)
    pressures = [recording.signals[name] for name in inputs[len(CURRENTS) :]]
    columns = [np.interp(held.time, s.time[s.valid], s.values[s.valid]) for s in pressures]
    return HeldCurrents(held.time, np.ascontiguousarray(np.column_stack((held.values, *columns))))


def held_currents(recording: Recording) -> HeldCurrents:
    """The currents of a recording at times when both are valid."""
    retract, extend = recording.signals["retract_current"], recording.signals["extend_current"]
    valid = retract.valid & extend.valid
    return HeldCurrents(retract.time[valid], np.column_stack((retract.values[valid], extend.values[valid])))
