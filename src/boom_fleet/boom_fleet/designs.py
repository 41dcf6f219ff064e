"""The posterior of a machine's numbers and of the changes that are accepted, and how likely a further one is beside them.

A change of a quantity runs along its path (``boom_fleet.paths``) as a step (g = 0, then 1) or a ramp (g grows by 1 in a year). It
is uneven where it is a step along one column of the path, whose size is another one in each recording, about a common one,

    delta_r = g_r (delta + e_r),    delta ~ N(0, 1),    e_r ~ N(0, UNEVEN^2)

because between its corners a path is not straight, and what a quantity seems to be depends on what the boom did. With J and j the
information and score of the sizes x of all recordings, theta and what is accepted integrated over, and K = g g' + UNEVEN^2 diag(g),

    ln odds = j'(K^-1 + J)^-1 j / 2 - ln det(1 + K J) / 2

An accepted change is a vector for each recording, that of its size delta divided by it, times a coefficient N(0, 1); a further one
of the same quantity goes on from where it has led.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import groupby
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from boom_fleet.past import YEAR, Direction, MachinePast
from boom_fleet.paths import Path, along_path

Array = NDArray[np.float64]

UNEVEN = 0.5
"""How much the size of an uneven change differs between recordings, in z."""
SMALL = 1e-6
"""Size at which a change moves the numbers as it does next to nothing, in z."""
Shape = Literal["step", "ramp", "uneven"]


@dataclass(frozen=True)
class ChangeCandidate:
    """A change that may have been: of a quantity, how, since when (see ``Change``), and how probable beforehand."""

    path: Path
    shape: Shape
    begin: int
    prior: float

    def course(self, times: Array) -> Array:
        """G at the times [s]."""
        if self.shape == "ramp":
            return np.asarray(np.maximum(0.0, times - times[self.begin]) / YEAR)
        return np.asarray(np.arange(len(times)) >= self.begin, dtype=float)


@dataclass(frozen=True)
class WeighedChange:
    """A candidate, its log odds against nothing further, prior included; the change's likeliest size, its standard deviation."""

    candidate: ChangeCandidate
    log_odds: float
    size: float
    deviation: float


class _SizeColumn(NamedTuple):
    """What of an accepted change is unknown: v (n, k) by which it moves the numbers in each recording, times N(0, 1 / precision).

    pushed: (n, k) A v. scores: (n,) v'b.
    """

    vectors: Array
    pushed: Array
    scores: Array
    precision: float


class Design:
    """The posterior of theta and of the accepted changes after the first ``count`` recordings of a machine.

    Attributes:
        log_evidence: up to what depends on no hypothesis.
    """

    def __init__(self, past: MachinePast, count: int, accepted: Sequence[WeighedChange]) -> None:
        self._past, self._count = past, count
        self.times = past.times[:count]
        self._levels: dict[tuple[str, ...], Array] = {}
        self._columns: list[_SizeColumn] = []
        self._sizes: dict[tuple[str, ...], tuple[Array, Array]] = {}
        for change in accepted:
            self._accept(change)
        t, matrices, vectors = len(past.precision), *past.matrices(count)
        precision = np.append(past.precision, [column.precision for column in self._columns])
        a, b = np.diag(precision), np.zeros(len(precision))
        a[:t, :t] += sum(matrices)
        b[:t] = sum(vectors)
        for k, column in enumerate(self._columns, t):
            a[:t, k] = a[k, :t] = column.pushed.sum(axis=0)
            b[k] = column.scores.sum()
            for j, other in enumerate(self._columns, t):
                a[k, j] += np.sum(column.pushed * other.vectors)
        self._inverse = np.linalg.inv(a)
        self._mean = self._inverse @ b
        self.log_evidence = 0.5 * float(b @ self._mean - np.linalg.slogdet(a)[1] + np.sum(np.log(precision)))

    def start(self, path: Path) -> Array:
        """Levels (n,) of a quantity by what is accepted."""
        return self._levels.get(path.key, np.zeros(self._count))

    def sizes(self, columns: Sequence[Direction]) -> tuple[Array, Array]:
        """Information J (n, c, n, c) and score j (n, c) of the sizes of columns in all recordings, all else integrated over."""
        key = tuple(column.id for column in columns)
        if key not in self._sizes:
            self._sizes[key] = self._sized(columns)
        return self._sizes[key]

    def _sized(self, columns: Sequence[Direction]) -> tuple[Array, Array]:
        along = np.array([column.along for column in columns])
        rows, scores = self._along(columns)
        crossed = [np.sum(rows * column.vectors[:, None], axis=2)[..., None] for column in self._columns]
        shared = np.concatenate([rows, *crossed], axis=2)
        information = -np.tensordot(shared @ self._inverse, shared, (2, 2))
        each = np.arange(self._count)
        information[each, :, each] += rows @ along.T
        return information, scores - shared @ self._mean

    def supposed(self, direction: Direction, spread: Array) -> float:
        """Log evidence of sizes x (n,) of a column in the recordings that are N(0, spread), beside what is accepted."""
        information, score = self.sizes((direction,))
        return float(_integrated_over(information[:, 0, :, 0], score[:, 0], spread)[0])

    def _along(self, columns: Sequence[Direction]) -> tuple[Array, Array]:
        """A d (n, c, k) and d'b (n, c) of columns."""
        each = [self._past.along(column, self._count) for column in columns]
        return np.stack([rows for rows, _ in each], axis=1), np.stack([scores for _, scores in each], axis=1)

    def _accept(self, change: WeighedChange) -> None:
        path, course = change.candidate.path, change.candidate.course(self.times)
        start = self.start(path)
        size = change.size if abs(change.size) > SMALL else SMALL
        x = (path.at(start + size * course) - path.at(start)) / size
        self._levels[path.key] = start + change.size * course
        unknown = [(x, 1.0)]
        if change.candidate.shape == "uneven":
            unknown += [(x * own[:, None], UNEVEN**-2) for own in np.eye(self._count)[course > 0.0]]
        rows, scores = self._along(path.columns)
        along = np.array([column.along for column in path.columns])
        for shares, precision in unknown:
            pushed = np.sum(rows * shares[..., None], axis=1)
            self._columns.append(_SizeColumn(shares @ along, pushed, np.sum(scores * shares, axis=1), precision))


