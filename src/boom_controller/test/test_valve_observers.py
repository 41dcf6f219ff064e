"""What the improved law learns of the valve: dead time, travel of the spool, what the supply gives; a spool without pilot stage."""

from __future__ import annotations

import copy
from functools import cache
from math import cos, exp, log, sin

import casadi as ca
import pytest

from boom_controller.blocks.direct_follower import DirectFollower, follower_of
from boom_controller.blocks.flat import leaves, nested
from boom_controller.blocks.hysteresis import Play
from boom_controller.blocks.valve_follower import ValveState
from boom_controller.controller import Settings
from boom_controller.loop.law_in_use import LawInUse
from boom_controller.observers.dead_time_observer import DeadTimeState, observe_dead_time
from boom_controller.observers.reach import ReachState, watch_reach
from boom_controller.observers.spool_observer import SpoolSeen, SpoolState, deflection_sigma, observe_spool
from boom_model.component_numbers import component_parameters
from boom_model.machine_file import load_machine, machine_from

S = Settings()
T = S.sample_time


def speed(time: float) -> float:
    """A piston speed that comes and goes [m/s]."""
    return 0.08 * sin(1.3 * time) * (1.0 + 0.6 * sin(11.0 * time))


@cache
def dead_time_observer() -> ca.Function:
    """(x, v, Q, f_p, trusted) -> x one sample time later, for K = 1e7 N/m."""
    shape = DeadTimeState.untold(T)
    x, given = ca.SX.sym("x", len(leaves(shape))), ca.SX.sym("given", 4)
    velocity, acting, force, trusted = ca.vertsplit(given)
    before = nested(shape, iter(ca.vertsplit(x)))
    after = observe_dead_time(before, velocity, acting, TOLD, force, STIFFNESS, -TOLD, trusted, S)
    return ca.Function("observer", [x, given], [ca.vertcat(*leaves(after))])


STIFFNESS, TOLD = 1e7, 0.02
"""N/m; s of dead time that the file tells."""


def delay_found(delay: float, gain: float = 1.0, compliance: float = 1.0, trusted: float = 1.0) -> float:
    """theta^ [s] where oil moves by ``gain`` times what was given ``delay`` [s] before, and part of it is compressed."""
    shape = DeadTimeState.untold(T)
    x = ca.DM(leaves(shape))
    for k in range(600):
        force = 2e4 * sin(23.0 * k * T)
        compressing = compliance * 2e4 * 23.0 * cos(23.0 * k * T) / STIFFNESS
        x = dead_time_observer()(x, [gain * speed(k * T - delay) - compressing, speed(k * T), force, trusted])
    return float(nested(shape, iter(ca.vertsplit(x))).delay) + TOLD


@pytest.mark.parametrize("delay", [0.0, 0.02, 0.06, 0.1])
def test_a_dead_time_other_than_the_one_told_is_found(delay: float) -> None:
    assert delay_found(delay) == pytest.approx(delay, abs=7e-3)  # the prior speaks for what is told


@pytest.mark.parametrize(("gain", "compliance"), [(1.15, 1.0), (1.0, 1.5)])
def test_neither_a_valve_that_gives_too_much_nor_soft_oil_passes_for_dead_time(gain: float, compliance: float) -> None:
    assert delay_found(0.05, gain, compliance) == pytest.approx(0.05, abs=6e-3)


def test_a_dead_time_is_not_learnt_where_the_flow_is_not_known() -> None:
    assert delay_found(0.06, trusted=0.0) == pytest.approx(TOLD, abs=1e-2)


EDGE, PER_TRAVEL = 2e-3, 40.0
"""m; 1/s, speed per travel beyond the dead zone."""


def share_found(
    true: float, side: float, sigma: float, *, compressing: float = 0.0, seconds: float = 9.0
) -> SpoolState:
    """What is learnt of a spool that goes 1 / ``true`` times as far as its file says, on one side."""
    x = SpoolState.uncertain(sigma)
    for k in range(round(seconds / T)):
        travel = EDGE + 1e-3 * (1.2 + sin(0.02 * k))
        here = travel / float(x.of(side))
        modelled, came = (PER_TRAVEL * max(at - EDGE, 0.0) for at in (here, travel / true))
        needed = EDGE + came / PER_TRAVEL
        seen = SpoolSeen(side * here, needed, -side * modelled, -side * came, compressing, 1.0)
        x = observe_spool(x, seen, EDGE, sigma, S)
    return x


@pytest.mark.parametrize("side", [-1.0, 1.0])
@pytest.mark.parametrize("true", [0.7, 1.05, 1.6])
def test_a_spool_that_goes_further_or_less_far_is_learnt_on_its_side_alone(true: float, side: float) -> None:
    x = share_found(true, side, 0.22)
    assert float(x.of(side)) == pytest.approx(true, rel=5e-3)
    assert float(x.of(-side)) == 1.0


