"""The set of the boom's sensors: completeness, plausibility and values. No ROS."""

from __future__ import annotations

import math

from boom_controller.supervision.reasons import StopCause
from boom_controller.supervision.sensors import CLOCK_STEP, Agreement, Range, SupervisedSensor
from boom_controller.supervision.supervision_settings import SupervisionSettings
from boom_controller.types import MOVES, Measurement
from boom_input.repeats import Repeats

_BEYOND = (
    0.3  # rad. An IMU may be mounted askew by that much; what is further outside the stroke is no angle of this boom
)
_RATE = Range("rate", "rad/s", -3.0, 3.0)
_PRESSURE = (-2.02e5, 6.0e7)  # Pa. Vacuum, to the accuracy of a transducer of 0 to 400 bar
_JUMP = 0.25
"""Of ``largest_disagreement``, that one sample of the angle may leave the one before against the rate: more is no boom's motion."""
_DRIFT_T, _DRIFT = 10.0, 2.0
"""s, and times ``largest_disagreement``: an angle that leaves the gyro slowly. A gyro that is 10 % wrong stays below over 1 rad."""
_NO_CHANGE = 1e-6  # rad/s
_NO_CHANGE_OF_PRESSURE = 10.0  # Pa
_FED_BACK = ("divergence", "oscillation", "load_not_held", "no_motion", "speed_limit")
"""What a pressure that is wrong may end in, as the law feeds it back."""
_CURRENT = Range("current", "A", -0.05, 10.0)


