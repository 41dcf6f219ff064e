"""./boom new-machine: from answers to a file that the other commands take, and what recordings can tell before a fit."""

from __future__ import annotations

import json
import os
import pty
import re
import subprocess
import sys
from collections.abc import Mapping
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from boom_bringup import cli
from boom_bringup.commands._manoeuvre import best_manoeuvre
from boom_model.errors import MachineError
from boom_model.machine_file import check_machine, load_machine
from boom_model.owner import draft
from boom_model.owner.moments import of_masses
from boom_model.owner.questions import BY_KEY
from boom_model.plant import Plant
from boom_recording import writing
from boom_recording.recording import Configuration, Recording
from boom_sim.offline import simulate
from boom_sim.simulated_crane import CraneStart

ANSWERS: dict[str, Any] = {
    "name": "loader", "foot_distance": 1.32, "eye_distance": 0.61, "closed_length": 0.905, "stroke": 0.62, "lowest_angle": -21.57,
    "piston_diameter": 80, "rod_diameter": 45, "inner_mass": 300, "inner_length": 2.2, "outer_mass": 120, "outer_length": 1.5,
    "outer_angle": -20, "tool_mass": 30, "pump_pressure": 165, "opening_current": 0.09, "full_current": 1.0, "lift_flow": 26,
    "lower_flow": 22, "q3": 0.3, "q4": 0.0,
}  # fmt: skip


DRAWN = {
    "foot_x": 0.433, "foot_y": -1.7682, "pivot_x": -0.12, "pivot_y": -0.07, "eye_x": 0.45388, "eye_y": -0.036034, "long_bar": 0.57,
    "short_bar": 0.124, "closed_length": 1.253, "stroke": 0.976,
}  # fmt: skip
"""The linkage of tz17."""
FORESTRY = {
    "spool": "pilot", "opening_current": 0.30, "full_current": 0.55, "opening_pressure": 6.9, "full_pressure": 22.95,
    "cylinder_valve": "hose_burst", "limit_flow": 98.0, "accumulators": "hose", "precharge_1": 75, "precharge_2": 55,
    "orifice_2": 1.5, "piston_diameter": 140, "rod_diameter": 90, "compensator": "yes",
}  # fmt: skip


def words(answers: Mapping[str, Any]) -> list[str]:
    """As options."""
    return [word for key, value in answers.items() for word in (f"--{key.replace('_', '-')}", str(value))]


def four_bar(**other: float) -> list[str]:
    """The linkage of tz17 as options, but for these."""
    return words({"linkage": "four_bar", **DRAWN, **other})


def pins(**given: float) -> list[str]:
    """Pins of a drawing as options."""
    return words({"linkage": "pins", **given})


URDF = str(files("boom_description") / "urdf" / "epsilon_tz17.urdf")


@pytest.fixture
def answers(tmp_path: Path) -> Path:
    path = tmp_path / "answers.yaml"
    path.write_text(yaml.safe_dump(ANSWERS), encoding="utf-8")
    return path


def recorded(machine: str, directory: Path, *pulses: tuple[float, float, float]) -> Recording:
    """20 s of a crane as in a file but for its friction, driven by pulses (from, to, current; < 0 lowers)."""
    crane = load_machine(machine).with_values({"friction.F_C_pos": 800.0, "friction.F_C_neg": 350.0})
    time = np.arange(0.0, 20.0, 0.01)
    currents = np.zeros((len(time), 2))
    for begin, end, size in pulses:
        currents[(time >= begin) & (time < end), int(size > 0)] = abs(size)
    made = simulate(
        crane,
        Configuration("loader", 0.3, 0.0, 0.0),
        CraneStart(-0.2),
        time,
        currents,
        noise=crane.sensor_noise(),
        name=directory.name,
    )
    writing.write(directory, made)
    return made


