"""Every test runs in the environment of our own processes: loopback only, fields checked, a ROS domain apart."""

import contextlib
import os
import sys
from collections.abc import Generator, Iterator
from functools import cache
from pathlib import Path
from typing import Any

import pytest
from hypothesis import settings
from xdist.scheduler import LoadScopeScheduling

sys.path[:0] = [str(Path(__file__).parent / folder) for folder in ("src/boom_bringup", "test", "benchmarks")]

import headless_browser
from standstill import Standstill

from boom_bringup import environment, showing

environment.apply()

# What a command says does not depend on how busy the machine is; what is tested as a process of its own may tell steps.
showing.QUIET = float("inf")

# A failure by chance tells nothing about the change that was tested. To look for new cases: --hypothesis-profile explore
settings.register_profile("repeatable", derandomize=True)
settings.register_profile("explore", derandomize=False)
settings.load_profile("repeatable")

# Tests that run side by side must not hear each other, nor a demo: every process of pytest has a domain of its own.
_held = contextlib.ExitStack()  # until the process ends
_worker = os.environ.get("PYTEST_XDIST_WORKER")
if _worker or "ROS_DOMAIN_ID" not in os.environ:
    os.environ["ROS_DOMAIN_ID"] = _held.enter_context(environment.private_domain())


@pytest.fixture(scope="session")
def browser() -> Iterator[headless_browser.Browser]:
    """Started for the first report that is looked at."""
    if headless_browser.program() is None:
        pytest.skip("nobody looked at this report: apt install chromium")
    with headless_browser.Browser() as opened:
        yield opened


_watched: list[Standstill] = []


def pytest_runtest_setup(item: pytest.Item) -> None:
    """What moves in real time goes before what computes; from its first motion on it is known when the computer stands still."""
    moves = item.get_closest_marker("process") is not None
    with contextlib.suppress(PermissionError):  # not everybody may take back what he gave way
        os.setpriority(os.PRIO_PROCESS, 0, 0 if moves else 10)
    if moves and not _watched:
        _watched.append(Standstill())


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(
    item: pytest.Item, call: pytest.CallInfo[None]
) -> Generator[None, pytest.TestReport, pytest.TestReport]:
    """A motion that was stopped while the computer stood still is no failure, and no success."""
    report = yield
    if report.failed and _watched and item.get_closest_marker("process"):
        excuse = _watched[0].excuse(report.longreprtext, call.start, call.stop)
        if excuse:
            report.outcome, report.longrepr = "skipped", (str(item.path), item.location[1] or 0, excuse)
    return report


class Together(LoadScopeScheduling):
    """Each test goes to the process that is free, except where those of a file share what is slow to make.

    What moves in real time goes to one process, so that the other one only computes, and gives way. ``xdist_group`` would say the
    same, but pytest 9.2 ignores what xdist 3.8 writes into a test's name.
    """

    def _split_scope(self, nodeid: str) -> str:
        file = nodeid.split("::")[0]
        if "unseen_plant" in file or file.endswith("test_blind_plants.py"):
            return "unseen_plant"  # one process compiles it, and not two at once
        return "process" if _moves(file) else nodeid


@cache
def _moves(file: str) -> bool:
    return "pytest.mark.process" in (Path(__file__).parent / file).read_text(encoding="utf-8")


def pytest_xdist_make_scheduler(config: pytest.Config, log: Any) -> LoadScopeScheduling:
    """How tests are given to the processes of ``./boom test``."""
    return Together(config, log)
