"""The hose pressure against what the boom needs: levels, their parts, and lasting steps."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from boom_checks.even_series import EvenSeries
from boom_checks.mechanics import Mechanics, mechanics
from boom_checks.statics import CONSTANT, LEVER, TURNING_PART, Statics, statics, statics_of
from boom_model.machine_file import load_machine
from boom_recording.loading import load

BAGS = Path(__file__).resolve().parents[3] / "bags"
TZ17 = load_machine("tz17")
BAR = 1e5


@pytest.fixture(scope="module")
def boom() -> Mechanics:
    return mechanics(TZ17, load(BAGS / "healthy" / "extended"))


def motion() -> tuple[np.ndarray, np.ndarray]:
    """Times and angles: rest, lift, rest, lower, by turns of five seconds."""
    time = np.arange(0.0, 80.0, 0.01)
    rate = 0.08 * np.select([(time % 20.0 >= 5) & (time % 20.0 < 10), time % 20.0 >= 15], [1.0, -1.0], 0.0)
    rate = np.convolve(rate, np.ones(50) / 50, "same")
    return time, 0.2 + np.cumsum(rate) * 0.01


def measured(boom: Mechanics, gap: np.ndarray) -> Statics:
    """Statics of a boom whose hose pressure is by ``gap`` [Pa] above what it needs."""
    time, angle = motion()
    series = EvenSeries(
        time, {"angle": angle, "rate": np.gradient(angle, 0.01), "rod_pressure": np.full(len(time), 30 * BAR)}
    )
    plain = statics_of(series.with_columns({"hose_pressure": np.zeros(len(time))}), boom)
    return statics_of(series.with_columns({"hose_pressure": plain.need + gap}), boom)


def test_levels_are_those_put_in(boom: Mechanics) -> None:
    _, angle = motion()
    rate = np.gradient(angle, 0.01)
    gap = np.select([rate > 0.02, rate < -0.02], [4 * BAR, -15 * BAR], -19 * BAR)
    levels = {level.regime: level.gap.value / BAR for level in measured(boom, gap).levels}
    assert levels == {
        "at rest": pytest.approx(-19, abs=0.1), "while lifting": pytest.approx(4, abs=0.1),
        "while lowering": pytest.approx(-15, abs=0.1),
    }  # fmt: skip


def test_a_level_is_told_in_words_with_number_interval_and_tolerance(boom: Mechanics) -> None:
    found = measured(boom, np.full(8000, -15 * BAR))
    lowering = next(level for level in found.levels if level.regime == "while lowering")
    assert lowering.sentence.startswith("while lowering the hose pressure is 15.0 bar lower than the ")
    assert "(15.0 to 15.0; the file's masses leave" in lowering.sentence


def test_the_gap_is_split_into_what_is_constant_turns_and_goes_with_the_lever(boom: Mechanics) -> None:
    _, angle = motion()
    direction = np.tanh(np.gradient(angle, 0.01) / 0.002)
    lever = boom.load_lever(angle)
    found = measured(boom, 3 * BAR + 6 * BAR * direction + 200 * 9.81 * lever)
    parts = {part.name: part.value for part in found.parts}
    assert parts[CONSTANT] == pytest.approx(3 * BAR, rel=0.05)
    assert parts[TURNING_PART] == pytest.approx(6 * BAR, rel=0.05)
    assert parts[LEVER] == pytest.approx(200 * 9.81 * float(np.mean(lever)), rel=0.1)


def test_what_the_file_knows_of_friction_and_valve_is_not_missing() -> None:
    found = statics(load(BAGS / "healthy" / "folded_fast"), TZ17)
    assert [level.regime for level in found.levels] == ["at rest", "while lifting", "while lowering"]
    assert all(abs(level.gap.value) < 1.0 * BAR for level in found.levels)
    assert found.steps == ()


def test_a_load_that_is_picked_up_is_told_with_time_and_mass() -> None:
    steps = statics(load(BAGS / "explained" / "payload_change_a"), TZ17).steps
    assert steps[0].time == pytest.approx(27.4, abs=1.5)  # grasped at 27.4 s, and seen at the next rest
    assert steps[0].mass == pytest.approx(260, rel=0.05)
    assert "a load was picked up, 26" in steps[0].sentence


def test_a_machine_that_was_explained_by_a_valve_that_holds_the_load_holds_it_in_every_analysis() -> None:
    recording, explained = (
        load(BAGS / "healthy" / "extended"),
        TZ17.with_effects({"load_holding_valve": {"p_set": 130e5}}),
    )
    assert not TZ17.holds and not mechanics(TZ17, recording).holds
    assert explained.holds and mechanics(explained, recording).holds


def test_of_a_boom_that_carries_less_than_the_load_that_was_told_the_load_may_have_been_put_down(
    boom: Mechanics,
) -> None:
    time, angle = motion()
    fallen = -200 * 9.81 * boom.load_lever(angle) * (time > 0.6 * time[-1])
    told = measured(replace(boom, load=210.0), fallen).steps
    assert "a load was put down, 18" in told[-1].sentence and "or the boom rests on something" in told[-1].sentence
    assert "a load was put down" not in measured(boom, fallen).steps[-1].sentence


def test_a_boom_that_rests_on_something_needs_more_than_its_hose_carries() -> None:
    found = statics(load(BAGS / "unexplained" / "crane_4_a"), TZ17)
    down = found.steps[0]
    assert down.change.value < -100 * BAR and down.level < -100 * BAR
    assert "rests on something, or a valve shuts the hose off" in down.sentence
