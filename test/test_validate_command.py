"""`./boom validate` as a process: output, documents, exit status, and one plain line for every wrong input."""

import json
import os
import shlex
import shutil
import subprocess
import sys
from dataclasses import dataclass, replace
from importlib.resources import files
from pathlib import Path

import numpy as np
import pytest
from recording_faults import FAULTS
from refusals import refusal

from boom_bringup import cli
from boom_recording.loading import load
from boom_recording.recording import Configuration
from boom_recording.writing import from_columns, write

BAGS = Path(__file__).parents[1] / "bags"
HEALTHY, CHANGED = BAGS / "healthy" / "folded_fast", BAGS / "explained" / "payload_change_a"


@dataclass
class Ended:
    returncode: int
    stdout: str
    stderr: str


@pytest.fixture
def validate(tmp_path, monkeypatch, capsys):
    """The command inside this process, in a folder of its own: what it imports is imported once."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("BOOM_PROGRAM", "./boom")

    def run(*arguments):
        status = cli.main(["validate", *map(str, arguments)])
        printed = capsys.readouterr()
        return Ended(status, printed.out, printed.err)

    return run


def as_process(folder, *arguments):
    command = [sys.executable, "-m", "boom_bringup.cli", "validate", *map(str, arguments)]
    environment = os.environ | {"BOOM_PROGRAM": "./boom"}
    return subprocess.run(
        command, cwd=folder, env=environment, capture_output=True, text=True, timeout=120, check=False
    )


def test_pressures_coarser_than_the_file_says_are_judged_by_their_own_steps(validate, tmp_path):
    recording = load(HEALTHY)
    for name in ("hose_pressure", "rod_pressure"):
        signal = recording.signals[name]
        recording.signals[name] = replace(signal, values=np.round(signal.values / 2e5) * 2e5)
    write(tmp_path / "coarse", recording)
    ended = validate(tmp_path / "coarse", "--no-report")
    assert ended.returncode == 0 and "agrees within sensor noise" in ended.stdout


def made(path, machine="tz17", load=0.0, angle=0.4):
    time = np.arange(200) * 0.01
    constant = {"angle": angle, "rate": 0.0, "hose_pressure": 6e6, "rod_pressure": 1e6}
    columns = {name: np.full(200, value) for name, value in constant.items()}
    columns |= {"retract_current": np.zeros(200), "extend_current": np.zeros(200)}
    write(path, from_columns(path.name, time, columns, Configuration(machine, 4.59, 0.0, load)))
    return path


def refused(result):
    """The one line on stderr of a run that ended with status 2 and printed nothing else."""
    assert result.returncode == 2, result.stderr
    assert result.stdout == ""
    return refusal(result.stderr)


def test_tables_verdicts_document_and_report_of_several_recordings(tmp_path):
    gap = BAGS / "damaged" / "gap_in_motion"
    result = as_process(tmp_path, HEALTHY, CHANGED, gap, "--json", "numbers.json")
    assert result.returncode == 0, result.stderr
    out = result.stdout
    assert "Table 5.1" in out and "Table 5.2" in out
    assert "folded_fast: agrees within sensor noise" in out
    assert "payload_change_a: differs: hose pressure 14.9 bar rms, 42 x its noise limit" in out
    assert "gap 24.19 s to 25.40 s, on 4 topics" in out
    assert "\x1b" not in out and max(map(len, out.splitlines())) <= 100
    assert "report: output/validate-folded_fast-and-2-more.html" in result.stdout.splitlines()
    assert (tmp_path / "output" / "validate-folded_fast-and-2-more.html").stat().st_size > 1e6

    document = json.loads((tmp_path / "numbers.json").read_text())
    assert document["machine"] == "tz17"
    assert [bag["bag"] for bag in document["bags"]] == ["folded_fast", "payload_change_a", "gap_in_motion"]
    first, _, damaged = document["bags"]
    keys = {"angle_mae_rad", "angle_rmse_rad", "rate_rmse_rad_s", "hose_pressure_rmse_pa", "rod_pressure_rmse_pa"}
    assert keys <= set(first["full"]) and keys <= set(first["reduced"])
    assert first["duration_s"] == pytest.approx(60, abs=0.1) and first["samples"] == 6000 and first["events"] == []
    assert first["reduced_vs_full"]["angle_mae_rad"] < 25e-3
    assert {"kind", "topic", "start_s", "end_s"} <= set(damaged["events"][0])


def test_strict_tells_a_mismatch_by_the_exit_status(validate, tmp_path):
    assert validate(CHANGED, "--strict", "--no-report").returncode == 1
    assert validate(HEALTHY, "--strict", "--no-report").returncode == 0
    assert not (tmp_path / "output").exists()


def test_a_recording_that_has_to_be_repaired_first_is_not_sent_to_the_diagnosis(validate, tmp_path):
    recording = load(BAGS / "healthy" / "extended")
    write(tmp_path / "turned", FAULTS["angle from the vertical"][2](recording))
    said = " ".join(validate(tmp_path / "turned", "--no-report").stdout.split())
    assert "repair first: /joint_states: the angle counts from the vertical" in said
    assert "next: repair turned as said above" in said and "diagnose" not in said


def test_a_bare_mcap_file_is_a_bag_and_the_report_goes_where_it_is_wanted(validate, tmp_path):
    shutil.copy(HEALTHY / "folded_fast.mcap", tmp_path / "alone.mcap")
    result = validate("alone.mcap", "--report", "here.html")
    assert result.returncode == 0, result.stderr
    assert "./boom validate alone.mcap --report here.html" in (tmp_path / "here.html").read_text()


def test_a_bag_that_a_simulation_made_stands_for_the_full_model(validate, tmp_path):
    result = validate(HEALTHY, "--simulated", HEALTHY, "--json", "n.json", "--no-report")
    assert result.returncode == 0, result.stderr
    assert json.loads((tmp_path / "n.json").read_text())["bags"][0]["full"]["angle_mae_rad"] == pytest.approx(
        0, abs=1e-9
    )


def test_what_could_not_be_compared_is_null_in_the_document(validate, tmp_path):
    made(tmp_path / "outside", angle=-1.25)
    result = validate("outside", "--json", "n.json", "--no-report")
    assert result.returncode == 0, result.stderr
    text = (tmp_path / "n.json").read_text()
    assert "NaN" not in text
    assert json.loads(text)["bags"][0]["full"]["angle_mae_rad"] is None
    assert "outside: stopped: " in result.stdout


def test_another_machine_than_the_recorded_one_is_noted_and_so_is_an_unknown_load(validate, tmp_path):
    made(tmp_path / "mine", machine="another", load=float("nan"))
    result = validate("mine", "--machine", "tz17", "--no-report")
    assert result.returncode == 0, result.stderr
    assert "note: mine was recorded on machine 'another', the model is that of 'tz17'" in result.stdout
    assert "note: mine does not state its load: 0 kg is assumed" in result.stdout


def test_a_machine_without_a_shipped_file_needs_one(validate, tmp_path):
    made(tmp_path / "mine", machine="another")
    line = refused(validate("mine"))
    assert "mine: recorded on machine 'another'" in line and "--machine FILE" in line and "tz17" in line


def test_recordings_of_different_machines_are_not_mixed(validate, tmp_path):
    made(tmp_path / "mine", machine="another")
    line = refused(validate(HEALTHY, "mine"))
    assert "different machines" in line and "--machine" in line


def test_recordings_of_one_name_are_told_apart_in_tables_document_and_report(validate, tmp_path):
    for folder in ("c7", "c13"):
        made(tmp_path / folder / "a")
    result = validate("c7/a", "c13/a", "--json", "n.json")
    assert result.returncode == 0, result.stderr
    assert "c7/a: " in result.stdout and "c13/a: " in result.stdout
    assert [bag["bag"] for bag in json.loads((tmp_path / "n.json").read_text())["bags"]] == ["c7/a", "c13/a"]
    assert "report: output/validate-c7-a-and-1-more.html" in result.stdout.splitlines()


def test_a_pose_that_does_not_fit_says_that_the_recording_is_of_another_machine(validate, tmp_path):
    made(tmp_path / "r", machine="crane_c10", load=-5.0)
    said = refused(validate("r", "--machine", "triangle_direct"))
    assert "does not fit machine" in said and "recorded on machine 'crane_c10'" in said


def test_a_process_with_wrong_input_ends_with_status_2(tmp_path):
    assert "nowhere: there is no such file or folder" in refused(as_process(tmp_path, HEALTHY, "nowhere"))


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ([], "required: BAG"),
        (["nowhere"], "nowhere: there is no such file or folder"),
        ([HEALTHY, "empty"], "empty: "),
        (["text.mcap"], "text.mcap: "),
        ([HEALTHY, "--machin", "tz17"], "did you mean --machine?"),
        ([HEALTHY, "--machine", "tz71"], "tz71: no such machine; shipped are "),
        ([HEALTHY, "--machine", "broken.yaml"], "broken.yaml"),
        ([HEALTHY, "--report", "no/such/report.html"], "there is no folder no/such: create it first"),
        ([HEALTHY, "--report", "empty"], "this is a folder"),
        ([HEALTHY, "--json", "text.mcap/n.json"], "there is no folder text.mcap"),
        ([HEALTHY, "--report", "r.html", "--no-report"], "not allowed with"),
        ([HEALTHY, CHANGED, "--simulated", HEALTHY], "--simulated needs one recording"),
        ([HEALTHY, "--simulated", "nowhere"], "nowhere: there is no such file or folder"),
    ],
)
def test_wrong_input_is_one_line_and_status_2(validate, tmp_path, arguments, said):
    (tmp_path / "empty").mkdir()
    (tmp_path / "text.mcap").write_text("this is no recording")
    (tmp_path / "broken.yaml").write_text("meta: [unclosed")
    assert said in refused(validate(*arguments))
    assert not (tmp_path / "r.html").exists()


def test_help_explains_every_option(tmp_path):
    result = as_process(tmp_path, "--help")
    assert result.returncode == 0
    for option in ("--machine", "--simulated", "--json", "--report", "--no-report", "--strict"):
        assert option in result.stdout


def test_a_mismatch_ends_with_the_line_to_type_next_and_agreement_does_not(validate, tmp_path):
    (tmp_path / "my bags").mkdir()
    (tmp_path / "my bags" / "load").symlink_to(CHANGED)
    machine = tmp_path / "m y.yaml"
    machine.write_text((files("boom_model") / "machines" / "tz17.yaml").read_text())
    result = validate(HEALTHY, "my bags/load", "--machine", machine, "--no-report")
    *_, last = result.stdout.splitlines()
    assert shlex.split(last) == ["next:", "./boom", "diagnose", "my bags/load", "--machine", str(machine)]
    assert result.stdout.count("diagnose") == 1


def test_a_recording_of_another_crane_has_no_doubts_and_no_next_command(validate, tmp_path):
    """By the other crane's masses a sound recording was to be repaired."""
    other = tmp_path / "other.yaml"
    own = files("boom_model").joinpath("machines/tz17.yaml").read_text("utf-8")
    other.write_text(own.replace("name: tz17", "name: other", 1), "utf-8")
    ended = validate(CHANGED, "--machine", other, "--no-report")
    assert ended.returncode == 0
    assert "no doubts and no levels: it was recorded on machine 'tz17'" in ended.stdout
    assert "the model is that of 'other'" in ended.stdout and "next:" not in ended.stdout
    assert "next:" in validate(CHANGED, "--no-report").stdout
