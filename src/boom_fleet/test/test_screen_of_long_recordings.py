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
    steps = dict(zip(one.numbers.names, zip(one.steps, one.numbers.unknowns, strict=True), strict=True))
    shares = [
        u.value(step) / u.value(0.0) for name, (step, u) in steps.items() if "precharge" in name or "p_g0" in name
    ]

    assert len(shares) == 3
    assert shares == pytest.approx([0.955] * 3)
    assert all(step > 0.0 for name, (step, _) in steps.items() if "precharge" not in name and "p_g0" not in name)
