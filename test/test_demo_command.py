"""./boom demo, whole: three processes, no socket off the loopback, a bag, a report, the numbers."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import threading
from pathlib import Path

import pytest

from boom_bringup import environment
from boom_recording.loading import load

pytestmark = pytest.mark.process
BAGS = Path(__file__).parents[1] / "bags"


def test_the_demo_repeats_a_recording_in_three_processes_on_the_loopback(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "boom_bringup.cli", "demo", str(BAGS / "healthy" / "extended")]
    command += ["--output", str(tmp_path / "demo"), "--json", str(tmp_path / "demo.json")]
    process = subprocess.Popen(
        command, env=environment.for_processes(os.environ), stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
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
        out, err = process.communicate(timeout=120)
    finally:
        ended.set()
        looker.join()
    assert process.returncode == 0, err
    assert len([found for found in sockets.values() if found]) >= 3
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


def test_a_recording_that_does_not_exist_is_one_line_and_status_2(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "boom_bringup.cli", "demo", "nowhere", "--output", str(tmp_path / "demo")]
    result = subprocess.run(command, capture_output=True, text=True, check=False, timeout=60)
    assert result.returncode == 2
    assert len(result.stderr.strip().splitlines()) == 1
    assert "nowhere" in result.stderr


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
