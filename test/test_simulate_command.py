"""./boom simulate: a bag like the machine's, which validates at noise level; wrong input is one line and status 2."""

from __future__ import annotations

import subprocess
import sys
from importlib import resources
from importlib.resources import files
from pathlib import Path

import numpy as np
import pytest
import yaml

from boom_bringup import cli
from boom_identification.validation import validate
from boom_input.whole import one_writer
from boom_model.errors import SimulationError
from boom_model.machine_file import load_machine, machine_from
from boom_model.sensors import IDEAL
from boom_recording import writing
from boom_recording.loading import load
from boom_recording.recording import Configuration
from boom_report.tracking import position_error
from boom_sim import offline
from boom_sim.simulated_crane import CraneSample, CraneStart, SimulatedCrane

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
    assert position_error.of_recording(made, load_machine("tz17")).errors.maxe < 0.02
    assert validate(made, load_machine("tz17")).mismatches == []
    refused = boom("simulate", "steps.csv", "--reference", "--output", "other", cwd=tmp_path)
    assert refused.returncode == 2
    assert "needs a bag" in refused.stderr


def test_currents_from_a_csv_file_move_the_boom(tmp_path: Path) -> None:
    # As a spreadsheet of a country with decimal commas writes it.
    (tmp_path / "steps.csv").write_text(
        "\ufefftime_s;retract_a;extend_a\r\n0;0;0\r\n1,005;0;0,5\r\n2;0;0\r\n4;0;0\r\n\r\n"
    )
    result = boom("simulate", "steps.csv", "--angle", "0.4", "--sensors", "ideal", "--output", "made", cwd=tmp_path)
    assert result.returncode == 0, result.stderr
    made = load(tmp_path / "made")
    angle = made.signals["angle"]
    assert angle.values[0] == pytest.approx(0.4)
    assert angle.values[-1] > 0.5
    assert made.events == []
    assert validate(made, load_machine("tz17")).mismatches == []


def test_currents_move_a_crane_of_another_make_in_the_first_pose_of_its_file(tmp_path: Path) -> None:
    (tmp_path / "steps.csv").write_text("time_s,retract_a,extend_a\n0,0,0\n1,0,0.5\n2,0,0\n")
    result = boom("simulate", "steps.csv", "--machine", "loader_crane", "--output", "made", cwd=tmp_path)
    assert result.returncode == 0, result.stderr
    told, first = load(tmp_path / "made").configuration, load_machine("loader_crane").tabulated[0]
    assert (told.machine, told.outer_boom_angle, told.telescope_length) == (
        "loader_crane", first.outer_boom_angle, first.telescope_length,
    )  # fmt: skip


def simulate(tmp_path: Path, capsys: pytest.CaptureFixture[str], *words: str) -> tuple[int, str]:
    """The command inside this process: what it imports is imported once."""
    status = cli.main(["simulate", *words, "--output", str(tmp_path / "made")])
    return status, capsys.readouterr().err


def test_what_ran_until_the_model_left_its_range_is_a_whole_bag_and_the_end_is_said(tmp_path: Path) -> None:
    (tmp_path / "up.csv").write_text("time_s,retract_a,extend_a\n0,0,0\n1,0,0.55\n30,0,0\n")
    result = boom("simulate", "up.csv", "--angle", "0.4", "--output", "made", cwd=tmp_path)
    assert result.returncode == 2
    (line,) = result.stderr.strip().splitlines()
    assert "angle (q_2) left its range" in line and "the simulation ended there; made holds the 4." in line
    made = load(tmp_path / "made")
    assert made.events == [] and made.warnings == []
    assert made.duration == pytest.approx(float(line.split("at ")[1].split(" s")[0]), abs=0.05)
    assert validate(made, load_machine("tz17")).mismatches == []
    assert sorted(p.name for p in tmp_path.iterdir()) == ["made", "up.csv"]
    assert sorted(p.name for p in (tmp_path / "made").iterdir()) == ["made_0.mcap", "metadata.yaml"]


