"""The least of a quadratic within limits."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import lsq_linear

from boom_diagnosis.steps import bounded


def test_what_a_limit_holds_lets_the_others_make_up_for_it() -> None:
    normal, gradient = np.array([[2.0, 1.0], [1.0, 2.0]]), np.array([-4.0, 0.0])
    step, free = bounded(normal, gradient, np.array([-1.0, -np.inf]), np.array([1.0, np.inf]))
    assert step == pytest.approx([1.0, -0.5], abs=1e-6)
    assert free.tolist() == [False, True]


def test_no_slope_leads_on_from_where_it_ends() -> None:
    rng = np.random.default_rng(0)
    for count in rng.integers(1, 30, 400):
        root = rng.normal(size=(count, count))
        normal, gradient = root.T @ root + 0.01 * np.eye(count), 5.0 * rng.normal(size=count)
        low, high = -rng.uniform(0.0, 1.0, count), rng.uniform(0.0, 1.0, count)
        step, free = bounded(normal, gradient, low, high)
        slope = (gradient + normal @ step) / (1.0 + np.abs(gradient).max())
        assert np.abs(slope[free]).max(initial=0.0) < 1e-5
        at_low = step - low < 0.5 * (high - low)
        assert (slope[~free & at_low] >= -1e-5).all() and (slope[~free & ~at_low] <= 1e-5).all()


@pytest.mark.parametrize("seed", range(8))
def test_it_is_the_least_of_a_badly_told_problem_as_scipy_finds_it(seed: int) -> None:
    rng = np.random.default_rng(seed)
    count = 40
    columns = rng.normal(size=(200, 12)) @ rng.normal(size=(12, count)) + 0.01 * rng.normal(size=(200, count))
    rest = 20.0 * rng.normal(size=200)
    low, high = -rng.uniform(0.0, 2.0, count), rng.uniform(0.0, 2.0, count)
    step, _ = bounded(columns.T @ columns + np.eye(count), columns.T @ rest, low, high)
    both = np.vstack([columns, np.eye(count)])
    best = lsq_linear(both, -np.concatenate([rest, np.zeros(count)]), (low, high), tol=1e-12)

    def cost(x: np.ndarray) -> float:
        return 0.5 * float(np.sum((columns @ x + rest) ** 2) + x @ x)

    assert (low <= step).all() and (step <= high).all()
    assert cost(step) <= cost(best.x) * (1.0 + 1e-6)
    assert cost(step) <= cost(np.zeros(count))
