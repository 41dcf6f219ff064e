"""The boom's sensors together: is the set complete, is it to be believed, and what does it show. No ROS."""

from __future__ import annotations

import math

from boom_controller.supervision.reasons import StopCause
from boom_controller.supervision.sensors import Agreement, Range, Sensor
from boom_controller.supervision.supervision_settings import SupervisionSettings
from boom_controller.types import Measurement

_BEYOND = (
    0.3  # rad. An IMU may be mounted askew by that much; what is further outside the stroke is no angle of this boom
)
_RATE = Range("rate", "rad/s", -3.0, 3.0)
_PRESSURE = (-1.02e5, 6.0e7)
_CURRENT = Range("current", "A", -0.05, 10.0)


class SensorSet:
    """Angle with rate and both pressures, without which nothing moves; the measured currents need not be there.

    Times are seconds: stamps by the senders' clock, ``now`` and ``measured`` by the one that supervises.

    Attributes:
        joint, hose, rod, currents: the sensors.
    """

    def __init__(self) -> None:
        self.set_stroke(-math.pi, math.pi)
        self.hose = Sensor("hose pressure", (Range("hose pressure", "Pa", *_PRESSURE),))
        self.rod = Sensor("rod pressure", (Range("rod pressure", "Pa", *_PRESSURE),))
        self.currents = Sensor("currents", (_CURRENT, _CURRENT))
        self._agreement = Agreement()
        self._age = 0.0

    def set_stroke(self, low: float, high: float) -> None:
        """The boom's angles lie between ``low`` and ``high`` [rad]. Forgets the samples of the angle."""
        self.joint = Sensor("angle", (Range("angle", "rad", low - _BEYOND, high + _BEYOND), _RATE))

    def take_joint(self, angle: float, rate: float, stamp: float, measured: float) -> None:
        """Angle [rad] and rate [rad/s]."""
        if self.joint.take((angle, rate), stamp, measured):
            self._agreement.update(stamp, angle, rate)

    def forget(self) -> None:
        """Begin again: the next samples are taken whatever their stamps."""
        for sensor in (self.joint, self.hose, self.rod, self.currents):
            sensor.forget()
        self._agreement.reset()

    def complete(self, most_apart: float) -> bool:
        """True once each has brought a new sample since :meth:`use`, and all are of one time: at most ``most_apart`` [s].

        A sample that came just after the cycle of its set waits for the others of the next one, and is old by then.
        """
        stamps = (self.joint.stamp, self.hose.stamp, self.rod.stamp)
        return self.joint.fresh and self.hose.fresh and self.rod.fresh and max(stamps) - min(stamps) <= most_apart

    @property
    def begun(self) -> bool:
        """True once one has brought a new sample since :meth:`use`."""
        return self.joint.fresh or self.hose.fresh or self.rod.fresh

    def newest(self) -> Measurement:
        """What they show."""
        angle, rate = self.joint.values
        return Measurement(self.joint.stamp, angle, rate, self.hose.values[0], self.rod.values[0], self._age)

    def use(self, now: float) -> Measurement:
        """:meth:`newest`, for a cycle at ``now`` [s]; from here on fresh is what comes later.

        Where no new angle came the age stays as it was: the reference goes on by a period, and so shall the law.
        """
        joint = self.joint
        if joint.fresh:
            self._age = min(max(now - joint.measured, 0.0), LARGEST_AGE)
        joint.fresh = self.hose.fresh = self.rod.fresh = False
        return self.newest()

    def measured_currents(self, now: float, timeout: float) -> tuple[float, ...] | None:
        """(i_+, i_-) [A], or None where nobody measures."""
        return self.currents.values if now - self.currents.measured < timeout else None

    def finding(self, now: float, s: SupervisionSettings) -> StopCause | None:
        """What is wrong with them at the time ``now`` [s], or None."""
        for sensor in (self.joint, self.hose, self.rod):
            if now - sensor.measured > s.sensor_timeout or sensor.bad >= s.bad_samples:
                return sensor.finding(now, s.sensor_timeout, s.bad_samples)
        apart = self._agreement.apart
        if abs(apart) > s.largest_disagreement:
            return StopCause("sensors_disagree", f"angle and integrated rate have drifted apart by {apart:.3f} rad")
        return None


LARGEST_AGE = 0.02
"""s. A dead time that is longer is no dead time that a law should make up for."""
