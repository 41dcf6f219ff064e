"""(6.27), (6.28) against the closed form of its step response."""

from __future__ import annotations

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


def test_another_pole_goes_on_from_rest_at_the_angle_and_not_past_what_is_wanted() -> None:
    generator = TrajectoryGenerator(-POLE, T)
    generator.reset(0.0)
    for _ in range(20):
        before = generator.step(1.0)
    assert not generator.change(-POLE)
    assert generator.change(-5.0)
    after = [generator.step(1.0) for _ in range(600)]
    assert after[0].angle == pytest.approx(before.angle, abs=1e-3)
    assert max(r.angle for r in after) <= 1.0 + 1e-9
    assert after[-1].angle == pytest.approx(1.0, abs=1e-6)