def test_a_lift_tells_the_lifting_edge_and_the_manoeuvre_that_is_proposed_tells_the_lowering_one(
    answers: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    first, file, found = tmp_path / "first.yaml", tmp_path / "crane.yaml", tmp_path / "told.json"
    assert cli.main(["new-machine", "--answers", str(answers), "--output", str(first), "--no-manoeuvre"]) == 0
    recorded(str(first), tmp_path / "lift", (2.0, 4.0, 0.3), (6.0, 7.5, 0.35))
    words = [
        "--answers",
        str(answers),
        "--output",
        str(file),
        "--json",
        str(found),
        "--manoeuvre",
        str(tmp_path / "next.csv"),
    ]
    assert cli.main(["new-machine", *words, str(tmp_path / "lift")]) == 0
    assert "record next: 40 s of" in capsys.readouterr().out
    document = json.loads(found.read_text())
    now, then = ({row["parameter"]: row for row in rows} for rows in (document["told"], document["manoeuvre"]["told"]))
    edge = "main_valve_orifices.A_{}_max"
    # with the form of its notches open, too, an edge's area is told together with that
    assert now[edge.format("sa")]["told"] in ("told", "only together")
    assert now[edge.format("sb")]["told"] == "not"
    assert then[edge.format("sb")]["told"] in ("told", "only together")
    assert (
        "45 %" in document["recordings"][0]["coverage"][0]
        or "% of the range" in document["recordings"][0]["coverage"][0]
    )
    machine, faults = check_machine(file)
    assert machine is not None, faults
    assert machine.sensors["p_quant"] == pytest.approx(1e4)
    written = yaml.safe_load(file.read_text())
    assert (written["friction"]["F_C_pos"]["prov"], written["cylinder"]["A_a"]["prov"]) == ("assumed", "answered")
    for command in (
        ("check-machine", str(file)),
        ("validate", str(tmp_path / "lift"), "--machine", str(file), "--no-report"),
    ):
        assert cli.main(list(command)) == 0
    steps = (
        "simulate",
        str(tmp_path / "next.csv"),
        "--machine",
        str(file),
        "--q3",
        "0.3",
        "--q4",
        "0",
        "--angle",
        "0.05",
    )
    assert cli.main([*steps, "--output", str(tmp_path / "next")]) == 0


def test_a_recording_with_its_command_the_wrong_way_round_is_doubted_and_tells_nothing(
    answers: Path, tmp_path: Path
) -> None:
    file, found = tmp_path / "crane.yaml", tmp_path / "told.json"
    assert cli.main(["new-machine", "--answers", str(answers), "--output", str(file), "--no-manoeuvre"]) == 0
    good = recorded(
        str(file), tmp_path / "good", (2.0, 4.0, 0.3), (6.0, 7.5, -0.25), (10.0, 12.0, 0.3), (14.0, 15.5, -0.25)
    )
    signals = dict(good.signals)
    signals["retract_current"], signals["extend_current"] = (
        type(signals["retract_current"])(**{**vars(signals[name]), "name": other})
        for name, other in (("extend_current", "retract_current"), ("retract_current", "extend_current"))
    )
    good.signals.update(signals)
    writing.write(tmp_path / "turned", good)
    words = [
        "--answers",
        str(answers),
        "--output",
        str(tmp_path / "other.yaml"),
        "--json",
        str(found),
        "--no-manoeuvre",
    ]
    assert cli.main(["new-machine", *words, str(tmp_path / "turned")]) == 0
    document = json.loads(found.read_text())
    assert "sign" in [check["kind"] for check in document["recordings"][0]["checks"]]
    assert document["told"] == []


def test_options_have_precedence_and_a_urdf_gives_the_moments_of_the_pose(answers: Path, tmp_path: Path) -> None:
    file = tmp_path / "crane.yaml"
    positions = ["--position", "outer_boom_joint=0.28", "--position", "telescope_joint=2.8"]
    words = [
        "--answers",
        str(answers),
        "--urdf",
        URDF,
        *positions,
        "--piston-diameter",
        "140",
        "--q3",
        "0.28",
        "--q4",
        "2.8",
    ]
    assert (
        cli.main(["new-machine", *words, "--cylinder-valve", "load_holding", "--no-manoeuvre", "--output", str(file)])
        == 0
    )
    machine, known = load_machine(file), load_machine("tz17").pose(0.28, 2.8)
    pose = machine.pose(0.28, 2.8)
    for name in ("D0", "Sx", "Sy"):
        assert getattr(pose, name) == pytest.approx(getattr(known, name), rel=0.01)
    assert pose.tip == pytest.approx(known.tip, abs=1e-3)
    assert machine.parameters["cylinder.A_a"].value[0] == pytest.approx(np.pi / 4 * 0.14**2, rel=1e-5)
    assert machine.structure.hose_burst_valve.holds
    assert str(machine.parameters["fluid.beta"].tol) == "factor 2"


def test_what_no_answer_told_and_was_taken_as_proposed_is_said(
    answers: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A set pressure that a data sheet tells, forgotten in the answers, was 180 bar without a word."""
    given = words({"cylinder_valve": "load_holding", "pilot_ratio": 3.0})
    common = ["new-machine", "--answers", str(answers), *given, "--no-manoeuvre", "--output"]
    assert cli.main([*common, str(tmp_path / "a.yaml")]) == 0
    (line,) = (row for row in capsys.readouterr().out.splitlines() if row.startswith("taken as proposed"))
    assert "set_pressure 180 bar" in line and "pilot_ratio" not in line and "lift_flow" not in line


def test_yes_and_no_in_a_file_of_answers_are_words_as_on_the_command_line(answers: Path, tmp_path: Path) -> None:
    with answers.open("a", encoding="utf-8") as file:
        file.write("compensator: yes\n")
    words = ("--answers", str(answers), "--no-manoeuvre", "--output", str(tmp_path / "crane.yaml"))
    assert cli.main(["new-machine", *words]) == 0
    assert load_machine(tmp_path / "crane.yaml").document["main_valve_orifices"]["compensator"] is True


def test_a_forestry_crane_has_linkage_pilot_stage_burst_valve_and_accumulators(answers: Path, tmp_path: Path) -> None:
    """From what a drawing and data sheets of tz17 say: its linkage over the whole range, its pilot pressures, its burst valve."""
    file = tmp_path / "crane.yaml"
    given = words({"linkage": "four_bar", **DRAWN, **FORESTRY})
    assert cli.main(["new-machine", "--answers", str(answers), *given, "--no-manoeuvre", "--output", str(file)]) == 0
    made, known = load_machine(file), load_machine("tz17")
    assert made.angle_limits[0] == pytest.approx(known.angle_limits[0], abs=2e-3)
    assert made.angle_limits[1] >= known.angle_limits[1]  # where the cylinder ends; the thesis' boom stops before
    for angle in np.linspace(*known.angle_limits, 9):
        stroke = [float(m.structure.linkage.piston_position(angle, m.numbers)) for m in (made, known)]
        assert stroke[0] == pytest.approx(stroke[1], abs=1e-6)
    for current, pressure in ((0.0, 0.0), (0.30, 6.9e5), (0.55, 22.95e5)):
        assert made.structure.pilot_valves.pressure(current, made.numbers) == pytest.approx(pressure)
    assert made.parameters["pilot_valves.h"].value == pytest.approx(
        (74.9, 0.53, 0.0), abs=0.1
    )  # the thesis: 76.1, -0.58, 0.247
    plant, time = Plant(made, made.pose(0.3, 0.0)), np.arange(0.0, 3.0, 0.01)
    for current, moves in ((0.25, False), (0.35, True)):
        run = plant.run(time, np.tile([0.0, current], (len(time), 1)), time, plant.equilibrium(0.3), start=0.0)
        assert (np.ptp(run.state("angle")) > 2e-3) == moves
        pressed = float(made.structure.pilot_valves.pressure(current, made.numbers)) / 22.95e5
        opened = -run.state("spool_position")[-1] / made.numbers.main_valve_spool.s_max
        assert opened == pytest.approx(pressed, abs=0.02)
    for key in ("a12", "a30"):
        name = f"hose_burst_valve.{key}"
        assert made.parameters[name].value == pytest.approx(known.parameters[name].value, rel=1e-3)
    driven = best_manoeuvre(made, [], None).currents
    assert 0.30 <= driven[driven > 0.0].min() < driven.max() <= 0.55
    assert made.numbers.accumulators.p_g0_2 == pytest.approx(55e5)


def test_pins_of_a_drawing_are_the_triangle_of_their_lengths(answers: Path, tmp_path: Path) -> None:
    """Foot 1.2 m below and 0.55 m before the joint: the lowest angle follows from the drawing."""
    drawn, measured = tmp_path / "drawn.yaml", tmp_path / "measured.yaml"
    pins = {"linkage": "pins", "foot_x": 0.55, "foot_y": -1.2, "eye_x": 0.6, "eye_y": -0.11}
    start = ["new-machine", "--answers", str(answers), "--no-manoeuvre", "--output"]
    assert cli.main([*start, str(drawn), *words(pins)]) == 0
    first = load_machine(drawn)
    lengths = {"foot_distance": np.hypot(0.55, 1.2), "eye_distance": np.hypot(0.6, 0.11)}
    lowest = {"lowest_angle": np.degrees(first.angle_limits[0])}
    assert cli.main([*start, str(measured), *words(lengths | lowest)]) == 0
    second = load_machine(measured)
    for angle in np.linspace(*first.angle_limits, 5):
        joint = 0.6 * np.cos(angle) + 0.11 * np.sin(angle), 0.6 * np.sin(angle) - 0.11 * np.cos(angle)
        length = np.hypot(joint[0] - 0.55, joint[1] + 1.2)
        for machine in (first, second):
            stroke = machine.structure.linkage.piston_position(angle, machine.numbers)
            assert float(stroke) + 0.905 == pytest.approx(length, abs=1e-4)


def test_masses_and_lengths_give_the_moments_of_rods() -> None:
    rods = {
        "inner_mass": 100.0,
        "inner_length": 2.0,
        "outer_mass": 50.0,
        "outer_length": 1.0,
        "outer_angle": -90.0,
        "tool_mass": 10.0,
    }
    body = of_masses(rods)
    assert pytest.approx(100 * 4 / 3 + 50 * (4 + 0.25 + 1 / 12) + 10 * 5) == body.D0
    assert (body.Sx, body.Sy) == pytest.approx((100 + 100 + 20, -25 - 10))
    assert body.tip == pytest.approx((2.0, -1.0))


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("--piston-diameter", "abc"), "piston_diameter: abc is no number of 20 .. 500 mm"),
        (("--rod-diameter", "90"), "rod_diameter: 90 mm is not below piston_diameter"),
        (("--closed-length", "3"), "measure the three lengths again"),
        (("--moments", "urdf"), "give --urdf FILE"),
        (("--moments", "numbers"), "no answer to --inertia [kg m^2]; --moment-x [kg m]; --tip-x [m]"),
        (("--urdf", "missing.urdf"), "missing.urdf"),
        (
            ("--position", "outer_boom_joint=1"),
            "--position says something of a robot description: give its --urdf FILE",
        ),
        (("--downwards",), "--downwards says something of a robot description"),
        (("--urdf", URDF, "--moments", "masses"), "--moments masses and --urdf contradict each other"),
        (
            ("--urdf", URDF, "--position", "outer_boom_joint=16"),
            "outer_boom_joint=16: it moves from -0.91 to 4.6 rad or m",
        ),
        (("--urdf", URDF, "--position", "inner_boom_joint=1e300"), "inner_boom_joint=1e+300: it moves from"),
        (("--urdf", URDF, "--position", "nope=1"), "no joint nope on the way to boom_tip; there are slewing_joint"),
        (("--urdf", URDF, *2 * ("--position", "telescope_joint=1")), "telescope_joint=1: its position is given twice"),
        (("--manoeuvre", "next.csv", "--no-manoeuvre"), "contradict each other"),
        (("nowhere",), "nowhere"),
        (four_bar(closed_length=2.9), "closed_length: with these pins and bars the cylinder is"),
        (four_bar(pivot_x=9.0), "closed_length: with these pins and bars the linkage never closes"),
        (four_bar(eye_y=0.5), "lifts between 0 and 39 mm of its stroke, not from 1.253 m over its stroke of 0.976 m"),
        (
            pins(foot_x=0.3, foot_y=1.2, eye_x=0.6, eye_y=0.11),
            "a cylinder that lifts by retracting cannot be described",
        ),
        (
            ("--spool", "pilot", "--opening-pressure", "22"),
            "opening_pressure: 22 bar is not below full_pressure, 22 bar",
        ),
        (
            ("--spool", "pilot", "--opening-pressure", "15"),
            "opening_pressure: no pilot valve has 15 bar at 0.09 A and 22 bar at 1 A",
        ),
        (("--spool", "pilot", "--opening-current", "0"), "opening_pressure: no pilot valve has 6 bar at 0 A"),
        (
            ("--cylinder-valve", "hose_burst", "--accumulators", "hose"),
            "no answer to --limit-flow [l/min]; --precharge-1 [bar]",
        ),
        (("--limit-flow", "50"), "--limit-flow goes with --cylinder-valve hose_burst: give that, or leave it out"),
        (("--foot-x", "0.4"), "--foot-x goes with --linkage pins or four_bar"),
        (("--stroke", "1.9"), "stroke: 1.9 m is not possible in a cylinder that is 0.905 m long retracted"),
    ],
)
def test_an_answer_that_cannot_be_is_said_in_one_line_and_nothing_is_written(
    words: tuple[str, ...],
    said: str,
    answers: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    assert cli.main(["new-machine", "--answers", str(answers), "--output", "crane.yaml", *words]) == 2
    error = capsys.readouterr().err
    assert said in error
    assert error.count("\n") == 1
    assert [path.name for path in tmp_path.iterdir()] == ["answers.yaml"]


@pytest.mark.parametrize("there", ["file", "link to nothing", "file of another command meanwhile"])
def test_nothing_that_has_the_name_of_the_machine_file_is_replaced(
    there: str, answers: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "crane.yaml"
    if there == "file":
        file.write_text("mine", encoding="utf-8")
    elif there == "link to nothing":
        file.symlink_to("nowhere.yaml")
    else:
        text = draft.text

        def slowly(*given: Any) -> str:
            file.write_text("mine", encoding="utf-8")
            return text(*given)

        monkeypatch.setattr(draft, "text", slowly)
    words = ["new-machine", "--answers", str(answers), "--output", str(file), "--yes", "--no-manoeuvre"]
    assert cli.main(words) == 2
    error = capsys.readouterr().err
    assert "crane.yaml exists already" in error and error.count("\n") == 1
    assert file.is_symlink() or file.read_text(encoding="utf-8") == "mine"
    assert not (tmp_path / "nowhere.yaml").exists()


def test_on_a_terminal_it_asks_what_is_open_and_again_where_the_answer_cannot_be(answers: Path, tmp_path: Path) -> None:
    own, theirs = pty.openpty()
    left = {key: value for key, value in ANSWERS.items() if key != "pump_pressure"}
    answers.write_text(yaml.safe_dump(left), encoding="utf-8")
    command = [
        sys.executable,
        "-m",
        "boom_bringup.cli",
        "new-machine",
        "--answers",
        str(answers),
        "--output",
        "crane.yaml",
    ]
    with subprocess.Popen(command, stdin=theirs, stdout=theirs, stderr=theirs, cwd=tmp_path, close_fds=True) as process:
        os.close(theirs)
        # linkage, hose_length, hose_bore, moments first without a URDF; pump_pressure first wrong; the proposals for the others
        os.write(own, b"\n3.5\n\nurdf\n\nmuch\n180\n" + 13 * b"\n")
        shown = b""
        try:
            while chunk := os.read(own, 65536):
                shown += chunk
        except OSError:  # the other end is closed
            pass
    os.close(own)
    assert process.returncode == 0, shown.decode()
    assert b"moments: urdf needs the robot description" in shown
    assert b"pump_pressure: much is no number of 20 .. 500 bar" in shown
    machine = load_machine(tmp_path / "crane.yaml")
    assert machine.parameters["fluid.p_s"].value[0] == pytest.approx(180e5)
    hose = np.pi / 4 * 0.019**2 * 3.5
    assert machine.parameters["cylinder.V_h"].value[0] == pytest.approx(hose, rel=1e-5)


@pytest.mark.parametrize("given", ["1.6 m", "1,6", "1.6m", 1.6])
def test_an_answer_may_bear_its_unit_and_a_decimal_comma(given: str | float) -> None:
    assert BY_KEY["closed_length"].checked(given) == 1.6


def test_an_answer_in_another_unit_is_refused() -> None:
    with pytest.raises(MachineError, match=r"closed_length: 1\.6 mm is no number"):
        BY_KEY["closed_length"].checked("1.6 mm")


@pytest.mark.parametrize(("key", "given", "meant"), [("q3", 34, "0.593 rad"), ("full_current", 600, "0.6 A")])
def test_an_answer_in_degrees_or_milliamperes_is_refused_with_what_it_is_in_the_unit_asked(
    key: str, given: float, meant: str
) -> None:
    with pytest.raises(MachineError, match=f"did you mean {meant}"):
        BY_KEY[key].checked(given)


def test_a_compensator_keeps_the_drop_at_which_the_flows_of_the_data_sheet_hold(answers: Path, tmp_path: Path) -> None:
    """59 l/min at 9 bar had become 56, as the margin stayed at 8."""
    path = tmp_path / "crane.yaml"
    words = ["--answers", str(answers), "--compensator", "yes", "--flow-drop", "9", "--no-manoeuvre"]
    assert cli.main(["new-machine", *words, "--output", str(path)]) == 0
    margin = load_machine(path).numbers.main_valve_orifices.dp_c
    assert margin == pytest.approx(9.0e5)


def test_a_load_holding_valve_of_a_data_sheet_does_not_swing_and_one_with_nothing_to_lean_on_is_told(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    crane = {
        **ANSWERS, "linkage": "pins", "foot_x": 0.45, "foot_y": -1.17, "eye_x": 0.72, "eye_y": -0.21, "closed_length": 1.05,
        "stroke": 0.85, "piston_diameter": 125, "rod_diameter": 80, "inner_mass": 420, "inner_length": 2.6, "outer_mass": 350,
        "outer_length": 2.4, "outer_angle": -40, "tool_mass": 180, "pump_pressure": 250, "compensator": "yes", "flow_drop": 7,
        "opening_current": 0.35, "full_current": 0.75, "lift_flow": 45, "lower_flow": 34, "cylinder_valve": "load_holding",
        "set_pressure": 280, "pilot_ratio": 4, "neutral": "vented", "hose_bore": 16, "hose_length": 3.2,
    }  # fmt: skip
    for key in ("foot_distance", "eye_distance", "lowest_angle"):
        del crane[key]
    file = tmp_path / "crane.yaml"
    assert cli.main(["new-machine", *words(crane), "--output", str(file)]) == 0
    said = " ".join(capsys.readouterr().out.split())
    assert "record next" in said and "SWINGS" not in said
    machine = load_machine(file)
    wide = 2.0 * machine.numbers.main_valve_orifices.A_ta_max
    file.write_text(
        re.sub(r"(A_ta_max: \{value: )[^,]+", rf"\g<1>{wide}", file.read_text(encoding="utf-8")), encoding="utf-8"
    )
    assert "SWINGS, up to 0." in best_manoeuvre(load_machine(file), [], None).sentence
