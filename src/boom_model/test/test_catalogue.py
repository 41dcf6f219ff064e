"""The terms of the effects against numbers worked out by hand, one switched on at a time; the catalogue as a whole."""

from __future__ import annotations

from math import cos, exp, pi, sin, tanh
from typing import Any

import numpy as np
import pytest

from boom_model.catalogue import CATALOGUE, beginning
from boom_model.catalogue.effect import QUANTITIES, SUBSYSTEM_NAMES, Effect
from boom_model.catalogue.terms import Terms
from boom_model.components import (
    cylinder,
    equation_of_motion,
    friction,
    hose_burst_valve,
    main_valve_orifices,
    oil,
    pilot_valve,
)
from boom_model.equations import full_model, namespace
from boom_model.machine import Machine
from boom_model.plant import Plant
from boom_model.slots import Supply, component
from boom_model.structure import structure

BAR = 1e5


# ------------------------------------------------------------------------------------------------------------ catalogue


def test_every_effect_is_in_the_file_of_its_name() -> None:
    import boom_model.catalogue as package

    for effect in CATALOGUE:
        assert getattr(package, effect.id).EFFECT is effect


def test_catalogue_is_in_the_order_of_the_subsystems() -> None:
    order = [list(SUBSYSTEM_NAMES).index(effect.subsystem) for effect in CATALOGUE]
    assert order == sorted(order)
    places = [(effect.subsystem, effect.place) for effect in CATALOGUE]
    assert len(set(places)) == len(places)


def test_equations_and_components_let_every_quantity_of_the_catalogue_pass(
    monkeypatch: pytest.MonkeyPatch, p: Any, effects: Any
) -> None:
    passed, through = set[str](), Terms.through

    def noting(self: Terms, quantity: str, value: Any, **at: Any) -> Any:
        passed.add(quantity)
        return through(self, quantity, value, **at)

    monkeypatch.setattr(Terms, "through", noting)
    full_model(structure())
    full_model(structure(supply=False))
    full_model(structure(spool="direct", pilot_valves="none"))
    full_model(structure(hose_burst_valve="pilot_opened"))
    structure().pilot_valves.settling(p, effects())
    assert passed == set(QUANTITIES)


def test_term_of_a_quantity_that_the_equations_do_not_have_is_refused() -> None:
    with pytest.raises(ValueError, match="no quantity of the equations is called frictoin_torque"):
        Effect("x", "load", "-", "-", ("a", "b"), "-", (), {"frictoin_torque": lambda value, own, at: value})


def test_component_alone_leaves_out_effects_with_states_and_stands_at_time_zero(p: Any, effects: Any) -> None:
    alone = effects(presliding_friction={"compliance": 1e-6}, friction_drift={"r": 3.0, "T": 10.0})
    assert float(friction.torque(0.3, 0.2, p, alone)) == float(friction.torque(0.3, 0.2, p, effects()))


def test_effect_that_begins_begins_at_another_time_in_another_recording() -> None:
    effects = {"payload_change": {"mass": 260.0, "t_g": 5.0}, "pilot_lag": {"r": 2.0}}
    assert beginning(effects, 7.0) == {"payload_change": {"mass": 260.0, "t_g": 7.0}, "pilot_lag": {"r": 2.0}}
    assert effects["payload_change"]["t_g"] == 5.0


def test_dead_times_of_the_command_are_those_of_its_effects(effects: Any) -> None:
    e = effects(command_delay={"T": 0.03}, pressure_delay={"T": 0.02})
    assert (e.delay("command"), e.delay("pressures"), effects().delay("command")) == (0.03, 0.02, 0.0)


# ---------------------------------------------------------------------------------------------------- load and structure


def test_payload_is_a_load_that_the_configuration_does_not_tell(tz17: Any, effects: Any) -> None:
    told, hidden = (namespace(tz17.values(tz17.pose(0.28, 2.8, load))) for load in (260.0, 0.0))
    e = effects(payload={"mass": 260.0})
    assert float(equation_of_motion.load_mass(hidden, e)) == float(equation_of_motion.load_mass(told, effects()))


