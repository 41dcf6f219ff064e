"""Long recordings: which stretches are searched, and the proof over all the others."""

from dataclasses import replace
from math import nan
from pathlib import Path

import numpy as np
import pytest
from diagnosis_samples import joined

from boom_diagnosis.bag_samples import prepare
from boom_diagnosis.case import case_of
from boom_diagnosis.freerun import Elsewhere, Span, errors, median
from boom_diagnosis.proof import fit_and_ladder, free_runs, placed, said_of_blocks, spans_of
from boom_diagnosis.stretches import stretches, tells_nothing
from boom_model.machine_file import load_machine
from boom_recording.loading import load
from boom_recording.recording import BLOCK, blocks, part

ROOT = Path(__file__).resolve().parents[3]
LAG = {"hose_burst_valve_lag": {"tau": 0.09}}


@pytest.fixture(scope="module")
def machine():
    return load_machine("tz17")


@pytest.fixture(scope="module")
def shift():
    """Four minutes: the valve lags in the third."""
    well, lags = (
        part(load(ROOT / "bags" / bag), 0.0, BLOCK) for bag in ("healthy/extended", "explained/hose_burst_valve_lag_a")
    )
    return joined([well, well, lags, well])


@pytest.fixture(scope="module")
def chosen(shift, machine):
    return stretches([shift], [], machine)


def test_blocks_are_the_whole_recording_and_a_minute_each(shift):
    found = list(blocks(shift))
    assert [block.duration for block in found] == pytest.approx([BLOCK] * 4)
    assert sum(len(b.signals["angle"].values) for b in found) == len(shift.signals["angle"].values)


def test_a_long_recording_is_searched_where_the_machine_file_fails_most(chosen):
    assert chosen.recordings[0].name == "shift from 120 s"
    assert len(chosen.recordings) == 2 and len(chosen.held_out) == 1
    fitted = {r.name for r in chosen.recordings}
    assert fitted | {b.name for b in chosen.others} == {f"shift from {s} s" for s in (0, 60, 120, 180)}
    assert not fitted & {b.name for b in chosen.others}


@pytest.mark.parametrize(
    ("apart", "told"),
    [(10, ""), (100, "the angle was sampled every 1 s, and 0.15 s are the most: log 100 samples a second")],
)
def test_a_recording_tells_something_at_ten_samples_a_second_and_why_it_does_not_at_one(shift, machine, apart, told):
    angle = shift.signals["angle"]
    fewer = {name: getattr(angle, name)[::apart] for name in ("stamps_ns", "time", "values", "valid")}
    seldom = part(replace(shift, signals={**shift.signals, "angle": replace(angle, **fewer)}), 0.0, BLOCK)
    assert tells_nothing(seldom, prepare(seldom, machine)) == told


def test_a_recording_whose_angle_is_no_number_says_that(shift, machine):
    angle = shift.signals["angle"]
    broken = replace(shift, signals={**shift.signals, "angle": replace(angle, valid=np.zeros_like(angle.valid))})
    assert (
        tells_nothing(broken, None) == f"none of {len(angle.time)} samples of the angle can be used: repair the logger"
    )


def test_short_recordings_are_searched_as_they_are(shift, machine):
    short = part(shift, 0.0, 3 * BLOCK)
    same = stretches([short], [short], machine)
    assert (same.recordings, same.held_out, same.others) == ((short,), (short,), ())


def test_the_other_blocks_are_placed_in_time_against_the_first_that_is_searched(chosen):
    begins = {int(b.recording.name.split()[2]): b.later for b in chosen.elsewhere}
    assert begins == pytest.approx({at: at - 120.0 for at in begins})
    assert len(begins) == len(chosen.others) > 0


@pytest.fixture(scope="module")
def answered(shift, machine):
    """The shift, whose third minute alone was explained."""
    parts = stretches([shift], [], machine)
    lags = next(r for r in parts.recordings if r.name == "shift from 120 s")
    well = tuple(replace(b, name=f"minute {k}") for k, b in enumerate(blocks(shift)) if b.start_ns != lags.start_ns)
    case = case_of(machine, [prepare(lags, machine)], [prepare(well[0], machine)], 0)
    case.elsewhere = tuple(Elsewhere(b, None) for b in (*well[1:], replace(lags, name="once more")))
    spans = spans_of(case)
    machines = {"nominal": machine, "parameters_only": machine, "explained": machine.with_effects(LAG)}
    driven = {label: free_runs(m, case, spans) for label, m in machines.items()}
    fit, _ = fit_and_ladder(case, machines, driven, spans)
    return case, fit, driven


def test_held_out_errors_are_those_of_every_block_that_nothing_was_fitted_to(answered):
    case, fit, driven = answered
    assert len(fit.held_out_bags) == 4
    rows = [
        *driven["explained"].elsewhere,
        errors(Span(case.proving[0].recording, 0.0, BLOCK), driven["explained"].runs[1]),
    ]
    assert fit.held_out["explained"] == pytest.approx(np.median(rows, axis=0))
    assert "medians over 4 blocks of a minute" in said_of_blocks(case, fit)[0]


def test_blocks_that_contradict_what_was_found_are_named(answered):
    _, fit, _ = answered
    assert len(fit.far) == 2
    assert "once more" not in fit.far, "the minute through which it lags"


def test_an_effect_that_sets_in_does_so_at_the_same_moment_in_every_block_of_its_recording(chosen, machine):
    case = case_of(machine, [prepare(r, machine) for r in chosen.recordings], [], 0)
    case.elsewhere = (Elsewhere(chosen.others[0], 30.0),)
    grasped = machine.with_effects({"payload_change": {"mass": 200.0, "t_g": 45.0}})
    block = Span(chosen.others[0], 0.0, BLOCK)
    assert placed(grasped, case, block).effects["payload_change"]["t_g"] == 15.0
    case.elsewhere = (Elsewhere(chosen.others[0], None),)
    assert placed(grasped, case, block) is grasped, "of another recording nothing is known"


@pytest.mark.parametrize(
    ("rows", "expected"), [([0.1, 0.3, nan], 0.3), ([0.1, nan, nan], nan), ([0.2, nan], nan), ([], nan)]
)
def test_a_run_that_ended_early_errs_without_end_in_the_median(rows, expected):
    assert median([(row,) * 4 for row in rows])[0] == pytest.approx(expected, nan_ok=True)
