"""Each component against numbers worked out by hand from its equation, one term switched on at a time."""

from __future__ import annotations

from math import exp, pi, sqrt, tanh
from types import SimpleNamespace
from typing import Any

import casadi as ca
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from boom_model.components import (
    accumulator,
    anti_cavitation,
    boom_flexibility,
    cylinder,
    direct_spool,
    equation_of_motion,
    four_bar_linkage,
    friction,
    hose_burst_valve,
    main_valve_spool,
    oil,
    pilot_valve,
    swinging_load,
    triangle_linkage,
)
from boom_model.equations import namespace
from boom_model.regularisation import PRESSURE_EPSILON, positive, signed_sqrt

BAR, LPM = 1e5, 1 / 60_000
HOLE = 0.65 * sqrt(2 / 870)  # C_d sqrt(2 / rho) of tz17


# ------------------------------------------------------------------------------------------------------ regularisation


def test_square_root_is_odd_and_within_a_millionth_above_ten_bar() -> None:
    assert float(signed_sqrt(4e6)) == pytest.approx(2000.0, rel=1e-6)
    assert float(signed_sqrt(-4e6)) == -float(signed_sqrt(4e6))
    assert float(signed_sqrt(0.0)) == 0.0


def test_square_root_has_a_finite_slope_at_zero() -> None:
    assert float(signed_sqrt(1e-3)) / 1e-3 == pytest.approx(1 / sqrt(PRESSURE_EPSILON))


def test_positive_part() -> None:
    assert (float(positive(3.0)), float(positive(-3.0))) == (3.0, 0.0)


# ------------------------------------------------------------------------------------------------------------- linkages


def linkage_and_slope(function: Any, angles: Any, parameters: Any) -> tuple[Any, Any]:
    q = ca.SX.sym("q")
    position = function(q, parameters)
    f = ca.Function("f", [q], [position, ca.jacobian(position, q)])
    values = f.map(len(angles))(np.asarray(angles)[None])
    return np.asarray(values[0]).ravel(), np.asarray(values[1]).ravel()


def test_four_bar_linkage_agrees_with_the_polynomial_of_the_machine_file(tz17: Any, p: Any) -> None:
    coefficients = tz17.document["kinematics"]["s_p_poly6"]["value"]
    angles = np.linspace(-0.9, 1.563, 200)
    position, slope = linkage_and_slope(four_bar_linkage.piston_position, angles, p)
    polynomial = np.polynomial.Polynomial(coefficients)
    assert np.abs(position - polynomial(angles)).max() < 0.05e-3
    assert np.abs(slope - polynomial.deriv()(angles)).max() < 0.0012


def test_four_bar_linkage_spans_the_stroke(tz17: Any) -> None:
    low, high = tz17.angle_limits
    assert tz17.piston_position(low) == pytest.approx(0.0, abs=2e-4)
    assert 0.95 < tz17.piston_position(high) <= 0.976


def test_four_bar_linkage_keeps_the_lengths_of_its_bars(tz17: Any, p: Any) -> None:
    # C from the circles around pivot and attachment, without the formula under test
    k = p.kinematics
    for q in (-0.8, 0.0, 0.7, 1.5):
        a = np.array([np.cos(q) * k.att[0] - np.sin(q) * k.att[1], np.sin(q) * k.att[0] + np.cos(q) * k.att[1]])
        pivot, foot = np.array(k.pivot), np.array(k.foot)
        length = float(four_bar_linkage.piston_position(q, p)) + p.cylinder.l_min
        # the rod's eye lies on both circles and at this distance from the foot
        d = a - pivot
        reach = np.hypot(*d)
        along = (k.L1**2 - k.L2**2 + reach**2) / (2 * reach)
        across = sqrt(k.L1**2 - along**2)
        unit = d / reach
        eyes = [pivot + along * unit + side * across * np.array([-unit[1], unit[0]]) for side in (1, -1)]
        assert min(abs(np.hypot(*(eye - foot)) - length) for eye in eyes) < 1e-9


