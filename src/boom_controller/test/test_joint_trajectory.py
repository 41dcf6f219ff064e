"""Planned motions: what is made of their points, and what is refused."""

from __future__ import annotations

import itertools
import math
from types import SimpleNamespace

import numpy as np
import pytest

from boom_controller.node.messages import points_of
from boom_controller.references.joint_trajectory import (
    LOOK_AHEAD,
    MOST_POINTS,
    SETTLING,
    Bounds,
    Code,
    JointTrajectory,
    TrajectoryError,
    TrajectoryPoint,
    plan,
)
from boom_controller.references.polynomial import Polynomial, cubic, quintic, to_rest
from boom_controller.types import Reference

BOUNDS = Bounds(-0.02, 1.5, 0.6, 0.05)
REST = Reference(0.3)


def planned(*points: TrajectoryPoint, present: Reference = REST, measured: float = 0.3) -> JointTrajectory:
    return plan(points, present, measured, BOUNDS)


def test_a_quintic_has_what_was_asked_for_at_both_ends() -> None:
    piece = quintic((0.1, 0.2, -0.3), (0.5, -0.1, 0.4), 1.7)
    begin, end = piece.at(0.0), piece.at(1.7)
    assert (begin.angle, begin.rate, begin.acceleration) == pytest.approx((0.1, 0.2, -0.3))
    assert (end.angle, end.rate, end.acceleration) == pytest.approx((0.5, -0.1, 0.4))


def test_a_cubic_has_angle_and_rate_at_both_ends() -> None:
    piece = cubic((0.1, 0.2), (0.5, -0.1), 0.8)
    assert (piece.at(0.8).angle, piece.at(0.8).rate) == pytest.approx((0.5, -0.1))
    assert (piece.at(0.0).angle, piece.at(0.0).rate) == pytest.approx((0.1, 0.2))


def test_derivatives_are_those_of_the_polynomial() -> None:
    piece, h = Polynomial(0.3, -0.2, 0.5, 0.7, -0.4, 0.1), 1e-5
    before, here, behind = piece.at(0.9 - h), piece.at(0.9), piece.at(0.9 + h)
    assert here.rate == pytest.approx((behind.angle - before.angle) / (2 * h), rel=1e-6)
    assert here.acceleration == pytest.approx((behind.rate - before.rate) / (2 * h), rel=1e-6)
    assert here.jerk == pytest.approx((behind.acceleration - before.acceleration) / (2 * h), rel=1e-6)


def test_the_ramp_to_rest_ends_at_rest_with_the_stated_way_and_deceleration() -> None:
    ramp = to_rest(Reference(0.2, 0.4), 0.5)
    end = ramp.at(0.5)
    assert (end.rate, end.acceleration) == pytest.approx((0.0, 0.0), abs=1e-12)
    assert end.angle == pytest.approx(0.2 + 0.4 * 0.5 / 2)
    assert max(-ramp.at(0.005 * k).acceleration for k in range(101)) == pytest.approx(1.5 * 0.4 / 0.5, rel=1e-3)


def test_accelerations_make_quintics_rates_alone_cubics() -> None:
    quintics = planned(
        TrajectoryPoint(0.0, 0.3, 0.0, 0.0), TrajectoryPoint(1.0, 0.4, 0.1, 0.2), TrajectoryPoint(2.0, 0.5, 0.0, 0.0)
    )
    cubics = planned(TrajectoryPoint(0.0, 0.3, 0.0), TrajectoryPoint(1.0, 0.4, 0.1), TrajectoryPoint(2.0, 0.5, 0.0))
    for piece in (quintics, cubics):
        assert piece.at(1.0).rate == pytest.approx(0.1)
        assert not piece.smoothed
        assert piece.duration == 2.0
    assert quintics.at(1.0 - 1e-9).acceleration == pytest.approx(0.2)
    assert abs(cubics.at(1.0 - 1e-9).acceleration - cubics.at(1.0).acceleration) > 0.01


def test_angles_alone_make_straight_lines_for_the_trajectory_generator() -> None:
    lines = planned(TrajectoryPoint(0.0, 0.3), TrajectoryPoint(1.0, 0.5), TrajectoryPoint(2.0, 0.5))
    assert lines.smoothed
    assert lines.at(0.25).angle == pytest.approx(0.35)
    assert lines.duration == pytest.approx(2.0 + SETTLING)


