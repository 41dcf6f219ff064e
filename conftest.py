"""Every test runs in the environment of our own processes: loopback only, fields checked, a ROS domain apart."""

import contextlib
import os
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent / "src" / "boom_bringup"))

from boom_bringup import environment

environment.apply()

# Tests that run side by side must not hear each other, nor a demo: every process of pytest has a domain of its own.
_held = contextlib.ExitStack()  # until the process ends
_worker = os.environ.get("PYTEST_XDIST_WORKER")
if _worker or "ROS_DOMAIN_ID" not in os.environ:
    os.environ["ROS_DOMAIN_ID"] = _held.enter_context(environment.private_domain())
