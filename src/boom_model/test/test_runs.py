"""Whole runs: balances of oil and energy, order of the integrator, delays, batches, steps, every effect at its ends."""

from __future__ import annotations

import ctypes
import dataclasses
from typing import Any

import casadi as ca
import numpy as np
import pytest

from boom_model.batch import run_sets
from boom_model.catalogue import CATALOGUE, EFFECTS
from boom_model.components import accumulator
from boom_model.equations import namespace
from boom_model.errors import ModelError, SimulationError
from boom_model.machine import Machine
from boom_model.plant import Plant

SENSORS = np.array([3.8e-4, 1.5e-3, 2e4, 2e4])  # angle, rate, pressures: what the machine's sensors resolve


@pytest.fixture(scope="module")
def dense(folded: Plant, joystick: Any) -> dict[str, Any]:
    """A run with everything in it (both directions, both limits of the burst valve), sampled every millisecond."""
    time, currents = joystick(20.0, 2)
    fine = np.arange(20_000 - 10) * 1e-3
    run = folded.run(time, currents, fine, folded.equilibrium(0.45), tolerance=1e-9)
    held = currents[np.minimum((fine / 0.01 + 1e-6).astype(int), len(time) - 1)]
    parameters = namespace(dict(zip(folded.parameter_names, folded.p, strict=True)))
    return {"time": fine, "run": run, "p": parameters} | folded.auxiliary(run.states, held)


def integral(values: Any, over: Any) -> float:
    return float(np.trapezoid(values, over))


def accumulator_flows(d: dict[str, Any]) -> list[Any]:
    a, run = d["p"].accumulators, d["run"]
    hose = ca.DM(run.state("hose_pressure"))
    return [
        np.asarray(
            accumulator.orifice_flow(hose, ca.DM(run.state(f"accumulator_pressure_{i}")), p_g0, d_i, d["p"])
        ).ravel()
        for i, p_g0, d_i in ((1, a.p_g0_1, a.d_1), (2, a.p_g0_2, a.d_2))
    ]


def oil_per_pressure(pressure: Any, i: int, d: dict[str, Any]) -> Any:
    p = d["p"]
    precharge = getattr(p.accumulators, f"p_g0_{i}")
    return 1 / np.asarray(accumulator.pressure_rate(ca.DM(pressure), 1.0, precharge, p.fluid.beta, p)).ravel()


def test_the_run_reaches_all_branches(dense: dict[str, Any]) -> None:
    drop = (dense["run"].state("hose_pressure") - dense["run"].state("head_pressure")) / 1e5
    assert drop.min() < -21.8 and drop.max() > 1.0
    assert dense["run"].output("angle").max() - dense["run"].output("angle").min() > 0.2


def test_oil_is_conserved_in_every_volume(dense: dict[str, Any]) -> None:
    """V exp(p / beta) grows by the integral of exp(p / beta) q, to 2e-5 of what went through: (3.8) as a balance."""
    p, run, time = dense["p"], dense["run"], dense["time"]
    c, beta, s = p.cylinder, p.fluid.beta, dense["piston_position"]
    q_o = sum(accumulator_flows(dense))
    volumes = {
        "head": (run.state("head_pressure"), c.V_0a + s * c.A_a, dense["head_flow"]),
        "rod": (run.state("rod_pressure"), c.V_0b + (c.l_p - s) * c.A_b, dense["rod_flow"]),
        "hose": (run.state("hose_pressure"), np.full(len(time), c.V_h), dense["hose_flow"] - q_o - dense["head_flow"]),
    }
    for name, (pressure, volume, flow) in volumes.items():
        density = np.exp(pressure / beta)
        stored = density[-1] * volume[-1] - density[0] * volume[0]
        through = integral(np.abs(flow), time) + integral(np.abs(dense["hose_flow"]), time)
        assert stored == pytest.approx(integral(density * flow, time), abs=2e-5 * through), name


