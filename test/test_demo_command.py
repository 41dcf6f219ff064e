"""./boom demo, whole: over CAN and on the topics, no socket off the loopback, a bag, a report, the numbers; what it refuses."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import threading
from pathlib import Path

import pytest

from boom_bringup import environment
from boom_recording.loading import load

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


def test_the_demo_repeats_a_recording_over_can_on_the_loopback(tmp_path: Path) -> None:
    process = begin(
        "demo", BAGS / "healthy" / "extended", "--output", tmp_path / "demo", "--json", tmp_path / "demo.json"
    )
    sockets: dict[int, set[environment.BoundSocket]] = {}
    ended = threading.Event()

    def look() -> None:
        while not ended.wait(0.1):
            for pid in children(process.pid):
                sockets.setdefault(pid, set()).update(environment.bound_sockets(pid))

    looker = threading.Thread(target=look)
    looker.start()
    try:
        out, err = process.communicate(timeout=PATIENCE)
    finally:
        ended.set()
        looker.join()
    assert process.returncode == 0, err
    assert len([found for found in sockets.values() if found]) >= 6
    assert environment.off_loopback(set().union(*sockets.values())) == []
    assert "no socket outside the loopback" in out
    assert "extended: agrees within sensor noise" in out
    (bag,) = json.loads((tmp_path / "demo.json").read_text())["bags"]
    assert bag["full"]["angle_mae_rad"] < 1e-3
    assert (tmp_path / "demo" / "report.html").stat().st_size > 1e6
    simulated = load(tmp_path / "demo" / "simulated")
    assert simulated.events == []
    assert simulated.warnings == []
    assert simulated.duration == pytest.approx(60.0, abs=0.05)


def test_two_demos_at_once_do_not_hear_each_other(tmp_path: Path, short: Path) -> None:
    both = [begin("demo", short, "--output", tmp_path / name, "--transport", name) for name in ("can", "topics")]
    for process in both:
        out, err = process.communicate(timeout=PATIENCE)
        assert process.returncode == 0, err
        assert "agrees within sensor noise" in out
    for name in ("can", "topics"):
        assert load(tmp_path / name / "simulated").events == []


def test_a_stopped_demo_says_so_with_the_signals_status_and_leaves_the_old_bag(tmp_path: Path, short: Path) -> None:
    for name in ("simulated", ".boom-demo"):
        (tmp_path / name).mkdir() if name == "simulated" else (tmp_path / name).touch()
    (tmp_path / "simulated" / "metadata.yaml").write_text("old")
    process = begin("demo", short, "--output", tmp_path)
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
    assert "there is no bridge" in result.stderr
    assert len(result.stderr.strip().splitlines()) == 1


def children(parent: int) -> list[int]:
    """Process ids of the children of ``parent``."""
    found = []
    for entry in Path("/proc").iterdir():
        if entry.name.isdigit():
            try:
                fields = (entry / "stat").read_text().rsplit(")", 1)[1].split()
            except OSError:
                continue
            if int(fields[1]) == parent:
                found.append(int(entry.name))
    return found