def test_triangle_at_a_right_angle_is_pythagoras() -> None:
    parameters = SimpleNamespace(
        kinematics=SimpleNamespace(a=4.0, b=3.0, phi0=0.5), cylinder=SimpleNamespace(l_min=2.0)
    )
    position, slope = linkage_and_slope(triangle_linkage.piston_position, [pi / 2 - 0.5], parameters)
    assert position[0] == pytest.approx(3.0)
    assert slope[0] == pytest.approx(4.0 * 3.0 / 5.0)


# ------------------------------------------------------------------------------------------------------------- friction


@pytest.mark.parametrize(
    ("rate", "expected"),
    [
        (0.3, 4000 + 6000),
        (-0.3, -3000 - 9000),
        (0.0, 0.0),
        (0.01, 4000 * tanh(1) + 200),
        (-0.01, -3000 * tanh(1) - 300),
    ],
)
def test_friction_is_asymmetric(p: Any, effects: Any, rate: float, expected: float) -> None:
    assert float(friction.torque(0.0, rate, p, effects())) == pytest.approx(expected, rel=1e-9, abs=1e-12)


def test_friction_is_continuous_at_reversal(p: Any, effects: Any) -> None:
    above, below = (float(friction.torque(0.0, w, p, effects())) for w in (1e-12, -1e-12))
    assert abs(above - below) < 1e-5


def test_stribeck_raises_the_coulomb_torque_at_the_stribeck_velocity_by_one_over_e(p: Any, effects: Any) -> None:
    e = effects(stribeck_friction={"tau_s": 1000.0, "w_s": 0.02})
    assert float(friction.torque(0.0, 0.02, p, e)) == pytest.approx(tanh(2) * (4000 + 1000 / exp(1)) + 400)
    assert float(friction.torque(0.0, 0.3, p, e)) == pytest.approx(10_000)


def test_tight_spot_doubles_coulomb_friction_at_its_centre_only(p: Any, effects: Any) -> None:
    e = effects(position_dependent_friction={"b": 1.0, "q_c": 0.4, "width": 0.1})
    assert float(friction.torque(0.4, 0.3, p, e)) == pytest.approx(8000 + 6000)
    assert float(friction.torque(0.5, 0.3, p, e)) == pytest.approx(4000 * (1 + exp(-1)) + 6000)
    assert float(friction.torque(1.4, 0.3, p, e)) == pytest.approx(10_000)


# --------------------------------------------------------------------------------------------------- cylinder and oil


def test_cylinder_volumes_and_force(p: Any) -> None:
    assert cylinder.head_volume(0.5, p) == pytest.approx(0.5e-3 + 0.5 * 1.5394e-2)
    assert cylinder.rod_volume(0.5, p) == pytest.approx(1.1e-3 + 0.476 * 9.032e-3)
    assert cylinder.force(1e7, 1e6, p) == pytest.approx(153_940 - 9_032)


def test_a_litre_per_second_raises_the_pressure_by_beta_over_volume() -> None:
    assert cylinder.pressure_rate(1.6e9, 8e-3, 1e-3) == pytest.approx(2e8)


def test_piston_leakage_flows_from_the_higher_pressure(p: Any, effects: Any) -> None:
    e = effects(piston_leakage={"c": 1e-12})
    assert cylinder.leakage(1e7, 1e6, e) == pytest.approx(9e-6)
    assert cylinder.leakage(1e6, 1e7, e) == pytest.approx(-9e-6)
    assert cylinder.leakage(1e7, 1e6, effects()) == 0.0


def test_oil_without_air_has_the_bulk_modulus_of_the_file(p: Any, effects: Any) -> None:
    assert [float(oil.bulk_modulus(x, p, effects())) for x in (-9e4, 0.0, 3e7)] == [1.6e9] * 3


def test_air_softens_oil_at_low_pressure_and_is_pressed_away_at_high(p: Any, effects: Any) -> None:
    e = effects(entrained_air={"a": 0.01})
    # at ambient pressure, r = 1
    assert float(oil.bulk_modulus(0.0, p, e)) == pytest.approx(1.6e9 * 1.01 / (1 + 0.01 * 1.6e9 / (1.4 * 101_325)))
    assert float(oil.bulk_modulus(3e7, p, e)) == pytest.approx(1.6e9, rel=0.01)