def test_accumulators_hold_what_flowed_into_them(dense: dict[str, Any]) -> None:
    run, time = dense["run"], dense["time"]
    for i, flow in enumerate(accumulator_flows(dense), 1):
        pressure = run.state(f"accumulator_pressure_{i}")
        taken = integral(oil_per_pressure(pressure, i, dense), pressure)
        assert taken == pytest.approx(integral(flow, time), abs=1e-4 * integral(abs(flow), time))


def test_energy_is_conserved(dense: dict[str, Any]) -> None:
    """Work in = kinetic + potential + stored in oil and gas + friction + throttling, to 1e-4 of the turnover."""
    p, run, time = dense["p"], dense["run"], dense["time"]
    rate, angle = run.state("rate"), run.state("angle")
    p_a, p_b, p_h = (run.state(f"{name}_pressure") for name in ("head", "rod", "hose"))
    c, s, beta = p.cylinder, dense["piston_position"], p.fluid.beta
    power = p_h * dense["hose_flow"] + p_b * dense["rod_flow"]
    work = integral(power, time)
    kinetic = 0.5 * p.pose.D0 * (rate[-1] ** 2 - rate[0] ** 2)
    height = p.pose.Sx * np.sin(angle) + p.pose.Sy * np.cos(angle)
    potential = p.constants.g * (height[-1] - height[0])
    friction = integral(dense["friction_torque"] * rate, time)
    valve = integral((p_h - p_a) * dense["head_flow"], time)
    oil = sum(
        integral(pressure * volume / beta, pressure)
        for pressure, volume in (
            (p_a, c.V_0a + s * c.A_a),
            (p_b, c.V_0b + (c.l_p - s) * c.A_b),
            (p_h, np.full(len(time), c.V_h)),
        )
    )
    orifices = gas = 0.0
    for i, flow in enumerate(accumulator_flows(dense), 1):
        p_o = run.state(f"accumulator_pressure_{i}")
        orifices += integral((p_h - p_o) * flow, time)
        gas += integral(p_o * oil_per_pressure(p_o, i, dense), p_o)
    assert friction > 0 and valve > 0 and orifices > 0
    used = kinetic + potential + friction + valve + oil + orifices + gas
    assert work == pytest.approx(used, abs=1e-4 * integral(np.abs(power), time))


# ---------------------------------------------------------------------------------------------------------- rest states


@pytest.mark.parametrize("kind", ["full", "reduced"])
@pytest.mark.parametrize("angle", [-0.5, 0.0, 0.9])
def test_equilibrium_is_one(tz17: Machine, kind: Any, angle: float) -> None:
    plant = Plant(tz17, tz17.pose(0.28, 2.8, 300.0), kind)
    x = plant.equilibrium(angle)
    np.testing.assert_allclose(plant.derivative(x, (0.0, 0.0))[0] / plant.scale, 0.0, atol=1e-9)
    run = plant.run([0.0], [[0.0, 0.0]], np.arange(0.0, 10.0, 0.1), x)
    np.testing.assert_allclose(run.states / plant.scale, np.tile(x / plant.scale, (100, 1)), atol=1e-9)


def test_rest_state_has_filled_accumulators_only_above_precharge(folded: Plant) -> None:
    low, high = folded.rest_state(0.3, 6.0e6, 1e6), folded.rest_state(0.3, 9.0e6, 1e6)
    names = folded.state_names
    assert [low[names.index(f"accumulator_pressure_{i}")] for i in (1, 2)] == [7.5e6, 6.0e6]
    assert [high[names.index(f"accumulator_pressure_{i}")] for i in (1, 2)] == [9.0e6, 9.0e6]


def test_boom_held_by_friction_stays_while_pressures_settle(folded: Plant) -> None:
    x = folded.equilibrium(0.4)
    x[folded.state_names.index("head_pressure")] *= 1.02
    x[folded.state_names.index("hose_pressure")] *= 1.02
    run = folded.run([0.0], [[0.0, 0.0]], np.linspace(0.0, 5.0, 51), x)
    assert np.ptp(run.output("angle")) < 2e-3


