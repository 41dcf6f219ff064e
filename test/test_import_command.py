"""./boom import: foreign recordings of twelve kinds become bags with the original's values; what cannot be told is asked."""

from __future__ import annotations

import os
import re
import subprocess
from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest
import yaml
from foreign_recordings import ASKS, KINDS, Data, data_of

import boom_model
from boom_bringup import cli
from boom_identification.validation import validate
from boom_input.yaml_text import read_yaml
from boom_model.machine_file import load_machine
from boom_recording import writing
from boom_recording.loading import load
from boom_recording.recording import Configuration, GivenConfiguration

BAG = Path(__file__).parents[1] / "bags" / "healthy" / "extended"
POSE = ("--q3", "0.28", "--q4", "2.2", "--load", "0")
ORIGINAL = {
    "angle": "q",
    "rate": "w",
    "hose_pressure": "ph",
    "rod_pressure": "pb",
    "extend_current": "ie",
    "retract_current": "ir",
}
DERIVED = 0.02  # rad/s: the derivative of an angle quantised to 0.38 mrad, smoothed over 0.1 s


@pytest.fixture(scope="module")
def original() -> Data:
    """The first 25 s: long enough to lift and lower."""
    whole = data_of(BAG)
    kept = whole.t < 25.0
    return Data(*(getattr(whole, field.name)[kept] for field in fields(whole)))


@pytest.fixture(autouse=True)
def _here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def boom(*words: str) -> int:
    return cli.main(words)


@pytest.mark.parametrize("kind", sorted(set(KINDS) - set(ASKS)))
def test_a_foreign_recording_is_imported_with_the_proposed_mapping(kind: str, original: Data, tmp_path: Path) -> None:
    files = KINDS[kind](original, tmp_path)
    assert boom("import", *map(str, files), "--yes", "--no-report", *POSE, "--output", "made") == 0
    made = load(tmp_path / "made")
    for signal, field in ORIGINAL.items():
        own = made.signals[signal]
        # An MF4 file has groups with times of their own: the original is looked at between its samples.
        wanted = np.interp(own.time, original.t, getattr(original, field))
        derived = signal == "rate" and "derivative" in str(read_yaml(mapping_of(files[0]))["signals"]["rate"])
        inner = slice(20, -20) if derived else slice(None)
        # One signed current holds the difference of both, and at rest both measure a milliampere of noise.
        allowed = (
            DERIVED
            if derived
            else 1e-3 * np.ptp(wanted) + (0.002 if kind == "mf4_signed" and "current" in signal else 0.0)
        )
        assert np.abs(own.values - wanted)[inner].max() <= allowed, signal
    assert validate(made, load_machine("tz17")).mismatches == []
    assert made.configuration.machine == ""


def mapping_of(file: Path) -> Path:
    return Path("output") / f"import-{file.name if file.suffix != '.mcap' else file.stem}.yaml"