def test_oil_with_air_is_the_derivative_of_its_volume(p: Any, effects: Any) -> None:
    # mixture: oil 1 - p / beta to first order, gas a (p_0 / p_abs)^(1/n); beta_mix = -V dp / dV
    e, beta, n, p0 = effects(entrained_air={"a": 0.02}), 1.6e9, 1.4, 101_325.0

    def volume(gauge: float) -> float:
        return 1 - gauge / beta + 0.02 * (p0 / (gauge + p0)) ** (1 / n)

    for gauge in (0.0, 5e5, 2e6):
        slope = (volume(gauge + 50) - volume(gauge - 50)) / 100
        assert float(oil.bulk_modulus(gauge, p, e)) == pytest.approx(-volume(gauge) / slope, rel=2e-3)


# ---------------------------------------------------------------------------------------------------------- accumulator


def test_slow_charge_follows_the_adiabatic_when_oil_is_stiff(p: Any) -> None:
    # taken in from p_g0 to 2 p_g0: integral of dp / (p' per flow); p V^kappa = const gives V_g0 (1 - 2^(-1/kappa))
    pressures = np.linspace(7.5e6, 15e6, 20_001)
    per_flow = np.array([float(accumulator.pressure_rate(x, 1.0, 7.5e6, 1e16, p)) for x in pressures[::20]])
    taken = np.trapezoid(1 / per_flow, pressures[::20])
    assert taken == pytest.approx(0.32e-3 * (1 - 2 ** (-1 / 1.4)), rel=1e-6)
    assert taken == pytest.approx(float(accumulator.oil_volume(15e6, 7.5e6, p)), rel=1e-6)


def test_rate_and_compliance_are_the_same_equation(p: Any) -> None:
    for pressure in (7.6e6, 1.2e7, 3e7):
        rate = float(accumulator.pressure_rate(pressure, 1.0, 7.5e6, 1.6e9, p))
        assert 1 / rate == pytest.approx(float(accumulator.compliance(pressure, 7.5e6, 1.6e9, p)), rel=1e-12)


def test_no_oil_leaves_an_accumulator_at_or_below_precharge(p: Any) -> None:
    for pressure in (5.0e6, 7.5e6):
        assert float(accumulator.orifice_flow(1e6, pressure, 7.5e6, 2e-3, p)) == 0.0
    assert float(accumulator.compliance(7.4e6, 7.5e6, 1.6e9, p)) == 0.0
    assert float(accumulator.oil_volume(7.4e6, 7.5e6, p)) == 0.0


def test_orifice_of_an_accumulator(p: Any) -> None:
    expected = HOLE * pi / 4 * 4e-6 * 1e3
    assert float(accumulator.orifice_flow(9e6, 8e6, 7.5e6, 2e-3, p)) == pytest.approx(expected, rel=1e-5)
    assert float(accumulator.orifice_flow(8e6, 9e6, 7.5e6, 2e-3, p)) == pytest.approx(-expected, rel=1e-4)
    assert float(accumulator.orifice_flow(8.5e6, 7.5e6, 7.5e6, 2e-3, p)) == pytest.approx(
        expected, rel=1e-5
    )  # fills when empty


# ------------------------------------------------------------------------------------------------- spool, pilot, direct


def test_spool_acceleration_adds_its_terms(p: Any, effects: Any) -> None:
    s = p.main_valve_spool
    assert float(main_valve_spool.acceleration(0, 0, 1e5, 0, p, effects())) == pytest.approx(1e5 * 3.14159e-4 / 0.31958)
    assert float(main_valve_spool.acceleration(1e-3, 0, 0, 0, p, effects())) == pytest.approx(-s.k * 1e-3 / s.m_s)
    damping = 160 * 0.02 + 75 * tanh(2)
    assert float(main_valve_spool.acceleration(0, 0.02, 0, 0, p, effects())) == pytest.approx(-damping / s.m_s)
    assert float(main_valve_spool.acceleration(0, 0, 0, 10.0, p, effects())) == pytest.approx(-10.0 / s.m_s)
    stiff = effects(spring_rate={"r": 1.3})
    assert float(main_valve_spool.acceleration(1e-3, 0, 0, 0, p, stiff)) == pytest.approx(-1.3 * s.k * 1e-3 / s.m_s)


