"""What the improved law learns as it runs: load, oil, missing flow, a supply that does not deliver; the valve that it follows."""

from __future__ import annotations

from dataclasses import replace
from math import exp, pi, sin
from types import SimpleNamespace

import pytest

from boom_controller.blocks.control_model import ControlModel, OperatingPoint
from boom_controller.blocks.dead_time import Motion, Past, predicted
from boom_controller.blocks.hysteresis import Play
from boom_controller.blocks.pilot_stage import StaticPilot
from boom_controller.blocks.valve_follower import ValveFollower, ValveState
from boom_controller.controller import Settings
from boom_controller.observers.flow_observer import ChamberState, MissedState, observe_chamber, observe_missed_flow
from boom_controller.observers.friction_observer import FrictionState, observe_friction
from boom_controller.observers.load_observer import LoadObserver
from boom_controller.observers.mode_observer import Modes
from boom_controller.observers.oscillation_watch import OscillationState, watch_oscillation
from boom_controller.observers.rest import RestState, watch_rest
from boom_controller.observers.stall_watch import StallState, reason, stalled, watch_supply
from boom_controller.types import Measurement
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
    model = ControlModel(machine, pose)
    observer = LoadObserver(Modes(machine, pose, model.p), model.p)
    settings = SimpleNamespace(**vars(S), **observer.gains(S))
    x = observer.start
    truth = ControlModel(machine, replace(pose, load=load))
    at_rest = OperatingPoint(0.4, 0.0, 0.0, 0.0, 0.4, 0.0, 0.0, 0.0, 0.0)
    q = truth.at(at_rest)
    pressure = q.gravity / q.jacobian / truth.p.cylinder.A_a
    for _ in range(round(1.0 / T)):
        q = model.at(at_rest._replace(hose_pressure=float(pressure), load=float(x.load)))
        x = observer.step(x, q, Measurement(0.0, 0.4, 0.0, float(pressure), 0.0), 0.0, settings)
    assert float(x.load) == pytest.approx(load, abs=5.0)


@pytest.mark.parametrize(("inertia", "left"), [(8000.0, 4000.0), (60_000.0, None)])
def test_no_estimated_load_leaves_a_light_boom_without_inertia(
    machine: Machine, inertia: float, left: float | None
) -> None:
    """A valve that holds the load shows the pressure of a hose that is being filled: the boom seems to weigh next to nothing."""
    pose = replace(machine.pose(0.28, 2.2), D0=inertia)
    model = ControlModel(machine, pose)
    observer = LoadObserver(Modes(machine, pose, model.p), model.p)
    settings = SimpleNamespace(**vars(S), **observer.gains(S))
    q = model.at(OperatingPoint(0.4, 0.0, 0.0, 0.0, 0.4, 0.0, 0.0, 0.0, 0.0))
    x = observer.step(observer.start._replace(load=-1e4), q, Measurement(0.0, 0.4, 0.0, 0.0, 0.0), 0.0, settings)
    reach = pose.tip[0] ** 2 + pose.tip[1] ** 2
    assert float(x.load) == pytest.approx(-500.0 if left is None else (left - inertia) / reach)


def test_what_the_boom_needs_tells_nothing_of_its_load(machine: Machine) -> None:
    """Behind a load-holding valve the force is known in part: the load moves by that part of what the gyro shows."""
    pose = machine.pose(0.28, 2.2)
    model = ControlModel(machine, pose)
    observer = LoadObserver(Modes(machine, pose, model.p), model.p)
    settings = SimpleNamespace(**vars(S), **observer.gains(S))
    q = model.at(OperatingPoint(0.4, -0.1, 8e6, 1e6, 0.4, -0.1, 0.0, 0.0, 0.0))
    shown = Measurement(0.0, 0.4, -0.1, 8e6, 1e6)
    whole, part, none = (
        float(observer.step(observer.start, q, shown, 0.0, settings, known).load) for known in (1.0, 0.25, 0.0)
    )
    assert whole != 0.0 and part == pytest.approx(0.25 * whole) and none == 0.0


