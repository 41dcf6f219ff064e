"""How many cores this process computes on: all that it may run on, unless it is one of several workers."""

from __future__ import annotations

import os

VARIABLE = "BOOM_CORES"
"""Of the environment, so that what a worker starts keeps to it, too; anything but a number above zero is no limit."""


def usable_cores() -> int:
    """Number of threads for what runs side by side; keeps to ``taskset`` and to a container's set of cores."""
    try:
        cores = len(os.sched_getaffinity(0))
    except AttributeError:  # not Linux
        cores = os.cpu_count() or 1
    said = os.environ.get(VARIABLE, "")
    return min(int(said), cores) if said.isdecimal() and int(said) > 0 else cores


def use_at_most(count: int) -> None:
    """From now on this process, and what it starts, computes with ``count`` threads at most."""
    os.environ[VARIABLE] = str(count)