def test_grasped_load_is_there_from_its_time_on(tz17: Any, effects: Any, held: Any) -> None:
    q = namespace(tz17.values(tz17.pose(0.28, 2.8, 100.0)))

    def mass(time: float) -> float:
        e = effects(held(elapsed_time=time), payload_change={"mass": 260.0, "t_g": 5.0})
        return float(equation_of_motion.load_mass(q, e))

    assert [mass(t) for t in (0.0, 4.9, 5.0, 5.1, 50.0)] == pytest.approx([100.0, 100.0, 230.0, 360.0, 360.0], abs=1e-5)


def test_swinging_load_at_rest_pulls_like_one_that_sticks(tz17: Any, effects: Any, held: Any) -> None:
    """theta = 0, no motion: torque - m g x_t over D + m x_t^2, and the rope's pivot takes theta along."""
    states = held(swing_angle=0.0, swing_rate=0.0)
    e = effects(states, swinging_load={"mass": 300.0, "length": 2.0})
    q = namespace(tz17.values(tz17.pose(0.28, 2.8)))
    w = e.through("angular_acceleration", 0.0, angle=0.0, rate=0.0, inertia=33_818.0, torque=5e4, p=q)
    expected = (5e4 - 300 * 9.81 * 4.7619) / (33_818 + 300 * 4.7619**2)
    assert float(w) == pytest.approx(expected)
    assert float(states.rates["swing_rate"]) == pytest.approx(-5.8335 * expected / 2.0)


def test_a_load_that_swings_far_pulls_along_its_rope(tz17: Any, effects: Any, held: Any) -> None:
    """Newton for the mass on its rope, with the accelerations that the equations give."""
    q = namespace(tz17.values(tz17.pose(0.28, 2.8, 200.0)))
    theta, rate, w, angle, m, length, g = 0.6, 0.4, 0.3, 0.2, 300.0, 2.0, 9.81
    states = held(swing_angle=theta, swing_rate=rate)
    e = effects(states, swinging_load={"mass": m, "length": length, "zeta": 0.0, "told": 0.5})
    a = float(e.through("angular_acceleration", 0.0, angle=angle, rate=w, inertia=33_818.0, torque=5e4, p=q))
    swung = float(states.rates["swing_rate"])
    x = float(q.pose.tip[0] * cos(angle) - q.pose.tip[1] * sin(angle))
    y = float(q.pose.tip[0] * sin(angle) + q.pose.tip[1] * cos(angle))
    tip = (-y * a - x * w * w, x * a - y * w * w)
    ax = tip[0] + length * (swung * cos(theta) - rate**2 * sin(theta))
    ay = tip[1] + length * (swung * sin(theta) + rate**2 * cos(theta))
    fx, fy = m * ax, m * (ay + g)  # of the rope on the mass
    assert fx * cos(theta) + fy * sin(theta) == pytest.approx(0.0, abs=1e-6 * m * g)  # along the rope only
    inertia = 33_818.0 - 150.0 * (x * x + y * y)  # half of the mass is of the 200 kg that are told
    assert inertia * a == pytest.approx(5e4 + 150.0 * g * x - (x * fy - y * fx))


def test_a_swinging_load_that_was_told_is_the_load_of_each_recording(tz17: Any, effects: Any, held: Any) -> None:
    """Found with 300 kg told; where 200 kg are told, 200 kg swing."""
    q = namespace(tz17.values(tz17.pose(0.28, 2.8, 200.0)))

    def acceleration(**numbers: float) -> float:
        e = effects(held(swing_angle=0.3, swing_rate=0.1), swinging_load={"length": 2.0, **numbers})
        return float(e.through("angular_acceleration", 0.0, angle=0.2, rate=0.3, inertia=33_818.0, torque=5e4, p=q))

    assert acceleration(mass=310.0, told=1.0, load=310.0) == pytest.approx(acceleration(mass=200.0, told=1.0))
    assert acceleration(mass=310.0, load=310.0) == acceleration(mass=310.0)


