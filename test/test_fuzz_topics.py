"""A short run of benchmarks/fuzz_topics.py: all nodes as processes under hostile messages; nothing dies, hangs or moves on."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.process
ROOT = Path(__file__).parents[1]


def test_no_hostile_message_ends_a_node_or_leaves_a_current() -> None:
    command = [sys.executable, str(ROOT / "benchmarks" / "fuzz_topics.py"), "--messages", "250", "--seed", "22"]
    result = subprocess.run(command, capture_output=True, text=True, timeout=240, check=False, env=dict(os.environ))
    assert result.returncode == 0, result.stdout + result.stderr[-2000:]
    assert "nothing counted that must not be" in result.stdout
