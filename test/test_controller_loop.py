"""The controller's core with the real control laws on the simulated crane, without ROS: changes in motion, stops, handover."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import pytest

from boom_controller.controller import Settings
from boom_controller.loop.control_loop import ControlLoop
from boom_controller.loop.cycle import Cycle
from boom_controller.references.joint_trajectory import TrajectoryPoint
from boom_controller.supervision.state_machine import MotionState
from boom_controller.supervision.supervision_settings import SupervisionSettings
from boom_model.machine import Machine
from boom_model.machine_file import load_machine
from boom_model.sensors import IDEAL
from boom_sim.simulated_crane import PERIOD, CraneStart, SimulatedCrane

MODES = ("baseline", "improved")


@pytest.fixture(scope="module")
def machine() -> Machine:
    return load_machine("tz17")


class Crane:
    """The loop around the crane, lifting at 0.05 rad/s. Commands act ``dead_time`` [s] after the samples, which is told or not."""

    def __init__(
        self, machine: Machine, mode: str, dead_time: float = 0.0, told: bool = True, pose: tuple[float, float] = (0.28, 2.2),
        angle: float = 0.3,
    ) -> None:  # fmt: skip
        self.dead_time, self.told = dead_time, told
        self.wanted: Callable[[float], float] | None = lambda time: 0.3 + 0.05 * time
        there = machine.pose(*pose, 0.0)
        self.crane = SimulatedCrane(machine, there, CraneStart(angle), IDEAL)
        self.loop = ControlLoop(mode, Settings(), SupervisionSettings())
        self.loop.configure(machine, there)
        self.cycles: list[Cycle] = []

    def run(self, seconds: float) -> list[Cycle]:
        begin = len(self.cycles)
        for _ in range(round(seconds / PERIOD)):
            s, loop = self.crane.sample, self.loop
            now = s.time + (self.dead_time if self.told else 0.0)
            if self.wanted:
                loop.stream(self.wanted(s.time), now)
            loop.joint(s.angle, s.rate, s.time, s.time)
            loop.hose_pressure(s.hose_pressure, s.time, s.time)
            loop.rod_pressure(s.rod_pressure, s.time, s.time)
            cycle = loop.cycle(now)
            self.crane.command(cycle.retract, cycle.extend, s.time + self.dead_time)
            self.crane.advance()
            self.cycles.append(cycle)
        return self.cycles[begin:]


CHANGES: list[dict[str, Any]] = [
    {"neutral_pressure": 5.5e5},
    {"neutral_pressure": 4.0e5},
    {"force_pole": -8.0},
    {"position_pole": -2.0},
    {"generator_pole": -6.0},
    {"largest_current": 0.5},
    {"largest_spool_position": 0.8},
]


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("change", CHANGES, ids=lambda change: next(iter(change)))
def test_a_change_in_motion_makes_no_jump_larger_than_its_steady_change(
    machine: Machine, mode: str, change: dict[str, Any]
) -> None:
    usual, changed = Crane(machine, mode), Crane(machine, mode)
    usual.run(3.0)
    changed.run(3.0)
    changed.loop.change(settings=replace(Settings(), **change))
    pairs = list(zip(usual.run(3.0), changed.run(3.0), strict=True))
    for side in ("retract", "extend"):
        off = [getattr(b, side) - getattr(a, side) for a, b in pairs]
        steady = abs(sum(off[-50:]) / 50)
        jumps = [abs(b - a) for a, b in itertools.pairwise([0.0, *off])]
        # another pole of the generator makes another reference: its first motion is no jump, but it is there
        own = 1.5e-3 if "generator_pole" in change else 5e-4
        assert max(jumps) <= steady + own


@pytest.mark.parametrize("modes", [("baseline", "improved"), ("improved", "baseline")], ids=lambda modes: modes[1])
def test_another_control_law_takes_over_in_motion_without_a_jump(machine: Machine, modes: tuple[str, str]) -> None:
    crane = Crane(machine, modes[0])
    before = crane.run(3.0)
    crane.loop.change(mode=modes[1])
    after = crane.run(2.0)
    usual = max(abs(b.extend - a.extend) for a, b in itertools.pairwise(before[50:]))
    jump = max(abs(b.extend - a.extend) for a, b in itertools.pairwise([before[-1], *after]))
    assert jump <= usual + 0.03
    assert all(c.state is MotionState.TRACK for c in after)
    assert abs(after[-1].reference.angle - after[-1].measurement.angle) < 5e-3


def moved(crane: Crane, to: float, seconds: float) -> list[Cycle]:
    """A goal, and two seconds more."""
    here = (
        crane.loop.references.present.angle if crane.cycles[-1].state is MotionState.HOLD else crane.crane.sample.angle
    )
    crane.loop.start(
        [TrajectoryPoint(0.0, here, 0.0, 0.0), TrajectoryPoint(seconds, to, 0.0, 0.0)], crane.crane.sample.time
    )
    return crane.run(seconds + 2.0)


def farthest(cycles: list[Cycle]) -> float:
    """The largest error of the angle [rad]."""
    return max(abs(c.reference.angle - c.measurement.angle) for c in cycles)


@pytest.mark.parametrize("before", ["baseline", "simple"])
@pytest.mark.parametrize(("begin", "end"), [(0.3, 0.7), (0.7, 0.3)])
@pytest.mark.parametrize("at", [0.6, 1.2])
def test_improved_takes_over_a_boom_in_fast_motion_with_its_valve_open(
    machine: Machine, before: str, at: float, begin: float, end: float
) -> None:
    """Off by 30 to 75 mrad with a valve that it took for closed; by up to 9 where the boom accelerates."""

    def run(change: bool) -> list[Cycle]:
        crane = Crane(machine, before, angle=begin)
        crane.wanted = None
        crane.run(0.5)
        crane.loop.start(
            [TrajectoryPoint(0.0, begin, 0.0, 0.0), TrajectoryPoint(3.0, end, 0.0, 0.0)], crane.crane.sample.time
        )
        crane.run(at)
        if change:
            crane.loop.change(mode="improved")
        return crane.run(4.0)

    assert farthest(run(change=True)) < farthest(run(change=False)) + 9e-3


@pytest.mark.parametrize(("low", "high", "seconds"), [(1.0, 1.4, 3.0), (1.2, 1.5, 3.0), (0.9, 1.4, 2.0)])
def test_a_folded_boom_that_hardly_presses_on_its_cylinder_is_lifted_without_swinging(
    machine: Machine, low: float, high: float, seconds: float
) -> None:
    crane = Crane(machine, "improved", pose=(4.5, 0.0), angle=high)
    crane.wanted = None
    crane.run(0.5)
    for to in (low, high):
        cycles = moved(crane, to, seconds)
        assert not any("oscillation" in c.output.note for c in cycles)
        assert cycles[-1].state is MotionState.HOLD
        assert farthest(cycles) < 7e-3


@pytest.mark.parametrize("mode", MODES)
def test_a_stop_brings_the_crane_to_rest(machine: Machine, mode: str) -> None:
    crane = Crane(machine, mode)
    crane.run(3.0)
    crane.loop.stop_now(crane.crane.sample.time)
    after = crane.run(1.5)
    assert (after[-1].state, after[-1].retract, after[-1].extend) == (MotionState.STOPPED, 0.0, 0.0)
    assert abs(crane.crane.sample.rate) < 0.01


def test_samples_that_are_told_to_be_old_cost_little_tracking(machine: Machine) -> None:
    def error(dead_time: float, told: bool) -> float:
        crane = Crane(machine, "improved", dead_time, told)
        crane.wanted = lambda time: 0.3 + 0.05 * math.sin(2.0 * time)
        cycles = crane.run(5.0)[100:]
        return sum(abs(c.reference.angle - c.measurement.angle) for c in cycles) / len(cycles)

    at_once, told, untold = error(0.0, told=True), error(0.005, told=True), error(0.005, told=False)
    assert told < 1.05 * at_once
    assert untold > told  # it is estimated, but not at once
