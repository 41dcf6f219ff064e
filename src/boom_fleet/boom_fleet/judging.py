"""From what the screen kept to what is said of each machine: which recordings are raised, what changed, since when, and how far."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from boom_fleet.evidence import ROUGH, Change, ChangeHistory, MachinePosterior, NumberKinds, posterior
from boom_fleet.habits import apparent, likeliest, profile, usual
from boom_fleet.numbers import QuantityColumn, TrackedQuantity
from boom_fleet.past import YEAR, Direction, Evidence
from boom_fleet.paths import Path

Array = NDArray[np.float64]


SAME_TIME = 10.0
"""s. No machine is recorded twice within: where two recordings begin so near, their clock tells nothing."""
UNDATED = YEAR / 12.0
"""s that are taken to lie between them then."""


def dated(times: Sequence[float]) -> Array:
    """Times [s] of a machine's recordings in their order, ascending, with ``UNDATED`` between those whose clock tells nothing."""
    apart = np.diff(np.asarray(times, dtype=float))
    return np.concatenate([times[:1], times[0] + np.cumsum(np.where(apart < SAME_TIME, UNDATED, apart))])


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
        histories: what was known after each of them; changes that the recording before it showed, too (:func:`confirmed`).
        raised: keys of the recordings that confirmed that something further had changed.
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
    found = _profile(several)
    for frame in frames.values():
        frame.kinds = frame.kinds._replace(
            effects=np.array([found.get(n, k) for n, k in zip(frame.names, frame.kinds.effects, strict=True)])
        )
    form, wander = usual([likeliest(f.evidence, f.kinds) for f in several])
    threshold = false_alarms / max(1, len(frames))
    return {machine: frame.judged(machine, form, wander, threshold) for machine, frame in frames.items()}


def _profile(frames: Sequence[_Frame]) -> dict[str, float]:
    """Effect's number -> how much more of it healthy machines seem to have than of all on the mean; from machines that know it."""
    squares: dict[str, list[float]] = {}
    for frame in frames:
        own = apparent(frame.evidence, frame.kinds)
        for name, square, is_effect in zip(frame.names, own, frame.kinds.effects, strict=True):
            if is_effect:
                squares.setdefault(name, []).append(float(square))
    known = [name for name, rows in squares.items() if len(rows) == len(frames)]
    if not known:
        return {}
    return dict(zip(known, profile(np.array([squares[name] for name in known]).T).tolist(), strict=True))


def confirmed(seen: Sequence[ChangeHistory]) -> tuple[ChangeHistory, ...]:
    """What was seen after each recording, with as many changes as were seen after the one before it, too.

    One recording can be odd, of a machine that is sound the next day: an accumulator that ran empty, another load than told. What
    has changed is still seen in the recording that follows.
    """
    before = [0, *(len(history.changes) for history in seen)]
    return tuple(replace(h, changes=h.changes[:count]) for h, count in zip(seen, before[:-1], strict=True))


class _Frame:
    """A machine's recordings in one set of numbers."""

    def __init__(self, kept: Sequence[Kept], quantities: Sequence[TrackedQuantity]) -> None:
        self.kept = sorted(kept, key=lambda k: k.time)  # of equal time as given
        self.quantities = {q.id: q for q in quantities}
        self.names = tuple(dict.fromkeys(name for k in self.kept for name in k.names))
        self.times = dated([k.time for k in self.kept])
        self.evidence = [self._evidence(k, float(at)) for k, at in zip(self.kept, self.times, strict=True)]
        sound = {name: q.sound for q in quantities for column in q.columns for name, _ in column.direction}
        self.kinds = NumberKinds(
            effects=np.array([float(name.startswith("effects.")) for name in self.names]),
            own=np.array([name == "pose.load" for name in self.names]),
            sound=np.array([sound.get(name, 0.0) for name in self.names]),
        )

    def _evidence(self, kept: Kept, time: float) -> Evidence:
        at = [self.names.index(name) for name in kept.names]
        matrix, vector = np.zeros((len(self.names),) * 2), np.zeros(len(self.names))
        matrix[np.ix_(at, at)], vector[at] = kept.matrix, kept.vector
        return Evidence(time, matrix, vector)

    def _direction(self, column: QuantityColumn, form: float) -> Direction:
        along = np.zeros(len(self.names))
        for name, share in column.direction:
            along[self.names.index(name)] = share
        usual = form * float(self.kinds.effects @ along)
        return Direction(column.id, along, column.low, column.high, usual, column.node)

    def judged(self, machine: str, form: float, wander: float, threshold: float) -> Judgement:
        paths = {
            q.id: Path(q.id, tuple(self._direction(column, form) for column in q.columns))
            for q in self.quantities.values()
        }
        past = posterior(self.evidence, self.kinds, form, wander, tuple(paths.values()))
        histories = confirmed([past.history(k + 1, threshold) for k in range(len(self.kept))])
        known = [0, *(len(h.changes) for h in histories)]
        raised = tuple(k.key for k, was, now in zip(self.kept, known[:-1], known[1:], strict=True) if now > was)
        changed = dict.fromkeys(c.quantity for h in histories for c in h.changes)
        return Judgement(
            machine, tuple(k.key for k in self.kept), tuple(k.time for k in self.kept), self._told(histories), raised,
            {name: self._levels(past, paths[name], self.quantities[name]) for name in changed},
        )  # fmt: skip

    def _told(self, histories: Sequence[ChangeHistory]) -> tuple[ChangeHistory, ...]:
        """With changes since the times that the recordings have, apart by what tells them in their order."""
        clock = {at: k.time + 1e-6 * n for n, (at, k) in enumerate(zip(self.times.tolist(), self.kept, strict=True))}

        def told(change: Change) -> Change:
            return replace(change, since=(clock[change.since[0]], clock[change.since[1]]))

        return tuple(replace(h, changes=tuple(told(c) for c in h.changes)) for h in histories)

    @staticmethod
    def _levels(past: MachinePosterior, path: Path, quantity: TrackedQuantity) -> tuple[TrendLevel, ...]:
        mean, known = past.levels(path)
        deviation = np.hypot(known, ROUGH * mean)
        scale = quantity.scale
        return tuple(
            TrendLevel(scale * m, scale * (m - 1.645 * d), scale * (m + 1.645 * d))
            for m, d in zip(mean, deviation, strict=True)
        )