def test_boom_moves_the_way_that_the_current_says(folded: Plant) -> None:
    time = np.arange(0.0, 2.0, 0.01)
    lift = folded.run([0.0], [[0.0, 0.45]], time, folded.equilibrium(0.4)).output("angle")
    lower = folded.run([0.0], [[0.45, 0.0]], time, folded.equilibrium(0.4)).output("angle")
    assert lift[-1] > 0.45 and lower[-1] < 0.35


def test_spool_creeps_to_its_stationary_place_without_overshoot(folded: Plant) -> None:
    time = np.arange(0.0, 3.0, 0.005)
    spool = folded.run([0.0], [[0.40, 0.0]], time, folded.equilibrium(0.6), tolerance=1e-7).state("spool_position")
    nu = 0.40 * (20.23 / 19.67 - 0.0285)
    settled = 3.14159e-4 * 1e5 * (76.1 * nu**2 - 0.58 * nu) / 8.0104e4
    assert spool[-1] == pytest.approx(settled, rel=1e-4)
    assert spool.max() <= settled * (1 + 1e-6)
    assert (np.diff(spool[4:]) > -1e-9).all()  # behind the feedthrough's short dip
    assert spool[20] < 0.6 * settled  # 0.1 s: f_c / sigma_s = 7500 N s/m holds it back


# ------------------------------------------------------------------------------------------------------- the integrator


@pytest.mark.parametrize("order", [3, 4])
def test_halving_the_step_divides_the_error_by_two_to_the_order(folded: Plant, order: int) -> None:
    time = np.arange(0.0, 0.4, 0.01)
    start = folded.run(time, np.tile((0.0, 0.42), (40, 1)), time, folded.equilibrium(0.3), tolerance=1e-10).final_state
    span = 0.032
    exact = folded.run([0.0], [[0.0, 0.42]], [0.0, span], start, tolerance=1e-13, order=4).final_state
    errors = []
    for count in (4, 8, 16):
        stepper = folded.stepper(start, tolerance=1e30)
        stepper._order.value = order
        for _ in range(count):
            stepper._h[0] = span / count  # one step each: the error control is out of force
            stepper.step(0.0, 0.42, span / count)
        errors.append(np.sqrt(np.mean(((stepper.state - exact) / folded.scale) ** 2)))
    observed = np.log2(np.array(errors[:-1]) / errors[1:])
    assert observed == pytest.approx(order, abs=0.25), errors


@pytest.mark.parametrize("order", [3, 4])
def test_error_follows_the_tolerance(folded: Plant, joystick: Any, order: int) -> None:
    time, currents = joystick(20.0, 2)
    start = folded.equilibrium(0.45)
    exact = folded.run(time, currents, time, start, tolerance=1e-11, order=4).states
    ranges = np.ptp(exact, axis=0)
    errors = [
        (np.abs(folded.run(time, currents, time, start, tolerance=t, order=order).states - exact) / ranges).max()
        for t in (1e-4, 1e-6, 1e-8)
    ]
    assert errors[0] < 2e-3 and errors[1] < 2e-5 and errors[2] < 1e-6, errors


def test_outputs_between_steps_lie_on_the_solution(folded: Plant, joystick: Any) -> None:
    time, currents = joystick(12.0, 2)
    between = np.arange(11_000) * 1e-3 + 3.7e-4
    start = folded.equilibrium(0.4)
    coarse = folded.run(time, currents, between, start, start=0.0, tolerance=1e-6)
    fine = folded.run(time, currents, between, start, start=0.0, tolerance=1e-11)
    deviation = (np.abs(coarse.states - fine.states) / np.ptp(fine.states, axis=0)).max(axis=0)
    # the spool's velocity settles within 0.1 ms of an input step, far below what a cubic over a step can follow
    deviation[fine.state_names.index("spool_velocity")] = 0.0
    assert deviation.max() < 1e-4