def test_elastic_mode_rings_at_its_frequency_and_is_seen(tz17: Any, effects: Any, held: Any) -> None:
    mode = {"gain": 0.1, "f": 2.0, "zeta": 0.0, "mu": 0.5, "eta": 0.4}
    bent, still = held(bend=0.01, bend_rate=0.2), held(bend=0.0, bend_rate=0.0)
    q = namespace(tz17.values(tz17.pose(0.28, 2.8, 100.0)))
    at = {"angle": 0.3, "rate": 0.0, "inertia": float(equation_of_motion.inertia(100.0, q)), "torque": 0.0, "p": q}
    e = effects(bent, boom_flexibility=mode)
    back = float(e.through("angular_acceleration", 0.0, **at))
    assert back == pytest.approx(0.1 * 0.5 * 0.01 * (4 * pi) ** 2 / (1 - 0.5 * 0.1**2))
    assert (e.through("seen_angle", 0.3), e.through("seen_rate", 0.1)) == pytest.approx((0.304, 0.18))
    assert float(bent.rates["bend_rate"]) == pytest.approx(-0.01 * (4 * pi) ** 2 - 0.1 * back)
    forced = float(effects(still, boom_flexibility=mode).through("angular_acceleration", 3.0, **at))
    assert float(still.rates["bend_rate"]) == pytest.approx(-0.1 * forced)


def test_a_load_on_a_bending_boom_lowers_its_frequency_and_pulls_at_the_outer_part_first(
    tz17: Any, effects: Any, held: Any
) -> None:
    """Two masses on a spring (Gamma = 1): at once the load's weight moves the outer one alone; held still it sags by g_r / k."""
    q = namespace(tz17.values(tz17.pose(0.28, 2.8)))
    own, load, angle = float(equation_of_motion.inertia(0.0, q)), 500.0, 0.3
    at = {"angle": angle, "rate": 0.0, "inertia": float(equation_of_motion.inertia(load, q)), "p": q}
    x, y = q.pose.tip
    weight = load * q.constants.g * (x * cos(angle) - y * sin(angle))
    mode = {"gain": 1.0, "f": 2.0, "zeta": 0.0, "mu": 0.4}
    still = held(bend=0.0, bend_rate=0.0)
    inner = effects(still, boom_flexibility=mode).through(
        "angular_acceleration", -weight / at["inertia"], torque=0.0, **at
    )
    assert float(inner) == pytest.approx(0.0, abs=1e-9)
    assert float(still.rates["bend_rate"]) == pytest.approx(-weight / (0.4 * own + at["inertia"] - own))
    sagging = held(bend=-weight / (0.4 * own * (4 * pi) ** 2), bend_rate=0.0)
    sunk = effects(sagging, boom_flexibility=mode).through("angular_acceleration", 0.0, torque=0.0, **at)
    assert float(sunk) == pytest.approx(0.0, abs=1e-9)  # the cylinder carries the load
    assert float(sagging.rates["bend_rate"]) == pytest.approx(0.0, abs=1e-9)


def test_a_boom_sags_under_its_own_weight_by_the_share_told_and_the_cylinder_carries_it(
    tz17: Any, effects: Any, held: Any
) -> None:
    q = namespace(tz17.values(tz17.pose(0.28, 2.8, 100.0)))
    own, angle = float(equation_of_motion.inertia(100.0, q)), 0.3
    at = {"angle": angle, "rate": 0.0, "inertia": own, "torque": 0.0, "p": q}
    weight = float(equation_of_motion.gravity_torque(angle, 100.0, q, effects()))
    mode = {"gain": 0.6, "f": 2.0, "zeta": 0.0, "mu": 0.4, "sag": 0.5}
    sagging = held(bend=-0.6 * 0.5 * weight / (0.4 * own * (4 * pi) ** 2), bend_rate=0.0)
    sunk = effects(sagging, boom_flexibility=mode).through("angular_acceleration", 0.0, **at)
    assert float(sunk) == pytest.approx(0.0, abs=1e-9)
    assert float(sagging.rates["bend_rate"]) == pytest.approx(0.0, abs=1e-9)


# ------------------------------------------------------------------------------------------------------------- friction


def test_stribeck_raises_the_coulomb_torque_at_the_stribeck_velocity_by_one_over_e(p: Any, effects: Any) -> None:
    e = effects(stribeck_friction={"tau_s": 1000.0, "w_s": 0.02})
    assert float(friction.torque(0.0, 0.02, p, e)) == pytest.approx(tanh(2) * (4000 + 1000 / exp(1)) + 400)
    assert float(friction.torque(0.0, 0.3, p, e)) == pytest.approx(10_000)


