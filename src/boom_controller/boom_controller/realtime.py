"""What the process needs to keep its time: a priority, and a garbage collector that works only when nothing is due."""

from __future__ import annotations

import gc
import os

_EVERY = 100


def use_priority(priority: int) -> str:
    """SCHED_FIFO with this priority for the whole process, 0: leave it. Returns why not, empty where it is done."""
    if priority:
        try:
            os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(priority))
        except OSError as error:
            return f"realtime_priority {priority} is not used: {error.strerror}; allow it (ulimit -r), or set 0"
    return ""


class Garbage:
    """Collects garbage behind every hundredth cycle instead of whenever Python likes, so never between sample and command."""

    def __init__(self) -> None:
        self._cycles = 0

    def hold(self) -> None:
        """From here on only :meth:`cycle_is_over` collects. What lives now is taken to live to the end, which makes that short."""
        gc.collect()
        gc.freeze()
        gc.disable()

    def cycle_is_over(self) -> None:
        """Nothing is due for most of a period."""
        self._cycles += 1
        if self._cycles % _EVERY == 0:
            gc.collect()

    def release(self) -> None:
        """Python's own way again."""
        gc.unfreeze()
        gc.enable()
