"""Ranges of the catalogue in proportion to a machine."""

import pytest

from boom_diagnosis.coordinates import coordinates, starts
from boom_diagnosis.sizes import THESIS, MachineSize, size_of, sized
from boom_model.catalogue import CATALOGUE, EFFECTS
from boom_model.machine_file import load_machine

SMALL = MachineSize(flow=0.1, torque=0.05, load=0.2)


def test_the_crane_of_the_thesis_keeps_the_catalogue_as_it_is():
    assert size_of(load_machine("tz17")) == THESIS
    assert all(sized(effect, THESIS) is effect for effect in CATALOGUE)


def test_a_loader_crane_is_as_large_as_its_piston_moment_and_load():
    flow, torque, load = size_of(load_machine("loader_crane"))
    assert (flow, torque, load) == pytest.approx((1.31, 0.80, 0.99), abs=0.01)


@pytest.mark.parametrize(
    ("effect", "name", "factor"),
    [("payload", "mass", 0.2), ("stribeck_friction", "tau_s", 0.05), ("presliding_friction", "compliance", 20.0),
     ("piston_leakage", "c", 0.1), ("pump_flow_limit", "inverse_q_max", 10.0), ("return_line_pressure", "k", 100.0),
     ("vented_neutral", "A_v", 0.1), ("command_delay", "T", 1.0), ("pressure_bias", "hose", 1.0)],
)  # fmt: skip
def test_flows_torques_and_loads_go_with_the_machine_and_times_and_pressures_do_not(effect, name, factor):
    at = [row.name for row in EFFECTS[effect].parameters].index(name)
    told, own = coordinates(EFFECTS[effect])[at], coordinates(EFFECTS[effect], SMALL)[at]
    row = EFFECTS[effect].parameters[at]
    inside = [min(max(factor * limit, row.minimum), row.maximum) for limit in told.plausible]
    assert own.plausible == pytest.approx(inside)


def test_a_search_in_a_small_machine_begins_at_pumps_of_its_size():
    begun = [next(iter(point.values())) for point in starts(EFFECTS["pump_flow_limit"], 60.0, SMALL)]
    assert min(begun) == pytest.approx(60_000 / 12) and max(begun) == pytest.approx(60_000 / 1.3)
