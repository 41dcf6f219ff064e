"""Real-time settings of a process: priority, cores that stay awake, garbage collection when nothing is due."""

from __future__ import annotations

import gc
import os
import struct
from pathlib import Path

_EVERY = 100
_LATENCY = Path("/dev/cpu_dma_latency")


def use_priority(priority: int) -> str:
    """SCHED_FIFO with this priority for all threads of the process. Returns the reason for a failure, or "".

    The threads of the middleware need it too, because samples wait for them as well. Child processes, a compiler for instance, do
    not inherit it.
    """
    try:
        for thread in _threads():
            os.sched_setscheduler(thread, os.SCHED_FIFO | os.SCHED_RESET_ON_FORK, os.sched_param(priority))
    except OSError as error:
        return f"realtime_priority {priority} is not used: {error.strerror}; allow it (ulimit -r), or set 0"
    return ""


def _threads() -> list[int]:
    return [int(thread.name) for thread in Path("/proc/self/task").iterdir()]


def use_core(core: int) -> str:
    """Bind all threads of the process to one core. Returns the reason for a failure, or "".

    If nothing else runs on that core, its caches keep what a cycle needs.
    """
    try:
        for thread in _threads():
            os.sched_setaffinity(thread, {core})
    except OSError as error:
        known = ", ".join(str(k) for k in sorted(os.sched_getaffinity(0)))
        return f"realtime_core {core} is not used: {error.strerror}; the process may run on {known}, or set -1"
    return ""


class WakeUpLatency:
    """Keeps the cores awake while held: the kernel's bound on wake-up latency (PM QoS) is then zero.

    A core in deep sleep takes up to a millisecond to wake up, and the host gives the idle core of a virtual machine to others.
    This costs power: idle cores wait at full clock.
    """

    def __init__(self, device: Path = _LATENCY) -> None:
        self._device = device
        self._held: int | None = None

    def hold(self) -> str:
        """Returns why not, empty where it is done."""
        if self._held is not None:
            return ""
        try:
            self._held = os.open(self._device, os.O_WRONLY | os.O_CLOEXEC)
            os.write(self._held, struct.pack("=i", 0))
        except OSError as error:
            self.release()
            return f"the cores may sleep between two cycles: {self._device}: {error.strerror}; allow to write it"
        return ""

    def release(self) -> None:
        """Let the cores sleep again, as the kernel does when the process ends."""
        if self._held is not None:
            os.close(self._held)
        self._held = None


class Garbage:
    """Collects garbage after every hundredth cycle instead of at any time, so never between sample and command."""

    def __init__(self) -> None:
        self._cycles = 0

    def hold(self) -> None:
        """From now on only :meth:`cycle_is_over` collects. Present objects count as permanent, which keeps collections short."""
        gc.collect()
        gc.freeze()
        gc.disable()

    def cycle_is_over(self) -> None:
        """Called when nothing is due for most of a period."""
        self._cycles += 1
        if self._cycles % _EVERY == 0:
            gc.collect()

    def release(self) -> None:
        """Restore Python's own collection."""
        gc.unfreeze()
        gc.enable()
