"""A number of the machine file that is wrong, in the command's own search."""

import pytest
from test_diagnosis import noisy, tz17

from boom_diagnosis.must_keep import unknown_by_free_runs
from boom_diagnosis.run import diagnose
from boom_report.diagnosis.words import headline

GIVEN = 1.4
"""Factor of the rod side's area in the file: another rod."""


def test_a_rod_that_was_mistyped_is_told_with_its_size_and_no_physics_is_named() -> None:
    machine = tz17()
    area = machine.parameters["cylinder.A_b"].value[0]
    result = diagnose([noisy(machine, 20.0, 1)], machine.with_values({"cylinder.A_b": GIVEN * area}))
    assert (result.document.verdict, result.document.findings) == ("parameters_only", ())
    assert result.wrong == "cylinder.A_b"
    estimate = result.tolerances_used["cylinder.A_b"]
    assert estimate.value == pytest.approx(area, rel=0.03)
    assert result.explained.parameters["cylinder.A_b"].value[0] == pytest.approx(area, rel=0.03)
    assert headline(result).startswith("cylinder.A_b is wrong in the machine file: 0.0")
    assert any(note.startswith("cylinder.A_b is wrong in the machine file: 0.0") for note in result.notes)
    (plain,) = (row for row in result.document.ranking if row.kind == "parameters")
    assert plain.parameters == {"cylinder.A_b": estimate}


@pytest.mark.parametrize(("ratio", "expected"), [(9.0, 0.5), (3.0, 0.1), (27.0, 0.9)])
def test_unknown_physics_is_likelier_the_farther_free_runs_are_from_noise(ratio: float, expected: float) -> None:
    assert unknown_by_free_runs(0.5, [ratio * 0.01, ratio * 0.02, float("nan")], [0.01, 0.02, 0.01]) == pytest.approx(
        expected
    )


def test_without_a_free_run_unknown_physics_is_what_one_step_says() -> None:
    assert unknown_by_free_runs(0.7, [float("nan")] * 4, [0.01] * 4) == 0.7