def test_a_closed_loop_that_leaves_the_stroke_keeps_what_ran(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    shorter = (
        (files("boom_model") / "machines" / "tz17.yaml")
        .read_text()
        .replace("q2_max: {value: 1.563", "q2_max: {value: 0.6")
    )
    (tmp_path / "shorter.yaml").write_text(shorter)
    source = str(BAGS / "healthy" / "folded_fast")
    words = (source, "--reference", "--mode", "thesis", "--machine", str(tmp_path / "shorter.yaml"))
    status, told = simulate(tmp_path, capsys, *words)
    assert status == 2 and "the simulation ended there" in told
    made = load(tmp_path / "made")
    assert made.events == [] and made.duration > 2.0 and "reference_angle" in made.signals


def ends_in_the_second_bag(monkeypatch: pytest.MonkeyPatch, error: BaseException) -> None:
    """The crane of a campaign raises this 1.5 s into its second recording."""
    advance, count = SimulatedCrane.advance, 0

    def broken(crane: SimulatedCrane) -> CraneSample:
        nonlocal count
        count += 1
        if count > 500 and crane.time > 1.5:
            raise error
        return advance(crane)

    monkeypatch.setattr(SimulatedCrane, "advance", broken)


def test_a_campaign_keeps_the_bags_and_what_ran_of_the_last(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    ends_in_the_second_bag(monkeypatch, SimulationError("at 1.500 s p_a left its range", 1.5, "p_a"))
    status, told = simulate(tmp_path, capsys, "--campaign", "cylinder", "--duration", "4")
    assert status == 2
    assert "made/folded_slow holds the 1.5" in told and told.strip().endswith("whole bags beside it: 1")
    assert sorted(p.name for p in (tmp_path / "made").iterdir()) == ["folded_slow", "folded_staircase"]
    assert load(tmp_path / "made" / "folded_slow").duration == pytest.approx(1.5, abs=0.03)
    assert load(tmp_path / "made" / "folded_staircase").duration == pytest.approx(4.0, abs=0.03)


def test_a_campaign_that_was_interrupted_says_what_is_in_the_way_of_the_next(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    ends_in_the_second_bag(monkeypatch, KeyboardInterrupt())
    status, told = simulate(tmp_path, capsys, "--campaign", "cylinder", "--duration", "4")
    assert status == 130
    assert "made has whole bags, 1: remove it to begin again" in told
    assert [p.name for p in (tmp_path / "made").iterdir()] == ["folded_staircase"]


def test_a_bag_that_another_command_is_making_is_refused_and_what_a_killed_one_left_is_not_in_the_way(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    place = tmp_path / ".made.new"
    (place / "made").mkdir(parents=True)
    words = (str(BAGS / "healthy" / "extended"), "--duration", "2")
    with one_writer(place):
        status, told = simulate(tmp_path, capsys, *words)
        assert status == 2 and told.count("\n") == 1 and "in use by another" in told
    assert simulate(tmp_path, capsys, *words)[0] == 0
    assert [p.name for p in tmp_path.iterdir()] == ["made"] and load(tmp_path / "made").events == []


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
        (
            [
                str(BAGS / "healthy" / "extended"),
                "--output",
                "x",
                "--effect",
                "piston_leakage.c=1e-12",
                "--effect",
                "piston_leakage.c=2e-12",
            ],
            "was given before, as 1e-12",
        ),
        ([str(BAGS / "healthy" / "extended"), "--output", "x", "--joint", " "], "--joint: an empty name"),
        ([str(BAGS / "healthy" / "extended"), "--output", "x", "--machine", "tz71"], "no such machine"),
        ([str(BAGS / "healthy" / "extended"), "--output", "x", "--angle", "2"], "angle"),
        ([str(BAGS / "healthy" / "extended"), "--outptu", "x"], "--output"),
        (
            [str(BAGS / "healthy" / "extended"), "--output", "x", "--q4", "-5"],
            "extended: its configuration does not fit machine tz17: telescope length q4 is -5 m",
        ),
        (["bad.csv", "--output", "x"], "line 3: expected three numbers"),
        (
            ["good.csv", "--angle", "17", "--output", "x"],
            "initial angle of 17 rad is outside the stroke, -1.054 .. 1.563 rad",
        ),
        (["header.csv", "--output", "x"], "the first line must be time_s,retract_a,extend_a"),
    ],
)
def test_wrong_input_is_one_line_and_status_2_and_leaves_nothing(
    words: list[str], message: str, tmp_path: Path
) -> None:
    (tmp_path / "there").mkdir()
    (tmp_path / "bad.csv").write_text("time_s,retract_a,extend_a\n0,0,0\n1,nan,0\n")
    (tmp_path / "header.csv").write_text("0,0,0\n")
    (tmp_path / "good.csv").write_text("time_s,retract_a,extend_a\n0,0,0\n1,0,0\n")
    result = boom("simulate", *words, cwd=tmp_path)
    assert result.returncode == 2
    assert len(result.stderr.strip().splitlines()) == 1
    assert message in result.stderr
    assert not (tmp_path / "x").exists()


def test_what_was_measured_of_the_supply_and_the_loads_of_that_recording_act_as_in_validate(tmp_path: Path) -> None:
    crane = yaml.safe_load((resources.files("boom_model") / "machines" / "loader_crane.yaml").read_text("utf-8"))
    crane["payload"] = {"recordings": {"monday": [{"mass": 150.0, "time": 6.0}, {"mass": -150.0, "time": 14.0}]}}
    file = tmp_path / "crane.yaml"
    file.write_text(yaml.safe_dump(crane), encoding="utf-8")
    time = np.arange(0.0, 20.0, 0.01)
    lift, supply = 0.55 * (np.sin(0.7 * time) > 0.3), 1.9e7 + 1.5e6 * np.sin(0.9 * time)
    lower = 0.5 * (np.sin(0.7 * time) < -0.5)
    machine = machine_from(crane)
    pose = machine.tabulated[0]
    configuration = Configuration("loader_crane", pose.outer_boom_angle, pose.telescope_length, 0.0)
    recorded = offline.simulate(
        machine, configuration, CraneStart(0.3), time, np.column_stack((lower, lift)), noise=IDEAL, name="monday",
        pressures={"supply_pressure": (time, supply)},
    )  # fmt: skip
    writing.write(tmp_path / "monday", recorded)
    words = ("--machine", str(file), "--sensors", "ideal", "--output", "again")
    result = boom("simulate", "monday", *words, cwd=tmp_path)
    assert result.returncode == 0, result.stderr
    again = load(tmp_path / "again")
    angle, supplied = again.signals["angle"], again.signals["supply_pressure"]
    assert np.abs(angle.values - recorded.signals["angle"].values[: len(angle.values)]).max() < 2e-4
    assert np.abs(supplied.values - supply[: len(supplied.values)]).max() < 1.0
    assert "payload.recordings.monday" in result.stdout  # under its new name they are not the bag's any more
