"""The control laws at rest, where they are saturated, and where thesis and baseline differ."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from boom_controller.blocks.control_model import ControlModel, OperatingPoint
from boom_controller.controller import MODES, Settings, make_controller
from boom_controller.errors import ControlError
from boom_controller.laws.cascade import Cascade, Variant
from boom_controller.types import Measurement, Reference
from boom_model.machine import Machine
from boom_model.machine_file import load_machine
from boom_model.plant import Plant

ANGLE = 0.4


@pytest.fixture(scope="module")
def machine() -> Machine:
    return load_machine("tz17")


@pytest.fixture(scope="module")
def rest(machine: Machine) -> Measurement:
    plant = Plant(machine, machine.pose(0.28, 2.2))
    angle, rate, hose, rod = (float(v) for v in plant.outputs(plant.equilibrium(ANGLE)))
    return Measurement(0.0, angle, rate, hose, rod)


@pytest.mark.parametrize("mode", MODES)
def test_a_boom_that_rests_at_its_reference_is_left_at_rest(machine: Machine, rest: Measurement, mode: str) -> None:
    controller = make_controller(mode, machine, machine.pose(0.28, 2.2))
    controller.reset(rest)
    edge = ControlModel(machine, machine.pose(0.28, 2.2)).p
    overlap = edge.main_valve_orifices.x0 * edge.main_valve_spool.s_max
    for _ in range(50):
        out = controller.step(Reference(ANGLE), rest)
    assert abs(out.spool_position) <= overlap * (1 + 1e-6)
    assert out.angle_error == pytest.approx(0.0, abs=1e-9)
    assert out.force == pytest.approx(out.force_set_point, rel=0.02)


@pytest.mark.parametrize("mode", MODES)
def test_a_boom_below_its_reference_is_lifted_and_one_above_lowered(
    machine: Machine, rest: Measurement, mode: str
) -> None:
    for off, lifts in ((0.03, True), (-0.03, False)):
        controller = make_controller(mode, machine, machine.pose(0.28, 2.2))
        controller.reset(rest)
        for _ in range(30):
            out = controller.step(Reference(ANGLE + off), rest)
        assert (out.extend > out.retract) is lifts
        assert (out.spool_position < 0) is lifts


@pytest.mark.parametrize("mode", ["thesis", "baseline"])
def test_integral_states_stand_while_the_spool_is_saturated(machine: Machine, rest: Measurement, mode: str) -> None:
    def recovery(seconds: float) -> int:
        """Cycles until the spool leaves its limit, after so long far below the reference."""
        controller = make_controller(mode, machine, machine.pose(0.28, 2.2))
        controller.reset(rest)
        for _ in range(round(seconds / 0.01)):
            out = controller.step(Reference(ANGLE + 0.4), rest)
        limit = abs(out.spool_position)
        for k in range(500):
            out = controller.step(Reference(ANGLE - 0.02), rest)
            if out.spool_position > -0.99 * limit:
                return k
        return 500

    assert recovery(20.0) <= recovery(2.0) + 5


def test_only_the_baseline_compensates_friction_at_the_wanted_rate(machine: Machine, rest: Measurement) -> None:
    pose = machine.pose(0.28, 2.2)
    moving = rest._replace(rate=0.05)
    model = ControlModel(machine, pose)
    q = model.at(OperatingPoint(rest.angle, 0.05, rest.hose_pressure, rest.rod_pressure, ANGLE, 0.0, 0.0, 0.0, 0.0))
    assert q.friction > 100.0 > abs(q.friction_wanted)
    found = {}
    for name, variant in (("printed", Variant()), ("wanted", Variant(friction_at_reference=True))):
        law = Cascade("thesis", machine, pose, Settings(), variant)
        law.reset(rest)
        found[name] = law.step(Reference(ANGLE), moving).force_set_point
    assert found["printed"] - found["wanted"] == pytest.approx((q.friction - q.friction_wanted) / q.jacobian, rel=1e-6)


def test_a_load_holding_valve_of_an_effect_has_its_own_drop_in_the_law(machine: Machine) -> None:
    """It stands in place of the hose burst valve, whose drop had been taken: 3 t of load that is not there."""
    valve = {"p_set": 1.2e7, "p_check": 2e5, "r_check": 8.4e8}
    holding = machine.with_effects({"load_holding_valve": valve})
    at = OperatingPoint(ANGLE, 0.1, 5e6, 1e6, ANGLE, 0.1, 0.0, 0.0, 0.0)
    lifting, lowering = (ControlModel(holding, machine.pose(0.28, 2.2)).at(at._replace(rate=r)) for r in (0.1, -0.1))
    area = float(holding.parameters["cylinder.A_a"].value[0])
    drop = 2e5 + 8.4e8 * area * lifting.jacobian * 0.1
    assert (lifting.friction - lifting.sliding) / (area * lifting.jacobian) == pytest.approx(drop, rel=1e-3)
    assert lowering.friction == pytest.approx(lowering.sliding)


def test_the_feedforward_force_is_what_the_equation_of_motion_needs(machine: Machine) -> None:
    model = ControlModel(machine, machine.pose(0.28, 2.2))
    q = model.at(OperatingPoint(ANGLE, 0.0, 0.0, 0.0, ANGLE, 0.1, 0.3, 0.0, 0.0))
    needed = q.inertia * 0.3 + q.reference_gravity + q.reference_friction
    assert q.feedforward_force * q.reference_jacobian == pytest.approx(needed, rel=1e-9)
    coming = model.coming(Reference(ANGLE, 0.1, 0.3, 0.0), 0.0)
    assert tuple(float(value) for value in coming) == pytest.approx(
        (q.reference_position, q.reference_jacobian, q.feedforward_force, q.feedforward_force_rate)
    )


def test_another_sample_time_and_a_mode_that_is_not_there_are_refused(machine: Machine) -> None:
    with pytest.raises(ControlError, match="thesis, baseline, improved"):
        make_controller("pid", machine, machine.pose(0.28, 2.2))
    for mode in MODES:
        with pytest.raises(ControlError, match="sample_time"):
            make_controller(mode, machine, machine.pose(0.28, 2.2)).change(replace(Settings(), sample_time=0.02))


def test_simple_keeps_nothing_and_does_not_need_the_gyro(machine: Machine, rest: Measurement) -> None:
    controller = make_controller("simple", machine, machine.pose(0.28, 2.2))
    controller.reset(rest)
    good = controller.step(Reference(ANGLE), rest)
    assert math.isnan(controller.step(Reference(ANGLE), rest._replace(hose_pressure=math.nan)).retract)
    assert controller.step(Reference(ANGLE), rest._replace(rate=math.nan))[:2] == good[:2]


@pytest.mark.parametrize("mode", [mode for mode in MODES if mode != "simple"])
@pytest.mark.parametrize("broken", ["rate", "hose_pressure"])
def test_what_is_no_number_is_not_hidden_by_a_limit(
    machine: Machine, rest: Measurement, mode: str, broken: str
) -> None:
    controller = make_controller(mode, machine, machine.pose(0.28, 2.2))
    controller.reset(rest)
    controller.step(Reference(ANGLE), rest._replace(**{broken: math.nan}))
    out = controller.step(Reference(ANGLE), rest)  # it has gone into the states
    assert math.isnan(out.retract) and math.isnan(out.extend)
