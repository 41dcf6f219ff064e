"""Components of loader cranes against numbers worked out by hand: load-holding valve, four edges, spool, seals, steps, supply."""

from __future__ import annotations

import copy
from dataclasses import replace
from math import log, pi, sqrt, tanh
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from boom_model.catalogue.terms import Terms
from boom_model.components import (
    compensator,
    four_edges,
    friction,
    load_holding_valve,
    main_valve_orifices,
    neutral_position,
    payload,
    second_order_spool,
)
from boom_model.components.payload import Step
from boom_model.derived import quantities
from boom_model.equations import namespace
from boom_model.errors import MachineError, ModelError
from boom_model.machine import Machine
from boom_model.machine_file import load_machine, machine_from
from boom_model.plant import Plant
from boom_model.prior import prior_of
from boom_model.structure import DRIVING
from boom_model.tolerance import Tolerance

BAR, LPM = 1e5, 1 / 60_000
POSE = (0.3, 2.0, 200.0)


@pytest.fixture(scope="module")
def q(loader: Machine) -> Any:
    """Numbers of the loader crane as nested namespaces of floats."""
    return namespace(loader.values(loader.pose(*POSE)))


@pytest.fixture(scope="module")
def crane(loader: Machine) -> Plant:
    return Plant(loader, loader.pose(*POSE))


# ---------------------------------------------------------------------------------------------------- vented neutral


def vented(loader: Machine) -> Machine:
    document = dict(loader.document)
    numbers = {"A_v": {"value": 5e-6, "unit": "m^2"}, "x_v": {"value": 0.07, "unit": "-"}}
    document["main_valve_orifices"] = document["main_valve_orifices"] | {"neutral": "vented"} | numbers
    return machine_from(document)


def test_vent_is_open_in_neutral_and_shut_from_x_v_on(loader: Machine) -> None:
    machine = vented(loader)
    p = namespace(machine.values(machine.pose(*POSE)))
    stroke = machine.parameters["main_valve_spool.s_max"].value[0]
    area = machine.structure.neutral.area
    assert [float(area(x * stroke, p)) for x in (0.0, 0.035, -0.035, 0.07, -0.5)] == pytest.approx(
        [5e-6, 2.5e-6, 2.5e-6, 0.0, 0.0], abs=1e-12
    )
    drop = 100 * BAR
    q_v = 5e-6 * p.fluid.C_d * sqrt(2 * drop / p.fluid.rho)
    assert float(neutral_position.flow(5e-6, p.fluid.p_t + drop, p)) == pytest.approx(-q_v, rel=1e-3)


def test_vented_ports_fall_to_the_tank_and_the_valve_at_the_cylinder_holds_the_boom(loader: Machine) -> None:
    plant = Plant(vented(loader), loader.pose(*POSE))
    time = np.arange(600) * 0.01
    command = np.interp(time, [0.0, 1.0, 1.2, 2.5, 2.7], [0.0, 0.0, 0.4, 0.4, 0.0])
    out = plant.run(time, np.column_stack((0 * time, command)), time, plant.equilibrium(0.3))
    tank = loader.parameters["fluid.p_t"].value[0]
    assert out.output("hose_pressure")[[0, -1]] == pytest.approx([tank, tank], abs=0.5 * BAR)
    assert out.output("hose_pressure").max() > 50 * BAR
    assert out.output("rod_pressure")[-1] == pytest.approx(tank, abs=1.0 * BAR)
    assert out.output("angle")[-1] > out.output("angle")[0] + 0.05, "lifted"
    assert abs(out.output("rate")[-1]) < 1e-3, "and held"


def test_vented_neutral_is_the_same_as_an_effect_of_a_file_that_says_shut(loader: Machine) -> None:
    told, left_out = vented(loader), loader.with_effects({"vented_neutral": {"A_v": 5e-6, "x_v": 0.07}})
    time = np.arange(300) * 0.01
    currents = np.column_stack((0 * time, np.interp(time, [0.0, 0.5, 1.5, 1.7], [0.0, 0.3, 0.3, 0.0])))
    plants = [Plant(machine, loader.pose(*POSE)) for machine in (told, left_out)]
    start = plants[0].equilibrium(0.3)
    one, other = (plant.run(time, currents, time, start).outputs for plant in plants)
    assert one == pytest.approx(other, rel=1e-6, abs=1.0)
    with pytest.raises(MachineError, match="no load holding valve or no shut neutral"):
        told.with_effects({"vented_neutral": {}})


