"""`./boom diagnose`: one plain line for wrong input, a plain verdict where nothing can be told, and whole files only."""

import contextlib
import json
import shutil
from importlib.resources import files
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from recording_faults import slipped, swapped

from boom_bringup import cli
from boom_bringup.commands.diagnose import _next_experiment as propose
from boom_diagnosis import run
from boom_input.whole import one_writer
from boom_recording.loading import load
from boom_recording.recording import Configuration
from boom_recording.writing import from_columns, write
from boom_report.diagnosis import report

BAGS = Path(__file__).parents[1] / "bags"


@pytest.fixture
def diagnose(tmp_path, monkeypatch, capsys):
    """The command inside this process, in a folder of its own."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("BOOM_PROGRAM", "./boom")

    def called(*arguments):
        status = cli.main(["diagnose", *map(str, arguments)])
        printed = capsys.readouterr()
        return status, printed.out, printed.err

    return called


def still(path, machine="tz17", seconds=6.0):
    """A recording at standstill."""
    count = round(seconds * 100)
    constant = {
        "angle": 0.4,
        "rate": 0.0,
        "hose_pressure": 6e6,
        "rod_pressure": 1e6,
        "retract_current": 0.0,
        "extend_current": 0.0,
    }
    columns = {name: np.full(count, value) for name, value in constant.items()}
    write(path, from_columns(path.name, np.arange(count) * 0.01, columns, Configuration(machine, 4.59, 0.0, 0.0)))
    return path


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["still", "--hold-out", "still"], "given both to diagnose and to hold out"),
        (
            ["still", "--hold-out", "sub/../still/"],
            "is the same recording as still: given both to diagnose and to hold out",
        ),
        (["still", "--hold-out", "link"], "link is the same recording as still"),
        (["still", "--hold-out", "still/still_0.mcap"], "is the same recording as still"),
        (["still", "--hold-out", "copy"], "copy is the same recording as still"),
        (["still", "--seed", "-1"], "give a number of 0 or more"),
        (["still", "--machine", "triangle_direct"], "was recorded on machine 'tz17'"),
        (["still", "--machine", "nothing.yaml"], "nothing.yaml"),
        (["nowhere"], "nowhere"),
        (["other"], "for which no file is shipped"),
    ],
)
def test_wrong_input_is_one_line_and_leaves_no_result(diagnose, tmp_path, arguments, said):
    still(tmp_path / "still")
    still(tmp_path / "other", machine="another")
    (tmp_path / "sub").mkdir()
    (tmp_path / "link").symlink_to("still")
    shutil.copytree(tmp_path / "still", tmp_path / "copy")
    status, _, err = diagnose(*arguments)
    assert status == 2
    assert said in err.strip().splitlines()[-1]
    assert not list((tmp_path / "output").rglob("*"))


def test_a_standstill_has_a_plain_verdict_and_all_files(diagnose, tmp_path):
    status, out, _ = diagnose(still(tmp_path / "still"), "--json", "d.json")
    assert status == 0 and out.startswith("not enough excitation")
    document = json.loads((tmp_path / "d.json").read_text())
    assert document["verdict"] == "not_enough_excitation" and document["findings"] == []
    names = sorted(path.name for path in (tmp_path / "output" / "diagnosis").iterdir())
    assert names == ["diagnosis.json", "machine.yaml", "report.html"]


def test_what_an_earlier_diagnosis_left_does_not_stay_beside_another_answer(diagnose, tmp_path):
    bag, folder = still(tmp_path / "still"), tmp_path / "output" / "diagnosis"
    diagnose(bag)
    (folder / "next_experiment").mkdir()
    assert diagnose(bag, "--no-report")[0] == 0
    assert sorted(path.name for path in folder.iterdir()) == ["diagnosis.json", "machine.yaml"]


@pytest.mark.parametrize("held_out", [False, True], ids=["given", "held out"])
def test_a_command_with_the_wrong_sign_is_told_and_no_physics_named(diagnose, tmp_path, held_out):
    good = BAGS / "healthy" / "extended"
    bad = swapped(load(good), "retract_current", "extend_current")
    write(tmp_path / "turned", bad)
    arguments = [good, "--hold-out", "turned"] if held_out else ["turned"]
    status, out, _ = diagnose(*arguments, "--json", "d.json")
    document = json.loads((tmp_path / "d.json").read_text())
    assert status == 0 and document["verdict"] == "sensor_or_clock"
    assert document["findings"] == [] and document["ranking"] == []
    spoilt = [check for check in document["checks"] if check["spoils"]]
    assert [(check["bag"], check["kind"], check["topic"]) for check in spoilt] == [
        ("turned", "sign", "/boom/solenoid_currents")
    ]
    assert " ".join(out.split()).startswith(
        "sensor or clock: turned, /boom/solenoid_currents: the command has the wrong sign"
    )
    assert "repair first" in (tmp_path / "output" / "diagnosis" / "report.html").read_text()


def test_an_angle_sensor_that_slips_is_told_with_its_jump_and_no_model_is_run(diagnose, tmp_path):
    write(tmp_path / "slipped", slipped(load(BAGS / "healthy" / "extended")))
    status, out, _ = diagnose("slipped", "--json", "d.json")
    document = json.loads((tmp_path / "d.json").read_text())
    (found,) = document["findings"]
    assert (status, document["verdict"], found["effect"]) == (0, "sensor_or_clock", "angle_offset")
    assert found["parameters"]["b"]["value"] == pytest.approx(-0.01, abs=6e-4)
    assert document["ranking"] == [] and "the angle jumps at" in " ".join(out.split())


SUPPORT = """learned:
  - {equation: torque, basis: ["minus(angle,0.45)"], coefficients: [30.0], unit: 10000 N m, validity: {angle: [-0.5, 1.2]}}
