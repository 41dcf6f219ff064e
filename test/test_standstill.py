"""A computer that stands still is told apart from software that is late."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from pathlib import Path

import pytest
from standstill import LATE, Standstill

from boom_controller.supervision.supervision_settings import SupervisionSettings
from boom_controller.supervision.watch import MotionWatch

ROOT = Path(__file__).resolve().parents[1]
LATE_MOTION = """
import os, signal, time
import pytest
from standstill import PROBE
import psutil

@pytest.mark.process
def test_motion():
    if {paused}:
        (probe,) = (p for p in psutil.Process().children() if "sched_setscheduler" in " ".join(p.cmdline()))
        time.sleep(0.5)  # it has begun to watch
        probe.suspend(); time.sleep(0.08); probe.resume(); time.sleep(0.1)
    assert not "stopped: {said}"
"""


def test_what_was_not_late_is_not_a_standstill() -> None:
    watched, begin = Standstill(), time.time()
    assert watched.longest(begin - 20.0, begin - 10.0) == 0.0


def test_the_words_are_those_of_the_controller() -> None:
    cause = MotionWatch(SupervisionSettings(), (-1.0, 1.0), (0.2, 0.6)).cycle(0.08, 0.01, 1.0)
    assert cause is not None and LATE[0] in cause.text


@pytest.mark.parametrize(
    ("paused", "said", "outcome"),
    [(True, f"80{LATE[0]}", "1 skipped"), (False, f"80{LATE[0]}", "1 failed"), (True, "speed_limit", "1 failed")],
)
def test_only_a_motion_that_was_stopped_while_the_computer_stood_still_is_skipped(
    tmp_path: Path, paused: bool, said: str, outcome: str
) -> None:
    (tmp_path / "test_motion.py").write_text(LATE_MOTION.format(paused=paused, said=said), encoding="utf-8")
    words = [sys.executable, "-m", "pytest", "-q", "-c", ROOT / "pyproject.toml", "--rootdir", ROOT]
    words += ["-p", "no:cacheprovider", "--confcutdir", ROOT, "-p", "conftest", tmp_path / "test_motion.py"]
    env = {**os.environ, "PYTHONPATH": str(ROOT)}
    result = subprocess.run(words, cwd=ROOT, env=env, capture_output=True, text=True, timeout=120, check=False)
    assert outcome in result.stdout, result.stdout + result.stderr
    assert ("stood still for" in result.stdout) is (outcome == "1 skipped")
