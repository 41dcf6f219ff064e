"""Proposes a mapping: the joint assignment of columns to signals that names, units, ranges and dynamics make most probable.

A hypothesis says which column in which unit is which signal, and whether the angle counts upwards. Its log-likelihood is the sum
of what `candidates` gives each column by itself and `dynamics` gives them together; all hypotheses are evaluated (some 10^5) and
normalised. What a signal is then has a probability: the sum over all hypotheses that agree. Below `SURE` it is asked for.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from boom_import import dynamics, units
from boom_import.candidates import ANGLE, EXTEND, HOSE, RATE, RETRACT, ROD, SIGNALS, ColumnCandidate, candidates
from boom_import.source import Column, Floats

SURE = 0.9
_ABSENT = {ANGLE: -9.0, RATE: -3.0, HOSE: -7.0, ROD: -5.0, EXTEND: -7.0, RETRACT: -7.0}
_DOWNWARDS = math.log(0.1 / 0.9)  # most count an angle upwards
_RATE_OPPOSED = math.log(0.05)
_UNIT_DIFFERS = math.log(0.02)
_NEVER = -200.0
_Choice = ColumnCandidate | None


@dataclass(frozen=True)
class Choice:
    """What was found for one signal: candidates with their probability, most probable first; None = there is none."""

    signal: str
    options: list[tuple[ColumnCandidate | None, float]]

    @property
    def best(self) -> ColumnCandidate | None:
        """The most probable one."""
        return self.options[0][0]

    @property
    def probability(self) -> float:
        """Of the best."""
        return self.options[0][1]


@dataclass
class Found:
    """The proposal before it is a mapping.

    Attributes:
        choices: by signal.
        angle_sign, rate_sign: +1 where the column counts in the direction of lifting, else -1.
        sign_probability: of the direction.
    """

    choices: dict[str, Choice]
    angle_sign: float
    rate_sign: float
    sign_probability: float


def find(columns: list[Column], *, joint: str = "") -> Found:
    """The most probable assignment of `columns` to the signals.

    Args:
        columns: all of the source.
        joint: name of the boom's joint; elements of a JointState of other names are then not its angle or rate.
    """
    usable = [c for c in columns if float(np.ptp(c.values)) > 0.0]
    options: dict[str, list[_Choice]] = {}
    for signal in SIGNALS:
        own = usable
        if joint and signal in (ANGLE, RATE):
            own = [c for c in usable if c.joint == joint] or [c for c in usable if not c.joint]
        options[signal] = [*candidates(own, signal), None]
    scorer = _Scorer(options)
    total = scorer.total()
    weight = np.exp(total - total.max())
    weight /= weight.sum()
    choices = {}
    for axis, signal in enumerate(SIGNALS):
        marginal = weight.sum(axis=tuple(k for k in range(7) if k != axis))
        order = np.argsort(-marginal, kind="stable")
        choices[signal] = Choice(signal, [(options[signal][k], float(marginal[k])) for k in order[:5]])
    up = float(weight[..., 0].sum())
    sign = 1.0 if up >= 0.5 else -1.0
    best = np.unravel_index(int(np.argmax(total)), total.shape)
    rate_sign = sign * float(scorer.rate_signs[best[0], best[1]])
    return Found(choices, sign, rate_sign, max(up, 1.0 - up))


class _Scorer:
    """The log-likelihood of all hypotheses as one array, axes: the six signals and the direction (0 up, 1 down)."""

    def __init__(self, options: dict[str, list[_Choice]]) -> None:
        self._options = options
        self._shape = tuple(len(options[signal]) for signal in SIGNALS)
        there = list({c.column.key: c.column for own in options.values() for c in own if c is not None}.values())
        self._grid = dynamics.grid(there) if there else None
        self._cache: dict[tuple[str, str, str], Floats] = {}
        self.rate_signs = np.ones((self._shape[0], self._shape[1]))

    def total(self) -> NDArray[np.float64]:
        """All hypotheses."""
        result = np.zeros((*self._shape, 2))
        result[..., 1] += _DOWNWARDS
        for axis, signal in enumerate(SIGNALS):
            scores = [_ABSENT[signal] if c is None else c.score for c in self._options[signal]]
            result += np.reshape(scores, [-1 if k == axis else 1 for k in range(7)])
        self._exclude_twice(result)
        self._add_pair(result, HOSE, ROD, _same_unit)
        self._add_pair(result, EXTEND, RETRACT, _same_unit)
        if self._grid is not None:
            self._add_dynamics(result)
        for a, angle in enumerate(self._options[ANGLE]):
            if angle is not None and angle.column.signal == ANGLE:  # which counts upwards by definition
                result[a, ..., 1] += _NEVER
        return result

    def _add_pair(
        self,
        result: NDArray[np.float64],
        one: str,
        other: str,
        score: Callable[[ColumnCandidate, ColumnCandidate], float],
    ) -> None:
        a, b = SIGNALS.index(one), SIGNALS.index(other)
        table = np.zeros((self._shape[a], self._shape[b]))
        for i, j in np.ndindex(*table.shape):
            first, second = self._options[one][i], self._options[other][j]
            if first is not None and second is not None:
                table[i, j] = score(first, second)
        result += table.reshape([self._shape[k] if k in (a, b) else 1 for k in range(6)] + [1])

    def _exclude_twice(self, result: NDArray[np.float64]) -> None:
        for a, one in enumerate(SIGNALS):
            for other in SIGNALS[a + 1 :]:
                self._add_pair(result, one, other, _twice)

    def _values(self, candidate: ColumnCandidate) -> Floats:
        key = (candidate.column.key, candidate.unit, candidate.part)
        if key not in self._cache:
            assert self._grid is not None
            self._cache[key] = self._grid.of(candidate.column, candidate.values)
        return self._cache[key]

    def _add_dynamics(self, result: NDArray[np.float64]) -> None:
        for a, angle in enumerate(self._options[ANGLE]):
            if angle is None:
                continue
            values = self._values(angle)
            lift = dynamics.smooth(dynamics.derivative(values))
            for r, rate in enumerate(self._options[RATE]):
                if rate is not None:
                    score, sign = dynamics.rate_fit(values, self._values(rate))
                    self.rate_signs[a, r] = sign
                    result[a, r] += score + (_RATE_OPPOSED if sign < 0 else 0.0)
            self._add_currents(result[a], lift)
            self._add_pressures(result[a], lift)
        for b, t in np.ndindex(self._shape[3], self._shape[5]):
            rod, retract = self._options[ROD][b], self._options[RETRACT][t]
            if rod is not None and retract is not None:
                statistic = dynamics.lowering(self._values(rod), self._values(retract))
                result[:, :, :, b, :, t] += dynamics.LOWERING.ratio(statistic)

    def _add_currents(self, result: NDArray[np.float64], lift: Floats) -> None:
        """`result` has the axes rate, hose, rod, extend, retract, direction."""
        for e, t in np.ndindex(self._shape[4], self._shape[5]):
            extend, retract = self._options[EXTEND][e], self._options[RETRACT][t]
            if extend is None or retract is None or _twice(extend, retract):
                continue
            r = dynamics.current_fit(lift, self._values(extend), self._values(retract))
            for k, direction in enumerate((1.0, -1.0)):
                result[:, :, :, e, t, k] += dynamics.CURRENTS.ratio(direction * r)

    def _add_pressures(self, result: NDArray[np.float64], lift: Floats) -> None:
        for h, b in np.ndindex(self._shape[2], self._shape[3]):
            hose, rod = self._options[HOSE][h], self._options[ROD][b]
            if hose is None or rod is None or hose.column.key == rod.column.key:
                continue
            p_h, p_b = self._values(hose), self._values(rod)
            weighs = dynamics.GRAVITY.ratio(dynamics.gravity(lift, p_h, p_b))
            statistic = dynamics.pressure_difference(lift, p_h, p_b)
            for k, direction in enumerate((1.0, -1.0)):
                result[:, h, b, :, :, k] += weighs + dynamics.DIFFERENCE.ratio(direction * statistic)


def _twice(one: ColumnCandidate, other: ColumnCandidate) -> float:
    """Never one column for two signals, except the halves of a signed current; and those go with each other only."""
    if one.column.key == other.column.key:
        halves = {one.part, other.part} == {"positive", "negative"} and one.unit == other.unit
        return 0.0 if halves else _NEVER
    mixed = bool(one.part) != bool(other.part) or bool(one.part and other.part)
    return _NEVER if mixed and _dimension(one) == _dimension(other) == units.CURRENT else 0.0


def _same_unit(one: ColumnCandidate, other: ColumnCandidate) -> float:
    return 0.0 if one.unit == other.unit or (one.told and other.told) else _UNIT_DIFFERS


def _dimension(candidate: ColumnCandidate) -> str:
    return units.BY_NAME[candidate.unit].dimension
