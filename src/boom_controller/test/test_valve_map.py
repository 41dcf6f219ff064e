"""The closed form of (6.23) against a numeric root of the orifice areas themselves."""

from __future__ import annotations

import pytest
from scipy.optimize import brentq

from boom_controller.blocks.valve_map import ValveMap
from boom_model.component_numbers import component_parameters
from boom_model.components import main_valve_orifices
from boom_model.machine_file import load_machine
from boom_model.slots import NO_CUSHIONS

MACHINE = load_machine("tz17")
P, E = component_parameters(MACHINE, MACHINE.pose(0.28, 2.2))
MAP = ValveMap(MACHINE.structure, P, E)
STROKE = P.main_valve_spool.s_max
PSI, OMEGA = 3.1e9, 0.7e9  # effect per area of the supply and of the tank edge


def effect(position: float, supply: float, tank: float) -> float:
    a, b = main_valve_orifices.areas(position, P, E)
    return float(supply * a + tank * b)


@pytest.mark.parametrize("share", [0.02, 0.1, 0.3, 0.6, 0.9])
def test_the_position_is_that_of_a_numeric_root_of_the_areas(share: float) -> None:
    wanted = share * effect(-STROKE, PSI, OMEGA)
    root = brentq(lambda s: effect(-s, PSI, OMEGA) - wanted, 0.0, STROKE)
    assert MAP.extending(wanted, PSI, OMEGA) == pytest.approx(root, abs=5e-3 * STROKE)

    wanted = -share * effect(STROKE, OMEGA, PSI)
    root = brentq(lambda s: -effect(s, OMEGA, PSI) - wanted, 0.0, STROKE)
    assert MAP.retracting(wanted, -PSI, -OMEGA) == pytest.approx(root, abs=5e-3 * STROKE)


@pytest.mark.parametrize("share", [-0.9, -0.05, 0.001, 0.05, 0.4, 0.99])
def test_the_spool_gives_the_flows_that_are_wanted_of_it(share: float) -> None:
    flows = MAP.flows(8e6, 1.5e6, NO_CUSHIONS)
    a, b = PSI, OMEGA
    head, rod, _ = flows.at(-STROKE if share > 0 else STROKE)
    wanted = abs(share) * (a * head - b * rod)
    head, rod, _ = flows.at(flows.spool(wanted, a, b, STROKE))
    assert float(a * head - b * rod) == pytest.approx(float(wanted), rel=1e-9)


def test_the_flows_are_those_of_the_model_with_its_effects() -> None:
    other = MACHINE.with_effects({"compensator_droop": {"k": 0.3}, "flow_force": {"c": 20.0}})
    p, e = component_parameters(other, other.pose(0.28, 2.2))
    there = ValveMap(other.structure, p, e)
    position = -there.extend[9][0]
    metering = other.structure.metering
    exact = metering.flows(position, 8e6, 1.5e6, p, e, other.structure.supply, NO_CUSHIONS)
    at = there.flows(8e6, 1.5e6, NO_CUSHIONS).at(position)
    assert [float(v) for v in at] == pytest.approx([float(exact.head), float(exact.rod), float(exact.force)])
    assert float(at[2]) < 0.0  # it pushes a spool that extends towards the middle
    assert float(at[0]) < float(MAP.flows(8e6, 1.5e6, NO_CUSHIONS).at(position)[0])


def test_nothing_wanted_is_the_edge_of_the_dead_zone_and_too_much_the_largest_opening() -> None:
    assert MAP.extending(0.0, PSI, OMEGA) == pytest.approx(P.main_valve_orifices.x0 * STROKE)
    assert MAP.retracting(0.0, -PSI, -OMEGA) == pytest.approx(P.main_valve_orifices.x0 * STROKE)
    assert MAP.extending(1e9, PSI, OMEGA) == pytest.approx(MAP.extend[-1][0])
    assert STROKE < MAP.extend[-1][0] <= main_valve_orifices.LARGEST_OPENING * STROKE
    inside = MAP.flows(8e6, 1.5e6, NO_CUSHIONS).at(0.5 * P.main_valve_orifices.x0 * STROKE)
    assert [float(v) for v in inside] == [0.0, 0.0, 0.0]