def test_friction_of_the_pins_does_not_follow_the_lever_of_the_cylinder(loader: Machine) -> None:
    """(J F_C+- + tau_p+-) tanh(w_p / sigma) + (J^2 d+- + k_p+-) w; none of the pins unless the file says so."""
    document = copy.deepcopy(dict(loader.document))
    given = {"tau_p_pos": 300.0, "tau_p_neg": 200.0, "k_p_pos": 900.0, "k_p_neg": 700.0}
    document["friction"] |= {
        key: {"value": v, "unit": "N m" if "tau" in key else "N m s/rad"} for key, v in given.items()
    }
    plain, pinned = (namespace(m.values(m.pose(*POSE))) for m in (loader, machine_from(document)))
    for rate, tau, k in ((0.2, 300.0, 900.0), (-0.2, -200.0, 700.0)):
        for lever in (0.2, 0.5):
            seals, both = (float(friction.torque_of_seals(0.3, rate, lever, p, Terms({}))) for p in (plain, pinned))
            assert both - seals == pytest.approx(tau * tanh(lever * 0.2 / plain.friction.sigma_p) + k * rate)


# ---------------------------------------------------------------------------------------- passages in series with an edge


def guessed(loader: Machine, **entries: Any) -> Machine:
    document = copy.deepcopy(dict(loader.document))
    document["main_valve_orifices"] |= entries
    return machine_from(document)


def test_a_passage_in_series_adds_its_drop_to_that_of_the_edge(loader: Machine) -> None:
    """dp = q^2 rho / (2 C_d^2) (1 / A_e^2 + 1 / A_p^2), A_p = A_sa_max / sqrt(kappa) of every edge."""
    kappa = 0.7
    machine = guessed(loader, passage={"value": kappa, "unit": "-"})
    plain, narrowed = (namespace(m.values(m.pose(*POSE))) for m in (loader, machine))
    square = plain.main_valve_orifices.A_sa_max**2 / kappa
    for position in (-6e-3, 4e-3):
        without = four_edges.areas(position, plain, Terms({}))
        beside = four_edges.areas(position, narrowed, Terms({}))
        for edge, both in zip(without, beside, strict=True):
            assert 1 / float(both) ** 2 == pytest.approx(1 / float(edge) ** 2 + 1 / square)


def test_an_edge_has_notches_of_its_own_where_the_file_says_so(loader: Machine) -> None:
    """A_e = A_e_max w^(n + dn_e) exp(4 b_e w (1 - w)); none where it says nothing."""
    formed = guessed(
        loader, **{key: {"value": v, "unit": "-"} for key, v in (("dn_ta", 0.2), ("b_ta", -0.1), ("b_sa", 0.05))}
    )
    plain, own = (namespace(m.values(m.pose(*POSE))) for m in (loader, formed))
    o = plain.main_valve_orifices
    for position, steeper, fuller in ((4e-3, (0.0, 0.2), (0.0, -0.1)), (-4e-3, (0.0, 0.0), (0.05, 0.0))):
        x = abs(position + o.x_n * plain.main_valve_spool.s_max * 0.0) / plain.main_valve_spool.s_max
        edges = ("sb", "ta") if position > 0 else ("sa", "tb")
        before, after = (four_edges.areas(position, p, Terms({})) for p in (plain, own))
        for edge, one, other, dn, b in zip(edges, before, after, steeper, fuller, strict=True):
            w = (x - getattr(o, f"x0_{edge}")) / (1 - getattr(o, f"x0_{edge}"))
            assert float(other) / float(one) == pytest.approx(w**dn * np.exp(4 * b * w * (1 - w)), rel=0.02)
    with pytest.raises(MachineError, match="b_ta: write"):
        guessed(loader, b_ta=0.5)


def test_the_form_of_an_edge_is_known_no_better_than_its_area(loader: Machine) -> None:
    """Of both laws; a file that says nothing of how far its areas may be off is believed in their form, too."""
    common = ("x0", "n", "A_sa_max", "A_tb_max", "A_sb_max")
    plain = load_machine("triangle_direct")
    given = {key: plain.document["main_valve_orifices"][key] for key in common}
    told = {key: {**entry, "tol": 0.2} for key, entry in given.items()}
    for machine, dn, b in ((loader, 0.15, 0.15), (plain, 0.0, 0.0), (guessed(plain, **told), 0.15, 0.15)):
        assert machine.parameters["main_valve_orifices.dn_tb"].value == (0.0,)
        sizes = [prior_of(machine, f"main_valve_orifices.{name}").sigma for name in ("dn_ta", "b_sa")]
        assert sizes == pytest.approx([dn, b])


def test_an_edge_opens_ever_further(loader: Machine) -> None:
    """Within what a file may say its area never falls towards full stroke, and its exponent is no less than a half."""
    formed = guessed(loader, b_tb={"value": 0.3, "unit": "-"}, n={"value": 1.2, "unit": "-"})
    p = namespace(formed.values(formed.pose(*POSE)))
    areas = [float(four_edges.areas(-x * p.main_valve_spool.s_max, p, Terms({}))[1]) for x in np.linspace(0.2, 1.2, 21)]
    assert (np.diff(areas) >= 0.0).all()
    for key, value, said in (
        ("b_tb", 0.4, "b_tb: 0.4 is outside -1 .. 0.3"),
        ("dn_tb", -0.6, "makes the exponent of this edge 0.4"),
    ):
        with pytest.raises(MachineError, match=said):
            guessed(loader, **{key: {"value": value, "unit": "-"}})


