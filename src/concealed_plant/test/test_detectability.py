"""What a recording can show: numbers within tolerance, the start and the load imitate what they can, and it counts for nothing."""

from pathlib import Path

import numpy as np
import pytest

from concealed_plant.concealments import CONCEALMENTS
from concealed_plant.detectability import NUMBERS, Detectability, DetectionSetting
from concealed_plant.kernel import STEPS
from concealed_plant.machine import MachineFile, Posture, linkage, quantities
from concealed_plant.operator import Operator
from concealed_plant.plant import InitialValues, RunError, per_millisecond, run

FILE = Path(__file__).parents[2] / "boom_model" / "boom_model" / "machines" / "tz17.yaml"
DRAWS = np.array([0.3, 0.6, 0.4, 0.7, 0.2])


def at_work(load=0.0):
    specimen, pose, start = MachineFile.read(FILE), Posture(0.28, 2.2, load), InitialValues(0.5)
    driver = Operator(quantities(specimen, pose), linkage(specimen), np.random.default_rng(3))
    currents, starts = driver.drive(14.0, start.angle, "work")
    return Detectability(DetectionSetting(specimen, pose, start, currents, starts), np.random.default_rng(4))


@pytest.fixture(scope="module")
def seen():
    return at_work()


def started(seen, start):
    setting = seen._setting
    return run(seen.m, seen.linkage, start, per_millisecond(setting.currents)).outputs


def test_a_number_that_is_off_by_its_standard_deviation_is_worth_one(seen):
    d, z = seen.separation(seen._moved({"fluid.beta": 1.0}))
    assert 0.2 < d < 1.1
    assert np.abs(z).max() < 1.5


def test_the_same_number_is_worth_far_more_where_it_may_not_move(seen):
    changed = seen._moved({"main_valve_spool.k": 1.0})
    free, _ = seen.separation(changed)
    held, z = seen.separation(changed, ("main_valve_spool.k", "pilot_valves.h.0"))
    assert held > 3.0 * free
    assert z[NUMBERS.index("main_valve_spool.k")] == 0.0


def test_beside_another_effect_a_number_within_tolerance_is_worth_next_to_nothing(seen):
    other = seen.seen(CONCEALMENTS["rate_scale"].build(0.05, DRAWS, seen.scene)) - seen.plain
    assert seen.beside(seen.plain + other, seen.plain + other) == 0.0
    stiffer = seen.plain + seen._change({"fluid.beta": 1.0}) + other
    assert seen.beside(stiffer, seen.plain + other) < 0.1 * seen.detectable
    moved = seen._moved({"main_valve_spool.k": 1.0}) + other
    held = seen.beside(moved, seen.plain + other, ("main_valve_spool.k", "pilot_valves.h.0"))
    assert held > 3.0 * seen.beside(moved, seen.plain + other)


def test_where_the_boom_starts_is_not_told(seen):
    higher = started(seen, InitialValues(0.52))
    assert np.linalg.norm(seen._white(higher - seen.plain)) > 50.0
    assert seen.separation(higher)[0] < 1.0


def test_a_load_that_was_told_is_known_to_twenty_kilograms_only():
    loaded = at_work(200.0)
    assert loaded.separation(loaded._moved({"load": 1.0}))[0] < 1.1
    assert not at_work()._numbers[:, NUMBERS.index("load")].any()
    assert loaded._numbers[:, NUMBERS.index("load")].any()


@pytest.mark.parametrize("name", ["accumulator_precharge", "spring_rate", "pilot_lag"])
def test_an_effect_that_is_a_number_begins_where_its_tolerance_ends(seen, name):
    row = CONCEALMENTS[name]
    assert seen.detectable_size(row, DRAWS) > row.tolerance > 0.0


def test_the_detectable_size_has_the_signature_that_is_asked(seen):
    row = CONCEALMENTS["rate_scale"]
    size = seen.detectable_size(row, DRAWS)
    d, _ = seen.separation(seen.seen(row.build(size, DRAWS, seen.scene)))
    assert d == pytest.approx(seen.detectable, rel=0.3)


@pytest.mark.parametrize("name", ["accumulator_restrictor", "hose_burst_valve_setting", "payload"])
def test_looking_on_with_fresh_sensitivities_does_not_imitate_an_effect_at_its_detectable_size(seen, name):
    row = CONCEALMENTS[name]
    size = seen.detectable_size(row, DRAWS)
    changed = seen.seen(row.build(size - row.tolerance, DRAWS, seen.scene))
    d, z = seen.separation(changed, row.twins)
    for _ in range(3):
        d, z = seen.separation(changed, row.twins, z, seen._sensitivities(dict(zip(NUMBERS, z, strict=True))))
    assert d > 0.5 * seen.detectable


def test_an_effect_that_does_nothing_at_small_sizes_has_its_detectable_size(seen, monkeypatch):
    row, whole = CONCEALMENTS["command_delay"], seen.seen
    size, idle = seen.detectable_size(row, DRAWS), []

    def limited(hidden):
        if hidden.parameters["T"] > 0.5 * size:
            return whole(hidden)
        idle.append(hidden)
        return seen.plain

    monkeypatch.setattr(seen, "seen", limited)
    assert seen.detectable_size(row, DRAWS) == pytest.approx(size, rel=0.1)
    assert len(idle) > 1


def test_a_crane_that_leaves_its_range_before_the_effect_shows_has_no_detectable_size(seen, monkeypatch):
    row, whole = CONCEALMENTS["command_delay"], seen.seen
    least = 0.3 * seen.detectable_size(row, DRAWS)

    def limited(hidden):
        if hidden.parameters["T"] > least:
            raise RunError("the crane left its range")
        return whole(hidden)

    monkeypatch.setattr(seen, "seen", limited)
    with pytest.raises(RunError):
        seen.detectable_size(row, DRAWS)


def test_a_crane_that_leaves_its_range_with_coarser_steps_has_no_detectable_size(monkeypatch):
    fresh = at_work()
    whole = fresh._moved

    def fails(deviations, steps=STEPS):
        if steps < STEPS:
            raise RunError("the crane left its range")
        return whole(deviations, steps)

    monkeypatch.setattr(fresh, "_moved", fails)
    with pytest.raises(RunError):
        fresh.detectable_size(CONCEALMENTS["command_delay"], DRAWS)
