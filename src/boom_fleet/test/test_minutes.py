"""Long recordings in the screen: which minutes are looked at, and how many."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from boom_estimation.design import sharpens
from boom_fleet import screen
from boom_fleet.minutes import in_order, lasting
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


def test_a_minute_in_which_the_boom_moves_otherwise_comes_before_one_that_repeats_another(recording):
    order = in_order(pieces(recording, 10.0, 10.0, 30.0))

    assert 2 in order[:2] and sorted(order) == [0, 1, 2]


def test_a_minute_that_lacks_a_channel_comes_last(recording):
    (block,) = pieces(recording, 10.0)
    gone = block.signals["rod_pressure"]
    gone = replace(gone, valid=np.zeros(len(gone.valid), dtype=bool))
    missing = replace(block, signals={**block.signals, "rod_pressure": gone})

    assert in_order([missing, block]) == [1, 0]
    assert in_order([missing]) == [0]
    assert in_order([]) == []


def test_what_differs_from_day_to_day_is_not_learnt_from_a_longer_recording():
    numbers = SimpleNamespace(tolerated=3, own=np.array([False, False, True, False]))
    matrix = np.diag([40.0, 10.0, 500.0, 200.0])
    known = [lasting(n * matrix, numbers) for n in (1.0, 2.0, 20.0, 200.0, 2000.0)]

    assert np.all(np.diff(known) > 0.0)
    assert sharpens(0.0, known[0], 4)
    assert not sharpens(known[3], known[4], 4)


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