def test_edges_of_one_overlap_have_notches_of_their_own(loader: Machine) -> None:
    """A_tb = A_tb_max w^(n + dn_tb) exp(4 b_tb w (1 - w)); A_ta through u of its law."""
    plain = load_machine("triangle_direct")
    formed = guessed(plain, dn_tb={"value": 0.2, "unit": "-"}, b_tb={"value": 0.1, "unit": "-"})
    one, other = (namespace(m.values(m.pose(*POSE))) for m in (plain, formed))
    o, half = one.main_valve_orifices, 0.6
    w = (half - o.x0) / (1 - o.x0)
    before, after = (main_valve_orifices.areas(-half * p.main_valve_spool.s_max, p, Terms({})) for p in (one, other))
    assert float(after[0]) == float(before[0])
    assert float(after[1]) / float(before[1]) == pytest.approx(w**0.2 * np.exp(0.4 * w * (1 - w)), rel=1e-3)


def test_a_file_without_a_passage_has_none_and_guessed_areas_leave_one_open(loader: Machine) -> None:
    area = loader.document["main_valve_orifices"]["A_sa_max"]
    known = guessed(loader, A_sa_max={"value": area["value"], "unit": "m^2", "tol": 0.1})
    plain = guessed(loader, A_sa_max={"value": area["value"], "unit": "m^2"})
    for machine, sigma in ((plain, 0.0), (known, 0.075), (loader, 0.5)):  # the owner of the loader crane tells a factor
        assert machine.parameters["main_valve_orifices.passage"].value == (0.0,)
        assert prior_of(machine, "main_valve_orifices.passage").sigma == sigma
    with pytest.raises(MachineError, match="passage: write"):
        guessed(loader, passage=0.5)


# -------------------------------------------------------------------------------------------------- load-holding valve

STRANGER = SimpleNamespace(
    p_set=132 * BAR, R=2.6, gain=0.1 * LPM / BAR**1.5, G_max=10 * LPM / BAR**0.5, play=2.5 * BAR, p_check=1.2 * BAR,
    r_check=0.14 * BAR / LPM,
)  # fmt: skip


def through(hose: float, head: float, pilot: float) -> float:
    """l/min into the cylinder at pressures in bar."""
    return float(load_holding_valve.flow(hose * BAR, head * BAR, pilot * BAR, STRANGER)) / LPM


@pytest.mark.parametrize(
    ("hose", "head", "pilot", "lpm"),
    [
        (60.0, 58.8, -50.0, 0.0),  # the check valve is at its opening pressure
        (62.6, 60.0, -50.0, (2.6 - 1.2 - 0.05) / 0.14),  # the rounded corner takes half of its width
        (0.0, 60.0, 0.0, 0.0),  # it holds
        (0.0, 64.0, 20.0, -0.1 * (20 - 0.05) * 8.0),
        (0.0, 64.0, 300.0, -10.0 * 8.0),  # as far open as it goes
    ],
)
def test_load_holding_valve_lets_in_holds_and_is_opened(hose: float, head: float, pilot: float, lpm: float) -> None:
    assert through(hose, head, pilot) == pytest.approx(lpm, rel=1e-6, abs=1e-9)


def test_load_holding_valve_never_gives_energy_and_has_no_corner() -> None:
    rng = np.random.default_rng(1)
    hose, head, pilot = rng.uniform(-1, 300, 2000), rng.uniform(-1, 300, 2000), rng.uniform(-200, 300, 2000)
    flow = np.asarray(load_holding_valve.flow(hose * BAR, head * BAR, pilot * BAR, STRANGER)).ravel()
    assert (flow * (hose - head) >= 0.0).all()
    for make in (
        lambda x: through(60.0 + x, 58.8, -50.0),
        lambda x: through(0.0, 60.0, x),
        lambda x: through(0.0, 60.0, 100.0 + x),
    ):
        x = np.linspace(-1.0, 1.0, 2001)
        slope = np.diff([make(v) for v in x]) / np.diff(x)
        assert np.abs(np.diff(slope)).max() < 0.02 * np.abs(slope).max()


def test_pilot_follows_behind_its_play() -> None:
    x = load_holding_valve.excess(60 * BAR, 40 * BAR, STRANGER)
    assert x == pytest.approx((60 + 2.6 * 40 - 132) * BAR)
    time = load_holding_valve.PLAY_TIME
    for behind, expected in ((1.0, 0.0), (-1.0, 0.0), (3.25, 2.0), (-3.25, -2.0)):
        rate = load_holding_valve.following(x - behind * BAR, x, STRANGER.play)
        assert float(rate) * time / BAR == pytest.approx(expected)


