"""The chain over CAN as processes: commands -> bridge -> bus -> ECU stand-in -> bus -> bridge -> topics, and each process killed.

How fast things happen is measured by benchmarks/can_faults.py, whose machinery is used here; here counts that they do.
"""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.process
ROOT = Path(__file__).parents[1]
PATIENCE = 240.0
KILLED, PAUSED = ("kill_bridge", "kill_server", "kill_ecu"), ("pause_bridge", "pause_server")
SILENT, BAD = ("frozen_ecu", "bus_off", "restart", "commands_end"), ("loss", "bit_flip", "reorder")


@pytest.fixture(scope="module")
def rows(tmp_path_factory: pytest.TempPathFactory) -> dict[str, dict[str, object]]:
    """What was seen in each case, by name; one chain goes through all of them."""
    path = tmp_path_factory.mktemp("chain") / "results.json"
    cases = ",".join((*KILLED, *PAUSED, *SILENT, *BAD))
    command = [sys.executable, ROOT / "benchmarks" / "can_faults.py", "--brief", "--only", cases, "--json", path]
    result = subprocess.run(command, capture_output=True, text=True, timeout=PATIENCE, check=False)
    assert result.returncode in (0, 1), result.stdout + result.stderr
    return {row["name"]: row for row in json.loads(path.read_text())}


def test_kill_9_of_each_process_stops_the_boom_and_it_moves_again_only_when_asked(
    rows: dict[str, dict[str, object]],
) -> None:
    assert {rows[name]["motion_again"] for name in KILLED} == {"when enabled"}
    assert rows["kill_bridge"]["current_zero_ms"] is not None
    assert rows["kill_server"]["current_zero_ms"] is not None


def test_processes_that_stand_still_stop_the_boom_and_nothing_stale_moves_it_later(
    rows: dict[str, dict[str, object]],
) -> None:
    assert {rows[name]["motion_again"] for name in PAUSED} == {"when enabled"}
    assert all(rows[name]["current_zero_ms"] is not None for name in PAUSED)


def test_ecu_that_falls_silent_or_freezes_stops_the_boom(rows: dict[str, dict[str, object]]) -> None:
    assert all(rows[name]["current_zero_ms"] is not None for name in SILENT)
    assert {rows[name]["motion_again"] for name in ("frozen_ecu", "bus_off", "restart")} == {"when enabled"}


def test_single_bad_frames_do_not_stop_the_boom(rows: dict[str, dict[str, object]]) -> None:
    # losses may by chance come close enough together to close the valve: then nothing but asking opens it again
    assert {rows[name]["motion_again"] for name in BAD} <= {"never stopped", "by itself", "when enabled"}
    assert "never stopped" in {rows[name]["motion_again"] for name in BAD}
