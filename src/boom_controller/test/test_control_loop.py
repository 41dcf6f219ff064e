"""The whole controller without ROS, on a boom of one line: rate = 0.6 rad/s per ampere. Time is counted, not waited for."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from boom_controller.controller import Settings
from boom_controller.errors import ControlError
from boom_controller.loop import law_in_use
from boom_controller.loop.control_loop import ControlLoop
from boom_controller.loop.cycle import Cycle
from boom_controller.references.joint_trajectory import Code, TrajectoryError, TrajectoryPoint
from boom_controller.supervision.state_machine import MotionState
from boom_controller.supervision.supervision_settings import SupervisionSettings
from boom_controller.supervision.tracking_goal import Tolerances
from boom_controller.types import ControlOutput, Measurement, Reference
from boom_model.machine import Machine, Pose
from boom_model.machine_file import load_machine
from boom_node.commands import LONGEST_SILENCE_S

TS = 0.01
GAIN = 0.6


class Law:
    """Feedforward and a proportional part."""

    def __init__(self, mode: str) -> None:
        self.mode = mode
        self.gain = 8.0 if mode == "improved" else 4.0
        self.reason = ""
        self.load = 120.0
        self.fastest = math.nan

    def reset(self, measurement: Measurement) -> None:
        pass

    def change(self, settings: Settings) -> None:
        self.gain = -settings.force_pole

    def step(self, reference: Reference, measurement: Measurement) -> ControlOutput:
        u = (reference.rate + self.gain * (reference.angle - measurement.angle)) / GAIN
        u = min(max(u, -1.0), 1.0)
        return ControlOutput(
            max(-u, 0.0), max(u, 0.0), reason=self.reason, estimated_load=self.load, fastest_lift=self.fastest,
            fastest_lower=self.fastest,
        )  # fmt: skip


class Boom:
    """The loop, its boom and its sensors, period by period."""

    def __init__(self, loop: ControlLoop, machine: Machine, pose: Pose) -> None:
        self.loop, self.machine, self.pose = loop, machine, pose
        self.now, self.angle, self.rate = 100.0, 0.3, 0.0
        self.hose, self.clock = 8e6, 0.0
        self.loop.configure(machine, pose)
        self.cycles: list[Cycle] = []
        self.wanted: Callable[[float], float] | None = None
        self.silent: set[str] = set()
        self.shown: Callable[[float, float], tuple[float, float]] = lambda angle, rate: (angle, rate)
        self.dead_solenoids = False
        self.push = 0.0

    def period(self) -> Cycle:
        stamp = self.now - 90.0 + self.clock
        if self.wanted is not None:
            self.loop.stream(self.wanted(self.now), self.now)
        if "joint" not in self.silent:
            self.loop.joint(*self.shown(self.angle, self.rate), stamp, self.now)
        if "hose" not in self.silent:
            self.loop.hose_pressure(self.hose, stamp, self.now)
        if "rod" not in self.silent:
            self.loop.rod_pressure(1e6, stamp, self.now)
        cycle = self.loop.cycle(self.now)
        given = (0.0, 0.0) if self.dead_solenoids else (cycle.retract, cycle.extend)
        self.loop.currents(*given, stamp, self.now)
        self.rate = GAIN * (given[1] - given[0]) + self.push
        self.angle += self.rate * TS
        self.now += TS
        self.cycles.append(cycle)
        return cycle

    def run(self, seconds: float) -> Cycle:
        for _ in range(round(seconds / TS)):
            self.period()
        return self.cycles[-1]

    def until(self, state: MotionState, most: float = 3.0) -> float:
        """Seconds until the state is reached."""
        begin = self.now
        while self.period().state is not state:
            assert self.now - begin < most, f"still {self.cycles[-1].state}"
        return self.now - begin

    @property
    def last(self) -> Cycle:
        return self.cycles[-1]


@pytest.fixture(scope="module")
def machine() -> Machine:
    return load_machine("tz17")


@pytest.fixture
def boom(machine: Machine, monkeypatch: pytest.MonkeyPatch) -> Boom:
    monkeypatch.setattr(law_in_use, "make_controller", lambda mode, *_: Law(mode))
    made = Boom(ControlLoop("improved", Settings(), SupervisionSettings()), machine, machine.pose(0.28, 2.2, 50.0))
    made.period()
    return made


def lifting(boom: Boom) -> Boom:
    """Follows a stream upwards at 0.2 rad/s."""
    begin = boom.now
    boom.wanted = lambda now: 0.3 + 0.2 * (now - begin)
    boom.run(1.0)
    assert boom.last.state is MotionState.TRACK
    assert boom.rate > 0.15
    return boom


def test_without_a_reference_nothing_moves(boom: Boom) -> None:
    cycle = boom.run(0.5)
    assert (cycle.state, cycle.retract, cycle.extend) == (MotionState.IDLE, 0.0, 0.0)
    assert cycle.status == "ok"
    assert math.isnan(cycle.load)


def test_a_stream_is_followed_and_its_silence_holds_the_boom(boom: Boom) -> None:
    lifting(boom)
    assert abs(boom.last.reference.angle - boom.last.measurement.angle) < 0.01
    assert boom.last.load == 170.0
    boom.wanted = None
    boom.run(1.0)
    assert boom.last.state is MotionState.HOLD
    assert boom.last.status == "warning" and "no reference" in boom.last.reason
    assert abs(boom.rate) < 1e-3


def test_a_trajectory_that_the_boom_cannot_follow_is_slowed_said_and_reaches_its_goal(boom: Boom) -> None:
    boom.loop.law.controller.fastest = 0.1  # type: ignore[union-attr]
    number = boom.loop.start([TrajectoryPoint(2.0, 0.7, 0.0, 0.0)], boom.now)
    boom.run(1.5)
    assert boom.last.status == "warning" and "the path is slowed to" in boom.last.reason
    progress = boom.loop.goal_progress(number)
    assert progress is not None and progress[2] < 1.0 and progress[3] < 0.5
    boom.until(MotionState.HOLD, 10.0)
    assert max(abs(cycle.reference.rate) for cycle in boom.cycles) < 0.1
    assert boom.angle == pytest.approx(0.7, abs=2e-3)


def test_a_stream_that_the_boom_cannot_follow_is_limited_in_its_rate_and_said(boom: Boom) -> None:
    boom.loop.law.controller.fastest = 0.1  # type: ignore[union-attr]
    lifted = boom.now
    boom.wanted = lambda now: 0.3 + 0.2 * (now - lifted)
    boom.run(1.5)
    assert 0.05 < boom.rate < 0.1
    assert "the boom cannot move faster" in boom.last.reason


def test_sensors_that_are_slower_than_the_sample_time_are_said_before_anything_moves(boom: Boom) -> None:
    boom.run(0.5)
    for _ in range(30):  # every other sample is missing
        boom.period()
        boom.now += TS
    with pytest.raises(
        TrajectoryError, match=r"samples of the angle come every 20 ms and sample_time is 10 ms: .*sample_time:=0.02"
    ):
        boom.loop.start([TrajectoryPoint(2.0, 0.7, 0.0, 0.0)], boom.now)
    boom.run(0.5)
    boom.loop.start([TrajectoryPoint(2.0, 0.7, 0.0, 0.0)], boom.now)


@pytest.mark.parametrize("name", ["hose_pressure", "rod_pressure"])
def test_a_pressure_that_is_slower_than_the_sample_time_is_said_before_anything_moves(boom: Boom, name: str) -> None:
    """It had been stopped by missed_deadlines 0.7 s into each motion."""
    take, count = getattr(boom.loop, name), itertools.count()
    setattr(boom.loop, name, lambda *sample: take(*sample) if next(count) % 4 == 0 else None)
    boom.run(1.0)
    words = f"samples of the {name.replace('_', ' ')} come every 40 ms"
    with pytest.raises(TrajectoryError, match=words):
        boom.loop.start([TrajectoryPoint(2.0, 0.7, 0.0, 0.0)], boom.now)
    assert words in boom.last.reason


def test_sensors_that_come_in_bursts_are_as_fast_as_they_are_on_the_whole(boom: Boom) -> None:
    for _ in range(40):  # two samples at once, every other period
        boom.period()
        boom.now += 0.0002
        boom.period()
        boom.now += 2 * TS - 0.0002 - 2 * TS
    boom.loop.start([TrajectoryPoint(2.0, 0.7, 0.0, 0.0)], boom.now)


def test_sensors_slower_than_any_sample_time_are_to_be_sampled_faster(boom: Boom) -> None:
    for _ in range(30):
        boom.period()
        boom.now += 0.09
    with pytest.raises(
        TrajectoryError, match="samples of the angle come every 100 ms and sample_time is 10 ms: sample them faster"
    ):
        boom.loop.start([TrajectoryPoint(2.0, 0.7, 0.0, 0.0)], boom.now)


def test_a_stream_that_begins_far_away_is_not_followed(boom: Boom) -> None:
    boom.wanted = lambda _: 0.5
    boom.run(0.5)
    assert boom.last.state is MotionState.IDLE
    assert "bring it within" in boom.last.reason
    boom.wanted = lambda _: 0.33
    boom.run(0.1)
    assert boom.last.state is MotionState.TRACK
    assert boom.last.status == "ok"


def test_a_stream_beyond_the_limits_is_followed_to_their_margin(boom: Boom) -> None:
    boom.loop.change(supervision=SupervisionSettings(lowest_angle=-0.1))
    begin = boom.now
    boom.wanted = lambda now: 0.3 - 0.3 * (now - begin)
    boom.run(3.0)
    assert boom.last.state is MotionState.TRACK
    assert boom.angle == pytest.approx(-0.09, abs=1e-3)
    assert boom.last.status == "warning" and "beyond" in boom.last.reason


def test_a_boom_that_stands_beyond_its_limits_stays_where_a_stream_wants_it_and_goes_no_further_out(boom: Boom) -> None:
    boom.loop.change(supervision=SupervisionSettings(lowest_angle=boom.angle + 0.15))
    begin = boom.angle
    boom.wanted = lambda _: begin
    boom.run(1.0)
    assert boom.last.state is MotionState.TRACK
    assert boom.angle == pytest.approx(begin, abs=1e-3)
    boom.wanted = lambda _: begin - 0.02
    boom.run(1.0)
    assert boom.angle == pytest.approx(begin, abs=1e-3)
    assert boom.last.status == "warning" and "beyond" in boom.last.reason
    inside = boom.now
    boom.wanted = lambda now: min(begin + 0.2 * (now - inside), begin + 0.2)
    boom.run(3.0)
    assert boom.angle == pytest.approx(begin + 0.2, abs=2e-3)


def test_a_reference_of_many_digits_is_told_in_few(boom: Boom) -> None:
    boom.wanted = lambda now: 1e308
    boom.run(0.5)
    assert boom.last.reason.startswith("the reference of 1e+308 rad is not followed") and len(boom.last.reason) < 160


def test_a_reference_that_is_no_number_is_not_used(boom: Boom) -> None:
    lifting(boom)
    boom.wanted = lambda _: math.nan
    boom.run(1.0)
    assert boom.last.state is MotionState.HOLD
    assert math.isfinite(boom.angle)


SENSOR_FAULTS = {
    "sensor_old joint": lambda b: b.silent.add("joint"),
    "sensor_old hose": lambda b: b.silent.add("hose"),
    "sensor_old rod": lambda b: b.silent.add("rod"),
    "sensor_not_a_number": lambda b: setattr(b, "shown", lambda a, w: (math.nan, w)),
    "sensor_out_of_range": lambda b: setattr(b, "shown", lambda a, w: (a + 3.0, w)),
    "sensors_disagree": lambda b: setattr(b, "shown", lambda a, w, since=b.angle: (since + 0.4 * (a - since), w)),
    "sensor_stuck": lambda b: setattr(b, "shown", lambda a, w, held=b.angle: (held, w)),
    "pressures_impossible": lambda b: setattr(b, "hose", 1e-5 * b.hose),
    "emergency_stop": lambda b: b.loop.emergency_stop(True, b.now),
    "emergency_stop by service": lambda b: b.loop.stop_now(b.now),
    "missed_deadlines": lambda b: setattr(b, "now", b.now + 0.045 + TS),
    "pressure_limit": lambda b: setattr(b, "hose", 4e7),
    "divergence": lambda b: setattr(b, "push", -0.7),
    "load_not_held": lambda b: setattr(b.loop.law.controller, "reason", "2000 kg cannot be held"),
    "currents_not_followed": lambda b: setattr(b, "dead_solenoids", True),
    "configuration_changed": lambda b: b.loop.configuration_changes(b.now),
}


@pytest.mark.parametrize("fault", SENSOR_FAULTS)
def test_every_fault_in_motion_ends_with_zero_currents_in_time_and_its_reason(boom: Boom, fault: str) -> None:
    lifting(boom)
    s = boom.loop.supervision.settings
    SENSOR_FAULTS[fault](boom)
    found = boom.until(MotionState.STOPPING) if boom.loop.supervision.state is MotionState.TRACK else 0.0
    assert boom.loop.supervision.finding is not None
    assert boom.loop.supervision.finding.reason == fault.split()[0]
    latest = {
        "sensors_disagree": 0.5, "sensor_stuck": 0.3, "pressures_impossible": 0.22, "divergence": 1.0,
        "currents_not_followed": s.current_timeout + 0.1,
    }  # fmt: skip
    assert found <= latest.get(fault, 0.11)
    before = max(boom.last.retract, boom.last.extend)
    taken = boom.until(MotionState.STOPPED)
    assert (
        taken
        <= (s.longest_stop if fault in ("pressure_limit", "configuration_changed") else 0.0) + s.current_ramp + 0.02
    )
    steps = [abs(b.extend - a.extend) for a, b in zip(boom.cycles[-12:], boom.cycles[-11:], strict=False)]
    assert max(steps) <= max(before, 0.05) * 0.25
    assert (boom.last.retract, boom.last.extend) == (0.0, 0.0)
    assert boom.last.status == "stopped"
    assert fault.split()[0] in boom.last.reason
    boom.run(0.3)
    assert (boom.last.state, boom.last.retract, boom.last.extend) == (MotionState.STOPPED, 0.0, 0.0)


def noisy(boom: Boom) -> None:
    """A gyro with noise, seen for a second."""
    rng = np.random.default_rng(5)
    boom.shown = lambda angle, rate: (angle, rate + float(rng.normal(0.0, 1.5e-3)))
    boom.run(1.0)


def frozen(boom: Boom) -> None:
    """From now on angle and rate of this moment, with stamps that go on."""
    held = boom.shown(boom.angle, boom.rate)
    boom.shown = lambda angle, rate: held


def test_a_sensor_of_angle_and_rate_that_is_stuck_in_motion_stops_the_boom_within_a_fifth_of_a_second(
    boom: Boom,
) -> None:
    noisy(boom)
    lifting(boom)
    frozen(boom)
    assert boom.until(MotionState.STOPPING) < 0.2
    boom.until(MotionState.STOPPED)
    assert boom.last.reason.startswith("sensor_stuck: the rate repeats ")


def test_one_that_is_stuck_at_hold_stops_the_boom_though_its_noise_was_not_seen_before_the_first_motion(
    boom: Boom,
) -> None:
    rng = np.random.default_rng(5)
    boom.shown = lambda angle, rate: (angle, rate + float(rng.normal(0.0, 1.5e-3)))
    boom.run(0.2)
    boom.loop.start([TrajectoryPoint(0.0, boom.angle), TrajectoryPoint(1.0, 0.35)], boom.now)
    boom.until(MotionState.HOLD)
    boom.run(1.0)
    frozen(boom)
    boom.until(MotionState.STOPPED, 0.5)
    assert boom.last.reason.startswith("sensor_stuck: the rate repeats ")


@pytest.mark.parametrize("step", [0.3, -0.3])
def test_a_clock_that_is_set_in_motion_stops_the_boom_and_it_goes_on_once_asked(boom: Boom, step: float) -> None:
    lifting(boom)
    before = boom.last.reference.angle
    boom.clock = step
    boom.until(MotionState.STOPPED, 0.5)
    assert boom.last.reason.startswith("clock_set: the stamps of the angle went ")
    assert abs(boom.angle - before) < 0.02
    boom.run(1.0)
    assert boom.loop.resume(boom.now)[0]
    boom.loop.start([TrajectoryPoint(0.0, boom.angle), TrajectoryPoint(1.0, 0.4)], boom.now)
    boom.until(MotionState.HOLD)
    assert boom.angle == pytest.approx(0.4, abs=5e-3)


def test_an_angle_that_jumps_in_motion_is_not_used_and_stops_the_boom(boom: Boom) -> None:
    lifting(boom)
    there = boom.angle
    boom.shown = lambda angle, rate: (angle + 0.035, rate)
    boom.until(MotionState.STOPPED, 0.5)
    assert boom.last.reason.startswith("sensors_disagree: the angle jumped by 35 mrad from one sample to the next")
    assert abs(boom.angle - there) < 0.02
    boom.run(0.1)
    assert boom.loop.resume(boom.now)[0]  # at rest it may have been mounted anew


def test_one_that_is_stuck_at_rest_lets_no_motion_begin(boom: Boom) -> None:
    noisy(boom)
    frozen(boom)
    boom.run(0.5)
    with pytest.raises(TrajectoryError, match="not ready: the rate repeats"):
        boom.loop.start([TrajectoryPoint(1.0, 0.32)], boom.now)
    noisy(boom)
    boom.loop.start([TrajectoryPoint(1.0, 0.32)], boom.now)
    boom.until(MotionState.HOLD)


def test_a_pressure_that_is_stuck_is_told_and_the_motion_goes_on(boom: Boom) -> None:
    rng = np.random.default_rng(5)
    for _ in range(100):
        boom.hose = 8e6 + float(rng.normal(0.0, 2e4))
        boom.period()
    lifting(boom)
    boom.run(0.5)
    assert (boom.last.status, boom.last.state) == ("warning", MotionState.TRACK)
    assert boom.last.reason.startswith("the hose pressure repeats its value for ")
    boom.loop.law.controller.reason = "the boom swings"  # type: ignore[union-attr]
    boom.period()
    assert boom.last.reason.startswith("load_not_held: the boom swings; the hose pressure repeats its value for ")


def test_one_without_noise_that_is_stuck_at_rest_is_found_by_the_valve_that_opens_for_nothing(boom: Boom) -> None:
    frozen(boom)
    boom.loop.law.controller.gain = 80.0  # type: ignore[union-attr]
    boom.loop.start([TrajectoryPoint(0.3, 0.32)], boom.now)
    boom.until(MotionState.STOPPED)
    assert boom.last.reason == "no_motion: the valve has been wide open for 1 s, and the angle stays at 0.300 rad"


@pytest.mark.parametrize(("seconds", "most"), [(0.1, 1.0), (10.0, 0.35)])
def test_a_pressure_that_stays_too_high_ends_the_stop_by_the_reference(boom: Boom, seconds: float, most: float) -> None:
    lifting(boom)
    boom.hose, begin = 4e7, boom.now
    boom.until(MotionState.STOPPING)
    while boom.last.state is not MotionState.STOPPED:
        boom.hose = 4e7 if boom.now - begin < seconds else 8e6
        boom.period()
    assert boom.last.reason.startswith("pressure_limit: 400 bar")
    assert (boom.now - begin < 0.35) == (seconds > 1.0) and boom.now - begin < most


def test_speed_beyond_the_limit_stops(boom: Boom) -> None:
    lifting(boom)
    boom.loop.change(supervision=replace(SupervisionSettings(), largest_rate=0.1))
    boom.until(MotionState.STOPPED)
    assert "speed_limit" in boom.last.reason


def test_beyond_an_angle_limit_the_boom_is_stopped(boom: Boom) -> None:
    boom.loop.change(supervision=SupervisionSettings(lowest_angle=0.28))
    boom.wanted = lambda _: 0.3
    boom.run(0.5)
    boom.push = -0.5
    boom.until(MotionState.STOPPING)
    assert boom.loop.supervision.finding is not None
    assert boom.loop.supervision.finding.reason == "angle_limit"


def test_after_a_stop_a_reference_moves_nothing_until_it_is_resumed(boom: Boom) -> None:
    lifting(boom)
    boom.loop.emergency_stop(True, boom.now)
    boom.until(MotionState.STOPPED)
    assert not boom.loop.resume(boom.now)[0]
    boom.loop.emergency_stop(False, boom.now)
    held = boom.angle
    boom.wanted = lambda _: held
    boom.run(0.5)
    assert boom.last.state is MotionState.STOPPED
    with pytest.raises(TrajectoryError, match="resume"):
        boom.loop.start([TrajectoryPoint(1.0, 0.6, 0.0)], boom.now)
    assert boom.loop.resume(boom.now)[0]
    boom.run(0.1)
    assert boom.last.state is MotionState.TRACK


def test_a_new_pose_counts_after_the_stop_that_it_causes(boom: Boom) -> None:
    lifting(boom)
    pose = boom.machine.pose(0.28, 2.2, 300.0)
    with pytest.raises(ControlError, match="moves"):
        boom.loop.configure(boom.machine, pose)
    boom.loop.configuration_changes(boom.now)
    boom.until(MotionState.STOPPED)
    boom.loop.configure(boom.machine, pose)
    boom.period()
    assert boom.loop.resume(boom.now)[0]
    assert boom.loop.configuration == (boom.machine, pose)


def test_at_rest_a_new_configuration_is_no_reason_to_stop(boom: Boom) -> None:
    boom.loop.configuration_changes(boom.now)
    assert boom.period().state is MotionState.IDLE


def endings(boom: Boom) -> list[tuple[int, Code, str]]:
    return [(number, e.code, e.text) for cycle in boom.cycles for number, e in cycle.endings]


def test_a_trajectory_is_followed_to_its_goal_and_held_there(boom: Boom) -> None:
    number = boom.loop.start([TrajectoryPoint(2.0, 0.6, 0.0, 0.0)], boom.now)
    boom.run(3.0)
    assert endings(boom) == [(number, Code.SUCCESSFUL, "")]
    assert boom.last.state is MotionState.HOLD
    assert boom.angle == pytest.approx(0.6, abs=1e-3)


def test_leaving_the_path_aborts_and_holds(boom: Boom) -> None:
    boom.loop.start([TrajectoryPoint(2.0, 0.6, 0.0)], boom.now, tolerances=Tolerances(0.03, 0.01, 1.0))
    boom.run(0.7)
    boom.push = -0.5
    boom.run(0.3)
    boom.push = 0.0
    boom.run(1.0)
    assert [code for _, code, _ in endings(boom)] == [Code.PATH_TOLERANCE_VIOLATED]
    assert boom.last.state is MotionState.HOLD
    assert abs(boom.rate) < 1e-3


def test_a_goal_that_is_not_reached_in_time_is_told(boom: Boom) -> None:
    boom.push = 0.1  # what the law leaves over: 0.1 / 8 rad
    boom.loop.start(
        [TrajectoryPoint(0.0, 0.3, 0.0), TrajectoryPoint(1.0, 0.3, 0.0)],
        boom.now,
        tolerances=Tolerances(None, 0.005, 0.5),
    )
    boom.run(1.45)
    assert endings(boom) == []
    boom.run(0.2)
    assert [code for _, code, _ in endings(boom)] == [Code.GOAL_TOLERANCE_VIOLATED]
    assert boom.last.state is MotionState.HOLD


def test_cancel_comes_to_rest_without_a_jump_and_holds(boom: Boom) -> None:
    number = boom.loop.start([TrajectoryPoint(2.0, 0.7, 0.0)], boom.now)
    boom.run(1.0)
    rate = boom.rate
    assert boom.loop.cancel(number)
    assert not boom.loop.cancel(number)
    boom.period()
    assert boom.rate == pytest.approx(rate, abs=0.05)
    boom.run(1.0)
    assert boom.last.state is MotionState.HOLD
    assert abs(boom.rate) < 1e-3


def test_a_new_trajectory_replaces_the_old_one_without_a_jump(boom: Boom) -> None:
    first = boom.loop.start([TrajectoryPoint(2.0, 0.7, 0.0)], boom.now)
    boom.run(1.0)
    rate = boom.rate
    second = boom.loop.start([TrajectoryPoint(2.0, 0.4, 0.0)], boom.now)
    boom.period()
    assert boom.rate == pytest.approx(rate, abs=0.05)
    boom.run(3.5)
    assert [(n, c) for n, c, _ in endings(boom)] == [(first, Code.INVALID_GOAL), (second, Code.SUCCESSFUL)]
    assert boom.angle == pytest.approx(0.4, abs=1e-3)


def test_trajectories_that_replace_one_another_between_an_angle_and_its_cycle_leave_the_wanted_rate_smooth(
    boom: Boom,
) -> None:
    begin = len(boom.cycles)
    for k in range(100):
        stamp = boom.now - 90.0
        boom.loop.joint(boom.angle, boom.rate, stamp, boom.now)
        goal = 0.7 if k % 3 else 0.1
        boom.loop.start([TrajectoryPoint(3.0, goal, 0.0, 0.0)], boom.now)
        boom.silent = {"joint"}
        boom.period()
    wanted = [cycle.reference for cycle in boom.cycles[begin:]]
    for a, b in pairwise(wanted):
        assert b.rate - a.rate == pytest.approx(0.5 * TS * (a.acceleration + b.acceleration), abs=1e-3)
    assert max(abs(reference.rate) for reference in wanted) > 0.01


def test_a_trajectory_for_later_that_replaces_a_motion_leaves_the_wanted_rate_smooth(boom: Boom) -> None:
    boom.loop.start([TrajectoryPoint(3.0, 0.7, 0.0, 0.0)], boom.now)
    boom.run(1.5)
    begin = len(boom.cycles)
    later = boom.now - 90.0 + 0.7
    boom.loop.start([TrajectoryPoint(2.0, 0.3, 0.0, 0.0)], boom.now, begin=later)
    boom.run(4.0)
    for a, b in pairwise(cycle.reference for cycle in boom.cycles[begin - 1 :]):
        assert b.rate - a.rate == pytest.approx(0.5 * TS * (a.acceleration + b.acceleration), abs=1e-3)
    assert boom.angle == pytest.approx(0.3, abs=1e-3)


def test_a_trajectory_on_its_way_goes_before_a_stream(boom: Boom) -> None:
    boom.loop.start([TrajectoryPoint(1.0, 0.4, 0.0)], boom.now)
    boom.wanted = lambda _: 0.3
    boom.run(0.9)
    assert boom.angle > 0.37


def test_a_stop_aborts_the_trajectory_with_its_reason(boom: Boom) -> None:
    boom.loop.start([TrajectoryPoint(2.0, 0.7, 0.0)], boom.now)
    boom.run(0.5)
    boom.loop.emergency_stop(True, boom.now)
    boom.run(0.3)
    (ending,) = endings(boom)
    assert ending[1] is Code.INVALID_GOAL and "emergency" in ending[2]


def test_stamped_trajectories_begin_at_their_time(boom: Boom) -> None:
    boom.loop.start(
        [TrajectoryPoint(0.0, 0.3, 0.0), TrajectoryPoint(1.0, 0.5, 0.0)], boom.now, begin=boom.now - 90.0 + 0.5
    )
    boom.run(0.5)
    assert boom.angle == pytest.approx(0.3, abs=1e-6)
    boom.run(1.2)
    assert boom.angle == pytest.approx(0.5, abs=1e-3)
    with pytest.raises(TrajectoryError) as caught:
        boom.loop.start([TrajectoryPoint(1.0, 0.5, 0.0)], boom.now, begin=boom.now - 95.0)
    assert caught.value.code is Code.OLD_HEADER_TIMESTAMP


def test_before_sensors_and_configuration_are_there_references_are_refused(
    machine: Machine, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(law_in_use, "make_controller", lambda mode, *_: Law(mode))
    loop = ControlLoop("improved", Settings(), SupervisionSettings())
    with pytest.raises(TrajectoryError, match="machine_configuration"):
        loop.start([TrajectoryPoint(1.0, 0.3)], 0.0)
    loop.configure(machine, machine.pose(0.28, 2.2))
    with pytest.raises(TrajectoryError, match="no angle yet"):
        loop.start([TrajectoryPoint(1.0, 0.3)], 0.0)
    loop.stream(0.3, 0.0)
    cycle = loop.cycle(0.0)
    assert cycle.state is MotionState.IDLE
    assert (cycle.status, cycle.retract, cycle.extend) == ("warning", 0.0, 0.0)


def test_another_control_law_takes_over_without_a_jump(boom: Boom) -> None:
    lifting(boom)
    boom.loop.change(mode="baseline")
    before = boom.last.extend
    boom.period()
    assert abs(boom.last.extend - before) < 0.02
    boom.run(1.0)
    assert boom.loop.law.mode == "baseline"
    assert boom.last.state is MotionState.TRACK


def test_no_law_has_to_be_made_while_the_boom_moves(boom: Boom, monkeypatch: pytest.MonkeyPatch) -> None:
    made: list[str] = []

    def make(mode: str, *_: object) -> Law:
        made.append(mode)
        return Law(mode)

    monkeypatch.setattr(law_in_use, "make_controller", make)
    boom.loop.configure(boom.machine, boom.pose)
    assert made == ["improved", "thesis", "baseline", "simple"]
    lifting(boom)
    for mode in ("baseline", "thesis", "improved"):
        boom.loop.change(mode=mode)
        boom.run(0.2)  # the hand-over takes 0.4 s
    boom.run(1.0)
    assert len(made) == 4
    assert boom.loop.law.controller is not None and boom.loop.law.controller.mode == "improved"
    assert boom.last.state is MotionState.TRACK
    with pytest.raises(ControlError, match="thesis, baseline, improved"):
        boom.loop.change(mode="pid")


def test_two_late_samples_make_one_cycle_and_a_missing_one_is_not_waited_for(boom: Boom) -> None:
    loop, now = boom.loop, boom.now
    stamp = now - 90.0
    loop.joint(0.3, 0.0, stamp, now)
    assert not loop.due(now)
    loop.hose_pressure(8e6, stamp, now)
    loop.rod_pressure(1e6, stamp, now)
    assert loop.due(now)
    loop.cycle(now)
    assert not loop.due(now)
    assert not loop.overdue(now + 0.012)
    loop.joint(0.3, 0.0, stamp + TS, now + TS)
    assert loop.overdue(now + 0.0135)
    assert loop.overdue(now + 0.018)


def test_a_sample_that_comes_after_the_cycle_of_its_set_does_not_complete_the_next_one(boom: Boom) -> None:
    loop, now = boom.loop, boom.now
    stamp = now - 90.0
    loop.joint(0.3, 0.0, stamp, now)
    loop.hose_pressure(8e6, stamp, now)
    loop.cycle(now)
    loop.rod_pressure(1e6, stamp, now + 0.001)
    loop.joint(0.3, 0.0, stamp + TS, now + TS)
    loop.hose_pressure(8e6, stamp + TS, now + TS)
    assert not loop.due(now + TS)
    loop.rod_pressure(1e6, stamp + TS, now + TS)
    assert loop.due(now + TS)


@pytest.mark.parametrize("phases", [(0.0, 0.0066, 0.0033), (0.0, 0.005, 0.005), (0.0, 0.0, 0.009)])
def test_sensors_that_each_keep_their_own_time_complete_a_set_in_every_period(
    boom: Boom, phases: tuple[float, float, float]
) -> None:
    loop, begin = boom.loop, boom.now
    arrivals = sorted((k * TS + phase, which) for k in range(1, 20) for which, phase in enumerate(phases))
    cycles = []
    for offset, which in arrivals:
        now, stamp = begin + offset, begin + offset - 90.0
        if which == 0:
            loop.joint(0.3, 0.0, stamp, now)
        else:
            (loop.hose_pressure if which == 1 else loop.rod_pressure)(4e6, stamp, now)
        if loop.due(now):
            loop.cycle(now)
            cycles.append(offset)
    assert [b - a for a, b in pairwise(cycles)] == pytest.approx([TS] * (len(cycles) - 1))
    assert len(cycles) >= 18


def test_a_controller_that_stood_still_says_so_although_its_samples_are_old_by_then(boom: Boom) -> None:
    lifting(boom)
    boom.silent |= {"joint", "hose", "rod"}
    boom.now += 0.3
    assert boom.period().reason.startswith("missed_deadlines: 310 ms between two cycles")


@pytest.mark.parametrize("first", ["cycle", "emergency stop"])
def test_after_a_gap_in_which_the_receivers_closed_the_valve_the_currents_are_zero_at_once(
    boom: Boom, first: str
) -> None:
    lifting(boom)
    boom.now += LONGEST_SILENCE_S
    if first == "emergency stop":  # queued during the gap, and heard before the first cycle
        boom.loop.emergency_stop(True, boom.now)
    cycle = boom.period()
    assert (cycle.state, cycle.retract, cycle.extend) == (MotionState.STOPPED, 0.0, 0.0)
    assert cycle.reason.startswith("missed_deadlines" if first == "cycle" else "emergency_stop")


def test_after_a_shorter_gap_the_currents_are_ramped_from_what_the_valve_still_has(boom: Boom) -> None:
    before = lifting(boom).last.extend
    boom.now += 0.6 * LONGEST_SILENCE_S
    cycle = boom.period()
    assert cycle.state is MotionState.STOPPING and cycle.extend == pytest.approx(before, rel=0.1)


def test_deactivation_after_such_a_gap_gives_no_currents_to_be_ramped(boom: Boom) -> None:
    lifting(boom)
    assert boom.loop.drop(boom.now + 3.0) == (0.0, 0.0)


def test_deactivation_gives_the_last_currents_to_be_ramped(boom: Boom) -> None:
    lifting(boom)
    extend = boom.last.extend
    assert boom.loop.drop(boom.now) == (0.0, pytest.approx(extend))
    assert boom.loop.supervision.state is MotionState.IDLE


def test_what_the_law_does_not_use_of_the_machine_file_is_said_at_start(boom: Boom) -> None:
    slow = {"pilot_lag": {"r": 1.2, "line": 0.02}, "end_cushioning": {"kappa_b": 2.0}}
    machine = boom.machine.with_effects(
        {"hose_burst_valve_lag": {"tau": 0.05}, "boom_flexibility": {"gain": 0.3}, **slow}
    )
    boom.loop.configure(machine, boom.pose)
    cycle = boom.run(0.1)
    assert cycle.status == "warning"
    assert "tells hose burst valve lag, pilot lag (line), which the control law does not use" in cycle.reason


def test_a_held_boom_of_a_quiet_encoder_beside_a_gyro_with_a_bias_is_no_stuck_sensor(boom: Boom) -> None:
    lifting(boom)
    held = boom.angle
    boom.wanted = lambda now: held
    boom.run(2.0)
    stands = boom.angle
    boom.shown = lambda angle, rate: (stands, rate + 5e-3)
    boom.run(8.0)
    assert boom.loop.supervision.finding is None
