"""The concealed plant alone: what is neutral changes nothing, what is not does; ranges; time."""

from pathlib import Path

import numpy as np
import pytest

from concealed_plant import sensing
from concealed_plant.cases import CaseSpec
from concealed_plant.concealments import CONCEALMENTS
from concealed_plant.detectability import DetectionSetting, outputs, scene, together
from concealed_plant.generator import _crane
from concealed_plant.hidden import Hidden, Sensing
from concealed_plant.kernel import limited, orifice, spear, stiffness
from concealed_plant.machine import DEVIATIONS_IN_TOLERANCE, MachineFile, Posture, linkage, quantities, scattered
from concealed_plant.operator import Operator
from concealed_plant.plant import InitialValues, RunError, per_millisecond, run

FILE = Path(__file__).parents[2] / "boom_model" / "boom_model" / "machines" / "tz17.yaml"
DURATION = 14.0


@pytest.fixture(scope="module")
def setting():
    specimen, pose, start = MachineFile.read(FILE), Posture(0.28, 2.2, 0.0), InitialValues(0.5)
    driver = Operator(quantities(specimen, pose), linkage(specimen), np.random.default_rng(3))
    currents, starts = driver.drive(DURATION, start.angle, "work")
    return DetectionSetting(specimen, pose, start, currents, starts)


@pytest.fixture(scope="module")
def plain(setting):
    m, table = quantities(setting.specimen, setting.pose), linkage(setting.specimen)
    undisturbed = run(m, table, setting.start, per_millisecond(setting.currents))
    return m, table, undisturbed, scene(m, setting, undisturbed)


@pytest.mark.parametrize("name", sorted(CONCEALMENTS))
def test_a_small_size_does_next_to_nothing_and_a_larger_one_more(name, setting, plain):
    m, table, undisturbed, there = plain
    row, draws = CONCEALMENTS[name], np.array([0.3, 0.6, 0.4, 0.7, 0.2])
    scale = undisturbed.outputs.std(axis=0)

    def moved(size):
        changed = outputs(m, table, setting, row.build(size, draws, there))
        return float(np.sqrt(np.mean(((changed - undisturbed.outputs) / scale) ** 2)))

    small, larger = moved(row.smallest), None
    size = row.smallest
    for _ in range(6):  # up in size until the crane shows it, at most to where it leaves its range
        size = min(4.0 * size, row.largest)
        try:
            larger = moved(size)
        except RunError:
            break
        if larger > max(3.0 * small, 1e-3):
            break
    assert small < 0.12
    if name == "end_cushioning":  # this operator stays away from the ends of stroke
        assert larger is not None and larger >= small
        return
    assert larger is not None and larger > 2.0 * small


def test_effects_in_one_machine_keep_what_each_of_them_changes(plain):
    *_, there = plain
    draws = np.full(5, 0.5)
    names = ("payload_change", "angle_offset", "command_delay", "piston_leakage")
    parts = [CONCEALMENTS[n].build(CONCEALMENTS[n].smallest, draws, there) for n in names]
    both = together(parts)
    assert both.courses.load is parts[0].courses.load
    assert both.sensing.angle_offset == parts[1].sensing.angle_offset
    assert both.late is parts[2].late
    assert both.changes["seal_gap"] == parts[3].changes["seal_gap"]
    assert both.onset == parts[0].onset
    assert together([]) == Hidden()


def test_a_crane_that_leaves_its_range_is_an_error_with_its_time(setting, plain):
    m, table, *_ = plain
    full = np.zeros((1200, 2))
    full[100:, 0] = 0.55  # lower on and on
    with pytest.raises(RunError, match=r"left its range at \d"):
        run(m, table, setting.start, per_millisecond(full))


def test_neutral_sensors_show_what_is_there():
    shown = np.random.default_rng(0).standard_normal((200, 4))
    assert np.array_equal(sensing.seen(shown, Sensing()), shown)


def test_late_currents_come_later_by_their_dead_time():
    currents = np.array([[0.0, 0.1], [0.0, 0.2], [0.0, 0.3]])
    held = per_millisecond(currents, np.array([4.0, 4.0, 4.0]))
    assert held[:4, 1].tolist() == [0.0] * 4
    assert held[4:14, 1].tolist() == [0.1] * 10
    assert held[14, 1] == 0.2


def test_specimens_stay_within_their_tolerances_and_differ():
    machine, pose = MachineFile.read(FILE), Posture(0.28, 2.2, 0.0)
    first, second = (scattered(machine, pose, np.random.default_rng(k), 0.5) for k in (1, 2))
    assert first != second
    for key, factor in first.items():
        assert abs(factor - 1.0) <= machine.tolerance(key, pose) + 1e-12


def test_conductances_have_the_form_that_is_documented(plain):
    m = plain[0]
    assert orifice(1.0, 4.0e8) * 4.0e8 == pytest.approx(np.sqrt(4.0e8), rel=1e-3)
    assert stiffness(1e7, m) == pytest.approx(1.0 / m.bulk)
    airy = m._replace(air=0.01, air_dissolves=4.0e6)
    assert stiffness(1e5, airy) > 3.0 * stiffness(1e7, airy)
    assert stiffness(1e7, airy) == pytest.approx(1.0 / m.bulk), "above its pressure the air is dissolved"
    stiff = m._replace(spear_resistance=1e9, spear_length=0.05)
    assert spear(0.05, stiff) == 0.0
    assert spear(0.0, stiff) == 1e9
    flow = [-limited(-d, m) * d for d in (1e5, 2e6, 1e7)]
    assert flow[0] > flow[1] > flow[2] or flow[0] < 0


def test_the_label_of_the_hose_burst_valve_is_the_flow_that_it_limits(plain):
    """q = a_31 dp + a_30 F beyond the knee: half the preload F is more than half the flow."""
    m, _, _, there = plain
    hidden = CONCEALMENTS["hose_burst_valve_setting"].build(0.5, np.array([0.3, 0.6, 0.4, 0.7, 0.2]), there)
    drop = there.limited_drop / 1e5
    assert drop <= 2.0 * m.hbv_30 / (m.hbv_21 - m.hbv_31)
    flows = [m.hbv_31 * drop + m.hbv_30 * preload for preload in (1.0, hidden.changes["poppet_preload"])]
    assert hidden.parameters["r"] == pytest.approx(flows[1] / flows[0])
    assert 0.5 < hidden.parameters["r"] < 0.8


def test_a_wrong_number_is_off_by_what_is_said_and_no_more():
    file, seen = MachineFile.read(FILE), 0
    for seed in range(30):
        crane = _crane(CaseSpec("x", (seed, 0), "parameters"), file, np.random.default_rng(seed))
        for key in set(crane.wrong) & {
            "main_valve_spool.k",
            "accumulators.p_g0_1",
            "accumulators.p_g0_2",
            "friction.tau_C_pos",
        }:
            factor = 1.0 + crane.wrong[key] * file.tolerance(key, crane.told) / DEVIATIONS_IN_TOLERANCE
            assert crane.specimen.number(key) == pytest.approx(factor * file.number(key))
            seen += 1
    assert seen > 3
