"""Garbage is collected between cycles and nowhere else; cores stay awake as long as they are asked to."""

from __future__ import annotations

import contextlib
import gc
import os
import subprocess
import sys
import threading
import weakref
from collections.abc import Iterator
from pathlib import Path

import pytest

from boom_node.realtime import Garbage, WakeUpLatency, use_core, use_priority


class Loop:
    """Something that only the collector can free."""

    def __init__(self) -> None:
        self.itself = self


@pytest.fixture
def garbage() -> Iterator[Garbage]:
    made = Garbage()
    made.hold()
    yield made
    made.release()


def test_nothing_is_collected_until_a_cycle_is_over(garbage: Garbage) -> None:
    left = weakref.ref(Loop())
    kept = [[k] for k in range(20_000)]  # more than Python's own threshold
    assert len(kept) == 20_000
    assert left() is not None
    for _ in range(100):
        garbage.cycle_is_over()
    assert left() is None


def test_afterwards_python_collects_as_it_likes() -> None:
    made = Garbage()
    made.hold()
    assert not gc.isenabled()
    made.release()
    assert gc.isenabled()
    assert gc.get_freeze_count() == 0


def test_a_wake_up_latency_of_zero_is_asked_for_until_it_is_released(tmp_path: Path) -> None:
    device = tmp_path / "cpu_dma_latency"
    device.touch()
    latency = WakeUpLatency(device)
    assert latency.hold() == latency.hold() == ""
    assert device.read_bytes() == b"\0\0\0\0"
    (open_file,) = [link for link in Path("/proc/self/fd").iterdir() if link.exists() and link.resolve() == device]
    latency.release()
    assert not open_file.exists()


def test_a_computer_that_does_not_let_us_says_so(tmp_path: Path) -> None:
    latency = WakeUpLatency(tmp_path / "missing")
    assert "cores may sleep" in latency.hold() and "missing" in latency.hold()
    latency.release()


@contextlib.contextmanager
def other_thread() -> Iterator[int]:
    """A thread that waits; its id."""
    asked = threading.Event()
    thread = threading.Thread(target=asked.wait, args=(10.0,))
    thread.start()
    assert thread.native_id is not None
    yield thread.native_id
    asked.set()
    thread.join(10.0)


def test_every_thread_is_kept_to_the_core() -> None:
    before = os.sched_getaffinity(0)
    core = max(before)
    with other_thread() as other:
        try:
            assert use_core(core) == ""
            assert os.sched_getaffinity(other) == os.sched_getaffinity(0) == {core}
        finally:
            for task in Path("/proc/self/task").iterdir():
                os.sched_setaffinity(int(task.name), before)


def test_every_thread_gets_the_priority() -> None:
    with other_thread() as other:
        try:
            told = use_priority(1)
            if told:
                assert told.startswith("realtime_priority 1 is not used: ")
                pytest.skip(told)
            assert os.sched_getscheduler(other) == os.sched_getscheduler(0) == os.SCHED_FIFO | os.SCHED_RESET_ON_FORK
            child = [sys.executable, "-c", "import os; raise SystemExit(os.sched_getscheduler(0))"]
            assert subprocess.run(child, check=False).returncode == os.SCHED_OTHER
        finally:
            for task in Path("/proc/self/task").iterdir():
                os.sched_setscheduler(int(task.name), os.SCHED_OTHER, os.sched_param(0))


def test_a_core_that_this_computer_does_not_have_is_told_with_those_it_has() -> None:
    known = ", ".join(str(k) for k in sorted(os.sched_getaffinity(0)))
    told = use_core(1023)
    assert "realtime_core 1023 is not used" in told and known in told
