"""The states of the motion, the ramp of a stop, and the limits that are watched."""

from __future__ import annotations

import math
from itertools import pairwise

import pytest

from boom_controller.errors import ControlError
from boom_controller.references.joint_trajectory import Code
from boom_controller.supervision.reasons import REASONS, StopCause
from boom_controller.supervision.state_machine import MotionState, Supervision
from boom_controller.supervision.supervision_settings import SUPERVISION, SupervisionSettings
from boom_controller.supervision.tracking_goal import Tolerances, TrackingGoal
from boom_controller.supervision.watch import MotionWatch
from boom_controller.types import ControlOutput, Measurement, Reference

SETTINGS = SupervisionSettings()
BY_CURRENTS = StopCause("divergence", "far away")
BY_REFERENCE = StopCause("pressure_limit", "400 bar")
STILL = Measurement(0.0, 0.4, 0.0, 8e6, 1e6)
CALM = ControlOutput(0.0, 0.3)


def tracking() -> Supervision:
    made = Supervision(SETTINGS)
    made.track()
    return made


def test_a_stop_by_the_currents_ramps_them_to_zero_in_the_stated_time() -> None:
    made = tracking()
    assert made.stop(BY_CURRENTS, 5.0)
    assert made.state is MotionState.STOPPING
    parts = [made.advance(5.0 + 0.01 * k, resting=False) for k in range(12)]
    assert parts[0] == 1.0
    assert parts[5] == pytest.approx(0.5)
    assert all(b <= a for a, b in pairwise(parts))
    assert parts[11] == 0.0
    assert made.state is MotionState.STOPPED


def test_a_stop_by_the_reference_lets_the_loop_work_until_it_rests() -> None:
    made = tracking()
    made.stop(BY_REFERENCE, 5.0)
    assert made.closed_loop
    assert made.advance(5.3, resting=False) == 1.0
    assert made.advance(5.4, resting=True) == 1.0
    assert made.closed_loop
    assert made.advance(5.4 + SETTINGS.stop_settling, resting=True) == 1.0
    assert not made.closed_loop
    assert made.advance(5.4 + SETTINGS.stop_settling + 0.5 * SETTINGS.current_ramp, resting=True) == pytest.approx(0.5)


def test_a_stop_by_the_reference_that_never_rests_ends_all_the_same() -> None:
    made = tracking()
    made.stop(BY_REFERENCE, 5.0)
    end = 5.0 + SETTINGS.longest_stop
    made.advance(end, resting=False)
    assert made.advance(end + SETTINGS.current_ramp + 1e-6, resting=False) == 0.0
    assert made.state is MotionState.STOPPED


def test_a_worse_reason_turns_a_stop_by_the_reference_into_one_by_the_currents() -> None:
    made = tracking()
    made.stop(BY_REFERENCE, 5.0)
    made.stop(BY_CURRENTS, 5.1)
    assert made.finding == BY_REFERENCE
    assert made.advance(5.15, resting=False) == pytest.approx(0.5)


def test_only_an_explicit_command_ends_a_stop_and_only_when_nothing_stands() -> None:
    made = tracking()
    made.stop(BY_CURRENTS, 5.0)
    assert not made.resume(None)[0]
    made.advance(6.0, resting=False)
    success, text = made.resume(StopCause("emergency_stop", "emergency stop"))
    assert not success and "emergency stop" in text
    assert made.state is MotionState.STOPPED
    assert made.resume(None, "not ready: preparing the laws") == (True, "not ready: preparing the laws")
    assert made.state is MotionState.IDLE and made.finding is None


def test_an_emergency_stop_at_rest_is_stopped_at_once() -> None:
    made = Supervision(SETTINGS)
    made.stop(StopCause("emergency_stop", "emergency stop"), 0.0)
    assert made.state is MotionState.STOPPED
    assert made.advance(0.0, resting=True) == 0.0


def test_deactivation_keeps_a_stop_that_stands() -> None:
    made = tracking()
    made.stop(BY_CURRENTS, 5.0)
    made.drop()
    assert made.state is MotionState.STOPPED
    other = tracking()
    other.drop()
    assert other.state is MotionState.IDLE


def seen(measurement: Measurement, reference: Reference, output: ControlOutput = CALM, seconds: float = 0.2) -> str:
    """The reason that is found within some time."""
    watch = MotionWatch(SETTINGS, (0.0, 1.5), (0.2, 0.6))
    for k in range(round(100 * seconds) + 1):
        finding = watch.motion(measurement, reference, output, 0.01 * k)
        if finding is not None:
            return finding.reason
    return ""


