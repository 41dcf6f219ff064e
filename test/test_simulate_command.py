"""./boom simulate: a bag like the machine's, which validates at noise level; wrong input is one line and status 2."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from boom_diagnosis import tracking
from boom_diagnosis.validation import validate
from boom_model.machine_file import load_machine
from boom_recording.loading import load

BAGS = Path(__file__).parents[1] / "bags"


def boom(*words: str, cwd: Path) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "boom_bringup.cli", *words]
    return subprocess.run(command, cwd=cwd, capture_output=True, text=True, check=False, timeout=60)


@pytest.mark.parametrize("name", ["folded_fast", "extended_log"])
def test_a_simulated_bag_validates_at_noise_level(name: str, tmp_path: Path) -> None:
    result = boom("simulate", str(BAGS / "healthy" / name), "--output", "made", "--seed", "4", cwd=tmp_path)
    assert result.returncode == 0, result.stderr
    made = load(tmp_path / "made")
    assert made.events == []
    assert validate(made, load_machine("tz17")).mismatches == []


def test_an_added_effect_shows_as_a_mismatch(tmp_path: Path) -> None:
    source = str(BAGS / "healthy" / "extended")
    result = boom("simulate", source, "--output", "leaky", "--effect", "piston_leakage.c=2e-12", cwd=tmp_path)
    assert result.returncode == 0, result.stderr
    machine = load_machine("tz17")
    leaky = load(tmp_path / "leaky")
    assert "angle_mae_rad" in validate(leaky, machine).mismatches
    assert validate(leaky, machine.with_effects({"piston_leakage": {"c": 2e-12}})).mismatches == []


def test_a_reference_is_followed_in_the_closed_loop_and_the_bag_tells_how_well(tmp_path: Path) -> None:
    source = str(BAGS / "healthy" / "folded_fast")
    words = ("--reference", "--mode", "baseline", "--duration", "12", "--output", "followed")
    result = boom("simulate", source, *words, cwd=tmp_path)
    assert result.returncode == 0, result.stderr
    assert "piston position error" in result.stdout
    made = load(tmp_path / "followed")
    assert tracking.of_recording(made, load_machine("tz17")).errors.maxe < 0.02
    assert validate(made, load_machine("tz17")).mismatches == []
    refused = boom("simulate", "steps.csv", "--reference", "--output", "other", cwd=tmp_path)
    assert refused.returncode == 2
    assert "takes a bag" in refused.stderr


def test_currents_from_a_csv_file_move_the_boom(tmp_path: Path) -> None:
    (tmp_path / "steps.csv").write_text("time_s,retract_a,extend_a\n0,0,0\n1.005,0,0.5\n2,0,0\n4,0,0\n")
    result = boom("simulate", "steps.csv", "--angle", "0.4", "--sensors", "ideal", "--output", "made", cwd=tmp_path)
    assert result.returncode == 0, result.stderr
    made = load(tmp_path / "made")
    angle = made.signals["angle"]
    assert angle.values[0] == pytest.approx(0.4)
    assert angle.values[-1] > 0.5
    assert made.events == []
    assert validate(made, load_machine("tz17")).mismatches == []


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["nowhere", "--output", "x"], "nowhere"),
        ([str(BAGS / "healthy" / "extended"), "--output", "there"], "there exists already"),
        (
            [str(BAGS / "healthy" / "extended"), "--output", "x", "--effect", "piston_leak.c=1"],
            "did you mean piston_leakage",
        ),
        ([str(BAGS / "healthy" / "extended"), "--output", "x", "--effect", "leak"], "expected ID.NAME=NUMBER"),
        ([str(BAGS / "healthy" / "extended"), "--output", "x", "--machine", "tz71"], "no such machine"),
        ([str(BAGS / "healthy" / "extended"), "--output", "x", "--angle", "2"], "angle"),
        ([str(BAGS / "healthy" / "extended"), "--outptu", "x"], "--output"),
        (["bad.csv", "--output", "x"], "line 3: current nan A"),
        (["header.csv", "--output", "x"], "the first line must be time_s,retract_a,extend_a"),
    ],
)
def test_wrong_input_is_one_line_and_status_2_and_leaves_nothing(
    words: list[str], message: str, tmp_path: Path
) -> None:
    (tmp_path / "there").mkdir()
    (tmp_path / "bad.csv").write_text("time_s,retract_a,extend_a\n0,0,0\n1,nan,0\n")
    (tmp_path / "header.csv").write_text("0,0,0\n")
    result = boom("simulate", *words, cwd=tmp_path)
    assert result.returncode == 2
    assert len(result.stderr.strip().splitlines()) == 1
    assert message in result.stderr
    assert not (tmp_path / "x").exists()