def test_a_run_repeats_bit_by_bit(folded: Plant, joystick: Any) -> None:
    time, currents = joystick(10.0)
    a, b = (folded.run(time, currents, time, folded.equilibrium(0.4)) for _ in range(2))
    np.testing.assert_array_equal(a.states, b.states)


def test_neutral_effects_change_no_bit(tz17: Machine, possible: Any, folded: Plant, joystick: Any) -> None:
    neutral = {e.id: {row.name: row.neutral for row in e.parameters} for e in possible}
    machine = tz17.with_effects(neutral)
    assert machine.effects == {}
    time, currents = joystick(10.0)
    plant = Plant(machine, tz17.pose(4.59, 0.0))
    np.testing.assert_array_equal(
        plant.run(time, currents, time, plant.equilibrium(0.4)).states,
        folded.run(time, currents, time, folded.equilibrium(0.4)).states,
    )


def test_batch_is_the_single_runs(folded: Plant, joystick: Any) -> None:
    time, currents = joystick(10.0)
    start = folded.equilibrium(0.4)
    sets = np.tile(folded.p, (4, 1))
    sets[:, folded.parameter_names.index("fluid.beta")] *= (1.0, 0.8, 0.5, 0.2)
    together = run_sets(folded, sets, time, currents, time, start, tolerance=1e-5)
    for values, outputs in zip(sets, together, strict=True):
        np.testing.assert_array_equal(outputs, folded.run(time, currents, time, start, parameters=values).outputs)


def test_batch_shows_a_failed_run_as_nan_from_where_it_failed(folded: Plant) -> None:
    time = np.arange(0.0, 10.0, 0.01)
    sets = np.vstack((folded.p, folded.p))
    sets[0, folded.parameter_names.index("main_valve_orifices.A_sa_max")] *= 0.1  # too slow to reach the end of stroke
    outputs = run_sets(folded, sets, [0.0], [[0.0, 0.5]], time, folded.equilibrium(0.4))
    assert np.isfinite(outputs[0]).all()
    failed = np.isnan(outputs[1]).all(axis=1)
    assert failed[-1] and not failed[0]
    assert (np.diff(failed.astype(int)) >= 0).all()


def test_steps_are_the_run(folded: Plant, joystick: Any) -> None:
    time, currents = joystick(10.0)
    start = folded.equilibrium(0.4)
    run = folded.run(time, currents, time, start, tolerance=1e-8)
    stepper = folded.stepper(start, tolerance=1e-8)
    outputs = [folded.outputs(start)] + [stepper.step(*u).copy() for u in currents[:-1]]
    assert (np.abs(np.array(outputs) - run.outputs) / np.ptp(run.outputs, axis=0)).max() < 1e-6
    assert stepper.time == pytest.approx(time[-1])


def test_steps_repeat_bit_by_bit(folded: Plant, joystick: Any) -> None:
    _, currents = joystick(5.0)
    ends = []
    for _ in range(2):
        stepper = folded.stepper(folded.equilibrium(0.4))
        for u in currents:
            stepper.step(*u)
        ends.append(stepper.state.copy())
    np.testing.assert_array_equal(*ends)


def test_a_log_grasped_while_stepping_raises_the_head_pressure(tz17: Machine) -> None:
    plant = Plant(tz17, tz17.pose(0.28, 2.8))
    stepper = plant.stepper(plant.equilibrium(0.4))
    before = stepper.step(0.0, 0.0)[2]
    values = plant.p.copy()
    values[plant.parameter_names.index("pose.load")] = 1500.0
    stepper.change_parameters(values)
    for _ in range(300):
        after = stepper.step(0.0, 0.0)[2]
    assert after > before + 1e6


# ----------------------------------------------------------------------------------------------------- delays, refusals


def test_command_delay_is_the_run_with_later_inputs(tz17: Machine, folded: Plant, joystick: Any) -> None:
    time, currents = joystick(10.0)
    late = Plant(tz17.with_effects({"command_delay": {"T": 0.05}}), tz17.pose(4.59, 0.0))
    start = folded.equilibrium(0.4)
    expected = folded.run(time + 0.05, currents, time, start)
    np.testing.assert_array_equal(late.run(time, currents, time, start).states, expected.states)


