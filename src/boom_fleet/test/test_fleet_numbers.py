"""In which numbers a machine may differ from its file, and what a change is called."""

import pytest

from boom_fleet.numbers import numbers_of, present
from boom_model.machine_file import load_machine
from boom_model.plant import Plant
from boom_model.prior import prior_of


@pytest.fixture(scope="module")
def machine():
    return load_machine("tz17")


@pytest.fixture(scope="module")
def numbers(machine):
    pose = machine.pose(0.28, 2.2, 0.0)
    return numbers_of(machine, pose, Plant(present(machine), pose, "full"))


def test_every_number_with_a_tolerance_is_one_that_a_sound_crane_may_have_otherwise(machine, numbers):
    """The exponent of the valve's opening was not: cranes with another one seemed to have a pressure in the return line."""
    told = {c for p in machine.parameters.values() for c in p.specification.components}
    missing = {name for name in told - set(numbers.names) if prior_of(machine, name).sigma > 0.0}
    in_the_plant = {
        name for name in missing if name in Plant(machine, machine.pose(0.28, 2.2, 0.0), "full").parameter_names
    }

    assert {"main_valve_orifices.n", "accumulators.kappa"} <= set(numbers.names)
    assert all(
        name.startswith(("constants.", "cylinder.l_", "hose_burst_valve.unit_"))
        or name
        in ("pilot_valves.b0_s", "main_valve_spool.A_s", "main_valve_spool.s_max", "main_valve_orifices.A_ta_law.c1")
        for name in in_the_plant
    ), sorted(in_the_plant)


def test_tolerated_numbers_come_first_and_each_quantity_moves_numbers_that_are_there(numbers):
    effects = [name.startswith("effects.") for name in numbers.names]
    assert effects == [False] * numbers.tolerated + [True] * (len(effects) - numbers.tolerated)
    assert {name for q in numbers.quantities for column in q.columns for name, _ in column.direction} <= set(
        numbers.names
    )
    assert len({q.id for q in numbers.quantities}) == len(numbers.quantities)


def test_where_a_search_starts_beyond_half_of_an_effects_range_there_is_a_difference_to_it(numbers):
    """A lag of 80 ms was restlessness: beside nothing its derivative says what 0.1 ms of it do."""
    half, lag = (point for point in numbers.far if "hose_burst_valve_lag" in point.name)
    assert [point.values for point in (half, lag)] == [{"effects.hose_burst_valve_lag.tau": tau} for tau in (0.05, 0.1)]
    quantity = next(q for q in numbers.quantities if q.id == "hose_burst_valve_lag")
    assert quantity.size(lag.z) == pytest.approx(0.1)
    assert [column.id for column in quantity.columns] == ["effects.hose_burst_valve_lag.tau", half.name, lag.name]
    assert not any("spring_rate.towards" in point.name for point in numbers.far)


def test_points_at_which_the_same_numbers_move_are_of_one_quantity_with_what_the_leading_one_does_beside_nothing(
    numbers,
):
    nodes = {q.id: [q.size(c.node) for c in q.columns] for q in numbers.quantities if q.name == "accumulator_precharge"}
    steps = dict(zip(numbers.names, numbers.steps, strict=False))

    assert nodes == {
        "accumulator_precharge": pytest.approx(
            [0.35, 0.7, 0.7**0.5, 1.0 + 0.45 * steps["effects.accumulator_precharge.r"], 1.08]
        ),
        "accumulator_precharge.r and r_2": pytest.approx([0.35, 0.7, 0.7**0.5]),
        "accumulator_precharge.r_2": pytest.approx([0.35, 0.7, 0.7**0.5]),
    }
