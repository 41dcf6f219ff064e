"""A machine that is no crane: two tanks in a row, with an overflow of which its model knows nothing.

    A_1 h_1' = q - c_1 sqrt(h_1)                    (+ A_1 w_1 d_1: what may be missing)
    A_2 h_2' = c_1 sqrt(h_1) - c_2 sqrt(h_2)        (+ A_2 w_2 d_2)

Both levels are measured, the pump's flow q is known.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import exp, sqrt

import numpy as np
from numpy.typing import NDArray

from boom_estimation.numbers import Number
from boom_estimation.score_test import SearchedEffect
from boom_estimation.system import Pass, Tangent, Values

Array = NDArray[np.float64]

STEP, SUBSTEPS = 1.0, 2
"""s."""
NOMINAL = {"c_1": 2.0e-4, "c_2": 1.6e-4, "overflow": 0.0, "leak": 0.0}
AREA, WEIR, SCALE = (0.01, 0.01), 0.3, 1e-4
"""m^2, m, m/s."""
NOISE = 5e-4
"""m, of the levels."""
RELATIVE = 0.05
"""Standard deviation of c_1 and c_2 by the machine's description."""


def rates(x: Sequence[float], q: float, p: Values) -> tuple[float, float, float, float]:
    """x' of (h_1, h_2, d_1, d_2); the overflow leaves the system, the leak joins the second tank."""
    h_1, h_2, d_1, d_2 = x
    through = p["c_1"] * sqrt(max(h_1, 0.0))
    over = p["overflow"] * max(h_1 - WEIR, 0.0)
    beside = p["leak"] * sqrt(max(h_2, 0.0))
    first = (q - through - over) / AREA[0] + SCALE * d_1
    second = (through - p["c_2"] * sqrt(max(h_2, 0.0)) - beside) / AREA[1] + SCALE * d_2
    return first, second, -d_1 / Tanks.memory, -d_2 / Tanks.memory


def advance(x: Sequence[float], q: float, p: Values) -> tuple[float, float, float, float]:
    """x after ``STEP`` by the midpoint rule."""
    h = STEP / SUBSTEPS
    a, b, c, d = x
    for _ in range(SUBSTEPS):
        k = rates((a, b, c, d), q, p)
        m = rates((a + h / 2 * k[0], b + h / 2 * k[1], c + h / 2 * k[2], d + h / 2 * k[3]), q, p)
        a, b, c, d = a + h * m[0], b + h * m[1], c + h * m[2], d + h * m[3]
    return a, b, c, d


class Tanks:
    """One experiment; ``boom_estimation.system.Model``."""

    places = ("tank_1", "tank_2")
    state_names = ("h_1", "h_2", "d_1", "d_2")
    discrepancies = np.array([2, 3])
    memory, interval = 20.0, STEP
    variance = np.full(2, NOISE**2)
    spread = np.array([2e-3, 2e-3, 0.0, 0.0])

    def __init__(self, name: str, flow: Array, levels: Array) -> None:
        self.name, self.flow, self.levels = name, flow, levels
        self.counted = np.ones(len(flow), dtype=bool)

    def numbers(self, values: Values) -> dict[str, float]:
        """All numbers; those with a tolerance are given in standard deviations of their logarithm."""
        p = dict(NOMINAL)
        for name, value in values.items():
            p[name] = NOMINAL[name] * exp(RELATIVE * value) if NOMINAL[name] else value
        return p

    def first_gain(self) -> Array:
        """Levels are pulled to their measurements."""
        return np.broadcast_to(
            np.array([[0.3, 0.0], [0.0, 0.3], [0.0, 0.0], [0.0, 0.0]]), (len(self.flow), 4, 2)
        ).copy()

    def observe(self, values: Values, gain: Array, *, coarse: bool = False) -> Pass:
        """One pass."""
        n, p = len(self.flow), self.numbers(values)
        states, innovations = np.empty((n, 4)), np.empty((n, 2))
        x = np.array([self.levels[0, 0], self.levels[0, 1], 0.0, 0.0])
        for k in range(n):
            states[k] = x
            x = np.array(advance(x.tolist(), float(self.flow[k]), p))
            innovations[k] = self.levels[k + 1] - x[:2]
            x = x + gain[k] @ innovations[k]
        return Pass(states, innovations, np.ones((n, 2), dtype=bool), np.ones((n, 2)), bool(np.isfinite(states).all()))

    def beside(self, values: Values, others: Sequence[Values], gain: Array) -> list[tuple[Pass, Pass]]:
        """Passes by fixed steps: any two are alike."""
        base = self.observe(values, gain)
        return [(base, self.observe(other, gain)) for other in others]

    def tangent(self, values: Values, along: Pass) -> Tangent:
        """By differences."""
        n, p, eps = len(along.states), self.numbers(values), 1e-6
        jacobian = np.empty((n, 4, 4))
        for k, x in enumerate(along.states):
            base = np.array(rates(x.tolist(), float(self.flow[k]), p))
            for j in range(4):
                moved = x.copy()
                moved[j] += eps
                jacobian[k, :, j] = (np.array(rates(moved.tolist(), float(self.flow[k]), p)) - base) / eps
        return Tangent(jacobian, np.zeros((n, 4, 1)), np.zeros((n, 4)), np.eye(4)[:2])

    def transitions(self, values: Values, along: Pass) -> Array:
        """By differences."""
        p, eps = self.numbers(values), 1e-6
        result = np.empty((len(along.states), 4, 4))
        for k, x in enumerate(along.states):
            base = np.array(advance(x.tolist(), float(self.flow[k]), p))
            for j in range(4):
                moved = x.copy()
                moved[j] += eps
                result[k, :, j] = (np.array(advance(moved.tolist(), float(self.flow[k]), p)) - base) / eps
        return result


class TankSystem:
    """Tanks with one experiment; ``boom_estimation.system.System``."""

    def __init__(self, model: Tanks) -> None:
        self.places, self.experiments, self._model = model.places, (model.name,), model

    def models(self, effects: Sequence[str]) -> list[Tanks]:
        """The same equations for all: effects that are not there have size zero."""
        return [self._model]


TOLERANCES = (Number("c_1", float, -4.0, 4.0), Number("c_2", float, -4.0, 4.0))
LEAK = SearchedEffect(
    "leak", (Number("leak", float, 0.0, 1e-3, float("inf"), step=1e-6),), ({"leak": 2e-5},), {"leak": 0.0}, ("leak",), True, True,
    -2.0,
)  # fmt: skip
OVERFLOW = SearchedEffect(
    "overflow", (Number("overflow", float, 0.0, 2e-2, float("inf"), step=1e-5),), ({"overflow": 1e-3},), {"overflow": 0.0},
    ("overflow",), True, True, -2.0,
)  # fmt: skip


def recorded(seed: int, **truth: float) -> Tanks:
    """Five minutes with a pump that is switched every 15 s, of tanks with these numbers."""
    rng = np.random.default_rng(seed)
    flow = np.repeat(rng.uniform(0.5e-4, 1.6e-4, 20), 15)
    p = {**NOMINAL, **truth}
    x = (0.25, 0.3, 0.0, 0.0)
    levels = [x[:2]]
    for q in flow:
        x = advance(x, float(q), p)
        levels.append(x[:2])
    measured = np.array(levels) + NOISE * rng.standard_normal((len(flow) + 1, 2))
    return Tanks(f"tanks_{seed}", flow, measured)