def test_boom_at_rest_is_carried_by_the_head_side_whatever_the_hose_shows(crane: Plant) -> None:
    state = dict(zip(crane.state_names, crane.rest_state(0.2, 2 * BAR, 8 * BAR), strict=True))
    at = crane.auxiliary(np.array([list(state.values())]), np.zeros((1, 2)))
    force = state["head_pressure"] * 2.0106e-2 - 8 * BAR * 1.2252e-2
    assert force * at["jacobian"][0] == pytest.approx(at["gravity_torque"][0])
    assert (state["hose_pressure"], state["rod_pressure"]) == (2 * BAR, 8 * BAR)
    time = np.arange(0.0, 5.0, 0.01)
    run = crane.run(time, np.zeros((len(time), 2)), time, list(state.values()))
    assert np.ptp(run.output("angle")) < 1e-4
    assert np.ptp(run.output("hose_pressure")) < 1.0


def test_oil_of_a_crane_with_a_load_holding_valve_is_conserved(crane: Plant) -> None:
    """What comes through the main valve is in hose and cylinder: as volume, and pressed together."""
    time = np.arange(0.0, 8.0, 1e-3)
    currents = np.zeros((len(time), 2))
    currents[(time > 0.5) & (time < 3), 1], currents[(time > 4) & (time < 7), 0] = 0.3, 0.3
    run = crane.run(time, currents, time, crane.equilibrium(0.2), tolerance=1e-8)
    inner, p = crane.auxiliary(run.states, currents), crane.machine.numbers
    head = p.cylinder.V_0a + inner["piston_position"] * p.cylinder.A_a

    def stored(volume: Any, pressure: str) -> Any:
        return (
            np.concatenate(([0.0], np.cumsum((volume[1:] + volume[:-1]) / 2 * np.diff(run.state(pressure)))))
            / p.fluid.beta
        )

    moved = (inner["piston_position"] - inner["piston_position"][0]) * p.cylinder.A_a
    kept = moved + stored(head, "head_pressure") + stored(np.full_like(head, p.cylinder.V_h), "hose_pressure")
    flow = inner["hose_flow"]
    come = np.concatenate(([0.0], np.cumsum((flow[1:] + flow[:-1]) / 2 * np.diff(time))))
    assert np.ptp(come) > 1e-3
    np.testing.assert_allclose(kept, come, atol=2e-6)


@pytest.mark.parametrize("instead", ["none", "flow_limiting"])
def test_effect_is_the_component(loader: Machine, instead: str) -> None:
    """Left out of a file without any valve or with another one, and put in as an effect, it is the same run."""
    document = {k: v for k, v in loader.document.items() if k != "hose_burst_valve"}
    burst = load_machine("tz17").document["hose_burst_valve"]
    plain = machine_from(document | {"hose_burst_valve": {"type": "none"} if instead == "none" else burst})
    numbers = {k.split(".")[1]: p.value[0] for k, p in loader.parameters.items() if k.startswith("hose_burst_valve")}
    time = np.arange(0.0, 6.0, 0.01)
    currents = np.zeros((len(time), 2))
    currents[(time > 0.5) & (time < 3), 1], currents[time > 3.5, 0] = 0.3, 0.4
    runs = []
    for machine in (loader, plain.with_effects({"load_holding_valve": numbers})):
        plant = Plant(machine, machine.pose(*POSE))
        runs.append(plant.run(time, currents, time, plant.equilibrium(0.2), tolerance=1e-6).outputs)
    np.testing.assert_allclose(runs[0], runs[1], rtol=1e-3, atol=1e-3)
    with pytest.raises(MachineError, match=r"effects\.load_holding_valve: this machine has a load holding valve"):
        loader.with_effects({"load_holding_valve": numbers})


# ------------------------------------------------------------------------------------------------------------ main valve


def test_each_edge_opens_at_its_own_overlap_with_its_own_area(q: Any, effects: Any) -> None:
    e, stroke = effects(), q.main_valve_spool.s_max
    for x, supply, tank in (
        (-0.09, 0.0, 1.6e-5 * 0.01 / 0.92),
        (-1.0, 1.4e-5, 1.6e-5),
        (0.10, 0.0, 1.1e-5 * 0.01 / 0.91),
        (1.0, 9e-6, 1.1e-5),
        (0.0, 0.0, 0.0),
    ):
        assert tuple(float(a) for a in four_edges.areas(x * stroke, q, e)) == pytest.approx((supply, tank), rel=1e-9)


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_edge_overlap_moves_the_edge_to_the_tank_alone(p: Any, q: Any, effects: Any, side: float) -> None:
    late = effects(edge_overlap={"d_extend": 0.04, "d_retract": 0.02})
    for areas, numbers in ((main_valve_orifices.areas, p), (four_edges.areas, q)):
        x = side * 0.5 * numbers.main_valve_spool.s_max
        supply, tank = (float(a) for a in areas(x, numbers, effects()))
        assert float(areas(x, numbers, late)[0]) == supply
        assert 0.0 < float(areas(x, numbers, late)[1]) < tank


def test_neutral_off_centre_shifts_all_edges(q: Any, effects: Any) -> None:
    s_max = q.main_valve_spool.s_max
    off = effects(neutral_offset={"x_n": 0.05})
    assert off.through("metering_position", 1e-3, p=q) == pytest.approx(1e-3 + 0.05 * s_max)


