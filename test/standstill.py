"""How long this computer stood still: a process that sleeps for milliseconds writes down when it slept longer.

A virtual machine that its host pauses for 80 ms stops whatever moves in real time, as a controller is meant to. No test of a motion
can tell then what it is about. (``benchmarks/controller_timing.py`` measures core by core, and tells when it has ended.)
"""

from __future__ import annotations

import os
import subprocess
import sys

from boom_node.children import die_with_parent

LEAST = 0.03
"""s. Shorter ones stop nothing: frames and angles may be 50 ms old."""
PROBE = f"""
import os, time
try:
    os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(95))
except OSError:
    pass  # then it waits for others, as what is tested does
last = time.time()
while True:
    time.sleep(0.005)
    now = time.time()
    if now - last > {LEAST}:
        print(last, now, flush=True)
    last = now
"""
LATE = (" ms between two cycles", " ms old, more than ", " for 50 ms; enable again", "periods without a cycle")
"""What the processes say where samples or cycles come late."""


class Standstill:
    """Watches until the process that made it ends."""

    def __init__(self) -> None:
        probe = subprocess.Popen(
            [sys.executable, "-c", PROBE], stdout=subprocess.PIPE, preexec_fn=die_with_parent(os.getpid())
        )
        assert probe.stdout is not None
        self._said = probe.stdout.fileno()
        os.set_blocking(self._said, False)
        self._seen: list[tuple[float, float]] = []
        self._rest = b""

    def longest(self, begin: float, end: float) -> float:
        """The longest standstill [s] between two times; 0.0 where there was none."""
        while True:
            try:
                more = os.read(self._said, 65536)
            except BlockingIOError:
                break
            if not more:
                break
            *lines, self._rest = (self._rest + more).split(b"\n")
            self._seen += [(float(a), float(b)) for a, b in (line.split() for line in lines)]
        return max((b - a for a, b in self._seen if b >= begin and a <= end), default=0.0)

    def excuse(self, said: str, begin: float, end: float) -> str:
        """Why a test that failed, saying this, tells nothing; empty where the computer is not to blame."""
        longest = self.longest(begin, end) if any(words in said for words in LATE) else 0.0
        return f"this computer stood still for {1e3 * longest:.0f} ms, and what moved was stopped" if longest else ""