def test_tight_spot_doubles_coulomb_friction_at_its_centre_only(p: Any, effects: Any) -> None:
    e = effects(position_dependent_friction={"b": 1.0, "q_c": 0.4, "width": 0.1})
    assert float(friction.torque(0.4, 0.3, p, e)) == pytest.approx(8000 + 6000)
    assert float(friction.torque(0.5, 0.3, p, e)) == pytest.approx(4000 * (1 + exp(-1)) + 6000)
    assert float(friction.torque(1.4, 0.3, p, e)) == pytest.approx(10_000)


def test_friction_drifts_from_one_to_its_factor(p: Any, effects: Any, held: Any) -> None:
    drift = {"r": 3.0, "T": 10.0}
    torques = [
        friction.torque(0.3, 0.2, p, effects(held(elapsed_time=t), friction_drift=drift)) for t in (0.0, 10.0, 1e4)
    ]
    nominal = float(friction.torque(0.3, 0.2, p, effects()))
    assert [float(torque) / nominal for torque in torques] == pytest.approx([1.0, 3.0 - 2.0 / np.e, 3.0])


def test_a_telescope_that_creeps_takes_its_moment_and_its_inertia_along(tz17: Any, effects: Any, held: Any) -> None:
    """In the end 300 kg m less along the tip's direction, and 2 r |tip| times that of the inertia."""
    q = namespace(tz17.values(tz17.pose(0.28, 2.8, 0.0)))
    creep = {"d": -300.0, "T": 20.0, "r": 0.6}
    reach = float(np.hypot(*np.ravel(q.pose.tip)))
    along = float(q.pose.tip[0] * cos(0.2) - q.pose.tip[1] * sin(0.2)) / reach
    for time, share in ((0.0, 0.0), (20.0, 1.0 - 1.0 / np.e), (1e4, 1.0)):
        e = effects(held(elapsed_time=time), telescope_creep=creep)
        torques = [float(equation_of_motion.gravity_torque(0.2, 0.0, q, terms)) for terms in (e, effects())]
        assert torques[0] - torques[1] == pytest.approx(-300.0 * 9.81 * along * share)
        a = float(e.through("angular_acceleration", 0.5, angle=0.2, rate=0.0, inertia=30_000.0, torque=15e3, p=q))
        assert a == pytest.approx(0.5 * 30_000.0 / (30_000.0 - 2 * 0.6 * reach * 300.0 * share))


@pytest.mark.parametrize(("rate", "bristle", "expected"), [(1e-3, 0.0, 1e3), (0.1, 4000.0, 0.0), (-0.1, -3000.0, 0.0)])
def test_bristles_are_a_spring_before_and_coulomb_friction_in_sliding(
    p: Any, effects: Any, held: Any, rate: float, bristle: float, expected: float
) -> None:
    states = held(bristle_torque=bristle)
    torque = friction.torque(0.3, rate, p, effects(states, presliding_friction={"compliance": 1e-6}))
    assert float(states.rates["bristle_torque"]) == pytest.approx(expected)  # w / c; sliding: z = tau_C
    assert float(torque) == pytest.approx(bristle + (20_000 if rate > 0 else 30_000) * rate)


# -------------------------------------------------------------------------------------------- cylinder, oil, accumulator


def test_piston_leakage_flows_from_the_higher_pressure(p: Any, effects: Any) -> None:
    e = effects(piston_leakage={"c": 1e-12})
    assert cylinder.leakage(1e7, 1e6, e) == pytest.approx(9e-6)
    assert cylinder.leakage(1e6, 1e7, e) == pytest.approx(-9e-6)
    assert cylinder.leakage(1e7, 1e6, effects()) == 0.0