"""


@pytest.mark.parametrize(
    ("term", "verdicts"), [("", {"no_mismatch", "parameters_only"}), (SUPPORT, {"unknown_physics"})]
)
def test_a_crane_without_burst_valve_accumulators_and_pilot_stage_is_diagnosed(diagnose, tmp_path, term, verdicts):
    shipped = files("boom_model").joinpath("machines", "triangle_direct.yaml").read_text(encoding="utf-8")
    (tmp_path / "real.yaml").write_text(shipped + term)
    at = np.arange(0.0, 16.0, 0.01)
    lift, lower = 0.45 * ((at % 4 > 0.8) & (at % 4 < 1.8)), 0.45 * ((at % 4 > 2.6) & (at % 4 < 3.6))
    rows = "".join(f"{t:.2f},{r},{e}\n" for t, r, e in zip(at, lower, lift, strict=True))
    (tmp_path / "steps.csv").write_text("time_s,retract_a,extend_a\n" + rows)
    pose = ["--angle", "0.35", "--outer-boom-angle", "0.3", "--telescope-length", "2"]
    assert cli.main(["simulate", "steps.csv", "--machine", "real.yaml", *pose, "--output", "bag"]) == 0
    status, _, err = diagnose("bag", "--machine", "triangle_direct", "--json", "d.json")
    assert status == 0, err
    assert json.loads((tmp_path / "d.json").read_text())["verdict"] in verdicts


def test_the_next_experiment_is_a_bag_whose_file_bears_its_name(tmp_path):
    time = np.arange(50) * 0.01
    given = SimpleNamespace(time=time, expected=np.ones((50, 4)), currents=np.zeros((50, 2)))
    like = SimpleNamespace(configuration=Configuration("tz17", 0.28, 2.2, 0.0))
    assert propose(SimpleNamespace(experiment=given), like, tmp_path / "next_experiment") == ["next_experiment"]
    assert [path.name for path in tmp_path.iterdir()] == ["next_experiment"]
    assert {path.name for path in (tmp_path / "next_experiment").iterdir()} == {
        "metadata.yaml",
        "next_experiment_0.mcap",
    }
    assert load(tmp_path / "next_experiment").warnings == []


@pytest.mark.parametrize("where", ["diagnosing", "drawing"])
def test_an_interruption_leaves_the_old_report_or_none(diagnose, tmp_path, monkeypatch, where):
    folder = tmp_path / "output" / "diagnosis"
    folder.mkdir(parents=True)
    (folder / "report.html").write_text("the old one")

    def interrupted(*_, **__):
        raise KeyboardInterrupt

    if where == "diagnosing":
        monkeypatch.setattr(run, "diagnose", interrupted)
    else:
        monkeypatch.setattr(report, "page", interrupted)
    with contextlib.suppress(KeyboardInterrupt):
        assert diagnose(still(tmp_path / "still"))[0] != 0
    assert (folder / "report.html").read_text() == "the old one"
    assert not list(folder.glob("*.new*"))


def test_an_interruption_before_anything_was_found_leaves_no_folder(diagnose, tmp_path, monkeypatch):
    def interrupted(*_, **__):
        raise KeyboardInterrupt

    monkeypatch.setattr(run, "diagnose", interrupted)
    assert diagnose(still(tmp_path / "still"), "--output", tmp_path / "found")[0] == 130
    assert not (tmp_path / "found").exists()


def test_a_second_diagnosis_into_the_same_folder_is_refused_in_one_line(diagnose, tmp_path):
    folder = tmp_path / "output" / "diagnosis"
    folder.mkdir(parents=True)
    with one_writer(folder):
        status, _, err = diagnose(still(tmp_path / "still"))
    assert status == 2 and err.startswith("boom: output/diagnosis is in use by another ./boom:")
    assert err.count("\n") == 1
    assert list(folder.iterdir()) == []