def test_neutral_of_the_file_opens_early_to_one_side(loader: Machine) -> None:
    def moved(x_n: float, currents: tuple[float, float]) -> float:
        machine = loader.with_values({"main_valve_orifices.x_n": x_n})
        plant = Plant(machine, machine.pose(*POSE))
        time = np.arange(0.0, 3.0, 0.01)
        run = plant.run(time, np.tile(currents, (300, 1)), time, plant.equilibrium(0.2))
        return float(run.output("angle")[-1] - run.output("angle")[0])

    assert moved(0.06, (0.0, 0.09)) < 1e-3 < moved(-0.06, (0.0, 0.09))


def test_second_order_spool_rings_at_its_frequency_and_stands_where_the_current_says(q: Any, effects: Any) -> None:
    s = q.main_valve_spool
    assert second_order_spool.acceleration(0.0, 0.0, 0.3, 0.0, q, effects()) == pytest.approx(75.0**2 * 1.333e-2 * 0.3)
    assert second_order_spool.acceleration(s.K_i * 0.3, 0.01, 0.3, 0.0, q, effects()) == pytest.approx(
        -2 * 0.8 * 75.0 * 0.01
    )


# ------------------------------------------------------------------------------------------------- friction of the seals


def test_a_spool_that_follows_its_current_stands_at_its_stop_beyond_full_current(loader: Machine) -> None:
    """Two machines of another hand were commanded 16 % beyond it; a sound one had unknown physics of its main valve."""
    plant = Plant(loader, loader.pose(0.3, 2.0))
    full = loader.numbers.main_valve_spool.s_max / loader.numbers.main_valve_spool.K_i
    time, ends = np.arange(100) * 0.01, {}
    for share in (1.0, 1.3):
        currents = np.zeros((100, 2))
        currents[:50, 1] = share * full
        run = plant.run(time, currents, time, plant.equilibrium(0.2))
        ends[share] = run.state("spool_position")
    assert np.abs(ends[1.3] - ends[1.0]).max() < 1e-6
    rest = loader.structure.spool.position(np.array([0.0]), np.array([1.3 * full]), loader.numbers, None)
    assert rest == pytest.approx([-loader.numbers.main_valve_spool.s_max])


def test_friction_of_the_seals_acts_with_the_lever_arm(q: Any, effects: Any) -> None:
    lever, rate = 0.4, 0.01
    force = 600 * tanh(lever * rate / 2e-3) + 3e4 * lever * rate
    assert float(friction.torque_of_seals(0.0, rate, lever, q, effects())) == pytest.approx(lever * force)


# ------------------------------------------------------------------------------------------------------------- supply


def test_supply_variation_is_another_level_and_an_orifice_in_series(effects: Any) -> None:
    e = effects(supply_variation={"a": -0.1, "k": 1e12})
    assert e.through("supply_pressure", 2e7) == pytest.approx(1.8e7)
    conductance, drop = 3e-7, 9e6
    flow = float(e.through("supply_flow", conductance * sqrt(drop), conductance=conductance, pressure=0.0))
    assert flow == pytest.approx(conductance * sqrt(drop - 1e12 * flow**2))


def test_supply_falls_with_the_flow_and_its_square_at_once_where_nothing_lags(effects: Any) -> None:
    e = effects(supply_variation={"k": 1e12, "r": 2e9})
    for drop in (9e6, 4e4, -3e6):
        signed = np.copysign(sqrt(abs(drop)), drop)
        flow = float(e.through("supply_flow", 3e-7 * signed, conductance=3e-7, pressure=0.0, pump=drop))
        left = drop - 2e9 * flow - 1e12 * flow * abs(flow)
        assert flow == pytest.approx(3e-7 * np.copysign(sqrt(abs(left)), left))


@pytest.mark.parametrize("tau", [0.0, 0.2])
def test_what_a_check_valve_holds_back_it_holds_back_from_a_supply_that_lags(loader: Machine, tau: float) -> None:
    weak = {"supply_variation": {"a": -0.75, "k": 1e12, "tau": tau}, "load_check_valve": {"c": 1.0}}
    plant = Plant(loader.with_effects(weak), loader.pose(*POSE))
    state = plant.rest_state_measured(0.2, 1.5e7, 1e6)
    state[plant.state_names.index("spool_position")] = -0.9 * loader.numbers.main_valve_spool.s_max
    assert plant.auxiliary(state[None], np.zeros((1, 2)))["hose_flow"] == pytest.approx(0.0, abs=1e-7)


def test_a_supply_that_lags_falls_to_where_one_falls_at_once_and_later(loader: Machine) -> None:
    time = np.arange(0.0, 4.0, 0.01)
    currents = np.tile((0.0, 0.45), (len(time), 1))

    def rates(tau: float) -> Any:
        sagging = loader.with_effects({"supply_variation": {"k": 2e12, "r": 2e9, "tau": tau}})
        plant = Plant(sagging, loader.pose(*POSE))
        return plant.run(time, currents, time, plant.equilibrium(0.2)).output("rate")

    none, at_once, late = rates(0.0), rates(1e-4), rates(0.3)
    np.testing.assert_allclose(at_once, none, atol=4e-4)
    assert late[200] == pytest.approx(none[200], rel=0.01)
    assert late[:100].max() > 1.03 * none[:100].max()