def test_a_piston_seal_with_a_nick_leaks_with_the_root_of_the_pressure_and_the_same_at_100_bar(effects: Any) -> None:
    e = effects(piston_leakage={"c": 1e-12, "n": 0.5})
    assert cylinder.leakage(1.1e7, 1e6, e) == pytest.approx(1e-5)
    assert cylinder.leakage(3.5e6, 1e6, e) == pytest.approx(0.5e-5)
    assert cylinder.leakage(1e6, 3.5e6, e) == pytest.approx(-0.5e-5)


def test_spool_leaks_into_each_port_by_its_own_line_of_the_pressure(effects: Any) -> None:
    """A port to the tank through c is -c p: its flow at a usual pressure, and a slope of c."""
    c = 2e-13
    e = effects(spool_leakage={"hose": -c * 1e7, "hose_slope": c, "rod": 3e-6})
    assert float(e.through("port_leakage", 0.0, port="hose", pressure=4e6)) == pytest.approx(-c * 4e6)
    assert float(e.through("port_leakage", 0.0, port="hose", pressure=0.0)) == pytest.approx(0.0, abs=1e-18)
    assert float(e.through("port_leakage", 1e-5, port="rod", pressure=2e6)) == pytest.approx(1.3e-5)
    assert float(effects().through("port_leakage", 0.0, port="hose", pressure=4e6)) == 0.0


def test_a_relief_valve_takes_oil_out_of_its_own_port_above_its_pressure_only(effects: Any) -> None:
    e = effects(port_relief_valve={"hose": 2e-10, "hose_set": 1.4e7, "rod": 1e-10, "rod_set": 6e6})
    for port, pressure, expected in (
        ("hose", 1.4e7, 0.0), ("hose", 1.5e7, -2e-10 * (1e6 - 2.5e4)), ("rod", 5e6, 0.0), ("rod", 7e6, -1e-10 * (1e6 - 2.5e4)),
    ):  # fmt: skip
        assert float(e.through("port_leakage", 0.0, port=port, pressure=pressure)) == pytest.approx(expected, abs=1e-15)


def test_a_boom_whose_spool_leaks_to_the_tank_sinks_by_what_leaks(tz17: Any) -> None:
    plant = Plant(tz17.with_effects({"spool_leakage": {"hose": -5e-6}}), tz17.pose(0.28, 2.2, 0.0))
    time = np.arange(0.0, 20.0, 0.01)
    run = plant.run(time, np.zeros((len(time), 2)), time, plant.equilibrium(0.6), tolerance=1e-6)
    position = plant.auxiliary(run.states, np.zeros((len(time), 2)))["piston_position"]
    sunk = (position[500] - position[-1]) / (time[-1] - time[500])
    assert sunk * tz17.parameters["cylinder.A_a"].value[0] == pytest.approx(5e-6, rel=0.2)  # accumulators give the rest


def test_cushion_is_a_throttle_in_series_over_the_last_stretch(p: Any, effects: Any) -> None:
    e = effects(end_cushioning={"kappa_b": 4.0, "length": 0.05})
    distances, expected = (0.5, 0.05, 0.025, 0.0, -0.01), [0.0, 0.0, 4.0, 16.0, 16.0]
    assert [float(e.through("cushion", 0.0, distance=d, way="b")) for d in distances] == pytest.approx(
        expected, abs=1e-9
    )
    assert float(e.through("cushion", 0.0, distance=0.0, way="a")) == 0.0
    edge, drop = 1e-5, 9e5
    alone = float(p.fluid.C_d * edge * np.sqrt(2 / p.fluid.rho) * np.sqrt(drop))  # of an orifice as large as the edge
    assert float(cylinder.cushioned(-alone, -drop, 24.0, edge, p)) == pytest.approx(-0.2 * alone)  # 1 / sqrt(1 + 24)
    assert float(cylinder.cushioned(-alone / 100, -drop, 24.0, edge, p)) == pytest.approx(-alone / 100, rel=2e-3)
    assert float(cylinder.cushioned(alone, drop, 24.0, edge, p)) == alone


