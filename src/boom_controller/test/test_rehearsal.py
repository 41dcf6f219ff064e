"""A cycle for nobody goes the way of a real one and leaves it as it is."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from boom_controller.controller import Settings
from boom_controller.loop.control_loop import ControlLoop
from boom_controller.loop.cycle import Cycle
from boom_controller.loop.rehearsal import Rehearsal
from boom_controller.supervision.state_machine import MotionState
from boom_controller.supervision.supervision_settings import SupervisionSettings
from boom_model.machine import Machine, Pose
from boom_model.machine_file import load_machine

TS = 0.01


@pytest.fixture(scope="module")
def configuration() -> tuple[Machine, Pose]:
    machine = load_machine("tz17")
    return machine, machine.pose(0.28, 2.2, 50.0)


def rehearsal_of(configuration: tuple[Machine, Pose]) -> Rehearsal:
    made = Rehearsal("improved", Settings(), SupervisionSettings())
    made.configure(*configuration)
    return made


def followed(configuration: tuple[Machine, Pose], rehearsal: Rehearsal | None) -> tuple[list[Cycle], set[str]]:
    """0.3 s of a rising reference with a boom that stands; the states that rehearsals ended in."""
    loop, states = ControlLoop("improved", Settings(), SupervisionSettings()), set()
    loop.configure(*configuration)
    cycles = []
    for k in range(30):
        now = 5.0 + TS * k
        loop.joint(0.3, 0.0, TS * k, now)
        if rehearsal and k:
            states.add(rehearsal.run(loop.sensors, now))
        loop.hose_pressure(8e6, TS * k, now)
        loop.rod_pressure(1e6, TS * k, now)
        loop.stream(0.3 + 0.001 * k, now)
        cycles.append(loop.cycle(now))
    return cycles, states


def test_a_rehearsal_goes_through_the_law_and_changes_nothing(configuration: tuple[Machine, Pose]) -> None:
    alone, _ = followed(configuration, None)
    beside, states = followed(configuration, rehearsal_of(configuration))
    assert states == {MotionState.TRACK.value}
    assert [(c.state, c.retract, c.extend, c.reason) for c in beside] == [
        (c.state, c.retract, c.extend, c.reason) for c in alone
    ]
    assert alone[-1].extend > 0.0


def test_before_any_sample_a_rehearsal_ends_idle(configuration: tuple[Machine, Pose]) -> None:
    loop, rehearsal = ControlLoop("improved", Settings(), SupervisionSettings()), rehearsal_of(configuration)
    assert rehearsal.run(loop.sensors, 5.0) == MotionState.IDLE.value


def test_the_same_samples_can_be_rehearsed_again(configuration: tuple[Machine, Pose]) -> None:
    loop, rehearsal = ControlLoop("improved", Settings(), SupervisionSettings()), rehearsal_of(configuration)
    loop.joint(0.3, 0.0, 0.0, 5.0)
    loop.hose_pressure(8e6, 0.0, 5.0)
    loop.rod_pressure(1e6, 0.0, 5.0)
    assert {rehearsal.run(loop.sensors, 5.0 + 0.0025 * k) for k in range(4)} == {MotionState.TRACK.value}


def test_a_rehearsal_with_sensors_that_say_nothing_ends_idle(configuration: tuple[Machine, Pose]) -> None:
    loop, rehearsal = ControlLoop("improved", Settings(), SupervisionSettings()), rehearsal_of(configuration)
    loop.joint(0.3, 0.0, 0.0, 5.0)
    assert math.isnan(loop.sensors.newest().hose_pressure)
    assert rehearsal.run(loop.sensors, 5.0) == MotionState.IDLE.value


def test_a_mode_that_changes_is_rehearsed_too(configuration: tuple[Machine, Pose]) -> None:
    rehearsal = rehearsal_of(configuration)
    rehearsal.change(mode="baseline", settings=Settings(), supervision=SupervisionSettings())
    _, states = followed(configuration, rehearsal)
    assert states == {MotionState.TRACK.value}


def test_between_two_rehearsals_another_pose_can_be_told(configuration: tuple[Machine, Pose]) -> None:
    machine, _ = configuration
    rehearsal = rehearsal_of(configuration)
    followed(configuration, rehearsal)
    rehearsal.configure(machine, machine.pose(0.28, 2.8, 0.0))
    assert followed(configuration, rehearsal)[1] == {MotionState.TRACK.value}


def test_a_rehearsal_that_was_stopped_goes_through_the_law_again(configuration: tuple[Machine, Pose]) -> None:
    rehearsal = rehearsal_of(configuration)
    settings = SupervisionSettings()
    rehearsal.change(supervision=replace(settings, largest_pressure=1e6, persistence=0.0))
    assert MotionState.STOPPING.value in followed(configuration, rehearsal)[1]
    rehearsal.change(supervision=settings)
    assert followed(configuration, rehearsal)[1] == {MotionState.TRACK.value}
