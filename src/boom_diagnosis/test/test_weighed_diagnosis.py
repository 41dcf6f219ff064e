"""A diagnosis by one likelihood, from a recording to the answer."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from boom_diagnosis.document import DiagnosisResult
from boom_diagnosis.must_keep import worse_channels
from boom_diagnosis.run import diagnose
from boom_model.machine_file import load_machine
from boom_recording.loading import load

BAG = Path(__file__).resolve().parents[3] / "bags" / "healthy" / "extended"
GAIN = 1.03


@pytest.fixture(scope="module")
def result() -> DiagnosisResult:
    """Of the beginning of a healthy recording whose gyro shows 3 % too much."""
    recording = replace(load(BAG), duration=15.0)
    rate = recording.signals["rate"]
    recording.signals["rate"] = replace(rate, values=rate.values * GAIN)
    return diagnose([recording], load_machine("tz17"), engine="likelihood")


def test_a_gyro_that_shows_too_much_is_named_with_its_gain(result: DiagnosisResult) -> None:
    unproved = worse_channels(
        result.document.fit.held_out, result.document.fit.noise_floor
    )  # 5 s are held out: chance may make a channel worse
    assert result.document.verdict == ("ambiguous" if unproved else "sensor_or_clock")
    (found,) = result.document.findings
    assert found.effect == "rate_scale"
    assert found.parameters["a"].value == pytest.approx(GAIN, abs=2e-3)
    low, high = found.parameters["a"].interval_90
    assert 1.0 < low < high < 1.04
    assert result.explained.effects["rate_scale"]["a"] == pytest.approx(GAIN, abs=2e-3)


def test_every_hypothesis_has_one_probability_and_they_sum_to_one(result: DiagnosisResult) -> None:
    document = result.document
    assert sum(row.posterior for row in document.hypotheses) == pytest.approx(1.0)
    weighed = {(row.effects, row.unknown): row for row in document.hypotheses}
    alone = weighed[(), ()]
    named = weighed[("rate_scale",), ()]
    assert named.log_likelihood > alone.log_likelihood + 100.0
    evidence = [row.log_likelihood - row.cost + row.log_prior for row in document.hypotheses]
    assert evidence == sorted(evidence, reverse=True)
    assert document.findings[0].confidence == pytest.approx(
        named.posterior, abs=0.011
    )  # 0.99 is the most that is claimed


def test_free_runs_over_the_end_that_was_not_fitted_improve(result: DiagnosisResult) -> None:
    held = result.document.fit.held_out
    rate = result.document.document()["fit"]["channels"].index("rate")
    assert held["explained"][rate] < 0.7 * held["parameters_only"][rate]
