"""What stands against moving now, from outside and from the sensors."""

from __future__ import annotations

from boom_controller.loop.law_in_use import LawInUse
from boom_controller.settings import LONGEST_SAMPLE_TIME
from boom_controller.supervision.reasons import StopCause
from boom_controller.supervision.sensor_set import SensorSet
from boom_controller.supervision.sensors import BURST
from boom_controller.supervision.state_machine import Supervision

SLOWER = 1.4
"""Times sample_time between two samples: beyond, more than one cycle in four has no new one."""


class Interlock:
    """Asked before a motion begins, before it is resumed, and in every cycle of it.

    Args:
        law: the control law.
        sensors: the sensors.
        supervision: its settings count.

    Attributes:
        emergency: the emergency stop stands.
        conflict: what stands against moving from outside, in a sentence; empty: nothing.
    """

    def __init__(self, law: LawInUse, sensors: SensorSet, supervision: Supervision) -> None:
        self._law, self._sensors, self._supervision = law, sensors, supervision
        self.emergency = False
        self.conflict = ""

    def standing(self, now: float) -> StopCause | None:
        """A reason to stop that holds at the time ``now`` [s], whatever the state."""
        if self.emergency:
            return StopCause("emergency_stop", "emergency stop")
        if self.conflict:
            return StopCause("two_publishers", self.conflict)
        return self._sensors.finding(now, self._supervision.settings)

    def missing(self, now: float) -> str:
        """Why no motion can begin at the time ``now`` [s], in a sentence; empty: it can."""
        if self._law.preparing:
            return f"not ready: {self._law.preparing}"
        if self._law.controller is None:
            return "not ready: no /boom/machine_configuration yet"
        period = self._law.settings.sample_time
        for sensor in (self._sensors.joint, self._sensors.hose, self._sensors.rod):
            if seldom := _seldom(sensor.spacing, sensor.burst, period):
                return f"not ready: samples of the {sensor.label} come {seldom}"
        finding = self.standing(now)
        return f"not ready: {finding.text}" if finding is not None else ""


def _seldom(spacing: float, burst: float, period: float) -> str:
    """How samples come that are too rare for a period, and what to do; empty where they are not; all [s]."""
    if burst > BURST * period:
        return f"in bursts, up to {1e3 * burst:.0f} ms apart: send each when it is measured"
    if spacing <= SLOWER * period:
        return ""
    said = f"every {1e3 * spacing:.0f} ms and sample_time is {1e3 * period:.0f} ms: "
    slow = spacing > LONGEST_SAMPLE_TIME
    return said + ("sample them faster" if slow else f"start the controller with sample_time:={spacing:.2g}")