def test_a_first_point_later_than_zero_is_reached_from_the_present_motion() -> None:
    moving = Reference(0.3, 0.2, 0.1)
    trajectory = planned(TrajectoryPoint(1.0, 0.5, 0.0, 0.0), present=moving)
    begin = trajectory.at(0.0)
    assert (begin.angle, begin.rate, begin.acceleration) == pytest.approx((0.3, 0.2, 0.1))


def test_before_its_start_and_behind_its_end_a_trajectory_stands_still() -> None:
    trajectory = planned(TrajectoryPoint(0.0, 0.3, 0.1), TrajectoryPoint(1.0, 0.4, 0.0))
    assert trajectory.at(-0.5) == Reference(0.3)
    assert trajectory.at(7.0) == Reference(0.4)


@pytest.mark.parametrize(
    ("points", "words"),
    [
        ([], "no points"),
        ([TrajectoryPoint(0.0, 0.3), TrajectoryPoint(0.0, 0.4)], "ascend"),
        ([TrajectoryPoint(-1.0, 0.3), TrajectoryPoint(0.0, 0.4)], "ascend"),
        ([TrajectoryPoint(1.0, math.nan)], "not finite"),
        ([TrajectoryPoint(1.0, 0.4, math.inf)], "not finite"),
        ([TrajectoryPoint(1.0, 0.4, 0.0), TrajectoryPoint(2.0, 0.5)], "other fields"),
        ([TrajectoryPoint(1.0, 0.4, None, 0.0)], "no rate"),
        ([TrajectoryPoint(1.0, 0.4, 0.2)], "rate of 0"),
        (
            [TrajectoryPoint(2.0, 0.35, 0.0, 3.0)],
            "accelerations at points 0 and 1 the boom would go to 0.5.* and back: give 0",
        ),
        ([TrajectoryPoint(t, 0.35, 0.0, 3.0) for t in (1.99, 2.0)], "accelerations at points 0 and 1 .* give 0"),
        ([TrajectoryPoint(0.0, 0.6), TrajectoryPoint(4.0, 0.5)], "away from the boom"),
        ([TrajectoryPoint(9.0, 1.6)], "moves between"),
        ([TrajectoryPoint(2.0, 1e308)], r"point 0 is at 1e\+308 rad: the boom moves between"),
        ([TrajectoryPoint(2.0, 0.4, 0.0, 1e300)], r"e\+\d+ rad: the boom moves between"),
        ([TrajectoryPoint(2.0, 0.4, 0.0, 1e308)], "too far away for a number"),
        ([TrajectoryPoint(1.0, 0.4, 1e308, 0.0), TrajectoryPoint(2.0, 0.4, 0.0, 0.0)], "too far away for a number"),
        ([TrajectoryPoint(t, 0.4, 0.0, 1e308) for t in (1.0, 1.001)], "too fast for a number"),
        ([TrajectoryPoint(0.2, 0.9)], "at most 0.6 rad/s"),
        ([TrajectoryPoint(0.6, 0.55, 0.0)], "at most 0.6 rad/s"),
    ],
)
def test_what_cannot_be_followed_is_refused_with_the_reason(points: list[TrajectoryPoint], words: str) -> None:
    with pytest.raises(TrajectoryError, match=words) as caught:
        planned(*points)
    assert caught.value.code is Code.INVALID_GOAL
    assert "\n" not in str(caught.value) and "nan" not in str(caught.value) and len(str(caught.value)) < 160


def test_the_last_point_may_have_the_deceleration_with_which_planners_come_to_it() -> None:
    speed, slowing, begin = 0.2, 0.5, 1.0
    points = [TrajectoryPoint(begin, 0.3 + speed * begin, speed, -slowing)]
    for t in (0.1, 0.2, 0.3, 0.4):
        points.append(
            TrajectoryPoint(
                begin + t, 0.3 + speed * begin + speed * t - slowing * t * t / 2, speed - slowing * t, -slowing
            )
        )
    assert planned(*points).goal == pytest.approx(0.3 + speed * begin + speed**2 / slowing / 2)


