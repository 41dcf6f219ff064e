"""The recordings of one machine as the comparison sees them: what differs from day to day taken into account."""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass
from math import log1p

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

YEAR = 365.25 * 86400.0
"""s"""


@dataclass(frozen=True)
class Direction:
    """A column: its id, its direction (k,) in z, and the range of its size in z.

    usual: standard deviation of the size of an effect, as healthy machines seem to have it; 0 of what is none.
    node: level of its quantity at which it is exact (``boom_fleet.paths``).
    """

    id: str
    along: Array
    low: float
    high: float
    usual: float = 0.0
    node: float = 1.0


@dataclass(frozen=True)
class Evidence:
    """One recording's log-likelihood b'z - z'Az/2, and when it was made [s]."""

    time: float
    matrix: Array
    vector: Array


class MachinePast:
    """All recordings of one machine, in the order of their times, with ``form`` as if it were known.

    Args:
        evidence: of the recordings. spread: (k,) s of the numbers. wander: (k,) what they differ by from day to day.
    """

    def __init__(self, evidence: Sequence[Evidence], spread: Array, wander: Array) -> None:
        self.times = np.array([e.time for e in evidence])
        self.precision = 1.0 / spread**2
        self._matrix, self._vector = [], []
        self._constants: list[float] = []
        self._along: dict[str, tuple[Array, Array]] = {}
        for e in evidence:
            factor = np.linalg.inv(np.eye(len(spread)) + wander[:, None] * e.matrix * wander)
            inner = wander[:, None] * factor * wander
            self._matrix.append(e.matrix - e.matrix @ inner @ e.matrix)
            self._vector.append(e.vector - e.matrix @ (inner @ e.vector))
            square = float(e.vector @ inner @ e.vector)
            self._constants.append(0.5 * (square + float(np.linalg.slogdet(factor)[1])))

    def wide(self, direction: Direction, size: float) -> MachinePast:
        """The same where a quantity is N(0, size^2) beside what it is by its spread, alike in all recordings."""
        result = copy(self)
        result.precision = 1.0 / (1.0 / self.precision + (size * direction.along) ** 2)
        return result

    def restless(self, direction: Direction, size: float) -> MachinePast:
        """The same where a quantity is another one in each recording, N(0, size^2)."""
        result = copy(self)
        along, result._along = direction.along, {}
        result._matrix, result._vector, result._constants = [], [], []
        for matrix, vector, constant in zip(self._matrix, self._vector, self._constants, strict=True):
            column, score = matrix @ along, float(along @ vector)
            information = float(along @ column)
            share = 1.0 / (size**-2 + information)
            result._matrix.append(matrix - share * np.outer(column, column))
            result._vector.append(vector - share * score * column)
            result._constants.append(constant + 0.5 * (share * score**2 - log1p(size**2 * information)))
        return result

    def constant(self, count: int) -> float:
        """What the first recordings say of how much the machine differs from day to day."""
        return sum(self._constants[:count])

    def along(self, direction: Direction, count: int) -> tuple[Array, Array]:
        """A d (count, k) and d'b (count,) of the first recordings."""
        if direction.id not in self._along:
            rows = np.array([m @ direction.along for m in self._matrix])
            self._along[direction.id] = rows, np.array([direction.along @ v for v in self._vector])
        rows, scores = self._along[direction.id]
        return rows[:count], scores[:count]

    def matrices(self, count: int) -> tuple[list[Array], list[Array]]:
        """A and b of the first recordings, what differs from day to day taken into account."""
        return self._matrix[:count], self._vector[:count]
