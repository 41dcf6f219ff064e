"""Steps of the fit on two unknowns, worked out by hand."""

import numpy as np
import pytest

from boom_diagnosis.fitting import Point, gauss_newton

JACOBIAN = np.array([[3.0, 0.0], [0.0, 0.1]])
LIMITS = np.array([[-4.0, -4.0], [4.0, 4.0]])


def at(z: tuple[float, float]) -> Point:
    """Innovations 1.5 and 1 there; one of the unknowns is told well, the other hardly."""
    return Point(np.array(z), {}, np.array([1.5, 1.0]), np.ones(2, dtype=bool), 0.0, [], [])


def test_a_step_solves_the_linear_problem_with_unit_priors() -> None:
    step = gauss_newton(at((0.0, 1.0)), JACOBIAN, (), LIMITS)
    assert step == pytest.approx([-3.0 * 1.5 / (9.0 + 1.0), -(0.1 * 1.0 + 1.0) / (0.01 + 1.0)], rel=1e-6)


@pytest.mark.parametrize("damping", [1e-4, 1e-2, 1.0])
def test_damping_shortens_each_step_by_a_share_of_its_own_curvature(damping: float) -> None:
    free, damped = (gauss_newton(at((0.0, 1.0)), JACOBIAN, (), LIMITS, d) for d in (0.0, damping))
    assert damped == pytest.approx(free / (1.0 + damping), rel=1e-6)


def test_what_would_leave_its_limit_stays_there() -> None:
    pushed = gauss_newton(at((-4.0, -4.0)), np.array([[30.0, 0.0], [0.0, 30.0]]), (), LIMITS)
    assert list(pushed) == [0.0, 0.0]
