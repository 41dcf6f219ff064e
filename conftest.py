"""Every test runs in the environment of our own processes: loopback only, fields checked, a ROS domain apart."""

import contextlib
import os
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from hypothesis import settings

sys.path[:0] = [str(Path(__file__).parent / "src" / "boom_bringup"), str(Path(__file__).parent / "test")]

import headless_browser

from boom_bringup import environment

environment.apply()

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
