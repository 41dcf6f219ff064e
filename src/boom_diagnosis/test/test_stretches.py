"""Long recordings: which stretches are searched, and the proof over all the others."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from boom_diagnosis.answer import About, not_enough_excitation
from boom_diagnosis.document import Fit
from boom_diagnosis.stretches import BLOCK, blocks, stretches
from boom_model.machine_file import load_machine
from boom_recording.loading import load
from boom_recording.recording import part

ROOT = Path(__file__).resolve().parents[3]
LAG = {"hose_burst_valve_lag": {"tau": 0.09}}


def joined(pieces, name="shift"):
    """Recordings one behind the other, as one."""
    first, begin, moved = pieces[0], 0.0, []
    for piece in pieces:
        moved.append((round(begin * 1e9) + first.start_ns - piece.start_ns, piece))
        begin += BLOCK
    signals = {}
    for key, signal in first.signals.items():
        stamps = np.concatenate([p.signals[key].stamps_ns + by for by, p in moved])
        signals[key] = replace(
            signal, stamps_ns=stamps, time=(stamps - first.start_ns) / 1e9,
            values=np.concatenate([p.signals[key].values for _, p in moved]),
            valid=np.concatenate([p.signals[key].valid for _, p in moved]),
        )  # fmt: skip
    return replace(first, name=name, duration=begin, signals=signals)


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


def test_short_recordings_are_searched_as_they_are(shift, machine):
    short = part(shift, 0.0, 3 * BLOCK)
    same = stretches([short], [short], machine)
    assert (same.recordings, same.held_out, same.others) == ((short,), (short,), ())


def test_what_was_found_is_proved_on_every_block_and_those_that_contradict_it_are_named(chosen, machine):
    lags = next(r for r in chosen.recordings if r.name == "shift from 120 s")
    empty = not_enough_excitation([lags], machine, About(0, "", {}, ""))
    ones = (1.0,) * 4
    held = dict.fromkeys(("nominal", "parameters_only", "explained"), ones)
    document = replace(empty.document, fit=Fit(held, held, ones, ("shift from 0 s",)))
    found = replace(empty, document=document, explained=machine.with_effects(LAG))
    result = replace(chosen, others=(*chosen.others, lags)).proved(found, lambda text, share: None)

    whole = result.document.document()["fit"]["whole"]
    assert whole["blocks"] == 3
    assert set(whole["far"]) == {b.name for b in chosen.others}, "healthy minutes, through which it does not lag"
    assert any("free runs through 3 blocks" in note for note in result.notes)
    assert [r.name for r in result.searched] == [r.name for r in (*chosen.recordings, *chosen.held_out)]
