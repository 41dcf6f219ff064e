"""Plausibility of the sensors: age, range, finite numbers, and agreement of angle and rate. No ROS.

A wrong sample is not used. Three wrong ones in a row from one sensor, or a good one that has become too old, stop the boom; a
single bad sample among good ones does not. Times are seconds of the supervising clock (steady, or simulated in lockstep).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from boom_controller.supervision.reasons import StopCause

MOVES = 0.02
"""rad/s. Ten times the noise of a gyro, and more than its bias: the boom really moves."""
CLOCK_STEP, BACK, TOLD = 0.01, 3, 1.0
"""s, by which stamps leave our clock from one sample to the next where a clock was set; samples in a row that are behind the one
before, as it then goes; and s, for which this is told."""
LONGEST_GAP = 0.5
"""s, without a sample. Longer than any time-out: what the boom did meanwhile is not known."""
FASTEST = 5.0
"""rad/s^2. No boom changes its rate faster."""


@dataclass(frozen=True)
class Range:
    """Range of a sensor value: name, unit, lowest and highest value [unit]."""

    name: str
    unit: str
    low: float
    high: float


class SupervisedSensor:
    """One sensor topic and its newest good sample.

    Args:
        label: name for the operator.
        ranges: of its values, in order.

    Attributes:
        values: newest good sample; NaN before the first.
        stamp: its time [s] by the sender's clock.
        measured: when the newest good sample was measured, by our clock [s]; minus infinity before the first.
        bad: samples in a row that were not used.
        clock_set: by how much [s] the stamp of that sample left our clock against the one before; usually 0.
        fresh: a good sample came since ``fresh`` was cleared.
    """

    def __init__(self, label: str, ranges: tuple[Range, ...]) -> None:
        self.label = label
        self._ranges = ranges
        self.values: tuple[float, ...] = (math.nan,) * len(ranges)
        self.stamp = -math.inf
        self.fresh = False
        self.measured = -math.inf
        self.bad = self._behind = 0
        self.clock_set = 0.0
        self._set = (0.0, -math.inf)
        self._last_bad: StopCause | None = None

    def take(self, values: tuple[float, ...], stamp: float, measured: float, doubt: StopCause | None = None) -> bool:
        """Accept a sample with its stamp [s] and its time of measurement on our clock [s]. False if it is not used.

        doubt: why it is not to be used though it is within its range.
        """
        finding = self._wrong(values) or doubt
        if finding is None:
            step = (stamp - measured) - (self.stamp - self.measured) if self.measured > -math.inf else 0.0
            step = step if abs(step) > CLOCK_STEP else 0.0
            if (
                stamp <= self.stamp
            ):  # the same again, or overtaken, which makes nothing younger; or a clock was set back
                self._behind = self._behind + 1 if step else 0
                if self._behind < BACK:
                    return False
            self._set = (step, measured) if step else self._set
            self.clock_set, self._behind = step, 0
            self.values, self.stamp, self.measured = values, stamp, measured
            self.fresh, self.bad = True, 0
            return True
        self.bad += 1
        self._last_bad = finding
        return False

    def forget(self) -> None:
        """Start again: accept the next sample whatever its stamp."""
        self.__init__(self.label, self._ranges)  # type: ignore[misc]

    def finding(self, now: float, timeout: float, most_bad: int) -> StopCause | None:
        """The fault of the sensor at the time `now` [s], or None."""
        if self.bad >= most_bad:
            return self._last_bad
        step, when = self._set
        if now - when < TOLD:
            way = "forward" if step > 0.0 else "back"
            text = f"the stamps of the {self.label} went {way} by {abs(step):.3g} s against the steady clock here"
            return StopCause("clock_set", f"{text}: was the clock set?")
        age = now - self.measured
        if age > timeout:
            text = f"no {self.label} yet" if age == math.inf else f"the {self.label} is {1e3 * age:.0f} ms old"
            return StopCause("sensor_old", f"{text}, more than {1e3 * timeout:.0f} ms: is the sensor or the bus gone?")
        return None

    def _wrong(self, values: tuple[float, ...]) -> StopCause | None:
        for value, known in zip(values, self._ranges, strict=True):
            if not math.isfinite(value):
                return StopCause("sensor_not_a_number", f"the {known.name} is {value}: check the sensor")
            if not known.low <= value <= known.high:
                return StopCause(
                    "sensor_out_of_range",
                    f"the {known.name} of {value:.4g} {known.unit} is outside {known.low:.4g} .. {known.high:.4g} {known.unit}: "
                    "check the sensor",
                )
        return None


class Agreement:
    """Angle against rate.

        r' = q_2' - d q_2 / dt - r / T

    r [rad] is the drift between both within about the last T seconds; zero for two good sensors. Discretised per
    sample: r <- (r + rate dt - change of angle) exp(-dt / T).
    """

    def __init__(self, T: float = 1.0) -> None:
        self.T = T
        self.reset()

    def reset(self) -> None:
        """Start again."""
        self.apart = 0.0
        self._last: tuple[float, float, float] | None = None

    def jump(self, time: float, angle: float, rate: float) -> float:
        """By how much [rad] a sample leaves the one before, where neither rate nor any change of it in between explains that."""
        before, angle_before, rate_before = self._last or (time, angle, rate)
        dt = max(time - before, 0.0)
        left = angle - angle_before - 0.5 * (rate + rate_before) * dt
        return left if abs(left) > 0.5 * FASTEST * dt**2 else 0.0

    def update(self, time: float, angle: float, rate: float) -> float:
        """Update with a sample: time [s], angle [rad], rate [rad/s]. Returns r [rad]."""
        if self._last is not None:
            before, angle_before, rate_before = self._last
            dt = time - before
            if dt <= 0.0:
                return self.apart
            # beyond T nothing is left of what was
            moved = 0.5 * (rate + rate_before) * dt if dt <= LONGEST_GAP else angle - angle_before
            self.apart = (self.apart + moved - (angle - angle_before)) * math.exp(-dt / self.T)
        self._last = (time, angle, rate)
        return self.apart
