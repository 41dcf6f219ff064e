"""What the improved law learns as it runs: load, oil, missing flow, a supply that does not deliver; the valve that it follows."""

from __future__ import annotations

from dataclasses import replace
from math import sin

import pytest

from boom_controller.blocks.control_model import ControlModel, OperatingPoint
from boom_controller.blocks.pilot_stage import StaticPilot
from boom_controller.blocks.valve_follower import ValveFollower, ValveState
from boom_controller.controller import Settings
from boom_controller.observers.flow_observer import ChamberState, MissedState, observe_chamber, observe_missed_flow
from boom_controller.observers.load_observer import LoadState, observe_load
from boom_controller.observers.stall_watch import StallState, reason, stalled, watch_supply
from boom_model.machine import Machine
from boom_model.machine_file import load_machine
from boom_model.plant import Plant

S = Settings()
T = S.sample_time


@pytest.fixture(scope="module")
def machine() -> Machine:
    return load_machine("tz17")


@pytest.mark.parametrize("load", [0.0, 260.0, 1500.0])
def test_a_load_that_is_carried_at_rest_is_known_within_a_second(machine: Machine, load: float) -> None:
    pose = machine.pose(0.28, 2.2)
    model, x = ControlModel(machine, pose), LoadState()
    truth = ControlModel(machine, replace(pose, load=load))
    at_rest = OperatingPoint(0.4, 0.0, 0.0, 0.0, 0.4, 0.0, 0.0, 0.0, 0.0)
    q = truth.at(at_rest)
    pressure = q.gravity / q.jacobian / truth.p.cylinder.A_a
    for _ in range(round(1.0 / T)):
        x = observe_load(x, model.at(at_rest._replace(hose_pressure=float(pressure), load=float(x.load))), 0.0, S)
    assert x.load == pytest.approx(load, abs=5.0)


@pytest.mark.parametrize("softer", [1.0, 2.5, 5.0])
def test_the_compliance_of_softer_oil_is_learnt_while_the_pressure_moves(softer: float) -> None:
    x = ChamberState(pressure=1e7)
    pressure = 1e7
    for k in range(1000):
        rate = 4e7 * sin(0.1 * k)  # of the nominal chamber, Pa/s
        pressure += T * rate / softer
        x = observe_chamber(x, pressure, rate, S)
    assert x.ratio == pytest.approx(softer, rel=0.05)


def test_nothing_is_learnt_at_rest_nor_where_the_pressure_is_not_trusted() -> None:
    x = ChamberState(pressure=1e7)
    for _ in range(100):
        x = observe_chamber(x, 1e7, 0.0, S)
    assert x.ratio == 1.0
    assert observe_chamber(x, 2e7, 3e7, S).ratio != 1.0
    assert observe_chamber(x, 2e7, 3e7, S, trusted=0.0).ratio == 1.0


def test_flow_that_the_model_misses_is_learnt_as_a_speed() -> None:
    x = MissedState(force=5e4)
    for _ in range(300):
        x = observe_missed_flow(x, 0.05, 0.04, 5e4, 4e6, S)
    assert x.speed == pytest.approx(0.01, rel=0.01)


def test_a_supply_that_does_not_deliver_is_told_after_the_stall_time_and_one_that_does_is_not() -> None:
    def told(velocity: float, seconds: float) -> bool:
        x = StallState(force=1e5)
        for _ in range(round(seconds / T)):
            x = watch_supply(x, velocity, 0.1, 1e5, 4e6, S)
        return bool(stalled(x, S))

    assert not told(0.0, 0.9 * S.stall_time)
    assert told(0.0, 2 * S.stall_time)
    assert not told(0.08, 3.0)
    assert "2000 kg cannot be held" in reason(2000.0, 2.5e7)
    assert "250 bar" in reason(2000.0, 2.5e7)


def test_the_spool_goes_where_it_is_wanted_and_is_known_without_being_measured(machine: Machine) -> None:
    pose = machine.pose(0.28, 2.2)
    model = ControlModel(machine, pose)
    valve, x = ValveFollower(model.p, model.e, StaticPilot(model.p, model.e), 0.0, T), ValveState()
    plant = Plant(machine, pose)
    stepper = plant.stepper(plant.equilibrium(0.4))
    spool = plant.state_names.index("spool_position")
    stroke = float(model.p.main_valve_spool.s_max)
    for k in range(150):
        wanted = 0.0 if k < 20 else -0.45 * stroke if k < 85 else 0.4 * stroke
        x, _, _ = valve.step(x, wanted, S)
        stepper.step(float(x.retract.current), float(x.extend.current), T)
        if k > 20:
            assert x.position == pytest.approx(stepper.state[spool], abs=0.05 * stroke)  # on its way: 2 ms at most
        if k in (84, 149):
            assert stepper.state[spool] == pytest.approx(wanted, abs=0.01 * stroke)