def test_what_the_file_does_not_say_is_asked_and_the_answer_imports_it(
    original: Data, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (file,) = KINDS["csv_percent"](original, tmp_path)
    assert boom("import", str(file), "--yes", "--no-report", *POSE, "--output", "made") == 2
    said = capsys.readouterr().err
    assert "extend_current: no column fits it" in said and "percent" in said and said.count("\n") == 1
    assert not Path("made").exists()
    mapping = mapping_of(file)
    answer = '{column: "Valve command (%)", unit: A, sign: SIGN, scale: 0.006, part: PART}'
    text = mapping.read_text()
    for signal, sign, part in (("extend_current", "1", "positive"), ("retract_current", "-1", "negative")):
        entry = answer.replace("SIGN", sign).replace("PART", part)
        text = text.replace(f"  {signal}: ask", f"  {signal}: {entry}")
    mapping.write_text(text)
    assert boom("import", str(file), "--mapping", str(mapping), "--no-report", *POSE, "--output", "made") == 0
    made = load(tmp_path / "made")
    net = made.signals["extend_current"].values - made.signals["retract_current"].values
    assert np.abs(net - (original.ie - original.ir)).max() < 1e-4


def test_without_a_terminal_nothing_is_taken_without_yes(
    original: Data, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (file,) = KINDS["csv_german"](original, tmp_path)
    assert boom("import", str(file), "--output", "made") == 2
    assert "take this mapping with --yes, or edit output/import-Messung_03.csv.yaml" in capsys.readouterr().err
    page = Path("output/import-Messung_03.csv.html").read_text()
    assert "Strom Heben [mA]" in page and "Columns that are left out" in page


@pytest.mark.parametrize("command", ["validate", "identify", "diagnose", "simulate"])
@pytest.mark.parametrize("name", ["x.txt", "x.mat", "x.mf4", "x.bag", "x.db3"])
def test_a_command_says_what_to_type_for_a_foreign_file(
    command: str, name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / name).write_bytes(b"some bytes of another kind")
    extra = ("--output", "made") if command == "simulate" else ()
    assert boom(command, name, *extra) == 2
    assert f"import it: ./boom import {name} --output output/x\n" in capsys.readouterr().err


@pytest.fixture(scope="module")
def bare(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A bag without a configuration whose joint has another name."""
    recording = load(BAG)
    recording.stored_configuration = None
    path = tmp_path_factory.mktemp("bare") / "bare"
    writing.write(path, recording, joint="main_boom")
    return path


def test_pose_load_and_joint_are_given_where_the_bag_lacks_them(bare: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert boom("validate", str(bare)) == 2
    assert "give its name with --joint" in capsys.readouterr().err
    assert boom("validate", str(bare), "--joint", "main_boom") == 2
    assert "--q3 RAD --q4 M --load KG, and the machine with --machine" in capsys.readouterr().err
    assert boom("validate", str(bare), "--joint", "main_boom", *POSE) == 2
    assert "no machine named" in capsys.readouterr().err
    words = ("--joint", "main_boom", *POSE, "--machine", "tz17")
    assert boom("validate", str(bare), *words, "--no-report", "--strict") == 0
    assert boom("simulate", str(bare), *words, "--duration", "3", "--output", "made") == 0


def test_what_the_contract_names_is_not_asked(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A supply whose pressure moves like the rod's, and a rod pressure that moves like nothing."""
    recording = load(BAG)
    hose, rod = recording.signals["hose_pressure"], recording.signals["rod_pressure"]
    steps = 50e5 + 1e5 * np.floor(rod.time / 7.0)
    recording.signals["supply_pressure"] = replace(rod, name="supply_pressure", topic="/boom/supply_pressure")
    recording.signals["rod_pressure"] = replace(rod, values=steps)
    recording.signals["tank_pressure"] = replace(hose, name="tank_pressure", topic="/boom/tank_pressure")
    writing.write(tmp_path / "bag", recording)
    assert boom("import", "bag", "--yes", "--no-report", "--output", "made") == 0
    np.testing.assert_allclose(load(tmp_path / "made").signals["rod_pressure"].values, steps, atol=1.0)


def test_a_pressure_that_nobody_recorded_is_no_question_and_what_is_left_out_is_named(
    original: Data, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The smallest set of sensors of a loader crane: angle, hose pressure, currents."""
    columns = {
        "time [s]": original.t, "boom angle [deg]": np.degrees(original.q), "piston side [bar]": original.ph / 1e5,
        "oil temperature [degC]": 40.0 + original.t / 60.0, "lift [mA]": 1e3 * original.ie, "lower [mA]": 1e3 * original.ir,
    }  # fmt: skip
    table = np.column_stack(list(columns.values()))
    np.savetxt(tmp_path / "run.csv", table, delimiter=",", header=",".join(columns), comments="", fmt="%.5f")
    assert boom("import", "run.csv", "--yes", "--no-report", *POSE, "--machine", "tz17", "--output", "made") == 0
    said = " ".join(capsys.readouterr().out.split())
    assert "no column is the rod pressure" in said and "not used: 'oil temperature [degC]'" in said
    assert not len(load(tmp_path / "made").signals["rod_pressure"].time)


def table_of(original: Data, tmp_path: Path, **changed: tuple[str, np.ndarray]) -> None:
    """run.csv of a logger; ``changed``: heading and numbers of some columns."""
    columns = {
        "time": ("time [s]", original.t), "angle": ("boom angle [deg]", np.degrees(original.q)),
        "hose": ("head pressure [bar]", original.ph / 1e5), "rod": ("rod pressure [bar]", original.pb / 1e5),
        "lift": ("lift [mA]", 1e3 * original.ie), "lower": ("lower [mA]", 1e3 * original.ir),
    } | changed  # fmt: skip
    heading = ";".join(name for name, _ in columns.values())
    table = np.column_stack([values for _, values in columns.values()])
    np.savetxt(tmp_path / "run.csv", table, delimiter=";", header=heading, comments="", fmt="%.5f")


def test_a_transmitter_in_milliamperes_is_asked_for_and_no_pressure_in_megapascals(
    original: Data, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    table_of(original, tmp_path, rod=("rod pressure transmitter [mA]", 4.0 + 16.0 * original.pb / 250e5))
    assert boom("import", "run.csv", "--yes", "--no-report", *POSE, "--output", "made") == 2
    said = capsys.readouterr().err
    assert "is in mA: if it is its transmitter" in said and "scale R/16, offset -R/4" in said
    written = mapping_of(tmp_path / "run.csv").read_text()
    entry = 'rod_pressure: {column: "rod pressure transmitter [mA]", unit: "bar", scale: 15.625, offset: -62.5, reference: "gauge"}'
    Path("m.yaml").write_text(written.replace("rod_pressure: ask", entry))
    assert boom("import", "run.csv", "--mapping", "m.yaml", "--no-report", *POSE, "--output", "made") == 0
    np.testing.assert_allclose(load(tmp_path / "made").signals["rod_pressure"].values, original.pb, atol=20.0)


def test_a_unit_that_nobody_knows_is_asked_for(
    original: Data, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    table_of(original, tmp_path, hose=("head pressure [bar x10]", original.ph / 1e6))
    assert boom("import", "run.csv", "--yes", "--no-report", *POSE, "--output", "made") == 2
    assert "is in 'bar x10', which is no unit that is known" in capsys.readouterr().err


def test_an_angle_in_hundredths_of_a_degree_from_the_vertical_is_one_from_the_horizontal(
    original: Data, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    table_of(original, tmp_path, angle=("boom from vertical [0.01 deg]", 9000.0 - 100.0 * np.degrees(original.q)))
    assert boom("import", "run.csv", "--yes", "--no-report", *POSE, "--output", "made") == 0
    assert "counts from the vertical" in capsys.readouterr().out
    np.testing.assert_allclose(load(tmp_path / "made").signals["angle"].values, original.q, atol=1e-6)


def test_a_piston_in_the_place_of_the_joint_is_shown_in_millimetres_and_sent_to_chain(
    original: Data, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    table_of(original, tmp_path, angle=("stroke [mm]", 100.0 + 300.0 * original.q))
    lines = [f'{name}: {{column: "{column}", unit: "{unit}"{more}}}' for name, column, unit, more in (
        ("angle", "stroke [mm]", "mm", ""), ("hose_pressure", "head pressure [bar]", "bar", ", reference: gauge"),
        ("rod_pressure", "rod pressure [bar]", "bar", ", reference: gauge"), ("extend_current", "lift [mA]", "mA", ""),
        ("retract_current", "lower [mA]", "mA", ""),
    )]  # fmt: skip
    Path("m.yaml").write_text("signals:\n  rate: derivative of angle\n" + "".join(f"  {line}\n" for line in lines))
    assert boom("import", "run.csv", "--mapping", "m.yaml", "--no-report", "--output", "made") == 0
    said = " ".join(capsys.readouterr().out.split())
    assert re.search(r"stroke \[mm\] │ mm │ \+ │ [\d.]+ \.\. [\d.]+ mm", said)
    assert "./boom chain made --areas A_A A_B" in said and "validate" not in said


def test_the_bag_carries_the_name_of_its_machine_file(
    original: Data, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text = (Path(boom_model.__file__).parent / "machines" / "tz17.yaml").read_text()
    Path("stranger.yaml").write_text(text.replace("name: tz17", "name: stranger", 1))
    (file,) = KINDS["csv_german"](original, tmp_path)
    words = ("import", str(file), "--yes", "--no-report")
    assert boom(*words, "--machine", "stranger.yaml", *POSE, "--output", "named") == 0
    assert "./boom validate named --machine stranger.yaml\n" in capsys.readouterr().out
    assert load(tmp_path / "named").configuration.machine == "stranger"
    assert boom(*words, "--output", "bare") == 0
    assert "./boom validate bare --q3 RAD --q4 M --load KG --machine FILE\n" in capsys.readouterr().out
    assert boom(*words, "--machine", "tz17", "--output", "no_pose") == 0  # a bag names no machine without a pose
    assert "./boom validate no_pose --q3 RAD --q4 M --load KG --machine tz17\n" in capsys.readouterr().out


def test_a_machine_with_one_pose_tells_it_and_a_load_without_a_pose_is_not_lost_in_silence(
    original: Data, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    document = yaml.safe_load((Path(boom_model.__file__).parent / "machines" / "tz17.yaml").read_text())
    body = document["rigid_body"]
    body["configs"] = {"only": body["configs"]["T3_extended"]}
    for name in ("planar", "bodies"):
        body.pop(name, None)
    Path("one.yaml").write_text(yaml.safe_dump(document))
    (file,) = KINDS["csv_german"](original, tmp_path)
    words = ("import", str(file), "--yes", "--no-report", "--load", "220")
    assert boom(*words, "--machine", "one.yaml", "--output", "with") == 0
    assert "note: pose: q3 0.28 rad, q4 2.2 m, the only one of one.yaml" in capsys.readouterr().out
    configuration = load(tmp_path / "with").configuration
    assert (configuration.outer_boom_angle, configuration.telescope_length, configuration.load_mass) == (
        0.28,
        2.2,
        220.0,
    )
    assert boom(*words, "--output", "without") == 0
    assert "the load of 220 kg is not kept without a pose" in " ".join(capsys.readouterr().out.split())


def test_a_given_load_replaces_the_recorded_one() -> None:
    given = GivenConfiguration(load_mass=120.0)
    assert load(BAG, given=given).configuration == Configuration("tz17", 0.28, 2.2, 120.0, "stand-in machine")


def test_a_bag_with_foreign_topics_is_sent_to_the_import(
    original: Data, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (file,) = KINDS["opera"](original, tmp_path)
    assert boom("diagnose", str(file)) == 2
    said = capsys.readouterr().err
    assert "the bag has /zx120/boom_down_solenoid_current" in said
    assert f"import it: ./boom import {file} --output output/zx120_boom" in said


@pytest.mark.parametrize("name", [b"bad\xff.csv", b"it's\n new.csv", "\u202ecsv.csv".encode()])
def test_a_file_of_any_name_is_imported_by_the_line_that_the_command_shows(
    name: bytes, original: Data, capsys: pytest.CaptureFixture[str]
) -> None:
    (made,) = KINDS["csv_german"](original, Path())
    made.rename(os.fsdecode(name))
    assert boom("import", os.fsdecode(name), "--no-report", *POSE, "--output", "made") == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    line = said.strip().partition(", then: ")[2]
    words = subprocess.run(["bash", "-c", f"printf '%s\\0' {line}"], capture_output=True, check=True).stdout.split(
        b"\0"
    )
    assert words[:3] == [b"./boom", b"import", name]
    assert boom(*map(os.fsdecode, words[1:-1]), "--no-report", *POSE) == 0
    assert load("made").warnings == []


def test_a_proposal_that_was_edited_is_kept(original: Data, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    files = KINDS[sorted(set(KINDS) - set(ASKS))[0]](original, tmp_path)
    words = ("import", *map(str, files), "--yes", "--no-report", *POSE, "--output")
    proposed = mapping_of(files[0])
    assert boom(*words, "first") == 0 and boom(*words, "second") == 0
    assert not proposed.with_suffix(".new.yaml").exists()
    edited = proposed.read_text(encoding="utf-8") + "# mine\n"
    proposed.write_text(edited, encoding="utf-8")
    assert boom(*words, "third") == 0
    assert proposed.read_text(encoding="utf-8") == edited and proposed.with_suffix(".new.yaml").exists()
    assert "was edited and stays" in capsys.readouterr().out


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize(
    ("scale", "status", "said"),
    [("1e0", 0, ""), ("0", 2, "scale: 0 makes the channel a constant"), ("1e308", 2, " lie outside ")],
)
def test_a_scale_may_have_an_exponent_and_leaves_the_channel_in_its_range(
    original: Data, tmp_path: Path, capsys: pytest.CaptureFixture[str], scale: str, status: int, said: str
) -> None:
    files = KINDS[sorted(set(KINDS) - set(ASKS))[0]](original, tmp_path)
    assert boom("import", *map(str, files), "--yes", "--no-report", *POSE, "--output", "made") == 0
    text = mapping_of(files[0]).read_text(encoding="utf-8").replace("scale: 1.0", f"scale: {scale}")
    Path("own.yaml").write_text(text, encoding="utf-8")
    words = ("import", *map(str, files), "--mapping", "own.yaml", "--report", "page.html", *POSE, "--output", "again")
    capsys.readouterr()
    assert boom(*words) == status
    error = capsys.readouterr().err
    assert said in error and error.count("\n") == bool(status)


def test_a_bag_that_the_commands_refuse_is_not_to_be_compared(
    original: Data, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    files = KINDS[sorted(set(KINDS) - set(ASKS))[0]](original, tmp_path)
    assert boom("import", *map(str, files), "--yes", "--no-report", *POSE, "--output", "made") == 0
    assert "compare it with the model" in capsys.readouterr().out
    text = re.sub("  angle: .*", "  angle: none", mapping_of(files[0]).read_text(encoding="utf-8"))
    Path("own.yaml").write_text(re.sub("  rate: .*", "  rate: none", text), encoding="utf-8")
    words = ("import", *map(str, files), "--mapping", "own.yaml", "--no-report", *POSE, "--output", "again")
    assert boom(*words) == 0
    told = capsys.readouterr().out
    assert "without angle: the commands will refuse the bag" in told and "compare it" not in told
