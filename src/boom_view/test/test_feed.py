"""The running machine as the pages see it: rows, the model beside it, marks, and runs that follow each other."""

import json

import numpy as np
import pytest

from boom_model.machine_file import shipped_machine
from boom_model.plant import Plant
from boom_model.sensors import OUTPUTS
from boom_sim.simulated_crane import CraneStart, SimulatedCrane
from boom_view.feed import KEEP, Feed
from boom_view.twin import Twin


def moved(time, begin, end):
    """A lever between two times [s], with ramps of a hand."""
    return float(np.clip(min(time - begin, end - time) / 0.3, 0.0, 1.0))


def play(feed, effects, seconds, *, begin=0.0):
    """A crane that rests, lifts, rests and lowers quickly, its samples given to the feed as topics would bring them."""
    machine = shipped_machine("tz17").with_effects(effects)
    crane = SimulatedCrane(machine, machine.pose(0.28, 2.2), CraneStart(0.3), machine.sensor_noise(), 3)
    for k in range(round(seconds * 100)):
        crane.command(0.55 * moved(k * 0.01, 4.0, 5.5), 0.5 * moved(k * 0.01, 1.5, 3.0))
        sample = crane.advance()
        at = begin + sample.time
        feed.add(
            begin + sample.current_time, retract_current=sample.retract_current, extend_current=sample.extend_current
        )
        feed.add(at, angle=sample.angle, rate=sample.rate)
        feed.add(at, hose_pressure=sample.hose_pressure)
        feed.add(at, rod_pressure=sample.rod_pressure)
        feed.flush(0.0)


def configured():
    feed, machine = Feed(), shipped_machine("tz17")
    feed.configure(machine, machine.pose(0.28, 2.2))
    return feed


def columns(feed):
    return np.array([[np.nan if v is None else v for v in row] for row in feed.rows])


@pytest.mark.parametrize(("effects", "parts"), [({}, False), ({"hose_burst_valve_lag": {"tau": 0.09}}, True)])
def test_the_model_follows_a_machine_like_it_and_parts_from_another(effects, parts):
    feed = configured()
    play(feed, effects, 7.0)
    rows = columns(feed)
    assert np.diff(rows[:, 0]) == pytest.approx(0.01)
    measured, model = rows[:, 1], rows[:, 1 + (rows.shape[1] - 1) // 2]
    begins = np.flatnonzero(np.isfinite(model))[0]
    assert 0.9 < rows[begins, 0] < 1.2  # it has rested for a second
    assert np.isfinite(model[begins:]).all()
    assert np.abs(model - measured)[begins:].max() < 0.01
    assert bool(json.loads(feed.marks)) == parts


@pytest.mark.parametrize(("retract", "extend", "begins"), [(0.2, 0.2, True), (0.2, 0.24, True), (0.0, 0.29, False)])
def test_the_model_begins_where_the_spool_rests_in_its_overlap_whatever_both_solenoids_get(retract, extend, begins):
    """A controller that holds the boom has oil in both pilot lines."""
    machine = shipped_machine("tz17")
    pose = machine.pose(0.28, 2.2, 0.0)
    plant, twin = Plant(machine, pose), Twin(machine, pose)
    rest = dict(zip(OUTPUTS, plant.outputs(plant.rest_state(0.4, 0.0, 2e6)).tolist(), strict=True))
    shown = {}
    for k in range(120):
        twin.current(0.01 * k, retract, extend)
        shown = twin.advance(0.01 * k, rest)
    assert bool(shown) is begins


def test_another_run_begins_where_the_clock_jumps():
    feed = configured()
    play(feed, {}, 1.0)
    run = feed.run
    play(feed, {}, 1.0, begin=-500.0)
    assert feed.run == run + 1 and columns(feed)[:, 0].max() < 0.0


def test_a_page_gets_the_last_minute_and_is_told_when_nothing_comes_any_more():
    feed = configured()
    for k in range(round((KEEP + 5) * 100)):
        feed.add(k * 0.01, angle=0.3, rate=0.0)
        feed.flush(0.0)
    assert feed.rows[-1][0] - feed.rows[0][0] == pytest.approx(KEEP, abs=0.02)
    feed.flush(1.0)
    feed.flush(5.0)
    assert feed.state.startswith("No angle for 4 s")


def test_a_current_that_is_no_number_leaves_the_model_alone():
    feed = configured()
    for k in range(100):
        feed.add(k * 0.01, **({"retract_current": 0.1} if k % 2 else {"extend_current": 0.1}))
        feed.add(k * 0.01, angle=0.3, rate=0.0)
        feed.flush(0.0)
    assert feed.rows and feed.rows[-1][0] > 0.9


def test_rows_are_in_order_and_a_fast_sensor_is_thinned_out_so_that_a_minute_of_it_stays():
    feed = configured()
    for k in range(40_000):
        feed.add(
            k * 5e-4 - (1.0 if k > 20_000 else 0.0), angle=0.3, rate=0.0
        )  # somebody sets the clock back by a second
    feed.flush(0.0)
    apart = np.diff(columns(feed)[:, 0])
    assert (apart > 0.0039).all() and len(feed.rows) < 20 / 0.0039


def live(feed):
    for now in (0.0, 1.0, 3.0):
        feed.flush(now)
    return feed.state


def test_a_page_says_why_samples_that_arrive_are_not_shown():
    feed = configured()
    assert live(feed).startswith("Waiting for the machine")
    feed.refused("/joint_states has no joint j")
    assert "no joint j" in live(feed)
    for k in range(10):
        feed.add(k * 0.01, angle=0.3, rate=0.0)
        feed.add(k * 0.01 - 500.0, retract_current=0.1, extend_current=0.1)
    assert "500 s apart" in live(feed)
    feed.add(0.0, angle=0.3)
    feed.add(0.0, angle=0.3)
    assert live(feed).startswith("Live")
    feed.add(0.0, angle=0.3)
    feed.flush(6.0)
    assert "stand still" in feed.state


def test_a_page_says_what_is_missing_where_no_machine_is_known_or_it_cannot_be_shown():
    feed = Feed()
    for k in range(10):
        feed.add(k * 0.01, angle=0.3)
    assert "no /boom/machine_configuration" in live(feed)
    feed.unknown("The machine cannot be shown.")
    assert live(feed) == "The machine cannot be shown."
