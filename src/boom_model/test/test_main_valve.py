"""Main valve: flows through its edges, and what changes them; exact numbers."""

from __future__ import annotations

from math import sqrt
from typing import Any

import pytest

from boom_model.components import main_valve_orifices
from boom_model.components.compensator import COMPENSATED, UNCOMPENSATED
from boom_model.equations import namespace

HOLE = 0.65 * sqrt(2 / 870)  # C_d sqrt(2 / rho) of tz17
S_MAX, X0 = 9e-3, 0.28


def valve(p: Any, e: Any, x: float, hose: float = 60e5, rod: float = 20e5) -> tuple[float, float, float]:
    flows = main_valve_orifices.flows(x * S_MAX, hose, rod, p, e, COMPENSATED)
    return float(flows.head), float(flows.rod), float(flows.force)


@pytest.mark.parametrize("x", [-X0, -0.2, -1e-9, 0.0, 1e-9, 0.2, X0])
def test_dead_zone_is_exactly_closed(p: Any, effects: Any, x: float) -> None:
    assert valve(p, effects(flow_force={"c": 10.0}), x * 0.999_999_999) == (0.0, 0.0, 0.0)


def test_fully_open_valve_lifts_with_two_litres_per_second(p: Any, effects: Any) -> None:
    head, rod, _ = valve(p, effects(), -1.0)
    assert head == pytest.approx(HOLE * 7.17e-5 * sqrt(8e5))
    assert rod == pytest.approx(-HOLE * 4.5e-5 * sqrt(18e5), rel=1e-6)


def test_fully_open_valve_lowers_through_the_meter_out_edge(p: Any, effects: Any) -> None:
    head, rod, _ = valve(p, effects(), 1.0)
    assert head == pytest.approx(-HOLE * 4.54e-5 / (2.27 - 0.7) * sqrt(58e5), rel=1e-6)
    assert rod == pytest.approx(HOLE * 4.54e-5 * sqrt(8e5))


def test_valve_flow_does_not_depend_on_the_load_with_compensator(p: Any, effects: Any) -> None:
    assert valve(p, effects(), -0.7, hose=20e5)[0] == valve(p, effects(), -0.7, hose=150e5)[0]


def test_tank_flow_turns_round_below_tank_pressure(p: Any, effects: Any) -> None:
    assert valve(p, effects(), -1.0, rod=0.0)[1] > 0
    assert valve(p, effects(), 1.0, hose=0.0)[0] > 0


def test_opening_stays_at_its_largest_beyond_the_stroke(p: Any, effects: Any) -> None:
    assert valve(p, effects(), -1.2) == valve(p, effects(), -1.5)


def test_valve_opens_continuously(p: Any, effects: Any) -> None:
    for side in (-1.0, 1.0):
        assert all(abs(q) < 1e-9 for q in valve(p, effects(), side * (X0 + 1e-6))[:2])


def test_a_load_check_valve_holds_back_its_share_of_what_would_flow_back_and_nothing_else(
    other_make: Any, effects: Any
) -> None:
    q = namespace(other_make.values(other_make.pose(4.5, 0.0)))
    above = q.fluid.p_s + 20e5

    def flows(e: Any, hose: float) -> tuple[float, float]:
        found = main_valve_orifices.flows(-8e-3, hose, 20e5, q, e, UNCOMPENSATED)
        return float(found.head), float(found.rod)

    back, tank = flows(effects(), above)
    assert back < 0.0
    for share in (0.0, 0.4, 1.0):
        e = effects(load_check_valve={"c": share})
        assert flows(e, above) == pytest.approx(((1.0 - share) * back, tank), abs=1e-15)
        assert flows(e, 60e5) == flows(effects(), 60e5)


def test_flow_follows_supply_and_load_without_compensator(other_make: Any, effects: Any) -> None:
    q = namespace(other_make.values(other_make.pose(4.5, 0.0)))
    flows = main_valve_orifices.flows(-8e-3, 60e5, 20e5, q, effects(), UNCOMPENSATED)
    assert float(flows.head) == pytest.approx(HOLE * 1.1e-5 * sqrt(150e5), rel=1e-6)
    assert (
        float(main_valve_orifices.flows(-8e-3, 220e5, 20e5, q, effects(), UNCOMPENSATED).head) < 0
    )  # the load is heavier than the supply


