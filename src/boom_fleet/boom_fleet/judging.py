"""From what the screen kept to what is said of each machine: which recordings are raised, what changed, since when, and how far."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from boom_fleet.evidence import Change, ChangeHistory, Direction, Evidence, MachinePosterior, habits, posterior
from boom_fleet.numbers import TrackedQuantity

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Kept:
    """One screened recording of a machine: its names, matrix and vector, and when it was made [s]."""

    key: str
    time: float
    names: tuple[str, ...]
    matrix: Array
    vector: Array


@dataclass(frozen=True)
class TrendLevel:
    """Size of a quantity in a recording, against the machine's first one, with its 90 % interval [unit of the quantity]."""

    value: float
    low: float
    high: float


@dataclass(frozen=True)
class Judgement:
    """What is said of one machine.

    Attributes:
        keys: of its screened recordings, in the order of time.
        histories: what was known after each of them.
        raised: keys of the recordings after which something further had changed.
        levels: quantity -> its size in each recording; of what has changed.
    """

    machine: str
    keys: tuple[str, ...]
    times: tuple[float, ...]
    histories: tuple[ChangeHistory, ...]
    raised: tuple[str, ...]
    levels: Mapping[str, tuple[TrendLevel, ...]]

    @property
    def changes(self) -> tuple[Change, ...]:
        """As known after the last recording."""
        return self.histories[-1].changes if self.histories else ()


def judge(
    fleet: Mapping[str, Sequence[Kept]], quantities: Mapping[str, Sequence[TrackedQuantity]], false_alarms: float
) -> dict[str, Judgement]:
    """Every machine, by name.

    Args:
        fleet: machine -> its screened recordings.
        quantities: machine -> what may change in it.
        false_alarms: machines raised for nothing that are expected in a night of the fleet.
    """
    frames = {machine: _Frame(kept, quantities[machine]) for machine, kept in fleet.items() if kept}
    several = [f for f in frames.values() if len(f.evidence) > 1]
    form, wander = _habits(several)
    threshold = false_alarms / max(1, len(frames))
    return {machine: frame.judged(machine, form, wander, threshold) for machine, frame in frames.items()}


def _habits(frames: Sequence[_Frame]) -> tuple[float, float]:
    """Of machines with the same numbers; those of a fleet of which nothing can be compared are wide."""
    pairs = [habits([f.evidence], f.effects, f.own) for f in frames]
    if not pairs:
        return UNKNOWN
    form, wander = np.median(np.log(np.array(pairs)), axis=0)
    return float(np.exp(form)), float(np.exp(wander))


UNKNOWN = (0.1, 0.2)
"""``form`` and ``wander`` of a fleet without two recordings of one machine."""


class _Frame:
    """A machine's recordings in one set of numbers."""

    def __init__(self, kept: Sequence[Kept], quantities: Sequence[TrackedQuantity]) -> None:
        self.kept = sorted(kept, key=lambda k: (k.time, k.key))
        self.quantities = {q.id: q for q in quantities}
        self.names = tuple(dict.fromkeys(name for k in self.kept for name in k.names))
        self.evidence = [self._evidence(k) for k in self.kept]
        self.effects = np.array([name.startswith("effects.") for name in self.names])
        self.own = np.array([name == "pose.load" for name in self.names])

    def _evidence(self, kept: Kept) -> Evidence:
        at = [self.names.index(name) for name in kept.names]
        matrix, vector = np.zeros((len(self.names),) * 2), np.zeros(len(self.names))
        matrix[np.ix_(at, at)], vector[at] = kept.matrix, kept.vector
        return Evidence(kept.time, matrix, vector)

    def _direction(self, quantity: TrackedQuantity) -> Direction:
        along = np.zeros(len(self.names))
        for name, share in quantity.direction:
            along[self.names.index(name)] = share
        return Direction(quantity.id, along, quantity.low, quantity.high)

    def judged(self, machine: str, form: float, wander: float, threshold: float) -> Judgement:
        directions = {q.id: self._direction(q) for q in self.quantities.values()}
        past = posterior(self.evidence, self.effects, self.own, form, wander, tuple(directions.values()))
        histories = tuple(past.history(k + 1, threshold) for k in range(len(self.kept)))
        known = [0, *(len(h.changes) for h in histories)]
        raised = tuple(k.key for k, was, now in zip(self.kept, known[:-1], known[1:], strict=True) if now > was)
        changed = dict.fromkeys(c.quantity for h in histories for c in h.changes)
        return Judgement(
            machine, tuple(k.key for k in self.kept), tuple(k.time for k in self.kept), histories, raised,
            {name: self._levels(past, directions[name], self.quantities[name]) for name in changed},
        )  # fmt: skip

    @staticmethod
    def _levels(past: MachinePosterior, direction: Direction, quantity: TrackedQuantity) -> tuple[TrendLevel, ...]:
        mean, deviation = past.levels(direction)
        scale = quantity.scale
        return tuple(
            TrendLevel(scale * m, scale * (m - 1.645 * d), scale * (m + 1.645 * d))
            for m, d in zip(mean, deviation, strict=True)
        )