class SensorSet:
    """Angle with rate and both pressures, which are required, and the measured currents, which are optional.

    Times are seconds: stamps by the senders' clock, ``now`` and ``measured`` by the supervising clock.

    Attributes:
        joint, hose, rod, currents: the sensors.
    """

    def __init__(self) -> None:
        self._clock_step = CLOCK_STEP
        self.set_stroke(-math.pi, math.pi)
        self.hose = SupervisedSensor("hose pressure", (Range("hose pressure", "Pa", *_PRESSURE),))
        self.rod = SupervisedSensor("rod pressure", (Range("rod pressure", "Pa", *_PRESSURE),))
        self.currents = SupervisedSensor("currents", (_CURRENT, _CURRENT))
        self._agreement, self._drift = Agreement(), Agreement(_DRIFT_T)
        self._age, self._turned = 0.0, math.inf
        self._watch_repeats()

    def set_stroke(self, low: float, high: float) -> None:
        """Set the range of the boom's angles, ``low`` to ``high`` [rad]. Forgets the samples of the angle."""
        ranges = (Range("angle", "rad", low - _BEYOND, high + _BEYOND), _RATE)
        self.joint = SupervisedSensor("angle", ranges, self._clock_step)

    def trust_no_clock(self) -> None:
        """Stamps are of a simulation's clock: it runs in steps, and at its own pace."""
        self._clock_step = math.inf
        for sensor in (self.joint, self.hose, self.rod, self.currents):
            sensor.clock_step = math.inf

    def take_joint(
        self, angle: float, rate: float, stamp: float, measured: float, s: SupervisionSettings, *, at_rest: bool = False,
        held: bool = False,
    ) -> None:  # fmt: skip
        """Accept angle [rad] and rate [rad/s].

        at_rest: the valve is closed; what the gyro does then, or while the boom is ``held``, tells its noise. Unless at rest an
        angle that jumps is not used.
        """
        jump, doubt = self._agreement.jump(stamp, angle, rate, self.joint.spacing or math.inf), None
        if abs(jump) > _JUMP * s.largest_disagreement and not at_rest:
            text = (
                f"the angle jumped by {1e3 * jump:.0f} mrad from one sample to the next, which the rate does not show"
            )
            doubt = StopCause("sensors_disagree", text)
        if self.joint.take((angle, rate), stamp, measured, doubt):
            if self.joint.clock_set:
                self._begin_again()
            turns = rate if abs(rate) > MOVES else 0.0
            turned, self._turned = turns * max(stamp - self._turned, 0.0), stamp
            self._agreement.update(stamp, angle, rate)
            self._drift.update(stamp, angle, rate)
            self._angle.take(angle, stamp, at_rest, turned)
            self._gyro.take(rate, stamp, at_rest or held)

    def take_hose(self, pressure: float, stamp: float, measured: float, *, at_rest: bool = False) -> None:
        """Accept p_h [Pa gauge], like :meth:`take_joint`."""
        if self.hose.take((pressure,), stamp, measured):
            self._pressures["hose"].take(pressure, stamp, at_rest)

    def take_rod(self, pressure: float, stamp: float, measured: float, *, at_rest: bool = False) -> None:
        """Accept p_b [Pa gauge], like :meth:`take_joint`."""
        if self.rod.take((pressure,), stamp, measured):
            self._pressures["rod"].take(pressure, stamp, at_rest)

    def _watch_repeats(self) -> None:
        self._gyro, self._angle = Repeats(_NO_CHANGE), Repeats(_NO_CHANGE)
        self._pressures = {side: Repeats(_NO_CHANGE_OF_PRESSURE) for side in ("hose", "rod")}

    def forget(self) -> None:
        """Start again: accept the next samples whatever their stamps."""
        for sensor in (self.joint, self.hose, self.rod, self.currents):
            sensor.forget()
        self._begin_again()

    def _begin_again(self) -> None:
        """What is known from one sample to the next begins with the next one."""
        self._agreement.reset()
        self._drift.reset()
        self._turned = math.inf
        self._watch_repeats()

    def complete(self, most_apart: float) -> bool:
        """True once each has delivered a new sample since :meth:`use`, all within ``most_apart`` [s].

        A sample that came just after the cycle of its set would otherwise wait for the others of the next one, and be old by then.
        """
        stamps = (self.joint.stamp, self.hose.stamp, self.rod.stamp)
        return self.joint.fresh and self.hose.fresh and self.rod.fresh and max(stamps) - min(stamps) <= most_apart

    @property
    def begun(self) -> bool:
        """True once one has delivered a new sample since :meth:`use`."""
        return self.joint.fresh or self.hose.fresh or self.rod.fresh

    def newest(self) -> Measurement:
        """The newest sensor values."""
        angle, rate = self.joint.values
        return Measurement(self.joint.stamp, angle, rate, self.hose.values[0], self.rod.values[0], self._age)

    def use(self, now: float) -> Measurement:
        """:meth:`newest`, for a cycle at ``now`` [s]; later samples count as fresh.

        Without a new angle the age stays unchanged: the reference advances by a period, and so does the law.
        """
        joint = self.joint
        if joint.fresh:
            self._age = min(max(now - joint.measured, 0.0), LARGEST_AGE)
        joint.fresh = self.hose.fresh = self.rod.fresh = False
        return self.newest()

    def measured_currents(self, now: float, timeout: float) -> tuple[float, ...] | None:
        """(i_+, i_-) [A], or None if they are not measured."""
        return self.currents.values if now - self.currents.measured < timeout else None

    @property
    def doubt(self) -> str:
        """What is to be told of a sensor though the boom may move: a pressure that repeats its value; empty: nothing.

        No reason to stop, as what a transducer does at rest is also the pump's doing, which may have been switched off.
        """
        for side, repeats in self._pressures.items():
            if stuck := repeats.stuck:
                return f"the {side} pressure repeats its value for {1e3 * stuck[0]:.0f} ms: is the sensor stuck?"
        return ""

    def doubted(self, cause: StopCause) -> StopCause:
        """The cause, with a pressure that is in doubt where it may be what is behind it."""
        if cause.reason in _FED_BACK and self.doubt:
            return StopCause(cause.reason, f"{cause.text}; {self.doubt}")
        return cause

    def finding(self, now: float, s: SupervisionSettings) -> StopCause | None:
        """The fault of the sensors at the time ``now`` [s], or None."""
        for sensor in (self.joint, self.hose, self.rod):
            if cause := sensor.finding(now, s.sensor_timeout, s.bad_samples):
                return cause
        if stuck := self._gyro.stuck:  # and the angle of the same message with it: at rest both agree
            text = (
                f"the rate repeats {self.joint.values[1]:.4g} rad/s for {1e3 * stuck[0]:.0f} ms, by its noise at most "
            )
            return StopCause("sensor_stuck", f"{text}{1e3 * stuck[1]:.0f} ms: is the sensor of angle and rate stuck?")
        if stuck := self._angle.stuck:
            text = f"the angle repeats {self.joint.values[0]:.4g} rad for {1e3 * stuck[0]:.0f} ms"
            turns = f", and the rate is {self.joint.values[1]:.3g} rad/s"
            return StopCause("sensor_stuck", f"{text}{turns}: is the angle's sensor stuck, or is the rate wrong?")
        for watched, most in (
            (self._agreement, s.largest_disagreement),
            (self._drift, _DRIFT * s.largest_disagreement),
        ):
            if abs(watched.apart) > most:
                text = (
                    f"angle and integrated rate have drifted apart by {watched.apart:.3f} rad in about {watched.T:g} s"
                )
                return StopCause("sensors_disagree", text)
        return None


LARGEST_AGE = 0.02
"""s. Longer dead times are not compensated."""