def test_measured_pressures_take_the_place_of_the_constants(loader: Machine) -> None:
    measured = loader.driven_by(["tank_pressure", "supply_pressure", "angle"])
    assert measured.structure.inputs == ("retract_current", "extend_current", *DRIVING)
    time = np.arange(0.0, 4.0, 0.01)
    currents = np.tile((0.0, 0.4), (len(time), 1))
    plant, driven = Plant(loader, loader.pose(*POSE)), Plant(measured, loader.pose(*POSE))
    start = plant.equilibrium(0.2)

    def lifted(supply: float) -> Any:
        inputs = np.column_stack((currents, np.full(len(time), supply), np.full(len(time), 3e5)))
        return driven.run(time, inputs, time, start).output("angle")

    nominal = plant.run(time, currents, time, start).output("angle")
    np.testing.assert_allclose(lifted(2.0e7), nominal, rtol=1e-6)
    assert lifted(1.6e7)[-1] < nominal[-1] - 0.01
    with pytest.raises(ModelError, match=r"shape \(m, 4\)"):
        driven.run(time, currents, time, start)
    with pytest.raises(ModelError, match="supply_pressure, tank_pressure: give 4 numbers"):
        driven.derivative(start, (0.0, 0.0))


def test_compensator_loses_its_margin_where_the_measured_supply_is_too_low(p: Any) -> None:
    low = SimpleNamespace(fluid=SimpleNamespace(p_s=2.0e7), main_valve_orifices=p.main_valve_orifices)
    margin = p.main_valve_orifices.dp_c
    drop = compensator.COMPENSATED.drop
    assert float(drop(1e7, p)) == float(drop(1e7, low)) == margin
    assert float(drop(2.0e7 - 0.3 * margin, low)) == pytest.approx(0.3 * margin)
    assert float(compensator.COMPENSATED.root(2.1e7, low)) == pytest.approx(-1e3, rel=1e-3)


# ---------------------------------------------------------------------------------------------------------- cavitation


def test_cavitating_oil_loses_half_of_its_stiffness_at_p_c_and_the_supply_its_share(effects: Any) -> None:
    e = effects(cavitation={"p_c": 6e4, "c": 0.5})
    at = 6e4 - 101_325.0
    assert float(e.through("bulk_modulus", 1.2e9, pressure=at)) == pytest.approx(0.6e9)
    assert float(e.through("bulk_modulus", 1.2e9, pressure=5e6)) == pytest.approx(1.2e9, rel=1e-5)
    assert float(e.through("supply_flow", 1e-3, conductance=0.0, pressure=at)) == pytest.approx(0.75e-3)
    assert float(e.through("supply_flow", 1e-3, conductance=0.0, pressure=5e6)) == pytest.approx(1e-3, rel=1e-5)


# -------------------------------------------------------------------------------------------------------- flexibility


def test_bending_boom_acts_back_as_two_masses_on_a_spring(loader: Machine) -> None:
    """Gamma = 1: the outer part D_2 = mu D moves with q_2 + x, and the torque moves both; momentum is that of both."""
    f_n, zeta, mu = 2.0, 0.015, 0.6
    machine = loader.with_effects({"boom_flexibility": {"gain": 1.0, "f": f_n, "zeta": zeta, "mu": mu}})
    plant, rigid = Plant(machine, machine.pose(*POSE)), Plant(loader, loader.pose(*POSE))
    names = plant.state_names
    x = np.zeros(len(names))
    own = [names.index(name) for name in rigid.state_names]
    x[own] = rigid.equilibrium(0.2) * 1.05
    x[names.index("bend")], x[names.index("bend_rate")] = 0.004, -0.02
    f = plant.derivative(x, (0.0, 0.0))[0]
    inner, outer = f[names.index("rate")], f[names.index("rate")] + f[names.index("bend_rate")]
    assert (1 - mu) * inner + mu * outer == pytest.approx(rigid.derivative(x[own], (0.0, 0.0))[0][1])
    spring = (2 * pi * f_n) ** 2 * 0.004 + 2 * zeta * 2 * pi * f_n * -0.02
    assert outer == pytest.approx(-spring)


# ------------------------------------------------------------------------------------------------------ steps of the load


def test_load_leaves_the_ground_at_a_stroke_and_is_grasped_at_a_time() -> None:
    p = SimpleNamespace(payload=SimpleNamespace(mass=(120.0, -50.0), at=(0.30, 8.0)))

    def mass(time: float, position: float) -> float:
        return float(payload.mass(("stroke", "time"), lambda: time, position, p))

    assert [mass(0.0, 0.2), mass(0.0, 0.3), mass(0.0, 0.4), mass(9.0, 0.4)] == pytest.approx([0, 60, 120, 70], abs=1e-6)


