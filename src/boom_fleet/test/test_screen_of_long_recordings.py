"""Long recordings in the screen: which minutes are looked at, and how many."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from boom_fleet import screen
from boom_model.machine_file import load_machine
from boom_recording.loading import load
from boom_recording.recording import Recording, part

ROOT = Path(__file__).resolve().parents[3]
PIECE = 7.0


@pytest.fixture(scope="module")
def recording() -> Recording:
    return load(ROOT / "bags/healthy/extended")


def pieces(recording, *starts):
    return [part(recording, start, start + PIECE) for start in starts]


def test_the_liveliest_minute_comes_first_and_one_that_lacks_a_channel_is_passed_over(recording, monkeypatch):
    lively, calm = pieces(recording, 52.0, 10.0)
    assert screen._travel(lively) > screen._travel(calm)
    gone = lively.signals["rod_pressure"]
    gone = replace(gone, valid=np.zeros(len(gone.valid), dtype=bool))
    missing = replace(lively, signals={**lively.signals, "rod_pressure": gone})
    monkeypatch.setattr(screen, "blocks", lambda _: iter([calm, missing]))
    without = screen.screened(recording, load_machine("tz17"), {})
    monkeypatch.setattr(screen, "blocks", lambda _: iter([calm]))
    alone = screen.screened(recording, load_machine("tz17"), {})

    assert without.seconds == alone.seconds
    assert without.vector == pytest.approx(alone.vector)


def test_minutes_are_screened_until_a_further_one_tells_little_and_the_table_says_how_much(recording, monkeypatch):
    repeated = pieces(recording, 10.0, 10.0, 10.0, 10.0, 10.0, 10.0)
    monkeypatch.setattr(screen, "blocks", lambda _: iter(repeated))
    long = screen.screened(recording, load_machine("tz17"), {})

    monkeypatch.setattr(screen, "blocks", lambda _: iter(repeated[:1]))
    one = screen.screened(recording, load_machine("tz17"), {})

    count = round(long.seconds / one.seconds)
    assert 2 <= count < len(repeated)
    assert long.columns()["screened_s"] == pytest.approx(count * one.seconds)
    assert long.matrix == pytest.approx(count * one.matrix)


def test_differences_by_the_gas_reach_across_the_corner_at_which_an_accumulator_is_empty(recording):
    """The same gas in the file's numbers and in the effect: by the same share, less of it."""
    (block,) = pieces(recording, 10.0)
    one = screen._PreparedBlock.of(block, load_machine("tz17"))
    steps = {u.name: (step, u) for step, u in zip(one.numbers.steps, one.numbers.unknowns, strict=True)}
    shares = [
        u.value(step) / u.value(0.0) for name, (step, u) in steps.items() if "precharge" in name or "p_g0" in name
    ]

    assert len(shares) == 3
    assert shares == pytest.approx([0.955] * 3)
    assert all(step > 0.0 for name, (step, _) in steps.items() if "precharge" not in name and "p_g0" not in name)


def test_an_effect_far_from_linear_has_a_difference_to_each_of_its_points(recording):
    """Less gas in the first accumulator alone is what it is in a machine whose file says so."""
    (block,) = pieces(recording, 10.0)
    machine = load_machine("tz17")
    one = screen._PreparedBlock.of(block, machine)
    point = next(p for p in one.numbers.far if p.name.endswith("precharge.towards r = 0.35, r_2 = 2.9"))
    at = np.zeros(len(one.problem.unknowns))
    gains = one.problem.gains(at, one.problem.first_gains(), level=screen.LEVEL)
    (here,), (there,) = one.problem.observed_with([{}, point.values], at, gains)
    charge = machine.parameters["accumulators.p_g0_1"].value[0]
    less = machine.with_values({"accumulators.p_g0_1": 0.35 * charge})
    (said,) = screen._PreparedBlock.of(block, less).problem.observed(at, gains)

    assert point.z == pytest.approx((0.35 - 1.0) / 0.45)
    apart = np.nanmax(np.abs(there.innovations - said.innovations), axis=0)
    assert (apart < 1e-3 * np.nanstd(said.innovations, axis=0)).all()
    assert np.nanmax(np.abs(there.innovations - here.innovations)) > 1e4
    expanded = one.expanded(np.zeros(len(one.numbers.names)))
    k = one.numbers.names.index(point.name)
    assert expanded.names == one.numbers.names
    assert expanded.matrix[k, k] > 0.0
