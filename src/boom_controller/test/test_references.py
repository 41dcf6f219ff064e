"""The reference never jumps, whatever it comes from."""

from __future__ import annotations

import itertools
import math

import pytest

from boom_controller.references.joint_trajectory import Bounds, TrajectoryPoint, plan
from boom_controller.references.references import References
from boom_controller.references.trajectory_generator import TrajectoryGenerator
from boom_controller.types import Reference

TS = 0.01
BOUNDS = Bounds(-1.0, 2.0, 2.0, 0.1)


def references(angle: float = 0.3) -> References:
    made = References(TrajectoryGenerator(-10.0, TS), TS, deceleration=1.5, fastest=0.6, blend=0.4)
    made.reset(angle, 0.0)
    return made


def run(made: References, begin: int, end: int) -> list[Reference]:
    return [made.advance(TS * k) for k in range(begin, end)]


def smooth(samples: list[Reference]) -> bool:
    """Each sample follows from the one before it: angle from the rate, rate from the acceleration; no jump."""
    return all(
        abs(b.angle - a.angle - 0.5 * TS * (a.rate + b.rate)) < 2e-4
        and abs(b.rate - a.rate - 0.5 * TS * (a.acceleration + b.acceleration)) < 3e-3
        for a, b in itertools.pairwise(samples)
    )


def test_a_stream_goes_through_the_generator_exactly() -> None:
    made, alone = references(), TrajectoryGenerator(-10.0, TS)
    alone.reset(0.3)
    for k in range(1, 200):
        wanted = 0.3 + 0.1 * math.sin(0.02 * k)
        made.stream(wanted)
        reference = made.advance(TS * k)
        assert reference.angle == pytest.approx(alone.step(wanted).angle, abs=1e-9)


def test_wanted_angles_that_come_twice_or_not_at_all_between_two_cycles_make_no_steps() -> None:
    def jerks(interpolated: bool) -> float:
        """Largest jerk [rad/s^3] behind the start, on a ramp of 0.2 rad/s whose samples come 4 ms early or late."""
        made, coming = references(), 1
        found = []
        for k in range(1, 300):
            while TS * coming + 0.004 * (-1) ** coming <= TS * k:
                came = TS * coming + 0.004 * (-1) ** coming
                made.stream(0.3 + 0.2 * came, came if interpolated else None)
                coming += 1
            found.append(abs(made.advance(TS * k, TS * k - 0.001).jerk))
        return max(found[200:])

    # a ramp in steps of a sample time leaves the generator a jerk of 0.017 rad/s^3 of its own
    assert jerks(interpolated=True) < 0.02
    assert jerks(interpolated=False) > 0.05


def test_a_stream_that_falls_silent_is_followed_to_its_last_angle() -> None:
    made = references()
    for k in range(1, 20):
        made.stream(0.3 + 0.001 * k, TS * k)
        made.advance(TS * k, TS * k)
    samples = [made.advance(TS * k, TS * k) for k in range(20, 400)]
    assert samples[-1].angle == pytest.approx(0.319, abs=1e-4)


def test_a_jump_of_the_stream_is_followed_no_faster_than_allowed() -> None:
    made = references()
    made.stream(1.3)
    samples = run(made, 1, 400)
    assert max(sample.rate for sample in samples) <= 0.6 + 1e-9
    assert samples[-1].angle == pytest.approx(1.3, abs=1e-3)
    assert smooth(samples)


def test_missed_cycles_do_not_slow_the_stream_down() -> None:
    whole, holes = references(), references()
    for k in range(1, 101):
        whole.stream(0.3 + 0.002 * k)
        whole.advance(TS * k)
        if k % 3 == 0 or k == 100:
            holes.stream(0.3 + 0.002 * k)
            holes.advance(TS * k)
    assert holes.present.angle == pytest.approx(whole.present.angle, abs=5e-3)
    assert holes.present.rate == pytest.approx(whole.present.rate, rel=0.05)


def test_to_rest_from_a_motion_is_bounded_and_ends_still() -> None:
    made = references()
    made.stream(0.9)
    samples = run(made, 1, 60)
    made.rest()
    samples += run(made, 60, 200)
    assert smooth(samples)
    assert made.resting
    assert samples[-1].rate == 0.0
    assert min(sample.acceleration for sample in samples) >= -1.5 * 1.5


