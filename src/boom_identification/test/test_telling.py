"""Long recordings in an identification: which minutes are searched, and what checks the result."""

from functools import partial
from pathlib import Path

import numpy as np
import pytest
from diagnosis_samples import joined, tz17

from boom_estimation.unknown import machine_unknown
from boom_identification import telling as module
from boom_identification.refine import refine
from boom_identification.telling import checking, telling, training
from boom_recording.loading import load
from boom_recording.recording import BLOCK, Recording, part

BAGS = Path(__file__).resolve().parents[3] / "bags"
NAMES = ("friction.tau_C_pos", "friction.tau_C_neg")


@pytest.fixture(scope="module")
def shift() -> Recording:
    """Eight minutes of which the second, third and seventh are recorded; of the others an instant."""
    works = part(load(BAGS / "healthy/extended"), 0.0, BLOCK)
    nothing = part(load(BAGS / "healthy/extended"), 0.0, 0.3)
    return joined([nothing, works, works, nothing, nothing, nothing, works, nothing])


def test_a_short_recording_is_one_part_and_its_end_checks() -> None:
    recording = part(load(BAGS / "healthy/extended"), 0.0, BLOCK)
    assert training(recording, 0.25) == [(recording, 0.25)]
    assert checking(recording, 0.25) == [(recording, 0.25)]


def test_a_long_recording_is_searched_in_minutes_and_its_last_quarter_checks_a_minute_at_a_time(
    shift: Recording,
) -> None:
    searched, checked = training(shift, 0.25), checking(shift, 0.25)
    assert [(round(p.duration), share) for p, share in searched] == [(60, 0.0)] * 6
    assert [(round(p.duration), share) for p, share in checked] == [(60, 1.0)] * 2
    assert max(p.start_ns for p, _ in searched) < min(p.start_ns for p, _ in checked)


def test_the_minutes_that_tell_are_searched_and_those_without_motion_are_not(
    shift: Recording, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(module, "LONGEST", BLOCK)
    asked = [machine_unknown(tz17(), name) for name in NAMES]
    seen = telling([shift], tz17(), asked, 0.25, lambda text: None)
    assert len(seen.selected) == 1 and seen.selected[0] in ("shift from 60 s", "shift from 120 s")
    assert np.all(np.diag(seen.information) > 100.0)
    assert [r.name for r in seen.recordings] == ["shift"]


def test_parts_are_chosen_by_what_they_tell_together_not_each_by_itself() -> None:
    """Two that tell the same, and a weaker one that tells the other number: the second choice is the weaker one."""
    chosen = partial(module._chosen, durations=[150.0, 150.0, 150.0])
    same, other = np.diag([100.0, 0.0]), np.diag([0.0, 50.0])
    assert chosen([same, 0.9 * same, other]) == [0, 2]
    assert module._chosen([same, same], [100.0, 100.0]) == [0, 1]
    little = np.diag([0.2, 0.0])
    assert chosen([little, little, little]) == [0]  # one at least, however little it tells


def test_numbers_of_a_long_recording_are_those_of_its_minutes_and_the_answer_says_which(shift: Recording) -> None:
    found = refine([shift], tz17(), unknowns=list(NAMES), starts=1)
    assert found.fitted_to == ()  # two minutes of motion are not too many
    assert {e.key for e in found.estimates} == set(NAMES)
    for estimate in found.estimates:
        assert estimate.value == pytest.approx(machine_unknown(tz17(), estimate.key).value(0.0), rel=0.1)
    assert found.held_out[0].bag == "shift" and found.held_out[0].after["hose_pressure"] < 0.05