def test_steps_of_the_file_are_those_of_the_recording(loader: Machine) -> None:
    steps = {
        "steps": [{"mass": 100.0, "stroke": 0.3}],
        "recordings": {"second": [{"mass": 40, "time": 2.0, "tol": 0.2}]},
    }
    machine = machine_from({**loader.document, "payload": steps | {"tol": 0.1}})
    assert machine.structure.steps == ("stroke",)
    second, first = machine.carrying("second"), machine.carrying("first")
    assert (second.structure.steps, first.structure.steps) == (("time",), ("stroke",))
    assert second.parameters["payload.mass.0"].value == (40.0,)
    assert prior_of(second, "payload.mass.0").sigma == pytest.approx(0.1 * 40)
    assert prior_of(machine, "pose.load", machine.pose(*POSE)).sigma == pytest.approx(0.05 * 200)


def test_load_in_steps_raises_the_pressure_from_its_stroke_on(loader: Machine) -> None:
    told = replace(loader, payloads={"monday": (Step(150.0, "stroke", loader.piston_position(0.3)),)})
    assert not told.carrying("c7/tuesday").structure.steps
    stepped = told.carrying("c7/monday")
    time = np.arange(0.0, 5.0, 0.01)
    currents = np.tile((0.0, 0.35), (len(time), 1))
    heads = []
    for machine in (loader, stepped):
        plant = Plant(machine, machine.pose(*POSE))
        heads.append(plant.run(time, currents, time, plant.equilibrium(0.2)))
    angle, difference = heads[1].output("angle"), heads[1].state("head_pressure") - heads[0].state("head_pressure")
    assert np.abs(difference[angle < 0.28]).max() < 1e4
    assert difference[angle > 0.35].mean() > 5e5


@pytest.mark.parametrize(
    ("section", "message"),
    [
        ({"steps": [{"mass": 100.0}]}, r"payload\.steps\[0\]: expected \{mass: \.\.\., time: \.\.\.\}"),
        ({"steps": [{"mass": "heavy", "time": 1.0}]}, r"payload\.steps\[0\]: .* time \[s\] of 0 to 100000"),
        ({"steps": [{"mass": 100.0, "time": -1.0}]}, r"payload\.steps\[0\]: .* time \[s\] of 0 to 100000"),
        ({"steps": [{"mass": 100.0, "stroke": -0.1}]}, r"payload\.steps\[0\]: .* stroke \[m\] of 0 to 100000"),
        ({"step": []}, r"payload\.step: no such key; did you mean steps"),
        ({"steps": [{"mass": 1.0, "stroke": 0.1}] * 9}, "a list of at most 8 steps"),
        ([1], "payload: expected tol, steps, recordings or told"),
        ({"told": {"heavy": 200.0}}, "payload.told: expected"),
        ({"told": {200.0: -5.0}}, "payload.told: expected"),
        ({"recordings": [1]}, r"payload\.recordings: expected the name of a recording"),
        ({"tol": -1}, r"payload\.tol: -1 is not above 0"),
    ],
)
def test_spoilt_payload_is_refused_in_one_line(loader: Machine, section: Any, message: str) -> None:
    with pytest.raises(MachineError, match=message):
        machine_from({**loader.document, "payload": section})


# ----------------------------------------------------------------------------------------------------------- tolerances


def with_tol(loader: Machine, tol: Any) -> Machine:
    fluid = loader.document["fluid"]
    return machine_from({**loader.document, "fluid": {**fluid, "beta": {"value": 1.2e9, "unit": "Pa", "tol": tol}}})


@pytest.mark.parametrize(
    ("tol", "kind", "sigma", "low", "high"),
    [
        (0.1, "normal", 0.6e8, 1e7, 5e9),
        ({"abs": 2e8}, "normal", 1e8, 1e7, 5e9),
        ({"factor": 3}, "log_normal", log(3) / 2, 1e7, 5e9),
        ({"range": [0.8e9, 1.6e9]}, "normal", 2e8, 0.8e9, 1.6e9),
    ],
)
def test_tolerance_is_two_standard_deviations(
    loader: Machine, tol: Any, kind: str, sigma: float, low: float, high: float
) -> None:
    prior = prior_of(with_tol(loader, tol), "fluid.beta")
    assert (prior.kind, prior.sigma, prior.low, prior.high) == (kind, pytest.approx(sigma), low, high)


@pytest.mark.parametrize(
    "tol", [0, -0.1, "much", {"abs": 0}, {"factor": 1}, {"range": [2e9, 3e9]}, {"sigma": 1}, [1, 2], True, None]
)
def test_what_is_no_tolerance_is_refused_in_one_line(loader: Machine, tol: Any) -> None:
    with pytest.raises(MachineError, match=r"^fluid\.beta\.tol: .*write 0\.1, \{abs: 0\.03\}"):
        with_tol(loader, tol)