def test_angle_and_rate_go_on_across_the_points() -> None:
    trajectory = planned(
        TrajectoryPoint(0.0, 0.3, 0.0, 0.0), TrajectoryPoint(0.8, 0.4, 0.1, -0.2), TrajectoryPoint(2.0, 0.45, 0.0, 0.0)
    )
    samples = [trajectory.at(0.001 * k) for k in range(2100)]
    for a, b in itertools.pairwise(samples):
        assert abs(b.angle - a.angle) < 1e-3
        assert abs(b.rate - a.rate) < 5e-3
        assert abs(b.acceleration - a.acceleration) < 5e-2


def test_more_points_than_can_be_read_between_two_cycles_are_refused_unread() -> None:
    message = SimpleNamespace(joint_names=["boom"], points=[None] * (MOST_POINTS + 1))
    with pytest.raises(TrajectoryError, match="1001 points: give at most 1000"):
        points_of(message, "boom")


def test_the_largest_trajectory_is_checked_at_every_piece() -> None:
    slow = [TrajectoryPoint(0.02 * k, 0.3 + 1e-4 * k, 5e-3, 0.0) for k in range(MOST_POINTS - 1)]
    end = TrajectoryPoint(0.02 * MOST_POINTS, 0.3 + 1e-4 * MOST_POINTS, 0.0, 0.0)
    assert planned(*slow, end).goal == end.angle
    slow[700] = TrajectoryPoint(slow[700].time, slow[700].angle + 0.05, 5e-3, 0.0)
    with pytest.raises(TrajectoryError, match=r"at 1[34]\."):
        planned(*slow, end)


def crept(count: int, seconds: float, step: float) -> JointTrajectory:
    """Points every ``seconds``, ``step`` [rad] apart, each at rest: a planner that fills what it does not know with zeros."""
    points = [TrajectoryPoint(seconds * (k + 1), 0.3 + step * (k + 1), 0.0, 0.0) for k in range(count)]
    return planned(TrajectoryPoint(0.0, 0.3, 0.0, 0.0), *points)


@pytest.mark.parametrize(("seconds", "step"), [(0.01, 1e-5), (0.01, 1e-3), (0.02, 1e-5), (0.05, 1e-3)])
def test_points_closer_than_a_law_looks_ahead_ask_for_no_more_than_their_path(seconds: float, step: float) -> None:
    path = crept(200, seconds, step)
    for t in np.linspace(0.0, 150 * seconds, 401):
        ahead = path.at(t).ahead(LOOK_AHEAD)
        assert ahead.angle == pytest.approx(path.at(t + LOOK_AHEAD).angle, abs=1e-12)
        for look in (0.035, 0.06):
            assert abs(path.at(t).ahead(look).rate) < 2.0 * step / seconds  # a quintic's own is 1.9


def test_a_smooth_path_in_points_every_10_ms_keeps_its_derivatives_though_they_are_rounded() -> None:
    w, size = 2 * math.pi * 0.3, 0.1
    t = 0.01 * np.arange(400)
    angle, rate, acceleration = 0.3 + size * np.cos(w * t), -size * w * np.sin(w * t), -size * w**2 * np.cos(w * t)
    rate[-1] = acceleration[-1] = 0.0
    points = [TrajectoryPoint(*map(float, p)) for p in zip(t, angle.round(5), rate.round(4), acceleration, strict=True)]
    path = planned(*points, measured=0.4)
    for k in np.linspace(0.5, 3.5, 301):
        ahead = path.at(k).ahead(0.06)
        assert ahead.angle == pytest.approx(0.3 + size * math.cos(w * (k + 0.06)), abs=2e-5)
        assert ahead.rate == pytest.approx(-size * w * math.sin(w * (k + 0.06)), abs=3e-3)


def test_a_boom_beyond_its_bounds_may_be_led_back_and_no_further_out() -> None:
    outside = BOUNDS.low - 0.01
    bounds = BOUNDS.from_where(outside + 1e-4, outside)  # measured, and by its reference
    back = TrajectoryPoint(3.0, 0.1, 0.0)
    assert plan([back], Reference(outside), outside, bounds).goal == 0.1
    out = [TrajectoryPoint(1.0, outside - 0.01, 0.0), back]
    to_and_fro = [back, TrajectoryPoint(6.0, outside, 0.0)]
    there_once_more = [back, TrajectoryPoint(6.0, outside + 0.005, 0.0), TrajectoryPoint(9.0, 0.1, 0.0)]
    for points in (out, to_and_fro, there_once_more):
        with pytest.raises(TrajectoryError, match="the boom moves between"):
            plan(points, Reference(outside), outside, bounds)