def test_a_spool_is_believed_as_far_and_as_soon_as_its_file_is_uncertain() -> None:
    surely, hardly = (float(share_found(1.3, -1.0, sigma, seconds=0.1).of(-1.0)) for sigma in (0.22, 0.04))
    assert hardly - 1.0 < 0.5 * (surely - 1.0)
    assert float(share_found(1.6, -1.0, 0.04).of(-1.0)) == pytest.approx(exp(3 * 0.04), rel=1e-3)


def test_a_flow_that_compresses_oil_of_unknown_softness_says_little_of_the_spool() -> None:
    steady, compressing = (float(share_found(1.3, -1.0, 0.22, compressing=q, seconds=0.1).of(-1.0)) for q in (0.0, 0.1))
    assert compressing - 1.0 < 0.2 * (steady - 1.0)


@pytest.mark.parametrize(("name", "sigma"), [("tz17", 0.226), ("loader_crane", 0.0367)])
def test_how_uncertain_a_deflection_is_follows_from_the_tolerances_of_the_file(name: str, sigma: float) -> None:
    machine = load_machine(name)
    assert deflection_sigma(machine, machine.pose(0.3, 2.0)) == pytest.approx(sigma, rel=0.01)


def test_a_stroke_that_is_known_to_a_factor_makes_a_deflection_as_uncertain_as_that() -> None:
    document = copy.deepcopy(dict(load_machine("loader_crane").document))
    document["main_valve_spool"]["K_i"] |= {"tol": {"factor": 1.5}}
    machine = machine_from(document)
    assert deflection_sigma(machine, machine.pose(0.3, 2.0)) == pytest.approx(log(1.5) / 2, rel=0.05)


def test_a_supply_that_gives_half_is_known_once_the_valve_was_wide_open_and_not_before() -> None:
    x, widest = ReachState(), (0.2, 0.15)
    for _ in range(200):
        x, lift, lower = watch_reach(x, 0.05, (0.1, 0.0), widest, S)
    assert (float(lift), float(lower)) == pytest.approx(widest)
    for _ in range(200):
        x, lift, lower = watch_reach(x, 0.1, (0.2, 0.0), widest, S)
    assert (float(lift), float(lower)) == pytest.approx((0.1, 0.15), rel=0.02)


@pytest.mark.parametrize("name", ["triangle_direct", "loader_crane"])
def test_a_spool_without_pilot_stage_goes_where_it_is_wanted_with_one_solenoid(name: str) -> None:
    machine = load_machine(name)
    p, e = component_parameters(machine, machine.pose(0.3, 2.0))
    follower = DirectFollower(machine, p, e, 0.0, T, Play({}, p.main_valve_spool.s_max))
    x, wanted = ValveState(), -0.4 * p.main_valve_spool.s_max
    for _ in range(60):
        x, *_ = follower.step(x, wanted, lambda _: 0.0, S)
    assert float(x.position) == pytest.approx(wanted, rel=1e-3)
    assert float(x.retract.current) == 0.0
    held = machine.structure.spool.current(-wanted, p, machine.structure.pilot_valves)
    assert float(x.extend.current) == pytest.approx(held, rel=1e-3)
    there = follower.settled(wanted, 0.0, S)
    assert (there.position, there.target, there.retract.current) == (wanted, wanted, 0.0)
    assert there.extend.current == pytest.approx(held)


@pytest.mark.parametrize("share", [-0.6, 0.4])
def test_a_valve_that_begins_where_it_has_been_for_long_stays_there(share: float) -> None:
    machine = load_machine("tz17")
    p, e = component_parameters(machine, machine.pose(0.28, 2.2))
    follower = follower_of(machine, "improved", p, e, 0.0, T, Play({}, p.main_valve_spool.s_max))
    wanted = share * p.main_valve_spool.s_max
    begun = x = follower.settled(wanted, 0.0, S)
    for _ in range(20):
        x, *_ = follower.step(x, wanted, lambda _: 0.0, S)
    assert float(x.position) == pytest.approx(wanted, rel=1e-3)
    assert float(x.extend.current) == pytest.approx(float(begun.extend.current), rel=1e-3, abs=1e-6)


def test_a_machine_without_pilot_stage_has_the_laws_that_can_drive_it_and_refuses_the_others_in_words() -> None:
    from boom_controller.errors import ControlError

    machine = load_machine("triangle_direct")
    law = LawInUse("improved", S)
    law.use(law.prepared(machine, machine.pose(0.3, 2.0)))
    with pytest.raises(ControlError, match="mode baseline commands pilot valves"):
        law.change_mode("baseline", None, 0.0)
    assert law.mode == "improved"
