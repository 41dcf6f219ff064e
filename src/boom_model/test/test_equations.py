"""The compiled models: equal to CasADi's own evaluation, with the right Jacobian, for every structure and effect."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import casadi as ca
import numpy as np
import pytest

from boom_model.catalogue import CATALOGUE, EFFECTS
from boom_model.codegen import source
from boom_model.components.payload import Step
from boom_model.equations import full_model, parameter_names, reduced_model
from boom_model.errors import ModelError
from boom_model.machine import Machine
from boom_model.machine_file import shipped_machine
from boom_model.plant import Plant
from boom_model.structure import structure

VARIANTS: dict[str, dict[str, Any]] = {
    "thesis": {},
    "triangle": {"linkage": "triangle"},
    "no_accumulators": {"accumulators": "none"},
    "no_hose_burst_valve": {"hose_burst_valve": "none"},
    "direct_spool": {"spool": "direct", "pilot_valves": "none"},
    "no_compensator": {"supply": False},
    "no_anti_cavitation": {"port_valves": False},
    "other_make": {
        "linkage": "triangle", "accumulators": "none", "hose_burst_valve": "none", "spool": "direct", "pilot_valves": "none",
        "supply": False,
    },
    "loader_crane": {
        "linkage": "triangle", "friction": "cylinder", "accumulators": "none", "hose_burst_valve": "pilot_opened",
        "spool": "second_order", "pilot_valves": "none", "supply": False, "metering": "four_edges",
    },
    "holding_valve_and_accumulators": {"hose_burst_valve": "pilot_opened"},
    "four_edges": {"metering": "four_edges"},
    "measured_supply": {"driven": ("supply_pressure", "tank_pressure")},
    "load_in_steps": {"steps": ("time", "stroke")},
}  # fmt: skip


def middle(effect: Any) -> dict[str, float]:
    return {row.name: 0.5 * (row.low + row.high) + 0.1 * (row.high - row.low) for row in effect.parameters}


def variant(tz17: Machine, others: Sequence[Machine], changes: dict[str, Any], effects: str) -> Machine:
    """A machine of any structure: the numbers that tz17 lacks come from the others.

    effects: none, all, or all of which every second one does nothing (``even``, ``odd``).
    """
    beside = {name: changes[name] for name in ("driven", "steps") if name in changes}
    changed = replace(structure(**{name: c for name, c in changes.items() if name not in beside}), **beside)
    other_make, loader = others
    steps = {"": (Step(120.0, "time", 5.0), Step(80.0, "stroke", 0.3))}
    stepped = replace(tz17, payloads=steps).carrying().parameters
    pool = dict(loader.parameters) | dict(other_make.parameters) | dict(stepped)
    keys = [s.key for s in changed.specifications() if not s.key.startswith("pose.")]
    if {"linkage", "spool"} & set(changes):
        own = loader if changes.get("spool") == "second_order" else other_make
        pool |= {
            k: v for k, v in own.parameters.items() if k.startswith(("kinematics", "main_valve_spool", "cylinder.l"))
        }
    machine = replace(tz17, structure=changed, parameters={k: pool[k] for k in keys})
    possible = [e for e in CATALOGUE if changed.has(e.needs)] if effects != "none" else []
    idle = {"even": possible[::2], "odd": possible[1::2]}.get(effects, [])
    return machine.with_effects(
        {e.id: {row.name: row.neutral for row in e.parameters} if e in idle else middle(e) for e in possible}
    )


def random_points(plant: Plant, count: int) -> list[tuple[Any, Any]]:
    rng = np.random.default_rng(3)
    typical = {
        "angle": (0.0, 1.0), "rate": (-0.4, 0.4), "spool_position": (-9e-3, 9e-3), "spool_velocity": (-0.1, 0.1),
        "pilot_retract": (0.0, 0.03), "pilot_extend": (0.0, 0.03), "hose_burst_valve_conductance": (1e-10, 1.4e-9),
        "accumulator_pressure_1": (3e6, 2e7), "accumulator_pressure_2": (3e6, 2e7), "elapsed_time": (0.0, 60.0),
        "swing_angle": (-0.3, 0.3), "swing_rate": (-0.5, 0.5), "bend": (-0.01, 0.01), "bend_rate": (-0.1, 0.1),
        "tilt": (-0.01, 0.01), "tilt_rate": (-0.1, 0.1),
        "bristle_torque": (-4e3, 4e3), "metering_position": (-9e-3, 9e-3), "accumulator_entropy_1": (-0.1, 0.1),
        "accumulator_entropy_2": (-0.1, 0.1), "accumulator_ambient_1": (0.9, 1.3), "accumulator_ambient_2": (0.9, 1.3),
    }  # fmt: skip
    low, high = np.array([typical.get(name, (-5e4, 2e7)) for name in plant.state_names]).T
    most = [2e7 if "pressure" in name else 0.6 for name in plant.machine.structure.inputs]
    return [(rng.uniform(low, high), rng.uniform(0.0, most)) for _ in range(count)]


@pytest.mark.parametrize("effects", ["none", "all", "even", "odd"])
@pytest.mark.parametrize("kind", ["full", "reduced"])
@pytest.mark.parametrize("name", list(VARIANTS))
def test_compiled_model_is_casadis_and_its_jacobian_that_of_differences(
    tz17: Machine, other_make: Machine, loader: Machine, name: str, kind: Any, effects: str
) -> None:
    machine = variant(tz17, (other_make, loader), VARIANTS[name], effects)
    plant = Plant(machine, machine.pose(0.28, 2.2, 100.0), kind)
    m = plant.equations
    function = ca.Function("f", [m.x, m.u, m.p], [m.derivative, m.outputs])
    for x, u in random_points(plant, 6):
        f, jacobian = plant.derivative(x, u)
        expected, outputs = (np.asarray(v).ravel() for v in function(x, u, plant.p))
        np.testing.assert_allclose(f, expected, rtol=1e-10, atol=1e-12 * np.abs(expected).max())
        np.testing.assert_allclose(plant.outputs(x, u), outputs, rtol=1e-13)
        for j in range(len(x)):
            h = 1e-6 * plant.scale[j]
            step = np.zeros(len(x))
            step[j] = h
            difference = (plant.derivative(x + step, u)[0] - plant.derivative(x - step, u)[0]) / (2 * h)
            size = np.abs(jacobian * plant.scale[None]).max(axis=1) / plant.scale[j]
            np.testing.assert_array_less(np.abs(difference - jacobian[:, j]), 2e-5 * size + 1e-6)


def test_full_model_has_the_eleven_states_of_5_40(folded: Plant) -> None:
    assert folded.state_names == (
        "angle", "rate", "head_pressure", "rod_pressure", "hose_pressure", "accumulator_pressure_1",
        "accumulator_pressure_2", "spool_position", "spool_velocity", "pilot_retract", "pilot_extend",
    )  # fmt: skip


def test_reduced_model_has_the_eight_states_of_5_46() -> None:
    assert reduced_model(structure()).state_names == (
        "angle", "rate", "head_pressure", "rod_pressure", "spool_position", "spool_velocity", "pilot_retract",
        "pilot_extend",
    )  # fmt: skip


def test_effects_bring_their_states_only_while_active(tz17: Machine) -> None:
    assert "hose_burst_valve_conductance" not in full_model(tz17.structure).state_names
    assert "hose_burst_valve_conductance" in full_model(tz17.structure, ["hose_burst_valve_lag"]).state_names
    assert "hose_burst_valve_conductance" not in reduced_model(tz17.structure, ["hose_burst_valve_lag"]).state_names


def test_effect_of_a_missing_component_is_refused(other_make: Machine) -> None:
    with pytest.raises(ModelError, match=r"effects\.pilot_lag: this machine has no pilot valves"):
        full_model(other_make.structure, ["pilot_lag"])


@pytest.mark.parametrize("kind", ["full", "reduced"])
def test_terms_at_their_neutral_values_leave_the_equations_as_they_are(tz17: Machine, kind: Any) -> None:
    # all effects compiled in, then put to neutral through the parameter vector
    possible = [e for e in CATALOGUE if not e.stateful(()) and tz17.structure.has(e.needs)]
    active = {e.id: {name: value for name, value in middle(e).items() if name not in e.moving} for e in possible}
    with_terms = Plant(tz17.with_effects(active), tz17.pose(4.59, 0.0), kind)
    nominal = Plant(tz17, tz17.pose(4.59, 0.0), kind)
    neutral = {f"effects.{e.id}.{row.name}": row.neutral for e in CATALOGUE for row in e.parameters}
    p = np.array(
        [neutral.get(name, value) for name, value in zip(with_terms.parameter_names, with_terms.p, strict=True)]
    )
    for x, u in random_points(nominal, 6):
        f, _ = nominal.derivative(x, u)
        np.testing.assert_allclose(with_terms.derivative(x, u, p)[0], f, rtol=1e-9, atol=1e-9 * np.abs(f).max())


def test_order_of_parameters_is_machine_first_then_effects_by_name() -> None:
    names = parameter_names(structure(), ["pilot_lag", "flow_force"])
    assert names[-4:-1] == ("effects.flow_force.c", "effects.pilot_lag.r", "effects.pilot_lag.line")
    assert len(set(names)) == len(names)


def test_reduced_head_side_is_5_45(tz17: Machine, p: Any) -> None:
    # two closed forms of the thesis, written out, against the compiled model, valve shut and no motion but w_p
    plant = Plant(tz17, tz17.pose(4.59, 0.0), "reduced")
    kappa, beta, v_g0 = 1.4, 1.6e9, 0.32e-3
    x = plant.rest_state(0.5, 0.0, 2e6)
    x[1] = -0.1
    s_p = tz17.piston_position(0.5)
    head = 0.5e-3 + 1.5394e-2 * s_p
    w_p = plant.auxiliary(x[None], np.zeros((1, 2)))["piston_velocity"][0]
    for pressure, precharges in ((5.0e6, ()), (6.5e6, (5.5e6,)), (9.0e6, (5.5e6, 7.5e6))):
        x[2] = pressure
        gas = sum((g * v_g0**kappa / pressure) ** (1 / kappa) for g in precharges)
        total = head + len(precharges) * v_g0
        expected = (
            kappa * beta * pressure * (-1.5394e-2 * w_p) / (kappa * pressure * total + (beta - kappa * pressure) * gas)
        )
        assert plant.derivative(x, (0.0, 0.0))[0][2] == pytest.approx(expected, rel=1e-9)


def test_without_anti_cavitation_the_equations_are_those_of_the_thesis(tz17: Machine, folded: Plant) -> None:
    printed = replace(tz17, structure=structure(port_valves=False))
    printed = replace(printed, parameters={k: v for k, v in tz17.parameters.items() if "anti_cavitation" not in k})
    plant = Plant(printed, tz17.pose(4.59, 0.0))
    x = folded.equilibrium(0.5)
    np.testing.assert_array_equal(plant.derivative(x, (0.4, 0.0))[0], folded.derivative(x, (0.4, 0.0))[0])
    x[3] = -5e4  # cavitating rod side
    difference = folded.derivative(x, (0.0, 0.0))[0] - plant.derivative(x, (0.0, 0.0))[0]
    assert difference[3] > 0
    assert np.count_nonzero(difference) == 1


def test_numbers_that_an_effect_changes_are_numbers_of_the_machine(tz17: Machine, other_make: Machine) -> None:
    machines = tz17, other_make, shipped_machine("loader_crane")
    known = [set(machine.values(machine.tabulated[0])) for machine in machines]
    for effect in CATALOGUE:
        assert set(effect.changes) <= set().union(*known), effect.id
        fitting = [own for machine, own in zip(machines, known, strict=True) if machine.structure.has(effect.needs)]
        assert not effect.changes or any(set(effect.changes) & own for own in fitting), effect.id


def test_every_effect_of_the_catalogue_stands_once_and_has_plausible_rows() -> None:
    assert len(EFFECTS) == len(CATALOGUE)
    for effect in CATALOGUE:
        assert effect.parameters and effect.term and effect.regime and effect.equation
        for row in effect.parameters:
            assert row.minimum <= row.low < row.high <= row.maximum, (effect.id, row.name)
            assert row.minimum <= row.neutral <= row.maximum or effect.states or effect.id == "hose_burst_valve_lag"


def test_an_output_that_is_needed_under_a_condition_is_read_behind_it() -> None:
    """A = {sin x exp x, 0}, B = {A^2 exp A, 0}, each where p is not zero: A is an output, and needed in the branch of B."""
    x, u, p = ca.SX.sym("x"), ca.SX.sym("u"), ca.SX.sym("p")
    a = ca.if_else(p != 0, ca.sin(x) * ca.exp(x), 0)
    b = ca.if_else(p != 0, a**2 * ca.exp(a), 0)
    text = source._Emitter().function("f", (x, u, p), [ca.vertcat(a, b)], ["f"])
    outside = text.split("{")[0]
    for line in text.splitlines():
        if line.lstrip().startswith("f["):
            assert f"real {line.split(' = ')[1].rstrip(';')} = R(0.0);" in outside
