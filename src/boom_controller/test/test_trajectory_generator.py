"""(6.27), (6.28) against the closed form of its step response."""

from __future__ import annotations

from itertools import pairwise
from math import exp

import pytest

from boom_controller.references.trajectory_generator import TrajectoryGenerator

POLE, T = 10.0, 0.01


def test_a_step_is_answered_as_by_the_continuous_filter() -> None:
    generator = TrajectoryGenerator(-POLE, T)
    generator.reset(0.2)
    for k in range(1, 101):
        r = generator.step(1.2)
        x = POLE * k * T
        decay = exp(-x)
        assert r.angle == pytest.approx(0.2 + 1 - decay * (1 + x + x**2 / 2 + x**3 / 6), abs=1e-10)
        assert r.rate == pytest.approx(decay * POLE * x**3 / 6, abs=1e-9)
        assert r.acceleration == pytest.approx(decay * POLE**2 * (x**2 / 2 - x**3 / 6), abs=1e-8)
        assert r.jerk == pytest.approx(decay * POLE**3 * (x - x**2 + x**3 / 6), abs=1e-7)


def test_it_rests_where_it_was_reset() -> None:
    generator = TrajectoryGenerator(-POLE, T)
    generator.reset(-0.7)
    r = generator.step(-0.7)
    assert r.angle == pytest.approx(-0.7, abs=1e-12)
    assert (r.rate, r.acceleration, r.jerk) == pytest.approx((0.0, 0.0, 0.0), abs=1e-9)


@pytest.mark.parametrize("pole", [-0.5, -5.0, -50.0])
def test_another_pole_in_motion_changes_nothing_at_once_and_leads_no_further_than_is_wanted(pole: float) -> None:
    generator = TrajectoryGenerator(-POLE, T)
    generator.reset(0.0)
    moving = [generator.step(0.3 * T * k) for k in range(60)]
    wanted = 0.3 * T * 59
    generator.change(pole)
    after = [generator.step(wanted) for _ in range(4000)]
    for a, b in pairwise([moving[-1], *after]):
        assert b.angle - a.angle == pytest.approx(0.5 * T * (a.rate + b.rate), abs=1e-5)
        assert b.rate - a.rate == pytest.approx(0.5 * T * (a.acceleration + b.acceleration), abs=1e-3)
    assert max(r.angle for r in after) < wanted + 2e-4
    assert after[-1].angle == pytest.approx(wanted, abs=1e-4)