def test_a_cushion_ahead_of_the_transducer_holds_the_piston_that_extends(tz17: Machine) -> None:
    held = tz17.with_effects({"end_cushioning": {"kappa_r": 4.0, "length": 1.0, "shape": 0.2}})
    free, cushioned = (Plant(m, tz17.pose(0.28, 2.2), "full") for m in (tz17, held))
    p = namespace(tz17.values(tz17.pose(0.28, 2.2)))
    x = free.rest_state(0.5, 0.0, 2e6)
    for rate in (0.2, -0.2):
        x[1] = rate
        states = {
            name: free.auxiliary(x[None], np.zeros((1, 2)))[name][0] for name in ("piston_velocity", "piston_position")
        }
        depth = 1 - (p.cylinder.l_p - states["piston_position"]) / 1.0
        drop = cylinder.cushion_drop(states["piston_velocity"], 16.0 * depth**0.4, p.main_valve_orifices.A_tb_max, p)
        forces = [plant.auxiliary(x[None], np.zeros((1, 2)))["force"][0] for plant in (free, cushioned)]
        assert forces[0] - forces[1] == pytest.approx(float(p.cylinder.A_b * drop), rel=1e-6)
        assert (float(drop) > 1e4) == (states["piston_velocity"] > 0.0)


def test_return_edge_that_is_hardly_open_is_hardly_narrowed_by_the_cushion(p: Any, effects: Any) -> None:
    def kept(stroke: float) -> float:
        supply, e = component(Supply, True), effects()
        open_, narrow = (
            main_valve_orifices.flows(-stroke * p.main_valve_spool.s_max, 1e7, 1e7, p, e, supply, (cushion, 0.0)).rod
            for cushion in (0.0, 24.0)
        )
        return float(narrow / open_)

    assert kept(1.0) == pytest.approx(0.2)
    assert kept(0.35) > 0.98


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


def test_gas_that_exchanges_heat_cools_when_it_is_hotter_than_at_rest(p: Any, effects: Any, held: Any) -> None:
    rest, hot = (8e6 / 5.5e6) ** (0.4 / 1.4), (1.2e7 / 5.5e6) ** (0.4 / 1.4)
    for pressure, expected in ((8e6, 0.0), (1.2e7, -(1 - rest / hot) * 0.1)):
        states = held(accumulator_entropy_1=0.0, accumulator_ambient_1=rest)
        e = effects(states, accumulator_heat_loss={"inverse_tau": 0.1})
        assert float(e.through("adiabat", 5.5e6, number=1, pressure=pressure, p=p)) == 5.5e6
        assert float(e.through("entropy_rate", 0.0, number=1)) == pytest.approx(expected)


# ---------------------------------------------------------------------------------------------- burst valve, pilot stage


def test_setting_moves_the_knee_and_keeps_the_slopes_before_and_behind_it(p: Any, effects: Any) -> None:
    e, v = effects(hose_burst_valve_setting={"r": 0.8}), p.hose_burst_valve
    limited = (0.8 * float(v.a30) + float(v.a31) * -40.0) / 60_000.0
    assert float(hose_burst_valve.flow(-40.0 * BAR, p, e)) == pytest.approx(limited)
    as_told = float(hose_burst_valve.flow(-0.01 * BAR, p, effects()))
    assert float(hose_burst_valve.flow(-0.01 * BAR, p, e)) == pytest.approx(as_told, rel=1e-3)
    assert float(hose_burst_valve.flow(BAR, p, e)) == float(hose_burst_valve.flow(BAR, p, effects()))
    q = float(hose_burst_valve.flow(-30 * BAR, p, e))
    assert float(hose_burst_valve.pressure_drop(q, p, e)) == pytest.approx(-30 * BAR)


def test_lagging_poppet_passes_what_its_conductance_says_outwards_only(p: Any, effects: Any, held: Any) -> None:
    states = held(hose_burst_valve_conductance=2e-9)
    lagging = effects(states, hose_burst_valve_lag={"tau": 0.05})
    assert float(hose_burst_valve.flow(-1e5, p, lagging)) == pytest.approx(-2e-4)
    stationary = float(hose_burst_valve.limited_conductance(-1e5, p, effects()))
    assert float(states.rates["hose_burst_valve_conductance"]) == pytest.approx((stationary - 2e-9) / 0.05)
    assert float(hose_burst_valve.flow(1e5, p, lagging)) == float(hose_burst_valve.flow(1e5, p, effects()))


