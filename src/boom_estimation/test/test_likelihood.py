"""One likelihood: exact derivatives, places and names of what is missing, on a machine that is no crane."""

from __future__ import annotations

import numpy as np
import pytest
import two_tanks_system as tanks
from numpy.typing import NDArray

from boom_estimation.linearising import HypothesisProblem
from boom_estimation.numbers import Number, SizePriors
from boom_estimation.posterior import HypothesisFit, fit
from boom_estimation.recursion import LinearisedPass, rho
from boom_estimation.search import Hypothesis, Search

Array = NDArray[np.float64]


@pytest.fixture(scope="module")
def overflowing() -> tanks.Tanks:
    return tanks.recorded(1, c_1=2.06e-4, c_2=1.55e-4, overflow=2e-3)


def exact_likelihood(lin: LinearisedPass, sizes: Array, moved: Array) -> float:
    """The same density from the joint covariance of all innovations' linear model, without a recursion."""
    n, ny = lin.along.innovations.shape
    nx = lin.transition.shape[1]
    variance = 2.0 * lin.model.interval / lin.model.memory * sizes**2
    spread = lin.spread.copy()
    spread[lin.unknown] = sizes
    mean, cov = lin.begin @ moved, np.diag(spread**2)
    total = 0.0
    for k in range(n):  # textbook form: predict, then update with the gain that the covariance asks for
        a = lin.transition[k]
        predicted = a @ mean + lin.forced[k] @ moved
        p = a @ cov @ a.T + lin.process[k] + lin.entry[k] @ np.diag(variance) @ lin.entry[k].T
        s = lin.output @ p @ lin.output.T + np.diag(lin.model.variance)
        e = lin.along.innovations[k] - lin.output @ predicted - lin.shown[k] @ moved
        gain = p @ lin.output.T @ np.linalg.inv(s)
        mean = predicted + gain @ e - lin.given[k] @ lin.along.innovations[k]
        cov = p - gain @ s @ gain.T
        w = np.linalg.solve(np.linalg.cholesky(s), e)
        total -= rho(w) + 0.5 * float(np.linalg.slogdet(s)[1])
    assert nx == len(mean) and ny == len(e)
    return total


def linearised(model: tanks.Tanks, numbers: tuple[Number, ...]) -> LinearisedPass:
    sizes = SizePriors(np.full(2, np.nan), np.full(2, np.nan), np.ones(2))
    problem = HypothesisProblem(tanks.TankSystem(model), (), numbers, sizes)
    found = fit(problem, np.zeros(len(numbers)), np.log([0.1, 0.1]), turns=0)
    return found.linearised[0]


def test_recursion_is_the_textbook_filter_at_any_size_and_for_moved_numbers(overflowing: tanks.Tanks) -> None:
    lin = linearised(overflowing, tanks.TOLERANCES)
    for sizes, moved in (([0.1, 0.1], [0.0, 0.0]), ([1e-4, 0.7], [0.4, -0.3]), ([2.0, 1e-3], [-1.0, 0.2])):
        there = lin.run(np.array(sizes), np.array(moved))
        expected = exact_likelihood(lin, np.array(sizes), np.array(moved))
        assert lin.log_likelihood(there) == pytest.approx(expected, rel=1e-9)


def test_columns_are_the_derivatives_of_the_passes_themselves(overflowing: tanks.Tanks) -> None:
    lin = linearised(overflowing, tanks.TOLERANCES)
    for j, number in enumerate(tanks.TOLERANCES):
        step = 0.02
        base = overflowing.observe({}, lin.pass_gain)
        moved = overflowing.observe({number.name: step}, lin.pass_gain)
        s = moved.states - base.states
        for k in (0, 5, 100, 298):  # prediction to the end of the interval, before the correction
            f = s[k + 1] - lin.pass_gain[k] @ (moved.innovations[k] - base.innovations[k])
            # one step from nothing is twice as far as another only as far as the model is linear
            assert lin.transition[k] @ s[k] + lin.forced[k, :, j] * step == pytest.approx(f, rel=0.02, abs=1e-9)


def test_healthy_tanks_need_no_discrepancy_and_their_numbers_are_found() -> None:
    model = tanks.recorded(2, c_1=2.06e-4, c_2=1.55e-4)
    search = Search(tanks.TankSystem(model), tanks.TOLERANCES, (tanks.LEAK,))
    ranked = search.run()
    best = ranked[0][0]
    assert best.hypothesis == Hypothesis()
    assert max(best.fit.sizes.values()) < 0.01
    _assert_inside(best.fit, {"c_1": np.log(2.06 / 2.0) / 0.05, "c_2": np.log(1.55 / 1.6) / 0.05})


def _assert_inside(found: HypothesisFit, truth: dict[str, float]) -> None:
    """Within four standard deviations."""
    spread = np.sqrt(np.diag(found.covariance))
    for k, number in enumerate(found.problem.numbers):
        if number.name in truth:
            assert abs(found.c[k] - truth[number.name]) < 4.0 * spread[k], number.name


def test_an_overflow_nobody_told_of_is_placed_in_its_own_equation(overflowing: tanks.Tanks) -> None:
    search = Search(tanks.TankSystem(overflowing), tanks.TOLERANCES, (tanks.LEAK,))
    ranked = search.run()
    assert ranked[0][0].hypothesis == Hypothesis((), ("tank_1",))
    assert ranked[0][1] > 0.9
    assert sum(p for _, p in ranked) == pytest.approx(1.0)


@pytest.fixture(scope="module")
def named(overflowing: tanks.Tanks) -> Search:
    search = Search(tanks.TankSystem(overflowing), tanks.TOLERANCES, (tanks.LEAK, tanks.OVERFLOW))
    search.run()
    return search


def test_the_overflow_is_named_with_its_size_once_the_catalogue_has_it(named: Search) -> None:
    best = named.posterior()[0][0]
    assert best.hypothesis == Hypothesis(("overflow",))
    _assert_inside(best.fit, {"overflow": 2e-3})


def test_a_richer_hypothesis_is_never_less_likely_than_the_one_it_starts_from(named: Search) -> None:
    nothing = named.weighed[Hypothesis()].fit
    for hypothesis, weighed in named.weighed.items():
        if len(hypothesis.effects) == 1 and not hypothesis.unknown:
            assert weighed.fit.log_likelihood > nothing.log_likelihood - 2.0, hypothesis.label
