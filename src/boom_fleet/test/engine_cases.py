"""What workers are given to do in the tests: a module of its own, which they import by its name."""

import os
import signal
import time
from pathlib import Path

from boom_model.cores import usable_cores


def twice(name):
    return 2 * name


def counted(name, folder):
    """How often this case was begun, this time included."""
    tries = len(list(Path(folder).glob(f"{name}-*")))
    (Path(folder) / f"{name}-{tries}").touch()
    return tries + 1


def fails_at_first(name, folder):
    if counted(name, folder) == 1:
        raise ValueError("the first attempt fails")
    return "well"


def fails_always(name, folder):
    counted(name, folder)
    raise ValueError("no way")


def kills_its_worker_at_first(name, folder):
    if counted(name, folder) == 1 and name == "b":
        os.kill(os.getpid(), signal.SIGKILL)
    return name


def slow(name):
    """The name, after a while."""
    time.sleep(1.0)
    return name


def computes_on(name):
    """Number of threads, and the cores on which they may run."""
    return usable_cores(), os.sched_getaffinity(0)
