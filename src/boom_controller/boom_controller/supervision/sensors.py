"""Plausibility of the sensors: age, range, finite numbers, and agreement of angle and rate. No ROS.

A wrong sample is not used. Three wrong ones in a row from one sensor, or a good one that has become too old, stop the boom; a
single bad sample among good ones does not. Times are seconds of the supervising clock (steady, or simulated in lockstep).
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass
from itertools import pairwise

from boom_controller.supervision.reasons import StopCause

CLOCK_STEP = 0.01
"""s, by which stamps leave our clock from one sample to the next where a clock was set: a sample time, and ten times what a clock
that is being slewed gains in one."""
CONFIRMED = 2
"""Samples in a row that tell so: a stall between the reading of two clocks is seen in one."""
TOLD = 1.0
"""s, for which it is told."""
LONGEST_GAP = 0.5
"""s, without a sample. Longer than any time-out: what the boom did meanwhile is not known."""
INTERVALS = 20
"""Between samples, which tell how often they come: a bus may hand over several at once."""
BURST = 3.0
"""Times their mean: as much longer are those between two bursts."""
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
        clock_step: from which a clock counts as set [s]; infinite where stamps are of a clock that does not run as ours: it is set
            where it goes back by more than ``LONGEST_GAP``, which no late sample does.

    Attributes:
        values: newest good sample; NaN before the first.
        stamp: its time [s] by the sender's clock.
        measured: when the newest good sample was measured, by our clock [s]; minus infinity before the first.
        bad: samples in a row that were not used.
        clock_set: by how much [s] the stamp of that sample left our clock against the one before; usually 0.
        fresh: a good sample came since ``fresh`` was cleared.
    """

    def __init__(self, label: str, ranges: tuple[Range, ...], clock_step: float = CLOCK_STEP) -> None:
        self.label, self._ranges, self.clock_step = label, ranges, clock_step
        self.values: tuple[float, ...] = (math.nan,) * len(ranges)
        self.stamp = -math.inf
        self.fresh = False
        self.measured = -math.inf
        self.bad = self._telling = 0
        self.clock_set = self._step = 0.0
        self._set = (0.0, -math.inf)
        self._last_bad: StopCause | None = None
        self._stamps = deque[float](maxlen=INTERVALS + 1)

    @property
    def spacing(self) -> float:
        """Time [s] from one sample to the next, but for the longest, which may be a loss; 0 before it is known."""
        gaps = self._gaps
        return sum(gaps[:-1]) / len(gaps[:-1]) if gaps else 0.0

    @property
    def burst(self) -> float:
        """Time [s] between two bursts of samples, the second longest of the last ones; 0 where they come evenly."""
        gaps = self._gaps
        return gaps[-2] if gaps and gaps[-2] > BURST * self.spacing else 0.0

    @property
    def _gaps(self) -> list[float]:
        """Times [s] between the last samples, the longest last; empty before there are enough."""
        return sorted(b - a for a, b in pairwise(self._stamps)) if len(self._stamps) > INTERVALS else []

    def take(self, values: tuple[float, ...], stamp: float, measured: float, doubt: StopCause | None = None) -> bool:
        """Accept a sample with its stamp [s] and its time of measurement on our clock [s]. False if it is not used.

        doubt: why it is not to be used though it is within its range.
        """
        finding = self._wrong(values)
        step = 0.0 if finding else self._stepped(stamp, measured)
        if finding is None and stamp > self.stamp and not step:
            finding = doubt
        if finding is not None:
            self.bad += 1
            self._last_bad = finding
            return False
        if (step or stamp <= self.stamp) and self._telling < CONFIRMED:
            return False  # not sure yet; or the same again, or overtaken, which makes nothing younger
        if step:  # by a clock that has not heard of it yet the sample is old
            self._set = (step, max(measured, self.measured))
        self.clock_set, self._telling = step, 0
        if step or stamp - self.stamp > LONGEST_GAP:
            self._stamps.clear()
        self._stamps.append(stamp)
        self.values, self.stamp, self.measured = values, stamp, measured
        self.fresh, self.bad = True, 0
        return True

    def _stepped(self, stamp: float, measured: float) -> float:
        """By how much [s] a stamp leaves our clock against the good sample before, or 0; those that agree are counted."""
        step = (stamp - measured) - (self.stamp - self.measured) if self.measured > -math.inf else 0.0
        if math.isinf(self.clock_step):
            step = min(stamp - self.stamp, 0.0) if self.measured > -math.inf else 0.0
        if abs(step) <= min(self.clock_step, LONGEST_GAP):
            self._telling = 0
            return 0.0
        self._telling = self._telling + 1 if abs(step - self._step) <= self.clock_step else 1
        self._step = step
        return step

    def forget(self) -> None:
        """Start again: accept the next sample whatever its stamp."""
        self.__init__(self.label, self._ranges, self.clock_step)  # type: ignore[misc]

    def finding(self, now: float, timeout: float, most_bad: int) -> StopCause | None:
        """The fault of the sensor at the time `now` [s], or None."""
        if self.bad >= most_bad:
            return self._last_bad
        step, when = self._set
        if now - when < TOLD:
            text = f"the stamps of the {self.label} went {'forward' if step > 0.0 else 'back'} by {abs(step):.3g} s"
            if math.isinf(self.clock_step):
                return StopCause("clock_set", f"{text}: did the bag or the simulation begin again?")
            return StopCause("clock_set", f"{text} against the steady clock here: was the clock set?")
        age = now - self.measured
        if age > timeout and self.bad:
            return self._last_bad
        if age > timeout:
            text = f"no {self.label} yet" if age == math.inf else f"the {self.label} is {1e3 * age:.0f} ms old"
            doubt = "is the sensor or the bus gone, or this computer too busy?"
            return StopCause("sensor_old", f"{text}, more than {1e3 * timeout:.0f} ms: {doubt}")
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

    def jump(self, time: float, angle: float, rate: float, spacing: float) -> float:
        """By how much [rad] a sample leaves the one before, where neither rate nor any change of it in between explains that.

        spacing: usual time between samples [s]; behind a longer gap the rate counts as known all the same.
        """
        before, angle_before, rate_before = self._last or (time, angle, rate)
        dt = time - before
        if not 0.0 < dt <= LONGEST_GAP:
            return 0.0
        left = angle - angle_before - 0.5 * (rate + rate_before) * dt
        return left if abs(left) > 0.5 * FASTEST * min(dt, spacing) ** 2 else 0.0

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
