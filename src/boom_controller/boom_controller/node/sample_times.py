"""When a sample was taken, by its stamp and by the clock that supervises. No ROS."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping
from typing import Any

from boom_controller.node.lockstep import TickGate
from boom_node.stamps import far, ns_to_seconds, seconds_to_ns, to_ns


class SampleTimes:
    """The times of a node's samples.

    Args:
        lockstep: whose ticks are the time; None: real time.
        values: the node's parameters, of which ``sensor_timeout`` counts.
        clock_ns: the clock here [ns], for stamps in real time.
        refuse: told of a stamp that is not believed: topic, what is wrong, the details.

    Attributes:
        origin_ns: the first stamp; None before it.
    """

    def __init__(
        self,
        lockstep: TickGate | None,
        values: Mapping[str, Any],
        clock_ns: Callable[[], int],
        refuse: Callable[[str, str, str], Any],
    ) -> None:
        self._lockstep, self._values, self._clock_ns, self._refuse = lockstep, values, clock_ns, refuse
        self.origin_ns: int | None = None

    def now(self) -> float:
        """The clock that supervises [s]: the simulation's in lockstep, else a steady one."""
        return ns_to_seconds(self._lockstep.tick_ns) if self._lockstep else time.monotonic()

    def now_ns(self) -> int:
        """Stamp of what is sent now [ns]: the tick, or zero before the first, in lockstep."""
        return max(self._lockstep.tick_ns, 0) if self._lockstep else self._clock_ns()

    def of(self, topic: str, message: Any) -> tuple[float, float] | None:
        """Stamp counted from the first one, and when it was measured by the supervising clock [s]; None: far from now, refused.

        A stamp from the future would make every later sample look overtaken, so one that is ahead of the clock here by
        more than ``sensor_timeout`` is not believed either. In lockstep samples come ahead of their tick.
        """
        stamp_ns = to_ns(message.header.stamp)
        now_ns = self.now_ns()
        delay = ns_to_seconds(now_ns - stamp_ns)
        ahead = math.inf if self._lockstep else self._values["sensor_timeout"]
        wrong = far(stamp_ns, now_ns) or ("" if -delay <= ahead else f"{-1e3 * delay:.0f} ms ahead of the clock here")
        if wrong and (not self._lockstep or self._lockstep.tick_ns >= 0):
            self._refuse(topic, "stamp far from now", f"{wrong}: synchronise the clocks")
            return None
        if self.origin_ns is None:
            self.origin_ns = stamp_ns
        stamp = ns_to_seconds(stamp_ns - self.origin_ns)
        return stamp, ns_to_seconds(stamp_ns) if self._lockstep else time.monotonic() - delay

    def stamp_ns(self, seconds: float) -> int:
        """The stamp [ns] of a time that is counted from the first one [s]."""
        return (self.origin_ns or 0) + int(seconds_to_ns(seconds))
