"""The posterior of a machine's numbers and of the changes that are accepted, and how likely a further one is beside them.

A change of a quantity d is a step (g = 0, then 1), a ramp (g grows by 1 in a year), or uneven: a step whose size is another one in
each recording, about a common one,

    delta_r = g_r (delta + e_r),    delta ~ N(0, 1),    e_r ~ N(0, UNEVEN^2)

because far from nothing a quantity is not linear, and what it seems to be depends on what the boom did. With J and j the
information and score of the sizes x of all recordings, theta and what is accepted integrated over, and K = g g' + UNEVEN^2 diag(g),

    ln odds = j'(K^-1 + J)^-1 j / 2 - ln det(1 + K J) / 2
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import groupby
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import logsumexp, ndtr, softmax

from boom_fleet.past import YEAR, Direction, MachinePast

Array = NDArray[np.float64]

UNEVEN = 0.5
"""How much the size of an uneven change differs between recordings, in z."""
Shape = Literal["step", "ramp", "uneven"]


@dataclass(frozen=True)
class Candidate:
    """A change that may have been: of a quantity, how, since when (see ``Change``), and how probable beforehand."""

    direction: Direction
    shape: Shape
    begin: int
    prior: float

    def course(self, times: Array) -> Array:
        """G at the times [s]."""
        if self.shape == "ramp":
            return np.asarray(np.maximum(0.0, times - times[self.begin]) / YEAR)
        return np.asarray(np.arange(len(times)) >= self.begin, dtype=float)


@dataclass(frozen=True)
class Weighed:
    """A candidate, its log odds against nothing further, prior included; the change's mean and standard deviation."""

    candidate: Candidate
    log_odds: float
    mean: float
    deviation: float


class _Column(NamedTuple):
    """An unknown size of an accepted change: quantity, course over the recordings, and precision beforehand."""

    direction: Direction
    course: Array
    precision: float


def integrated(candidates: Sequence[Candidate], rows: Array, known: Array) -> list[Weighed]:
    """The candidates under every ``form``: rows (forms, 3, c) of :meth:`Design.weigh`.

    known: (forms,) log evidence of each if nothing further had changed.
    """
    both = known[:, None] + rows[:, 0]
    share = softmax(both, axis=0)
    odds = logsumexp(both, axis=0) - logsumexp(known)
    means = np.sum(share * rows[:, 1], axis=0)
    deviations = np.sqrt(np.sum(share * (rows[:, 2] ** 2 + (rows[:, 1] - means) ** 2), axis=0))
    return [
        Weighed(c, float(o), float(m), float(d)) for c, o, m, d in zip(candidates, odds, means, deviations, strict=True)
    ]


class Design:
    """The posterior of theta and of the accepted changes after the first ``count`` recordings of a machine.

    Attributes:
        log_evidence: up to what depends on no hypothesis.
    """

    def __init__(self, past: MachinePast, count: int, accepted: Sequence[Candidate]) -> None:
        self._past, self._count = past, count
        self._columns = [column for c in accepted for column in _columns(c, past.times[:count])]
        t, matrices, vectors = len(past.precision), *past.matrices(count)
        precision = np.append(past.precision, [column.precision for column in self._columns])
        a, b = np.diag(precision), np.zeros(len(precision))
        a[:t, :t] += sum(matrices)
        b[:t] = sum(vectors)
        for k, column in enumerate(self._columns, t):
            rows, scores = past.along(column.direction, count)
            a[:t, k] = a[k, :t] = column.course @ rows
            b[k] = column.course @ scores
            for j, other in enumerate(self._columns, t):
                a[k, j] += (column.course * other.course) @ rows @ other.direction.along
        self._inverse = np.linalg.inv(a)
        self._mean = self._inverse @ b
        self.log_evidence = 0.5 * float(b @ self._mean - np.linalg.slogdet(a)[1] + np.sum(np.log(precision)))

    def weigh(self, candidates: Sequence[Candidate]) -> Array:
        """(3, c) of each candidate beside what is accepted: log odds, prior included; mean and standard deviation of its size.

        Candidates of one quantity are next to one another; uneven ones are weighed alone.
        """
        return np.concatenate(
            [self._weighed(list(own)) for _, own in groupby(candidates, key=lambda c: c.direction.id)], axis=1
        )

    def supposed(self, direction: Direction, spread: Array) -> float:
        """Log evidence of sizes x (n,) of a quantity in the recordings that are N(0, spread), beside what is accepted."""
        information, score = self._sizes(direction)
        return _integrated_over(information, score, spread)[0]

    def _weighed(self, own: Sequence[Candidate]) -> Array:
        """Candidates of one quantity."""
        direction, one = own[0].direction, np.ones(len(own))
        information, score = self._sizes(direction)
        courses = np.array([c.course(self._past.times[: self._count]) for c in own])
        if own[0].shape == "uneven":
            each = [_uneven(g, information, score) for g in courses]
        else:
            each = [(0.0, information, score)] * len(own)
        constants, informations, seen = (np.array(row) for row in zip(*each, strict=True))
        squares = np.maximum(0.0, np.einsum("ci,cij,cj->c", courses, informations, courses))
        scores = np.einsum("ci,ci->c", courses, seen)
        variances = 1.0 / (squares + 1.0)
        means, deviations = scores * variances, np.sqrt(variances)
        inside = _mass(direction, courses[:, -1], means, deviations) / _mass(direction, courses[:, -1], 0.0 * one, one)
        odds = constants + 0.5 * scores * means + 0.5 * np.log(variances) + np.log(np.maximum(1e-300, inside))
        return np.array([np.log([c.prior for c in own]) + odds, means, deviations])

    def _sizes(self, direction: Direction) -> tuple[Array, Array]:
        """Information J (n, n) and score j (n,) of the sizes of a quantity in all recordings, all else integrated over."""
        rows, scores = self._past.along(direction, self._count)
        along = rows @ direction.along
        cross = [column.course * (rows @ column.direction.along) for column in self._columns]
        shared = np.column_stack([rows, *cross])
        return np.diag(along) - shared @ self._inverse @ shared.T, scores - shared @ self._mean


def _columns(candidate: Candidate, times: Array) -> list[_Column]:
    """What of an accepted change is unknown: its size, and of an uneven one how much each recording's differs from it."""
    course = candidate.course(times)
    each = [_Column(candidate.direction, row, UNEVEN**-2) for row in np.eye(len(times))[course > 0.0]]
    return [_Column(candidate.direction, course, 1.0), *(each if candidate.shape == "uneven" else [])]


def _uneven(course: Array, information: Array, score: Array) -> tuple[float, Array, Array]:
    """What the recordings know of a common size: log evidence, information and score; integrated over how each one's differs."""
    gained, factor = _integrated_over(information, score, UNEVEN**2 * np.diag(course))
    return gained, factor @ information, factor @ score


def _integrated_over(information: Array, score: Array, spread: Array) -> tuple[float, Array]:
    """Log evidence of sizes that are N(0, spread), and (1 + J spread)^-1."""
    factor = np.asarray(np.linalg.inv(np.eye(len(score)) + information @ spread), dtype=np.float64)
    return 0.5 * float(score @ spread @ factor @ score + np.linalg.slogdet(factor)[1]), factor


def _mass(direction: Direction, course: Array, mean: Array, deviation: Array) -> Array:
    """Probability that the change at the last recording is in the quantity's range; 1 where it has not begun."""
    begun = np.where(course > 0.0, course, 1.0)
    low, high = (ndtr((x / begun - mean) / deviation) for x in (direction.low, direction.high))
    return np.where(course > 0.0, high - low, 1.0)
