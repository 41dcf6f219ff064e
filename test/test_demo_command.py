"""./boom demo: over CAN and on the topics, apart from others, closed loop, stopped; what it refuses. Whole: test_front_door.py."""

from __future__ import annotations

import json
import os
import shlex
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from fresh_clone import children

from boom_bringup import environment
from boom_controller.controller import Settings, make_controller
from boom_controller.references.trajectory_generator import TrajectoryGenerator
from boom_model.machine_file import load_machine
from boom_recording.loading import load
from boom_report.tracking import position_error
from boom_sim.simulated_crane import PERIOD, CraneStart, SimulatedCrane
from boom_trials.closed_loop import follow, wanted_angles

pytestmark = pytest.mark.process
BAGS = Path(__file__).parents[1] / "bags"
PATIENCE = 180


def command(*words: str | Path) -> list[str]:
    return [sys.executable, "-m", "boom_bringup.cli", *map(str, words)]


def begin(*words: str | Path) -> subprocess.Popen[str]:
    variables = environment.for_processes(os.environ)
    return subprocess.Popen(
        command(*words), env=variables, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )  # fmt: skip


@pytest.fixture(scope="module")
def short(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The first ten seconds of a healthy recording, simulated: long enough to move."""
    bag = tmp_path_factory.mktemp("short") / "bag"
    words = command("simulate", BAGS / "healthy" / "extended", "--output", bag, "--duration", "10")
    subprocess.run(words, check=True, capture_output=True, timeout=PATIENCE)
    return bag


def test_two_demos_at_once_do_not_hear_each_other(tmp_path: Path, short: Path) -> None:
    both = [
        begin("demo", short, "--loop", "open", "--output", tmp_path / name, "--transport", name)
        for name in ("can", "topics")
    ]
    for process in both:
        out, err = process.communicate(timeout=PATIENCE)
        assert process.returncode == 0, err
        assert "agrees within sensor noise" in out
    for name in ("can", "topics"):
        assert load(tmp_path / name / "simulated").events == []


def test_a_demo_that_finds_a_mismatch_ends_with_the_line_to_type_next(tmp_path: Path) -> None:
    bag = tmp_path / "leaky one"
    words = ("--duration", "4", "--effect", "rate_scale.a=1.3")
    made = subprocess.run(
        command("simulate", BAGS / "healthy" / "extended", "--output", bag, *words),
        check=False, capture_output=True, text=True, timeout=PATIENCE,
    )  # fmt: skip
    assert made.returncode == 0, made.stderr
    process = begin("demo", bag, "--loop", "open", "--transport", "topics", "--output", tmp_path / "demo")
    out, err = process.communicate(timeout=PATIENCE)
    assert process.returncode == 0, err
    assert shlex.split(out.splitlines()[-1])[2:] == ["diagnose", str(bag)]
    assert out.splitlines()[-1].startswith("next: ")


def test_the_closed_loop_of_processes_follows_as_well_as_the_one_in_one_process(tmp_path: Path, short: Path) -> None:
    words = ("--loop", "closed", "--transport", "topics", "--closed-duration", "0", "--json", tmp_path / "demo.json")
    process = begin("demo", short, "--output", tmp_path / "demo", *words)
    _, err = process.communicate(timeout=PATIENCE)
    assert process.returncode == 0, err
    over_topics = json.loads((tmp_path / "demo.json").read_text())["closed_loop"]
    recording, machine = load(short), load_machine("tz17")
    c, wanted = recording.configuration, wanted_angles(recording)
    pose = machine.pose(c.outer_boom_angle, c.telescope_length, c.load_mass)
    crane = SimulatedCrane(machine, pose, CraneStart(float(wanted[0])), machine.sensor_noise())
    generator = TrajectoryGenerator(Settings().generator_pole, PERIOD)
    alone = follow(crane, make_controller("improved", machine, pose), generator, wanted, c)
    numbers = position_error.of_recording(alone, machine).errors.document()
    for name in ("mae_mm", "rmse_mm"):
        assert over_topics[name] == pytest.approx(numbers[name], rel=0.15)
    assert load(tmp_path / "demo" / "closed_loop").events == []


def test_a_stopped_demo_says_so_with_the_signals_status_and_leaves_the_old_bag(tmp_path: Path, short: Path) -> None:
    for name in ("simulated", ".boom-demo"):
        (tmp_path / name).mkdir() if name == "simulated" else (tmp_path / name).touch()
    (tmp_path / "simulated" / "metadata.yaml").write_text("old")
    process = begin("demo", short, "--loop", "open", "--output", tmp_path)
    assert process.stderr is not None
    while not children(process.pid):
        assert process.poll() is None
    process.send_signal(signal.SIGTERM)
    _, err = process.communicate(timeout=PATIENCE)
    assert process.returncode == 143
    assert err.strip().splitlines()[-1] == "boom: stopped"
    assert sorted(path.name for path in tmp_path.iterdir()) == [".boom-demo", "simulated"]
    assert (tmp_path / "simulated" / "metadata.yaml").read_text() == "old"


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["nowhere"], "nowhere"),
        (["--json", "nowhere/x.json"], "there is no folder nowhere"),
        (["--seed", "-1"], "whole number"),
        (["--machine", "tz18"], "tz18"),
        (["--transport", "flexray"], "flexray"),
        (["--closed-duration", "1"], "5 to 3600 seconds"),
    ],
)
def test_a_wrong_word_is_one_line_and_status_2_before_anything_is_made(
    tmp_path: Path, words: list[str], told: str
) -> None:
    output = tmp_path / "demo"
    result = subprocess.run(
        command("demo", *words, "--output", output), capture_output=True, text=True, check=False, timeout=PATIENCE
    )
    assert result.returncode == 2
    assert len(result.stderr.strip().splitlines()) == 1
    assert told in result.stderr
    assert not output.exists()


def test_motion_that_cannot_be_enabled_is_one_line_and_status_2() -> None:
    words = [sys.executable, "-m", "boom_can_bridge.enable_node", "--ros-args", "-p", "wait_timeout:=0.3"]
    result = subprocess.run(words, capture_output=True, text=True, check=False, timeout=PATIENCE)
    assert result.returncode == 2
    assert "no bridge is running" in result.stderr
    assert len(result.stderr.strip().splitlines()) == 1