def test_pressure_delay_shifts_the_pressures_and_nothing_else(tz17: Machine, folded: Plant, joystick: Any) -> None:
    time, currents = joystick(10.0)
    late = Plant(tz17.with_effects({"pressure_delay": {"T": 0.05}}), tz17.pose(4.59, 0.0))
    start = folded.equilibrium(0.4)
    expected = folded.run(time, currents, time, start, tolerance=1e-8).outputs
    outputs = late.run(time, currents, time, start, tolerance=1e-8).outputs
    np.testing.assert_allclose(outputs[:, :2], expected[:, :2], atol=1e-7)
    np.testing.assert_allclose(outputs[5:, 2:], expected[:-5, 2:], atol=100.0)


def test_a_run_that_leaves_the_range_names_time_and_state(folded: Plant) -> None:
    with pytest.raises(
        SimulationError, match=r"at \d+\.\d+ s angle \(q_2\) left its range of -1\.0541 \.\. 1\.563 rad"
    ) as caught:
        folded.run([0.0], [[0.0, 0.55]], np.arange(0.0, 20.0, 0.01), folded.equilibrium(0.4))
    assert caught.value.state == "angle"
    assert 2.0 < caught.value.time < 20.0


def test_a_run_can_be_stopped_from_outside(folded: Plant) -> None:
    time = np.arange(0.0, 1.0, 0.01)
    with pytest.raises(SimulationError, match="stopped at"):
        folded.run(time, np.zeros((100, 2)), time, folded.equilibrium(0.4), stop=ctypes.c_int(1))


@pytest.mark.parametrize(
    ("change", "named"),
    [
        ({"currents": np.zeros((5, 3))}, "currents"),
        ({"currents": np.full((10, 2), np.nan)}, "currents"),
        ({"initial_state": np.zeros(3)}, "initial state"),
        ({"input_time": np.arange(10)[::-1] * 0.01}, "ascend"),
        ({"output_time": np.array([0.0, np.nan])}, "output times"),
        ({"start": 0.5}, "before the start"),
        ({"parameters": np.zeros(3)}, "parameters"),
    ],
)
def test_arguments_that_do_not_fit_are_refused(folded: Plant, change: dict[str, Any], named: str) -> None:
    arguments: dict[str, Any] = {
        "input_time": np.arange(10) * 0.01, "currents": np.zeros((10, 2)), "output_time": np.arange(10) * 0.01,
        "initial_state": folded.equilibrium(0.4),
    } | change  # fmt: skip
    with pytest.raises(ModelError, match=named):
        folded.run(**arguments)


# -------------------------------------------------------------------------------------------------------------- effects


@pytest.fixture(scope="module")
def exercise(tz17: Machine) -> tuple[Plant, Any, Any, Any]:
    """An extended boom that rests, creeps, and moves at full current both ways: every effect finds its regime."""
    plant = Plant(tz17, tz17.pose(0.28, 2.2))
    time = np.arange(3000) * 0.01
    command = np.interp(
        time,
        [0, 8, 8.3, 11, 11.3, 12, 13, 14, 15.2, 16, 17, 18, 19.2, 20, 20.3, 22, 22.5, 24, 24.3, 26, 26.5, 30],
        [0, 0, -0.315, -0.315, 0, 0, -0.55, -0.55, 0, 0, 0.55, 0.55, 0, 0, 0.4, 0.4, 0, 0, -0.4, -0.4, 0, 0],
    )
    currents = np.column_stack((np.maximum(command, 0.0), np.maximum(-command, 0.0)))
    nominal = plant.run(time, currents, time, plant.equilibrium(0.2)).outputs
    return plant, time, currents, nominal