def test_a_configured_load_that_is_not_there_is_found_missing(machine: Machine) -> None:
    pose = replace(machine.pose(0.28, 2.2), load=1000.0)
    model = ControlModel(machine, pose)
    observer = LoadObserver(Modes(machine, pose, model.p), model.p)
    settings = SimpleNamespace(**vars(S), **observer.gains(S))
    q = model.at(OperatingPoint(0.4, 0.0, 0.0, 0.0, 0.4, 0.0, 0.0, 0.0, 0.0))
    x = observer.step(observer.start._replace(load=-1e4), q, Measurement(0.0, 0.4, 0.0, 0.0, 0.0), 0.0, settings)
    assert float(x.load) < -1000.0  # friction may look like less than none


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
        x = observe_missed_flow(x, 0.05, 0.04, 5e4, 4e6, 0.0, S)
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
    none = Play({}, float(model.p.main_valve_spool.s_max))
    valve, x = ValveFollower(model.p, model.e, StaticPilot(model.p, model.e), 0.0, T, none), ValveState()
    plant = Plant(machine, pose)
    stepper = plant.stepper(plant.equilibrium(0.4))
    spool = plant.state_names.index("spool_position")
    stroke = float(model.p.main_valve_spool.s_max)
    for k in range(150):
        wanted = 0.0 if k < 20 else -0.45 * stroke if k < 85 else 0.4 * stroke
        x, _, _ = valve.step(x, wanted, lambda position: 0.0, S)
        stepper.step(float(x.retract.current), float(x.extend.current), T)
        if k > 20:
            assert x.position == pytest.approx(stepper.state[spool], abs=0.05 * stroke)  # on its way: 2 ms at most
        if k in (84, 149):
            assert stepper.state[spool] == pytest.approx(wanted, abs=0.01 * stroke)


@pytest.mark.parametrize("frequency", [1.5, 2.5, 7.0])
def test_an_oscillation_that_stands_is_recognised_within_four_half_waves_and_a_damped_or_small_one_never(
    frequency: float,
) -> None:
    def recognised(size: float, decay: float) -> float | None:
        x = OscillationState()
        for k in range(500):
            t = k * T
            x = watch_oscillation(x, size * exp(-decay * t) * sin(2 * pi * frequency * t), 0.0, S)
            if x.calmed:
                return t
        return None

    at = recognised(3 * S.oscillation_speed, 0.0)
    assert at is not None
    assert at < 2.5 / frequency
    assert recognised(3 * S.oscillation_speed, 2.0 * frequency) is None
    assert recognised(0.7 * S.oscillation_speed, 0.0) is None


def test_what_decays_under_the_safe_gains_is_no_reason_to_stop_and_what_grows_is() -> None:
    def stops(growth: float) -> bool:
        x = OscillationState()
        for k in range(800):
            x = watch_oscillation(x, 0.03 * exp(growth * k * T) * sin(2 * pi * 2.5 * k * T), 0.0, S)
        return bool(x.unsettled)

    assert not stops(-0.3)
    assert stops(0.4)


def test_gains_are_raised_once_when_the_dead_time_behind_the_oscillation_is_known() -> None:
    def calm_after(learnt: float, again: bool) -> bool:
        """Two seconds that swing and three that do not, the dead time then; ``again``: the same once more."""
        x, dead_time = OscillationState(), 0.01
        for _ in range(1 + again):
            for k in range(500):
                dead_time += learnt * (k == 200)
                x = watch_oscillation(x, 0.03 * sin(2 * pi * 2.5 * k * T) * (k < 200), dead_time, S)
        return bool(x.calmed)

    assert calm_after(0.0, again=False)
    assert calm_after(0.005, again=False)
    assert not calm_after(0.03, again=False)
    assert calm_after(0.03, again=True)


def test_the_boom_rests_until_the_reference_moves_or_the_feedback_asks() -> None:
    def after(x: RestState, asked: float, moving: float, count: int) -> RestState:
        for _ in range(count):
            x = watch_rest(x, asked, moving, 1e-3, T)
        return x

    resting = after(RestState(), 5e-4, 0.0, 10)
    assert resting.resting
    assert not after(resting, 5e-4, 1e-3, 1).resting
    assert not after(resting, 3e-3, 0.0, 100).resting
    assert not after(resting, 2e-2, 0.0, 1).resting