@pytest.mark.parametrize(("current", "bar"), [(0.30, 6.9), (0.55, 22.95)])
def test_pilot_valve_settles_at_the_thesis_pressures(p: Any, effects: Any, current: float, bar: float) -> None:
    settled = current / 19.67
    assert float(pilot_valve.pressure(settled, current, p, effects())) == pytest.approx(bar * BAR, abs=0.03 * BAR)


def test_pilot_valve_has_its_pole_gain_and_feedthrough(p: Any, effects: Any) -> None:
    e = effects()
    assert float(pilot_valve.state_rate(1e-2, 0.0, p, e)) == pytest.approx(-0.1967)
    assert float(pilot_valve.state_rate(0.0, 0.5, p, e)) == 0.5
    nu = -0.0285 * 0.5
    assert float(pilot_valve.pressure(0.0, 0.5, p, e)) == pytest.approx(BAR * (76.1 * nu**2 - 0.58 * nu + 0.247))


def test_pilot_lag_slows_down_and_keeps_the_stationary_pressure(p: Any, effects: Any) -> None:
    slow = effects(pilot_lag={"r": 2.0})
    assert float(pilot_valve.state_rate(1e-2, 0.0, p, slow)) == pytest.approx(-0.1967 / 2)
    settled = 0.4 / 19.67
    fast = pilot_valve.pressure(settled, 0.4, p, effects())
    assert float(pilot_valve.pressure(2 * settled, 0.4, p, slow)) == pytest.approx(float(fast))


def test_direct_spool_is_a_first_order_lag(other_make: Any) -> None:
    q = namespace(other_make.values(other_make.pose(4.5, 0.0)))
    assert direct_spool.velocity(0.0, 0.6, 0.0, q) == pytest.approx(8e-3 / 0.04, rel=1e-3)
    assert direct_spool.velocity(0.0, 0.0, 0.6, q) == pytest.approx(-8e-3 / 0.04, rel=1e-3)
    assert direct_spool.velocity(1.333e-2 * 0.3, 0.3, 0.0, q) == pytest.approx(0.0, abs=1e-12)


# ----------------------------------------------------------------------------------------------------- hose burst valve


@pytest.mark.parametrize(
    ("bar", "lpm"),
    [(1.0, 3.67 + 29.2 / sqrt(1.02)), (10.0, 36.7 + 292 / sqrt(10.02)), (0.0, 0.0),
     (-10.0, -82.4 + 0.1704857 * 100), (-30.0, -80.3 - 0.84 * 30)],
)  # fmt: skip
def test_hose_burst_valve_branches(p: Any, effects: Any, bar: float, lpm: float) -> None:
    assert float(hose_burst_valve.flow(bar * BAR, p, effects())) == pytest.approx(lpm * LPM, rel=1e-5, abs=1e-12)


def test_hose_burst_valve_branches_meet_smoothly_near_the_printed_node(p: Any, effects: Any) -> None:
    a22, node = hose_burst_valve.smooth_node(8.24, -80.3, 0.84)
    assert (a22, node) == (pytest.approx(0.1704857, abs=1e-7), pytest.approx(-21.7027, abs=1e-4))
    h = 1e-4
    below, at, above = (float(hose_burst_valve.flow((node + d) * BAR, p, effects())) / LPM for d in (-h, 0.0, h))
    assert (at - below) / h == pytest.approx(0.84, abs=1e-3)
    assert (above - at) / h == pytest.approx(0.84, abs=1e-3)


@settings(max_examples=200, deadline=None)
@given(bar=st.floats(-150.0, 60.0))
def test_pressure_drop_inverts_the_flow(bar: float) -> None:
    v = SimpleNamespace(
        unit_flow=LPM, unit_pressure=BAR, a11=3.67, a12=29.2, a21=8.24, a30=-80.3, a31=0.84, dp_lin=0.02
    )
    parameters = SimpleNamespace(hose_burst_valve=v)
    e = SimpleNamespace(hose_burst_valve_setting=SimpleNamespace(r=1.0))
    flow = hose_burst_valve.flow(bar * BAR, parameters, e)
    back = float(hose_burst_valve.pressure_drop(flow, parameters, e)) / BAR
    assert back == pytest.approx(bar, abs=0.02 if bar > 0 else 1e-6)  # dp_lin is left out of the inverse


