"""The command that measures latencies prints ages in ms, and names a topic that is silent."""

from __future__ import annotations

import os
import subprocess
import sys

from boom_node.latency_node import TOPICS, table_row


def test_row_has_median_high_percentile_and_largest_age() -> None:
    row = table_row("/joint_states", [1_000_000, 2_000_000, 3_000_000, 50_000_000])
    assert row.split()[:3] == ["/joint_states", "4", "2.50"]
    assert row.endswith("50.00")


def test_silent_topics_are_named() -> None:
    command = [sys.executable, "-m", "boom_node.latency_node", "--ros-args", "-p", "duration:=1.0"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=30, env=os.environ, check=False)
    assert done.returncode == 0
    for topic in TOPICS:
        assert any(line.startswith(topic) and "no message came" in line for line in done.stdout.splitlines())