def test_a_trajectory_that_replaces_another_in_motion_does_not_jump() -> None:
    made = references()
    first = plan([TrajectoryPoint(2.0, 0.8, 0.0, 0.0)], made.present, 0.3, BOUNDS)
    made.start(first, 0.0)
    samples = run(made, 1, 100)
    other = plan(
        [TrajectoryPoint(0.0, samples[-1].angle, 0.0, 0.0), TrajectoryPoint(3.0, 0.4, 0.0, 0.0)],
        made.present,
        0.55,
        BOUNDS,
    )
    made.start(other, 1.0)
    samples += run(made, 100, 500)
    assert smooth(samples)
    assert samples[-1].angle == pytest.approx(0.4)


def test_straight_lines_become_smooth_and_arrive() -> None:
    made = references()
    lines = plan([TrajectoryPoint(1.0, 0.6), TrajectoryPoint(2.0, 0.4)], made.present, 0.3, BOUNDS)
    made.start(lines, 0.0)
    samples = run(made, 1, 400)
    assert smooth(samples)
    assert samples[-1].angle == pytest.approx(0.4, abs=1e-4)


def test_from_a_stream_in_motion_to_a_trajectory_and_back_nothing_jumps() -> None:
    made = references()
    made.stream(0.5)
    samples = run(made, 1, 40)
    made.start(plan([TrajectoryPoint(1.0, 0.5, 0.0)], made.present, 0.4, BOUNDS), 0.39)
    samples += run(made, 40, 90)
    made.stream(0.45)
    samples += run(made, 90, 300)
    assert smooth(samples)
    assert samples[-1].angle == pytest.approx(0.45, abs=1e-3)


def test_a_trajectory_waits_for_its_start() -> None:
    made = references()
    made.start(plan([TrajectoryPoint(0.0, 0.3, 0.0), TrajectoryPoint(1.0, 0.5, 0.0)], made.present, 0.3, BOUNDS), 0.5)
    assert run(made, 1, 50)[-1].angle == pytest.approx(0.3)
    assert run(made, 50, 160)[-1].angle == pytest.approx(0.5)


@pytest.mark.parametrize("pole", [-0.5, -2.0, -50.0])
def test_another_pole_in_motion_makes_no_jump_and_leads_no_further_than_is_wanted(pole: float) -> None:
    made = references()
    moving = []
    for k in range(1, 60):
        made.stream(0.6)
        moving.append(made.advance(TS * k))
    made.change(pole)
    after = run(made, 60, 2000)
    assert smooth([*moving, *after])
    assert max(r.angle for r in after) < 0.6 + 2e-4
    assert max(abs(r.rate) for r in after) < 0.6


@pytest.mark.parametrize("seconds", [0.05, 0.1])
def test_short_goals_one_after_the_other_lead_where_they_are(seconds: float) -> None:
    """Each asks for 0.01 rad more, within less than the time in which a change fades."""
    made = references()
    angles = [0.3]
    for k in range(100):
        now = 0.05 * k
        path = plan([TrajectoryPoint(seconds, made.present.angle + 0.01, 0.0)], made.onward, made.present.angle, BOUNDS)
        made.start(path, now)
        angles += [made.advance(now + TS * i).angle for i in range(1, 6)]
    assert min(b - a for a, b in itertools.pairwise(angles)) > -1e-3
    assert angles[-1] > 0.7


def test_a_short_quintic_is_followed_without_a_step_back_and_nothing_of_it_is_left_at_rest() -> None:
    made = references()
    made.start(plan([TrajectoryPoint(0.09, 0.328, 0.0, 0.0)], made.onward, 0.3, BOUNDS), 0.0)
    path = run(made, 1, 60)
    assert min(r.angle for r in path) >= 0.3 and max(r.angle for r in path) < 0.328 + 1e-9
    made.rest()
    assert run(made, 60, 120)[-1].angle == pytest.approx(0.328, abs=1e-9)


@pytest.mark.parametrize("blend", [0.05, 3.0])
def test_another_blend_does_not_change_what_fades_already(blend: float) -> None:
    made = references()
    for k in range(1, 80):
        made.stream(0.6)
        before = made.advance(TS * k)
    made.start(
        plan([TrajectoryPoint(2.0, 0.7, 0.0)], Reference(0.4), 0.4, BOUNDS), TS * 79
    )  # 60 mrad and its rate away
    fading = run(made, 80, 90)
    made.blend = blend
    samples = [before, *fading, *run(made, 90, 500)]
    assert smooth(samples)
    assert samples[-1].angle == pytest.approx(0.7) and max(abs(r.angle) for r in samples) < 0.75