def test_the_check_valve_opens_without_a_corner_and_is_as_printed_on_both_sides(p: Any, effects: Any) -> None:
    e, opening = effects(), hose_burst_valve.OPENING
    drop = np.linspace(-opening, 2 * opening, 3001)
    flow = np.array([float(hose_burst_valve.flow(d, p, e)) for d in drop])
    slope = np.diff(flow) / np.diff(drop)
    assert float(hose_burst_valve.flow(0.0, p, e)) == 0.0
    assert (slope > 0).all()
    assert np.abs(np.diff(slope)).max() < 0.01 * slope.max()
    v = p.hose_burst_valve
    bar = 1.5 * opening / v.unit_pressure
    free = (v.a11 * bar + v.a12 * bar / np.sqrt(bar + v.dp_lin)) * v.unit_flow
    assert float(hose_burst_valve.flow(1.5 * opening, p, e)) == pytest.approx(free, rel=1e-12)


def test_setting_scales_the_limited_flow_and_keeps_the_free_one(p: Any, effects: Any) -> None:
    e = effects(hose_burst_valve_setting={"r": 0.8})
    for bar in (-5.0, -30.0):
        ratio = float(hose_burst_valve.flow(bar * BAR, p, e)) / float(hose_burst_valve.flow(bar * BAR, p, effects()))
        assert ratio == pytest.approx(0.8)
    assert float(hose_burst_valve.flow(BAR, p, e)) == float(hose_burst_valve.flow(BAR, p, effects()))
    q = float(hose_burst_valve.flow(-30 * BAR, p, e))
    assert float(hose_burst_valve.pressure_drop(q, p, e)) == pytest.approx(-30 * BAR)


def test_lagging_poppet_passes_what_its_conductance_says_outwards_only(p: Any, effects: Any) -> None:
    for bar in (-5.0, -40.0):
        settled = hose_burst_valve.limited_conductance(bar * BAR, p, effects())
        stationary = float(hose_burst_valve.flow(bar * BAR, p, effects()))
        assert float(hose_burst_valve.flow(bar * BAR, p, effects(), settled)) == pytest.approx(stationary)
    assert float(hose_burst_valve.flow(-1e5, p, effects(), 2e-9)) == pytest.approx(-2e-4)
    assert float(hose_burst_valve.flow(1e5, p, effects(), 2e-9)) == float(hose_burst_valve.flow(1e5, p, effects()))


def test_anti_cavitation_valve_is_shut_above_and_open_below_its_pressure(p: Any) -> None:
    assert float(anti_cavitation.flow(0.0, p)) == 0.0
    assert float(anti_cavitation.flow(1e7, p)) == 0.0
    assert float(anti_cavitation.flow(-1e5, p)) == pytest.approx(HOLE * 1e-4 * sqrt(1e5), rel=1e-4)


# --------------------------------------------------------------------------------------------------------------- motion


def test_load_adds_to_inertia_and_gravity_at_the_tip(tz17: Any, effects: Any) -> None:
    q = namespace(tz17.values(tz17.pose(0.28, 2.8, 300.0)))
    load = equation_of_motion.load_mass(q, effects())
    assert float(load) == 300.0
    assert float(equation_of_motion.inertia(load, q)) == pytest.approx(33_818 + 300 * (4.7619**2 + 5.8335**2))
    assert float(equation_of_motion.gravity_torque(0.0, load, q)) == pytest.approx(9.81 * (4633.6 + 300 * 4.7619))
    upright = float(equation_of_motion.gravity_torque(pi / 2, load, q))
    assert upright == pytest.approx(9.81 * (3142.9 + 300 * 5.8335))


def test_payload_effect_is_a_load_that_the_configuration_does_not_tell(tz17: Any, effects: Any) -> None:
    told, hidden = (namespace(tz17.values(tz17.pose(0.28, 2.8, load))) for load in (260.0, 0.0))
    e = effects(payload={"mass": 260.0})
    assert float(equation_of_motion.load_mass(hidden, e)) == float(equation_of_motion.load_mass(told, effects()))


