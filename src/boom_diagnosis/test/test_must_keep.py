"""An answer does not contradict its own numbers and free runs, whichever way it was found."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from boom_diagnosis.document import Estimate, Finding, Fit
from boom_diagnosis.must_keep import allowed, as_far_by_chance, by_free_runs, far, kept, shown, told, worse_on_the_whole

FLOOR = (0.01, 0.02, 0.02, 0.03)


def finding(confidence: float) -> Finding:
    return Finding("rate_scale", "sensors", "", confidence, {}, "", (), (), "The gyro is off.")


def fit(explained: tuple[float, ...], before: tuple[float, ...] = (0.5, 0.5, 0.5, 0.5)) -> Fit:
    return Fit({}, {"nominal": before, "parameters_only": before, "explained": explained}, FLOOR, ("b",))


@pytest.mark.parametrize(
    ("interval", "expected", "from_sound"),
    [((0.003, 0.02), True, True), ((0.001, 0.02), True, False), ((-0.001, 0.02), False, False)],
)
def test_an_effect_is_told_where_an_interval_leaves_out_that_it_does_nothing(
    interval: tuple[float, float], expected: bool, from_sound: bool
) -> None:
    """From a sound machine where it leaves out the 0.0025 that sound valves have, too."""
    numbers = {"h": Estimate(0.01, "-", interval)}
    assert told("valve_hysteresis", numbers) is expected
    assert told("valve_hysteresis", numbers, sound=True) is from_sound


def test_gas_that_one_accumulator_lost_is_told_by_the_factor_of_its_own() -> None:
    """Half of the second one's gas was given up after the search: the factor of both was 1, and the second's did not count."""
    both = Estimate(0.999, "-", (0.9945, 1.0035))
    assert told("accumulator_precharge", {"r": both, "r_2": Estimate(0.495, "-", (0.451, 0.543))})
    assert not told("accumulator_precharge", {"r": both, "r_2": Estimate(0.97, "-", (0.9, 1.05))})
    assert not told("friction_drift", {"r": Estimate(1.0, "-", (0.9, 1.1)), "r_0": Estimate(2.0, "-", (1.9, 2.1))})


@pytest.mark.parametrize(("interval", "expected"), [((6e-8, 3.5e-5), False), ((2e-7, 3.5e-5), True)])
def test_a_size_sought_by_its_logarithm_is_told_where_its_interval_leaves_out_some_of_what_is_plausible(
    interval: tuple[float, float], expected: bool
) -> None:
    assert told("presliding_friction", {"compliance": Estimate(1e-6, "rad/(N m)", interval)}) is expected


@pytest.mark.parametrize(("times", "expected"), [(1.5, 2.25 / 27), (6.0, 1.0)])
def test_free_runs_near_what_noise_leaves_let_no_physics_be_missing(times: float, expected: float) -> None:
    held_out = {"parameters_only": tuple(times * n for n in FLOOR)}
    assert far(held_out, FLOOR) == pytest.approx(expected)


def test_what_numbers_that_are_left_open_may_do_to_free_runs_speaks_against_no_effect() -> None:
    """A spool off-centre by 0.02 was unknown physics, 0.95: held out, the boom moved faster than where anything was fitted."""
    before, explained, spread = (0.4, 0.04, 0.04, 0.06), (0.7, 0.05, 0.04, 0.06), (0.6, 0.05, 0.02, 0.02)
    found = fit(explained, before)
    assert worse_on_the_whole({**found.held_out, "explained": (0.7, 0.07, 0.05, 0.07)}, FLOOR)
    assert not worse_on_the_whole(found.held_out, allowed(FLOOR, spread))
    assert by_free_runs(0.5, found.held_out, FLOOR)[0] > 0.9
    assert by_free_runs(0.5, found.held_out, FLOOR, allowed(FLOOR, spread))[0] == pytest.approx(0.5)
    verdict, _, notes = kept("identified", [finding(0.98)], found, True)
    assert verdict == "ambiguous" and notes[0].startswith("unproved")
    verdict, _, (note,) = kept("identified", [finding(0.98)], replace(found, open_numbers=spread), True)
    assert (
        verdict == "identified"
        and "by no more than numbers may make them that the recordings fitted leave open" in note
    )


def test_a_load_in_two_steps_is_told_where_one_of_its_masses_is() -> None:
    first = Estimate(86.0, "kg", (-13.0, 185.0))
    assert told("payload_change", {"mass": first, "mass_2": Estimate(74.0, "kg", (16.0, 133.0))})
    assert not told("payload_change", {"mass": first, "mass_2": Estimate(74.0, "kg", (-5.0, 133.0))})


@pytest.mark.parametrize(("farthest", "chance"), [(1.0, 1.0), (3.0, 0.189), (4.0, 0.00443)])
def test_free_runs_speak_for_parameters_as_far_as_chance_takes_one_of_them(farthest: float, chance: float) -> None:
    z = np.zeros(70)
    z[3] = -farthest
    assert as_far_by_chance(z) == pytest.approx(chance, rel=5e-3)
    assert as_far_by_chance(np.zeros(0)) == 0.0


def test_an_error_that_noise_makes_is_no_worse_than_a_smaller_one() -> None:
    before, explained = (0.5, 0.5, 0.025, 0.5), (0.1, 0.1, 0.029, 0.1)  # hose pressure at 1.45 times its floor
    assert kept("identified", [finding(0.8)], fit(explained, before), True)[0] == "identified"


def test_free_runs_that_end_before_the_data_do_are_far_from_the_floor() -> None:
    verdict, _, notes = kept("parameters_only", [], fit((float("nan"),) * 4), True)
    assert verdict == "ambiguous"
    assert "without end" in notes[0]


def test_errors_that_numbers_left_open_may_make_are_no_sign_of_physics_and_it_is_said() -> None:
    left = fit((0.12, 0.02, 0.02, 0.03))  # the angle at twelve times its floor
    verdict, _, (note,) = kept("parameters_only", [], replace(left, open_numbers=(0.05, 0.01, 0.01, 0.01)), True)
    assert verdict == "parameters_only" and "leave open" in note and "angle 12 times" in note
    assert kept("parameters_only", [], replace(left, open_numbers=(0.03, 0.01, 0.01, 0.01)), True)[0] == "ambiguous"


def test_errors_that_parameters_fitted_to_all_recordings_do_not_have_are_no_sign_of_physics_and_it_is_said() -> None:
    left = fit((0.12, 0.02, 0.02, 0.03))  # the angle at twelve times its floor
    assert kept("parameters_only", [], left, True)[0] == "ambiguous"
    verdict, _, (note,) = kept("parameters_only", [], replace(left, all_fitted=(0.029, 0.02, 0.02, 0.02)), True)
    assert verdict == "parameters_only" and "fitted to that data, too" in note and "angle 12 times" in note
    assert kept("parameters_only", [], replace(left, all_fitted=(0.031, 0.02, 0.02, 0.02)), True)[0] == "ambiguous"


def test_an_explanation_that_makes_held_out_runs_worse_is_said_to_be_unproved() -> None:
    verdict, findings, notes = kept("identified", [finding(0.98)], fit((0.01, 0.02, 0.02, 0.6)), True)
    assert verdict == "ambiguous"
    assert "rod pressure 1.2 times" in notes[0]
    assert findings[0].confidence == 0.98  # one probability everywhere


@pytest.mark.parametrize("verdict", ["ambiguous", "unknown_physics"])
def test_an_unsure_answer_that_makes_held_out_runs_worse_says_so_too(verdict: str) -> None:
    kind, _, notes = kept(verdict, [finding(0.49)], fit((0.01, 0.02, 0.02, 0.6)), True)  # type: ignore[arg-type]
    assert kind == verdict
    assert "unproved" in notes[0]


@pytest.mark.parametrize(
    ("explained", "worse"),
    [((0.1, 2.0, 0.5, 0.5), False), ((0.25, 2.0, 1.0, 0.5), True), ((0.1, 0.1, float("nan"), 0.1), True)],
    ids=["one channel", "on the whole", "ends early"],
)
def test_what_makes_held_out_runs_worse_on_the_whole_is_not_what_is_missing(
    explained: tuple[float, ...], worse: bool
) -> None:
    assert worse_on_the_whole(fit(explained).held_out, FLOOR) is worse


@pytest.mark.parametrize(
    ("plain", "explained", "seen"),
    [((0.020, 0.02, 0.02, 0.02), (0.0195, 0.02, 0.021, 0.019), False), ((0.012, 0.02, 0.02, 0.02), (0.01, 0.02, 0.02, 0.02), True),
     ((float("nan"), 0.02, 0.02, 0.02), (0.3, 0.02, 0.02, 0.02), True)],
    ids=["within the noise", "by more than half of it", "only parameters alone end early"],
)  # fmt: skip
def test_an_effect_shows_where_free_runs_come_nearer_by_half_the_noise(
    plain: tuple[float, ...], explained: tuple[float, ...], seen: bool
) -> None:
    assert shown({"parameters_only": plain, "explained": explained}, (0.0105, 0.02, 0.02, 0.02)) is seen


def test_a_run_that_ends_early_is_worse_than_any_error() -> None:
    assert kept("identified", [finding(0.9)], fit((0.01, 0.02, 0.02, float("nan"))), True)[0] == "ambiguous"


@pytest.mark.parametrize("verdict", ["no_mismatch", "parameters_only"])
def test_nothing_is_not_the_answer_where_free_runs_stay_at_nine_times_the_floor(verdict: str) -> None:
    explained = (0.01, 0.19, 0.02, 0.03)
    assert kept(verdict, [], fit(explained), True)[0] == "ambiguous"  # type: ignore[arg-type]
    assert kept(verdict, [], fit((0.01, 0.1, 0.02, 0.03)), True)[0] == verdict  # type: ignore[arg-type]


def test_what_remains_is_said_in_the_sentence_of_a_sure_finding() -> None:
    explained = (0.01, 0.02, 0.08, 0.03)
    _, (sure, unsure), _ = kept("identified", [finding(0.95), finding(0.6)], fit(explained), True)
    assert "hose pressure 4 times" in sure.evidence
    assert "times" not in unsure.evidence


def test_what_stays_far_from_noise_is_said_of_unsure_findings_too() -> None:
    _, (unsure,), _ = kept("identified", [finding(0.6)], fit((0.01, 0.02, 0.4, 0.03)), True)
    assert "hose pressure 20 times" in unsure.evidence


def test_without_a_healthy_twin_errors_are_not_compared_with_noise() -> None:
    verdict, _, notes = kept("no_mismatch", [], fit((0.4, 0.4, 0.4, 0.4)), False)
    assert verdict == "no_mismatch"
    assert "not compared" in notes[0]