def test_cushion_raises_the_rod_pressure_near_the_end_of_stroke(tz17: Machine) -> None:
    """The only effect that the exercise does not reach: it stays clear of the ends."""
    time = np.arange(0.0, 0.5, 0.01)
    currents = np.tile([0.0, 0.5], (50, 1))

    def at_the_end(kappa: float) -> float:
        plant = Plant(tz17.with_effects({"end_cushioning": {"kappa_b": kappa, "length": 0.1}}), tz17.pose(0.28, 2.2))
        return float(plant.run(time, currents, time, plant.equilibrium(1.42)).output("rod_pressure")[-1])

    assert at_the_end(2.0) > at_the_end(0.0) + 1e5
    assert at_the_end(20.0) > at_the_end(2.0) + 1e6


@pytest.mark.parametrize(("contact", "solenoid", "side"), [("ground_contact", 0, -1.0), ("mechanical_stop", 1, 1.0)])
def test_a_boom_that_is_driven_against_something_is_carried_by_it_or_held(
    tz17: Machine, contact: str, solenoid: int, side: float
) -> None:
    """At rest against it, J f_p = g(q_2) - c max(0, q_0 - q_2), or g(q_2) + c max(0, q_2 - q_0)."""
    c, q_0 = 3e5, 0.4 + 0.05 * side
    plant = Plant(tz17.with_effects({contact: {"c": c, "q_0": q_0}}), tz17.pose(0.28, 2.2))
    time = np.arange(800) * 0.01
    currents = np.zeros((800, 2))
    currents[100:500, solenoid] = 0.35
    run = plant.run(time, currents, time, plant.equilibrium(0.4))
    touched = side * (run.output("angle")[-1] - q_0)
    assert touched > 5e-3
    assert abs(run.output("rate")[-1]) < 1e-4
    inner = plant.auxiliary(run.states[-1:], np.zeros((1, 2)))
    free = Plant(tz17, plant.pose).auxiliary(run.states[-1:], np.zeros((1, 2)))
    carried = inner["gravity_torque"][0] - free["gravity_torque"][0]
    assert carried == pytest.approx(side * c * touched, rel=0.1)
    torque = inner["force"][0] * inner["jacobian"][0]
    assert torque == pytest.approx(inner["gravity_torque"][0], abs=3e3)  # but for friction


def test_a_boom_on_a_base_that_gives_is_seen_lower_where_the_cylinder_pushes_more(tz17: Machine) -> None:
    """x = -C (g(q_2) - g(0)) at rest."""
    C, pose = 5e-8, tz17.pose(0.28, 2.2)
    firm, soft = Plant(tz17, pose), Plant(tz17.with_effects({"giving_base": {"C": C}}), pose)
    state = soft.equilibrium(0.8)
    tilt = state[soft.state_names.index("tilt")]
    assert soft.outputs(state)[0] - state[0] == pytest.approx(tilt)
    g = tz17.parameters["constants.g"].value[0]
    weight = g * (pose.Sx * np.cos(state[0]) - pose.Sy * np.sin(state[0]))
    assert tilt == pytest.approx(-C * (weight - g * pose.Sx), rel=1e-6)
    assert abs(tilt) > 1e-4
    assert "tilt" not in firm.state_names


NOT_REACHED = ("end_cushioning", "cavitation", "supply_variation", "load_holding_valve", "load_holding_valve_lag",
               "load_holding_valve_setting", "vented_neutral", "spool_lag", "ground_contact", "mechanical_stop",
               "load_check_valve", "port_relief_valve")  # fmt: skip
"""The exercise of tz17 stays clear of the ends and of cavitation and touches nothing, and tz17 has a compensator, a burst valve
and a pilot stage; they have tests of their own."""