@pytest.mark.parametrize(
    ("measurement", "output", "reason"),
    [
        (STILL, CALM, ""),
        (STILL._replace(rate=0.7), CALM, "speed_limit"),
        (STILL._replace(rate=-0.7), CALM, "speed_limit"),
        (STILL._replace(hose_pressure=3.6e7), CALM, "pressure_limit"),
        (STILL._replace(rod_pressure=3.6e7), CALM, "pressure_limit"),
        (STILL._replace(angle=0.65), CALM, "divergence"),
        (STILL, ControlOutput(math.nan, 0.0), "divergence"),
        (STILL, ControlOutput(0.0, 0.5, reason="the load cannot be held"), "load_not_held"),
    ],
)
def test_each_limit_has_its_reason(measurement: Measurement, output: ControlOutput, reason: str) -> None:
    assert seen(measurement, Reference(0.4), output) == reason


@pytest.mark.parametrize(
    ("current", "rate", "reason"), [(0.6, 0.0, "no_motion"), (0.6, 0.01, ""), (0.5, 0.0, "")],
)  # fmt: skip
def test_a_valve_that_is_wide_open_for_a_second_moves_the_boom(current: float, rate: float, reason: str) -> None:
    watch, found = MotionWatch(SETTINGS, (0.0, 1.5), (0.2, 0.6)), ""
    for k in range(150):
        time = 0.01 * k
        moving = STILL._replace(angle=0.4 + rate * time + 0.5e-3 * (k % 2))
        finding = watch.motion(moving, Reference(0.4), ControlOutput(0.0, current), time)
        found = found or (finding.reason if finding else "")
        assert not found or time >= SETTINGS.longest_stall
    assert found == reason


def test_a_single_sample_beyond_a_limit_of_speed_is_no_reason() -> None:
    watch = MotionWatch(SETTINGS, (0.0, 1.5), (0.2, 0.6))
    for k in range(50):
        rate = 0.8 if k % 4 == 0 else 0.1
        assert watch.motion(STILL._replace(rate=rate), Reference(0.4), CALM, 0.01 * k) is None


def test_beyond_an_angle_limit_only_the_way_out_stops() -> None:
    out, back = STILL._replace(angle=1.51, rate=0.1), STILL._replace(angle=1.51, rate=-0.1)
    assert seen(out, Reference(1.5)) == "angle_limit"
    assert seen(back, Reference(1.5)) == ""
    assert seen(STILL._replace(angle=-0.01, rate=-0.1), Reference(0.0)) == "angle_limit"


def test_late_cycles_are_counted_and_a_long_gap_stops_at_once() -> None:
    watch = MotionWatch(SETTINGS, (0.0, 1.5), (0.2, 0.6))
    assert watch.cycle(0.012, 0.01, 0.0) is None
    finding = watch.cycle(0.06, 0.01, 0.1)
    assert finding is not None and finding.reason == "missed_deadlines"
    slow = MotionWatch(SETTINGS, (0.0, 1.5), (0.2, 0.6))
    found = [slow.cycle(0.021, 0.01, 0.021 * k) for k in range(40)]
    assert found[10] is None
    assert found[-1] is not None and found[-1].reason == "missed_deadlines"


def test_a_few_missed_cycles_are_forgotten_after_a_second() -> None:
    watch = MotionWatch(SETTINGS, (0.0, 1.5), (0.2, 0.6))
    assert all(watch.cycle(0.03 if k % 20 == 0 else 0.01, 0.01, 0.01 * k) is None for k in range(2000))


def test_currents_that_do_not_follow_are_found_and_those_nobody_measures_are_not() -> None:
    watch = MotionWatch(SETTINGS, (0.0, 1.5), (0.2, 0.6))
    found = [watch.currents((0.0, 0.4), (0.0, 0.0), 0.01 * k) for k in range(60)]
    assert found[40] is None
    assert found[-1] is not None and found[-1].reason == "currents_not_followed"
    assert "measured 0.00 and 0.00 A: is the motion enabled?" in str(found[-1])
    assert all(watch.currents((0.0, 0.4), None, 1.0 + 0.01 * k) is None for k in range(60))