def test_grasped_load_is_there_from_its_time_on(tz17: Any, effects: Any) -> None:
    q = namespace(tz17.values(tz17.pose(0.28, 2.8, 100.0)))
    e = effects(payload_change={"mass": 260.0, "t_g": 5.0})
    masses = [float(equation_of_motion.load_mass(q, e, t)) for t in (0.0, 4.9, 5.0, 5.1, 50.0)]
    assert masses == pytest.approx([100.0, 100.0, 230.0, 360.0, 360.0], abs=1e-5)


def test_friction_drifts_from_one_to_its_factor(effects: Any) -> None:
    e = effects(friction_drift={"r": 3.0, "T": 10.0})
    assert [float(friction.drift(t, e)) for t in (0.0, 10.0, 1e4)] == pytest.approx([1.0, 3.0 - 2.0 / np.e, 3.0])


def test_bristles_are_a_spring_before_and_coulomb_friction_in_sliding(p: Any, effects: Any) -> None:
    e = effects(presliding_friction={"compliance": 1e-6})
    assert float(friction.bristle_rate(0.3, 1e-3, 0.0, p, e)) == pytest.approx(1e3)  # w / c
    assert float(friction.bristle_rate(0.3, 0.1, 4000.0, p, e)) == pytest.approx(0.0)  # sliding: z = tau_C+
    assert float(friction.bristle_rate(0.3, -0.1, -3000.0, p, e)) == pytest.approx(0.0)


def test_cushion_leaves_the_passage_open_but_for_the_last_stretch(effects: Any) -> None:
    e = effects(end_cushioning={"k": 0.8, "length": 0.05})
    passages = [float(cylinder.cushion(d, e)) for d in (0.5, 0.05, 0.025, 0.0, -0.01)]
    assert passages == pytest.approx([1.0, 1.0, 0.6, 0.2, 0.2])


def test_gas_that_exchanges_heat_cools_when_it_is_hotter_than_at_rest(p: Any, effects: Any) -> None:
    e = effects(accumulator_heat_loss={"inverse_tau": 0.1})
    rest = (8e6 / 5.5e6) ** (0.4 / 1.4)
    assert float(accumulator.entropy_rate(8e6, 0.0, rest, 5.5e6, p, e)) == pytest.approx(0.0)
    hot = (1.2e7 / 5.5e6) ** (0.4 / 1.4)
    expected = -(1 - rest / hot) * 0.1
    assert float(accumulator.entropy_rate(1.2e7, 0.0, rest, 5.5e6, p, e)) == pytest.approx(expected)


def test_swinging_load_at_rest_pulls_like_one_that_sticks(tz17: Any, effects: Any) -> None:
    """theta = 0, no motion: torque - m g x_t over D + m x_t^2, and the rope's pivot takes theta along."""
    q = namespace(tz17.values(tz17.pose(0.28, 2.8)))
    e = effects(swinging_load={"mass": 300.0, "length": 2.0})
    w, theta = (float(v) for v in swinging_load.accelerations(0.0, 0.0, 0.0, 0.0, 33_818.0, 5e4, q, e))
    expected = (5e4 - 300 * 9.81 * 4.7619) / (33_818 + 300 * 4.7619**2)
    assert w == pytest.approx(expected)
    assert theta == pytest.approx(-5.8335 * expected / 2.0)


def test_elastic_mode_rings_at_its_frequency(effects: Any) -> None:
    e = effects(boom_flexibility={"gain": 0.1, "f": 2.0, "zeta": 0.0})
    assert float(boom_flexibility.acceleration(0.01, 0.0, 0.0, e)) == pytest.approx(-0.01 * (4 * pi) ** 2)
    assert float(boom_flexibility.acceleration(0.0, 0.0, 3.0, e)) == pytest.approx(-0.3)


def test_acceleration_is_torque_over_inertia() -> None:
    assert equation_of_motion.acceleration(5000.0, 20_000.0, 0.4, 100_000.0, 4_000.0) == pytest.approx(16_000 / 5000)