def test_pilot_lag_slows_down_and_keeps_the_stationary_pressure(p: Any, effects: Any) -> None:
    slow = effects(pilot_lag={"r": 2.0})
    assert float(pilot_valve.state_rate(1e-2, 0.0, p, slow)) == pytest.approx(-0.1967 / 2)
    settled = 0.4 / 19.67
    fast = pilot_valve.pressure(settled, 0.4, p, effects())
    assert float(pilot_valve.pressure(2 * settled, 0.4, p, slow)) == pytest.approx(float(fast))
    drains = effects(pilot_lag={"r_fall": 1.5})
    assert float(pilot_valve.state_rate(1e-2, 0.6, p, drains)) == pytest.approx(0.6 - 0.1967, rel=1e-3)
    assert float(pilot_valve.state_rate(1e-2, 0.0, p, drains)) == pytest.approx(-0.1967 / 1.5, rel=1e-3)


@pytest.mark.parametrize(
    ("line", "y", "rate"), [(0.048, 10e5, 10e5 / 0.050), (0.048, 30e5, -10e5 / 0.075), (0.0, 10e5, 5e8)]
)
def test_the_line_to_the_spool_lags_the_pilot_pressure(
    effects: Any, held: Any, line: float, y: float, rate: float
) -> None:
    states = held(pilot_line=y)
    moves = effects(states, pilot_lag={"line": line, "r_fall": 1.5}).through("pilot_difference", 20e5)
    assert float(moves) == pytest.approx(20e5 + (y - 20e5) * line / (line + 0.002))
    assert float(states.rates["pilot_line"]) == pytest.approx(rate, rel=1e-2)


def test_the_reduced_model_keeps_of_a_slow_pilot_stage_what_needs_no_state(tz17: Machine) -> None:
    slow = Plant(tz17.with_effects({"pilot_lag": {"r": 2.0, "line": 0.05}}), tz17.pose(0.28, 2.2), "reduced")
    x = slow.rest_state(0.5, 0.0, 2e6)
    state = slow.equations.state_names.index("pilot_extend")
    x[state] = 1e-2
    assert "pilot_line" not in slow.equations.state_names
    assert slow.derivative(x, np.zeros(2))[0][state] == pytest.approx(-0.1967 / 2, rel=1e-3)


# ----------------------------------------------------------------------------------------------------- play of the spool


def metering(p: Any, effects: Any, held: Any, follower: float, spool: float, **numbers: float) -> tuple[float, float]:
    """(where the metering edges stand [m], rate of what follows the spool [m/s])."""
    states = held(metering_position=follower)
    position = effects(states, valve_hysteresis=numbers).through("metering_position", spool, p=p)
    return float(position), float(states.rates["metering_position"])


def test_metering_edges_stand_still_inside_the_play_and_follow_behind_it(p: Any, effects: Any, held: Any) -> None:
    rates = [metering(p, effects, held, 0.0, s, h=0.05)[1] for s in (0.0, 4e-4, -4e-4, 6e-4, -6e-4)]  # 0.45 mm
    assert rates == pytest.approx([0.0, 0.0, 0.0, 1.5e-4 / 2e-3, -1.5e-4 / 2e-3])


def test_hysteresis_without_a_travel_of_its_own_is_a_play(p: Any, effects: Any, held: Any) -> None:
    assert metering(p, effects, held, 1e-3, 1.2e-3, h=0.05)[0] == pytest.approx(1e-3)


def test_edges_with_a_travel_change_sides_in_proportion(p: Any, effects: Any, held: Any) -> None:
    wide = {"h": 0.02, "travel": 0.1}  # 0.18 mm to either side, within 2 x 0.9 mm
    follower = [2e-3 - 0.9e-3 * side for side in (1.0, 0.5, 0.0, -1.0)]
    behind = [2e-3 - metering(p, effects, held, x, 2e-3, **wide)[0] for x in follower]
    assert behind == pytest.approx([0.18e-3, 0.09e-3, 0.0, -0.18e-3])
    assert metering(p, effects, held, 1.2e-3, 2e-3, **wide)[1] == 0.0
    assert metering(p, effects, held, 1.0e-3, 2e-3, **wide)[1] == pytest.approx(0.1e-3 / 2e-3)