def test_without_tol_the_confidence_decides(tz17: Machine) -> None:
    pose = tz17.pose(0.28, 2.8, 300.0)
    assert prior_of(tz17, "friction.tau_C_pos").sigma == pytest.approx(0.15 * 4000)  # low: 30 %
    assert prior_of(tz17, "pilot_valves.h.0").sigma == pytest.approx(0.015 * 76.1)  # thesis: 3 %
    assert prior_of(tz17, "pose.load", pose).sigma == 10.0  # 20 kg are more than 5 %
    assert prior_of(tz17, "pose.tip.0", pose).sigma == 0.0
    with pytest.raises(MachineError, match=r"fluid\.bet: no such parameter; did you mean"):
        prior_of(tz17, "fluid.bet")


def test_known_linkage_does_not_bend(tz17: Machine) -> None:
    prior, length = prior_of(tz17, "kinematics.L1"), tz17.numbers.kinematics.L1
    assert (prior.low, prior.high) == (pytest.approx(0.97 * length), pytest.approx(1.03 * length))


def test_parameter_tells_its_tolerance_relative(loader: Machine) -> None:
    assert loader.parameters["fluid.beta"].tolerance == 1.0  # factor 2
    assert loader.parameters["main_valve_orifices.x0_sa"].tolerance == pytest.approx(0.3)
    assert str(Tolerance("range", (0.0, 1e6))) == "0 .. 1e+06"


def test_a_lagging_spool_is_the_machine_with_another_natural_frequency(loader: Machine) -> None:
    slower = loader.with_effects({"spool_lag": {"r": 1.5}})
    told = loader.with_values(
        {"main_valve_spool.omega_n": loader.values(loader.pose(*POSE))["main_valve_spool.omega_n"] / 1.5}
    )
    time, currents = np.arange(0.0, 3.0, 0.01), np.tile((0.0, 0.4), (300, 1))
    runs = []
    for machine in (slower, told, loader):
        plant = Plant(machine, machine.pose(*POSE))
        runs.append(plant.run(time, currents, time, plant.equilibrium(0.2)).output("angle"))
    assert runs[0] == pytest.approx(runs[1], abs=1e-9)
    assert np.abs(runs[0] - runs[2]).max() > 1e-4


def test_a_slow_load_holding_valve_lets_the_boom_down_later_and_as_fast(loader: Machine) -> None:
    time, currents = np.arange(0.0, 6.0, 0.01), np.tile((0.4, 0.0), (600, 1))
    lowered = []
    for effects in ({}, {"load_holding_valve_lag": {"tau": 0.15}}):
        machine = loader.with_effects(effects)
        plant = Plant(machine, machine.pose(*POSE))
        lowered.append(plant.run(time, currents, time, plant.equilibrium(0.6)).output("angle"))
    rate = (lowered[0][-1] - lowered[0][-200]) / 1.99
    later = (lowered[1] - lowered[0]) / -rate
    assert 0.01 < later[-1] < 0.15
    assert np.ptp(later[-100:]) < 0.02


def test_a_load_holding_valve_that_is_set_higher_is_the_machine_with_another_set_pressure(loader: Machine) -> None:
    """The boom starts to sink later: the rod pressure must open the valve."""
    p_set = loader.parameters["hose_burst_valve.p_set"].value[0]
    time, currents = np.arange(0.0, 3.0, 0.01), np.tile((0.3, 0.0), (300, 1))
    lowered = []
    for machine in (
        loader.with_effects({"load_holding_valve_setting": {"r": 1.3}}),
        loader.with_values({"hose_burst_valve.p_set": 1.3 * p_set}),
        loader,
    ):
        plant = Plant(machine, machine.pose(*POSE))
        lowered.append(plant.run(time, currents, time, plant.equilibrium(0.6)).output("angle"))
    assert lowered[0] == pytest.approx(lowered[1], abs=1e-9)
    assert 1e-4 < (lowered[0] - lowered[2])[-1] < 0.01


def test_a_machine_without_load_holding_valve_has_no_lag_of_it(tz17: Machine) -> None:
    with pytest.raises(MachineError, match=r"effects\.load_holding_valve_lag: "):
        tz17.with_effects({"load_holding_valve_lag": {"tau": 0.1}})


def test_a_machine_with_pilot_valves_has_no_lag_of_its_own_spool(tz17: Machine) -> None:
    with pytest.raises(MachineError, match=r"effects\.spool_lag: this machine has pilot valves$"):
        tz17.with_effects({"spool_lag": {"r": 1.5}})


def test_edges_through_which_a_boom_would_be_too_fast_for_any_crane_are_doubted() -> None:
    machine = load_machine("triangle_direct")
    wide = {key: 4.0 * p.value[0] for key, p in machine.parameters.items() if key.startswith("main_valve_orifices.A_s")}

    def rates(machine: Machine) -> list[str]:
        return [row.value for row in quantities(machine) if row.meaning in ("lift: boom", "lower: boom")]

    assert [rate.endswith(" rad/s") for rate in rates(machine)] == [True, True]
    assert all("too fast for a crane" in rate for rate in rates(machine.with_values(wide)))
