"""How many cores this process computes on: all that it may run on, unless it is one of several workers."""

from __future__ import annotations

import os

_most = 0


def usable_cores() -> int:
    """Number of threads for what runs side by side; keeps to ``taskset`` and to a container's set of cores."""
    try:
        cores = len(os.sched_getaffinity(0))
    except AttributeError:  # not Linux
        cores = os.cpu_count() or 1
    return min(_most or cores, cores)


def use_at_most(count: int) -> None:
    """From now on this process computes with ``count`` threads at most."""
    global _most
    _most = count