@pytest.mark.parametrize("effect", [e for e in CATALOGUE if e.id not in NOT_REACHED], ids=lambda e: e.id)
def test_effect_shows_at_both_ends_of_its_range(tz17: Machine, exercise: Any, effect: Any) -> None:
    nominal_plant, time, currents, nominal = exercise
    start = nominal_plant.outputs(nominal_plant.equilibrium(0.2))
    for end in ("low", "high"):
        shape = {"w_s", "q_c", "width", "t_g", "s_g", "T", "f", "zeta", "length", "eta", "q_0"} - {
            row.name for row in effect.parameters[:1]
        }  # say where a term acts, not how strongly: kept
        values = {
            row.name: row.neutral if row.name in shape or row.fixed else getattr(row, end) for row in effect.parameters
        }
        plant = Plant(tz17.with_effects({effect.id: values}), nominal_plant.pose)
        outputs = plant.run(time, currents, time, plant.rest_state(start[0], start[2], start[3])).outputs
        assert np.isfinite(outputs).all()
        assert (np.abs(outputs - nominal).max(axis=0) / SENSORS).max() > 3.0, (
            end,
            np.abs(outputs - nominal).max(axis=0),
        )


# ----------------------------------------------------------------------------------------------------------- other make


@pytest.mark.parametrize("kind", ["full", "reduced"])
@pytest.mark.parametrize("pose", [(4.5, 0.0, 0.0), (0.3, 2.0, 200.0)])
def test_machine_of_another_make_lifts_holds_and_lowers(
    other_make: Machine, kind: Any, pose: tuple[float, ...]
) -> None:
    plant = Plant(other_make, other_make.pose(*pose), kind)
    time = np.arange(0.0, 14.0, 0.01)
    currents = np.zeros((len(time), 2))
    currents[(time > 1) & (time < 4), 1] = 0.3
    currents[(time > 8) & (time < 10), 0] = 0.3
    run = plant.run(time, currents, time, plant.equilibrium(0.0))
    angle = run.output("angle")
    assert angle[450] > 0.1
    assert abs(angle[790] - angle[600]) < 5e-3
    assert angle[-1] < angle[790] - 0.05
    assert run.outputs[:, 2:].min() > -5e4 and run.outputs[:, 2:].max() < 4e7


def test_other_make_has_only_its_own_states(other_make: Machine) -> None:
    plant = Plant(other_make, other_make.pose(4.5, 0.0))
    assert plant.state_names == ("angle", "rate", "head_pressure", "rod_pressure", "spool_position")


def test_a_plant_with_the_numbers_of_another_machine_has_its_limits_and_delays_and_leaves_the_first_one_as_it_is(
    tz17: Machine,
) -> None:
    late = {"command_delay": {"T": 0.02}}
    first = Plant(tz17.with_effects(late), tz17.pose(4.59, 0.0))
    minimum, maximum = first.minimum.copy(), first.maximum.copy()
    narrow = dataclasses.replace(tz17.with_effects({"command_delay": {"T": 0.05}}), angle_limits=(-0.5, 0.5))
    other = first.with_numbers(narrow, tz17.pose(4.59, 0.0))
    assert (other.command_delay, other.minimum[0], other.maximum[0]) == (0.05, -0.5, 0.5)
    assert other.minimum[other.state_names.index("rod_pressure")] == -101_325.0
    assert first.command_delay == 0.02
    np.testing.assert_array_equal([first.minimum, first.maximum], [minimum, maximum])


@pytest.mark.parametrize("kind", ["full", "reduced"])
@pytest.mark.parametrize(
    "effect",
    [
        {},
        {"angle_offset": {"b": 0.05}},
        {"pressure_bias": {"hose": 3e5, "hose_gain": 1.3, "rod_gain": 0.7}},
        {"boom_flexibility": {"gain": 0.6, "f": 1.5, "mu": 0.3, "sag": 1.0}},
        {"transducer_lag": {"hose": 0.1}, "pressure_bias": {"hose": 2e5}},
    ],
    ids=lambda effect: next(iter(effect), "none"),
)
def test_at_rest_the_sensors_show_what_they_were_said_to_show(tz17: Machine, effect: Any, kind: Any) -> None:
    """A free run of a boom that sags by 40 mrad began 40 mrad away, of a transducer with another gain as many percent."""
    plant = Plant(tz17.with_effects(effect), tz17.pose(4.5, 0.0), kind)
    shown = plant.outputs(plant.rest_state_measured(0.3, 9e6, 1e6))
    assert shown == pytest.approx([0.3, 0.0, 9e6, 1e6], rel=1e-6)