@pytest.mark.parametrize("dead_time", [0.0, 0.013, 0.1])
def test_the_motion_over_the_dead_time_is_that_of_a_mass_on_an_oil_spring(dead_time: float) -> None:
    stiffness, mass, still, given = 3e7, 1.5e5, 1.6e5, 0.04
    past = Past((0.0,) * 21, (given,) * 21)
    frequency = (stiffness / mass) ** 0.5
    end = predicted(Motion(1.0, 0.1, 1.7e5), past, 0.01, still, stiffness, frequency, dead_time, T)
    position, v, f = 1.0, 0.1, 1.7e5
    steps = round(dead_time / 1e-5)
    for _ in range(steps):
        v += 1e-5 * (f - still) / mass
        position, f = position + 1e-5 * v, f + 1e-5 * stiffness * (given + 0.01 - v)
    assert [float(part) for part in end] == pytest.approx([position, v, f], rel=1e-3)


def test_the_spool_that_lags_by_its_play_has_the_edges_where_they_are_wanted() -> None:
    play, x, spool = Play({"valve_hysteresis": {"h": 0.04, "travel": 0.1}}, 1.0), 0.0, 0.0
    for wanted in (0.5, 0.9, 0.2, -0.6):
        for _ in range(3):
            spool = float(play.spool(x, wanted))
            x = float(play.after(x, spool))
        assert play.edges(x, spool) == pytest.approx(wanted, abs=1e-9)
    assert Play({}, 1.0).spool(0.3, 0.2) == 0.2
    off = Play({}, 1.0, 0.05)
    assert off.edges(0.0, off.spool(0.0, 0.2)) == pytest.approx(0.2)


def test_a_bending_boom_is_seen_from_the_machine_file_and_the_gains_are_stable(machine: Machine) -> None:
    bending = machine.with_effects({"boom_flexibility": {"gain": 0.5, "f": 2.5, "zeta": 0.02}})
    pose = machine.pose(0.28, 2.2)
    p = ControlModel(bending, pose).p
    modes = Modes(bending, pose, p)
    bent = {"bend": 0.01, "bend_rate": 0.2}
    seen = modes.at(tuple(bent[name] for name in modes.names), 0.4, 0.1, 3e4, 0.0, 0.0)
    assert (float(seen.angle), float(seen.rate)) == pytest.approx((0.01, 0.2))
    gain = modes.gain(15.0)
    assert len(gain.states) == 2
    assert gain.missing > 0
    assert Modes(machine, pose, p).gain(15.0) == (30.0, 225.0, ())


@pytest.mark.parametrize("factor", [0.5, 1.0, 1.5])
def test_friction_is_told_from_load_by_the_direction_of_motion(machine: Machine, factor: float) -> None:
    model = ControlModel(machine, machine.pose(0.28, 2.2))
    x, load = FrictionState(), 0.0
    for k in range(6000):
        rate = 0.1 * sin(2 * pi * k * T / 8.0)
        q = model.at(OperatingPoint(0.4, rate, 8e6, 1e6, 0.4, rate, 0.0, 0.0, 0.0, float(x.factor)))
        load = 200.0 + (factor - float(x.factor)) * q.sliding / q.tip_gravity  # as the load observer would find it
        x = FrictionState(*map(float, observe_friction(x, q, load, T)))
    assert x.factor == pytest.approx(factor, rel=0.05)
    assert x.steady == pytest.approx(200.0, abs=20.0)


def test_a_grasped_load_is_not_taken_for_friction(machine: Machine) -> None:
    model = ControlModel(machine, machine.pose(0.28, 2.2))
    q = model.at(OperatingPoint(0.4, 0.1, 8e6, 1e6, 0.4, 0.1, 0.0, 0.0, 0.0))
    x = FrictionState(*map(float, observe_friction(FrictionState(), q, 700.0, T)))
    assert (x.factor, x.steady) == (1.0, 700.0)