def weigh(candidates: Sequence[ChangeCandidate], designs: Sequence[Design], known: Array) -> list[WeighedChange]:
    """Each candidate beside what is accepted, integrated over ``form``.

    Args:
        candidates: those of one quantity next to one another, uneven ones apart from the others.
        designs: (f,) under every ``form``.
        known: (f,) log evidence of each ``form`` if nothing further had changed.
    """
    result = []
    for _, group in groupby(candidates, key=lambda c: (c.path.key, c.shape == "uneven")):
        own = list(group)
        odds, sizes, deviations = _weighed(own, designs)
        both = known[:, None] + odds + np.log([c.prior for c in own])
        total = np.logaddexp.reduce(both, axis=0)
        share = np.exp(both - total)
        size = np.sum(share * sizes, axis=0)
        deviation = np.sqrt(np.sum(share * (deviations**2 + (sizes - size) ** 2), axis=0))
        table = np.array([total - np.logaddexp.reduce(known), size, deviation])
        result += [WeighedChange(c, *row) for c, row in zip(own, table.T.tolist(), strict=True)]
    return result


def _weighed(own: Sequence[ChangeCandidate], designs: Sequence[Design]) -> tuple[Array, Array, Array]:
    """Log odds without the prior, likeliest size and its standard deviation (f, c) of candidates of one quantity."""
    path = own[0].path
    courses = np.array([c.course(designs[0].times) for c in own])
    sizes = [design.sizes(path.columns) for design in designs]
    information = np.array([j.reshape(s.size, s.size) for j, s in sizes])[:, None]
    score = np.array([s.reshape(-1) for _, s in sizes])[:, None]
    constant: Array | float = 0.0
    if own[0].shape == "uneven":
        constant, information, score = _uneven(courses, information, score)
    odds, likeliest, deviations = along_path(path, designs[0].start(path), courses, information, score)
    return constant + odds, likeliest, deviations


def _uneven(courses: Array, information: Array, score: Array) -> tuple[Array, Array, Array]:
    """What is known of a common size: log evidence (f, c), information and score; integrated over how each recording's differs."""
    gained, factor = _integrated_over(information, score, UNEVEN**2 * courses[:, None] * np.eye(courses.shape[1]))
    return gained, factor @ information, (factor @ score[..., None])[..., 0]


def _integrated_over(information: Array, score: Array, spread: Array) -> tuple[Array, Array]:
    """Log evidence (...) of sizes that are N(0, spread), and (1 + J spread)^-1; J (..., n, n), j (..., n)."""
    factor = np.asarray(np.linalg.inv(np.eye(score.shape[-1]) + information @ spread), dtype=np.float64)
    explained = np.sum(score * (spread @ factor @ score[..., None])[..., 0], axis=-1)
    return 0.5 * (explained + np.linalg.slogdet(factor)[1]), factor