def test_the_plainest_numbers_of_a_bending_boom_do_the_same(tz17: Machine) -> None:
    """Gamma^2 mu, Gamma eta and Gamma^2 s tell all of a boom that picks nothing up: of Gamma = 0.7 it is that of Gamma = 1."""
    bends = EFFECTS["boom_flexibility"]
    found = {"gain": 0.7, "f": 2.0, "zeta": 0.02, "mu": 0.9, "eta": 0.5, "sag": 0.8}
    assert bends.plainest is not None
    plain = bends.plainest(found)
    assert plain == pytest.approx({**found, "gain": 1.0, "mu": 0.441, "eta": 0.35, "sag": 0.392})
    shown = []
    for numbers in (found, plain):
        plant = Plant(tz17.with_effects({"boom_flexibility": numbers}), tz17.pose(0.28, 2.2))
        stepper = plant.stepper(plant.rest_state_measured(0.3, 9e6, 1e6))
        shown.append([stepper.step(0.0, 0.5, 0.01).tolist() for _ in range(100)])
    assert np.asarray(shown[0]) == pytest.approx(np.asarray(shown[1]), rel=1e-4, abs=1e-6)
    whole = {**found, "mu": 0.0}
    assert bends.plainest(whole) == whole  # nothing that shows


@pytest.mark.parametrize("kind", ["full", "reduced"])
def test_a_spool_off_centre_acts_in_both_models_and_wanders_in_the_full_one(tz17: Machine, kind: Any) -> None:
    time = np.arange(0.0, 12.0, 0.01)
    currents = np.tile((0.0, 0.32), (len(time), 1))

    def rate(**numbers: float) -> Any:
        plant = Plant(tz17.with_effects({"neutral_offset": numbers}), tz17.pose(0.28, 2.2), kind)
        return plant.run(time, currents, time, plant.equilibrium(0.0)).output("rate")

    still, off, wandering = rate(), rate(x_n=-0.03), rate(x_n=-0.03, d=0.03, T=2.0)
    assert off[300:].mean() > 1.2 * still[300:].mean() > 0.0
    if kind == "full":
        assert wandering[150] == pytest.approx(off[150], rel=0.6) and wandering[-1] == pytest.approx(
            still[-1], rel=0.05
        )
    else:
        np.testing.assert_array_equal(wandering, off)


def test_a_slow_transducer_shows_its_own_pressure_by_a_first_order_and_begins_at_rest(
    tz17: Machine, exercise: Any
) -> None:
    nominal, time, currents, _ = exercise
    lag = 0.08
    slow = Plant(tz17.with_effects({"transducer_lag": {"hose": lag}, "pressure_bias": {"hose": 2e5}}), nominal.pose)
    start = slow.rest_state_measured(0.2, 100e5, 20e5)
    assert slow.outputs(start)[2:] == pytest.approx([100e5, 20e5])
    run = slow.run(time, currents, time, start)
    shown, s = run.output("hose_pressure") - 2e5, run.state("hose_pressure")
    np.testing.assert_allclose(run.output("rod_pressure"), run.state("rod_pressure"), rtol=1e-12)
    expected, step = [s[0]], time[1] - time[0]
    for k in range(1, len(time)):  # the pressure on a line between two samples
        slope, decay = (s[k] - s[k - 1]) / step, np.exp(-step / lag)
        expected.append(s[k] - slope * lag + (expected[-1] - s[k - 1] + slope * lag) * decay)
    np.testing.assert_allclose(shown[20:], np.array(expected)[20:], atol=0.02 * np.ptp(s))
    assert np.abs(shown - s).max() > 0.2 * np.ptp(s)
