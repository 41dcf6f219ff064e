"""Lockstep: one cycle for each tick of the simulation's clock, once all samples of that tick are there. No ROS.

Times are nanoseconds of the simulation's clock, -1 before the first.
"""

from __future__ import annotations

_SENSORS = ("joint", "hose", "rod")


class TickGate:
    """Decides which tick to answer.

    Args:
        with_reference: a cycle also waits for the reference of its tick.
        delay_ns: age of the samples at their tick; the reference has none.

    Attributes:
        tick_ns: the newest tick.
        begun: the first command, without which the simulation does not start, has been sent.
    """

    def __init__(self, with_reference: bool, delay_ns: int) -> None:
        self.tick_ns = -1
        self.begun = False
        self._answered_ns = 0
        self._with_reference = with_reference
        self._ages = dict.fromkeys(_SENSORS, delay_ns) | ({"reference": 0} if with_reference else {})
        self._stamps = dict.fromkeys((*_SENSORS, "reference"), -1)

    def arrived(self, name: str, stamp_ns: int) -> None:
        """Note a sample of joint, hose, rod or reference."""
        self._stamps[name] = stamp_ns

    def may_begin(self) -> bool:
        """True until the first command is sent or a tick has come, and once the reference is there if required."""
        waited_for = self._stamps["reference"] >= 0 or not self._with_reference
        return not self.begun and self.tick_ns < 0 and waited_for

    def due(self) -> bool:
        """True once for each tick, as soon as all its samples are there."""
        tick = self.tick_ns
        if tick <= (self._answered_ns if self.begun else -1):
            return False
        if any(self._stamps[name] < tick - age for name, age in self._ages.items()):
            return False
        self.begun, self._answered_ns = True, tick
        return True
