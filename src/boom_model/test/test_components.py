"""Each component against numbers worked out by hand from its equation, one term switched on at a time."""

from __future__ import annotations

from math import pi, sqrt, tanh
from types import SimpleNamespace
from typing import Any

import casadi as ca
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from boom_model.catalogue.terms import Terms
from boom_model.components import (
    accumulator,
    anti_cavitation,
    cylinder,
    direct_spool,
    equation_of_motion,
    four_bar_linkage,
    friction,
    hose_burst_valve,
    main_valve_spool,
    oil,
    pilot_valve,
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


# --------------------------------------------------------------------------------------------------- cylinder and oil


def test_cylinder_volumes_and_force(p: Any) -> None:
    assert cylinder.head_volume(0.5, p) == pytest.approx(0.5e-3 + 0.5 * 1.5394e-2)
    assert cylinder.rod_volume(0.5, p) == pytest.approx(1.1e-3 + 0.476 * 9.032e-3)
    assert cylinder.force(1e7, 1e6, p) == pytest.approx(153_940 - 9_032)


def test_a_litre_per_second_raises_the_pressure_by_beta_over_volume() -> None:
    assert cylinder.pressure_rate(1.6e9, 8e-3, 1e-3) == pytest.approx(2e8)


def test_oil_without_air_has_the_bulk_modulus_of_the_file(p: Any, effects: Any) -> None:
    above_void = oil.VOID_PRESSURE - oil.AMBIENT_PRESSURE
    assert [float(oil.bulk_modulus(x, p, effects())) for x in (above_void, 0.0, 3e7)] == [1.6e9] * 3


def test_oil_pulled_apart_gives_way_and_never_reaches_vacuum(p: Any, effects: Any) -> None:
    assert float(oil.bulk_modulus(-91_325.0, p, effects())) == pytest.approx(1.6e9 / (1 + 4**4))  # 0.1 bar absolute
    pressure = 0.0
    for _ in range(20_000):  # room that grows by a tenth without oil
        pressure += cylinder.pressure_rate(float(oil.bulk_modulus(pressure, p, effects())), 1.0, -0.1) / 20_000
    assert -oil.AMBIENT_PRESSURE + oil.VACUUM < pressure < -9e4


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


def test_direct_spool_is_a_first_order_lag(other_make: Any, effects: Any) -> None:
    q = namespace(other_make.values(other_make.pose(4.5, 0.0)))
    assert direct_spool.velocity(0.0, 0.6, 0.0, q, effects()) == pytest.approx(8e-3 / 0.04, rel=1e-3)
    assert direct_spool.velocity(0.0, 0.0, 0.6, q, effects()) == pytest.approx(-8e-3 / 0.04, rel=1e-3)
    assert direct_spool.velocity(1.333e-2 * 0.3, 0.3, 0.0, q, effects()) == pytest.approx(0.0, abs=1e-12)


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
    e = Terms({})
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
    assert float(equation_of_motion.gravity_torque(0.0, load, q, effects())) == pytest.approx(
        9.81 * (4633.6 + 300 * 4.7619)
    )
    upright = float(equation_of_motion.gravity_torque(pi / 2, load, q, effects()))
    assert upright == pytest.approx(9.81 * (3142.9 + 300 * 5.8335))


def test_torque_that_accelerates_is_what_gravity_and_friction_leave_of_the_force() -> None:
    assert equation_of_motion.torque(20_000.0, 0.4, 100_000.0, 4_000.0) == pytest.approx(16_000)
