"""What the process needs to keep its time: priority, cores that stay awake, a garbage collector that works when nothing is due."""

from __future__ import annotations

import gc
import os
import struct
from pathlib import Path

_EVERY = 100
_LATENCY = Path("/dev/cpu_dma_latency")


def use_priority(priority: int) -> str:
    """SCHED_FIFO with this priority for all threads of the process. Returns why not, empty where it is done.

    The middleware has threads of its own, and samples that wait for one of them are as late as those that wait for us. What the
    process starts, a compiler for instance, does not inherit it.
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
    """Keeps all threads of the process to one core. Returns why not, empty where it is done.

    Where everything else is kept off that core, its caches hold what a cycle needs.
    """
    try:
        for thread in _threads():
            os.sched_setaffinity(thread, {core})
    except OSError as error:
        known = ", ".join(str(k) for k in sorted(os.sched_getaffinity(0)))
        return f"realtime_core {core} is not used: {error.strerror}; the process may run on {known}, or set -1"
    return ""


class WakeUpLatency:
    """Keeps the cores from sleeping, as long as it is held: the kernel's bound on wake-up latency (PM QoS) is zero then.

    A core that sleeps deeply takes up to a millisecond to be back, and the core of a virtual machine is given to others meanwhile.
    It costs power: idle cores wait at full clock.
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
        """They may sleep again; the kernel does so itself where the process ends."""
        if self._held is not None:
            os.close(self._held)
        self._held = None


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