def test_dead_zone_effect_shifts_one_side_only(p: Any, effects: Any) -> None:
    e = effects(valve_dead_zone={"d_extend": 0.1})
    assert valve(p, e, -0.37)[:2] == (0.0, 0.0)
    assert valve(p, e, -1.0)[0] == pytest.approx(valve(p, effects(), -1.0)[0])
    assert valve(p, e, 0.37) == valve(p, effects(), 0.37)


def test_a_limit_of_the_stroke_holds_the_edges_of_its_side_where_they_would_open_further(p: Any, effects: Any) -> None:
    e = effects(stroke_limit={"x_extend": 0.6})
    for x, edges in ((-1.0, -0.6), (-0.5, -0.5), (0.0, 0.0), (1.2, 1.2)):
        assert e.through("metering_position", x * S_MAX, p=p) == pytest.approx(edges * S_MAX)


@pytest.mark.parametrize("n", [1.0, 1.4, 2.0])
def test_droop_takes_supply_flow_only(n: float, p: Any, effects: Any) -> None:
    e, (head, rod, _) = effects(compensator_droop={"k": 0.5, "n": n}), valve(p, effects(), -1.0)
    assert valve(p, e, -1.0)[:2] == (pytest.approx(head * (1 - 0.5 * (head / 2e-3) ** n)), rod)


def test_pump_limit_caps_full_flow_and_spares_small(p: Any, effects: Any) -> None:
    e = effects(pump_flow_limit={"inverse_q_max": 1e3})  # 60 l/min
    full = HOLE * 7.17e-5 * sqrt(8e5)
    assert valve(p, e, -1.0)[0] == pytest.approx(full / (1 + (full / 1e-3) ** 32) ** (1 / 32))
    assert valve(p, e, -1.0)[0] < 1e-3
    just = effects(pump_flow_limit={"inverse_q_max": 0.9 / full})  # a stop: hardly anything is missing before it
    assert valve(p, just, -1.0)[0] == pytest.approx(full, rel=2e-3)
    assert valve(p, e, -0.5)[0] == pytest.approx(valve(p, effects(), -0.5)[0], rel=1e-3)


def test_a_pump_may_give_way_softly_and_give_less_the_higher_its_pressure(p: Any, effects: Any) -> None:
    full = HOLE * 7.17e-5 * sqrt(8e5)
    soft = effects(pump_flow_limit={"inverse_q_max": 1.0 / full, "w": 0.2})
    assert valve(p, soft, -1.0)[0] == pytest.approx(full * 2.0**-0.2)
    pump = 68e5  # 8 bar above the port
    power = effects(pump_flow_limit={"inverse_q_max": 1e3, "s": 1.0})
    assert valve(p, power, -1.0)[0] == pytest.approx(full / (1 + (full * 1e3 * pump / 1e7) ** 32) ** (1 / 32))


def test_return_line_shares_the_drop_with_the_orifice(p: Any, effects: Any) -> None:
    k = 4e11
    q = -valve(p, effects(return_line_pressure={"k": k}), -1.0)[1]
    assert (q / (HOLE * 4.5e-5)) ** 2 + k * q**2 == pytest.approx(18e5, rel=1e-6)


@pytest.mark.parametrize("n", [1.0, 1.5, 1.75, 2.0])
def test_a_return_lines_pressure_rises_with_another_power_of_the_flow(n: float, p: Any, effects: Any) -> None:
    k, q_r = 4e11, 0.1 / 60.0
    q = -valve(p, effects(return_line_pressure={"k": k, "n": n}), -1.0)[1]
    assert (q / (HOLE * 4.5e-5)) ** 2 + k * q_r**2 * (q / q_r) ** n == pytest.approx(18e5, rel=2e-3)


def test_flow_force_closes_the_spool_from_both_sides(p: Any, effects: Any) -> None:
    e = effects(flow_force={"c": 10.0})
    head, rod, force = valve(p, e, -1.0)
    assert force == pytest.approx(-10.0 * (head * sqrt(8e5) - rod * sqrt(18e5)), rel=1e-6)
    assert valve(p, e, 1.0)[2] > 0 > force
