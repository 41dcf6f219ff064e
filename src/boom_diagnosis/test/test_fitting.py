"""Steps of the fit on two unknowns, worked out by hand."""

import numpy as np
import pytest

from boom_diagnosis.fitting import Point, gauss_newton, strained

JACOBIAN = np.array([[3.0, 0.0], [0.0, 0.1]])
LIMITS = np.array([[-4.0, -4.0], [4.0, 4.0]])


def at(z: tuple[float, float]) -> Point:
    """Innovations 1.5 and 1 there; one of the unknowns is told well, the other hardly."""
    return Point(np.array(z), {}, np.array([1.5, 1.0]), np.ones(2, dtype=bool), 0.0, [], [])


def test_a_step_solves_the_linear_problem_with_unit_priors() -> None:
    (step,) = gauss_newton(at((0.0, 1.0)), JACOBIAN, (), LIMITS)
    assert step == pytest.approx([-3.0 * 1.5 / (9.0 + 1.0), -(0.1 * 1.0 + 1.0) / (0.01 + 1.0)], rel=1e-6)


@pytest.mark.parametrize("damping", [1e-4, 1e-2, 1.0])
def test_damping_shortens_each_step_by_a_share_of_its_own_curvature(damping: float) -> None:
    free, damped = gauss_newton(at((0.0, 1.0)), JACOBIAN, (), LIMITS, (0.0, damping))
    assert damped == pytest.approx(free / (1.0 + damping), rel=1e-6)


def test_what_would_leave_its_limit_stays_there() -> None:
    (pushed,) = gauss_newton(at((-4.0, -4.0)), np.array([[30.0, 0.0], [0.0, 30.0]]), (), LIMITS)
    assert list(pushed) == [0.0, 0.0]


@pytest.mark.parametrize(("told", "most"), [(1e3, 8.0 + 3.0 * np.sqrt(8.0)), (1.0, 4.0 + 3.0 * np.sqrt(4.0))])
def test_tolerances_are_strained_where_they_cost_more_than_those_that_are_told_may(told: float, most: float) -> None:
    """16 numbers told by innovations of their own with sqrt(told) each: 16 or 8 of them count."""
    jacobian = np.sqrt(told) * np.eye(16)
    for nats, answer in ((0.99 * most, False), (1.01 * most, True)):
        z = np.sqrt(2.0 * nats / 16.0) * np.ones(16)
        there = Point(z, {}, np.zeros(16), np.ones(16, dtype=bool), 0.0, [], [])
        assert strained(there, jacobian) is answer