@pytest.mark.parametrize(("every", "reason"), [(4, "currents_not_followed"), (50, "load_not_held")])
def test_currents_that_come_now_and_then_are_no_load_that_cannot_be_held(every: int, reason: str) -> None:
    """As where the motion is enabled and disabled in turns."""
    watch = MotionWatch(SETTINGS, (0.0, 1.5), (0.2, 0.6))
    for k in range(150):
        assert watch.currents((0.0, 0.4), (0.0, 0.0 if k % every == 0 else 0.4), 0.01 * k) is None
    law = ControlOutput(0.0, 0.4, reason="the load of about 5 kg cannot be held", cause="load_not_held")
    found = watch.motion(STILL, Reference(0.5), law, 1.5)
    assert found is not None and found.reason == reason


@pytest.mark.parametrize("lasting", [0.05, 0.2, 0.4])
def test_currents_that_stay_away_half_of_the_time_stop_the_boom_and_a_single_time_does_not(lasting: float) -> None:
    watch = MotionWatch(SETTINGS, (0.0, 1.5), (0.2, 0.6))

    def found(time: float, away: bool) -> str | None:
        cause = watch.currents((0.0, 0.4), (0.0, 0.0 if away else 0.4), time)
        return cause and cause.reason

    assert {found(0.01 * k, 100 <= k < 100 + round(100 * lasting)) for k in range(300)} == {None}
    in_turns = [found(3.0 + 0.01 * k, int(0.01 * k / lasting) % 2 == 0) for k in range(300)]
    assert "currents_not_followed" in in_turns


def test_impossible_settings_are_refused_by_name() -> None:
    with pytest.raises(ControlError, match="sensor_timeout"):
        SupervisionSettings(sensor_timeout=9.0)
    with pytest.raises(ControlError, match="largest_rate"):
        SupervisionSettings(largest_rate=math.nan)


def test_limits_never_lie_beyond_the_stroke_and_exclude_each_other_with_a_reason() -> None:
    assert SupervisionSettings(lowest_angle=0.1).angles((-1.0, 1.6)) == (0.1, 1.6)
    assert SupervisionSettings(highest_angle=3.0).angles((-1.0, 1.6)) == (-1.0, 1.6)
    with pytest.raises(ControlError, match="highest_angle"):
        SupervisionSettings(lowest_angle=0.5, highest_angle=0.4)
    with pytest.raises(ControlError, match=r"leave nothing of this boom.s -0\.300 to 1\.300 rad"):
        SupervisionSettings(lowest_angle=1.5).angles((-0.3, 1.3))


def test_every_setting_has_description_and_range() -> None:
    for spec in SUPERVISION:
        assert spec.description and spec.minimum is not None and spec.maximum is not None
        assert spec.minimum <= spec.default <= spec.maximum


def test_every_reason_says_how_to_go_on() -> None:
    for reason in REASONS.values():
        assert reason.cause and reason.remedy
        assert reason.reaction in ("reference", "currents")


def test_a_goal_is_not_reached_while_something_of_the_reference_before_is_left() -> None:
    goal = TrackingGoal(Tolerances(None, 0.005, 1.0), 0.09, 0.328)
    assert goal.look(0.2, 0.33, 0.328, True) is None
    ending = goal.look(0.5, 0.328, 0.328)
    assert ending is not None and ending.code is Code.SUCCESSFUL
    late = TrackingGoal(Tolerances(None, 0.005, 1.0), 0.09, 0.328)
    assert late.look(3.0, 0.33, 0.30, True) is None
    assert late.look(3.9, 0.328, 0.30) is None  # its time counts from there
    ending = late.look(4.1, 0.328, 0.30)
    assert ending is not None and ending.code is Code.GOAL_TOLERANCE_VIOLATED


def test_time_in_which_nobody_measures_the_currents_is_no_time_in_which_they_differ() -> None:
    watch = MotionWatch(SETTINGS, (0.0, 1.5), (0.2, 0.6))
    away = (0.0, 0.4), (0.0, 0.0)
    assert watch.currents((0.0, 0.4), (0.0, 0.4), 0.0) is None
    assert watch.currents((0.0, 0.4), None, 0.3) is None
    assert watch.currents(*away, 0.6) is None
    assert watch.currents(*away, -9.0) is None  # a clock that goes back
    found = [watch.currents(*away, -9.0 + 0.01 * k) for k in range(1, 60)]
    assert found[30] is None and found[-1] is not None
