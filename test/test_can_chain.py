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
PATIENCE = 120.0


def broken(cases: list[str], folder: Path) -> dict[str, dict[str, object]]:
    """Runs the named cases, returns what was seen by name."""
    path = folder / "results.json"
    command = [
        sys.executable,
        str(ROOT / "benchmarks" / "can_faults.py"),
        "--only",
        ",".join(cases),
        "--json",
        str(path),
    ]
    result = subprocess.run(command, capture_output=True, text=True, timeout=PATIENCE, check=False)
    assert result.returncode in (0, 1), result.stdout + result.stderr
    return {row["name"]: row for row in json.loads(path.read_text())}


def test_kill_9_of_each_process_stops_the_boom_and_it_moves_again_only_when_asked(tmp_path: Path) -> None:
    rows = broken(["kill_bridge", "kill_server", "kill_ecu"], tmp_path)
    assert {row["motion_again"] for row in rows.values()} == {"when asked"}
    assert rows["kill_bridge"]["current_zero_ms"] is not None
    assert rows["kill_server"]["current_zero_ms"] is not None


def test_processes_that_stand_still_stop_the_boom_and_nothing_stale_moves_it_later(tmp_path: Path) -> None:
    rows = broken(["pause_bridge", "pause_server"], tmp_path)
    assert {row["motion_again"] for row in rows.values()} == {"when asked"}
    assert all(row["current_zero_ms"] is not None for row in rows.values())


def test_ecu_that_falls_silent_or_freezes_stops_the_boom(tmp_path: Path) -> None:
    rows = broken(["frozen_ecu", "bus_off", "restart", "commands_end"], tmp_path)
    assert all(row["current_zero_ms"] is not None for row in rows.values())
    assert {rows[name]["motion_again"] for name in ("frozen_ecu", "bus_off", "restart")} == {"when asked"}


def test_single_bad_frames_do_not_stop_the_boom(tmp_path: Path) -> None:
    rows = broken(["loss", "bit_flip", "reorder"], tmp_path)
    assert set(rows) == {"loss", "bit_flip", "reorder"}
    # losses may by chance come close enough together to close the valve: then nothing but asking opens it again
    assert {row["motion_again"] for row in rows.values()} <= {"never stopped", "by itself", "when asked"}
    assert "never stopped" in {row["motion_again"] for row in rows.values()}
