"""Limits of a boom in motion: speed, pressure, angle, distance from the reference, currents, cycles. No ROS."""

from __future__ import annotations

import math
from collections import deque

from boom_controller.supervision.reasons import StopCause
from boom_controller.supervision.supervision_settings import SupervisionSettings
from boom_controller.supervision.weight import CarriedWeight
from boom_controller.types import MOVES, ControlOutput, Measurement, Reference
from boom_model.derived import valve_currents
from boom_model.machine import Machine, Pose

_STAYS = 0.1  # s that a pressure stays beyond its limit once that was told: bringing the boom to rest by the loop is of no use
_WIDE_OPEN = 0.8  # of the way from where the valve opens to where it is open
_RECENT, _SHARE = 1.0, 0.8  # s, of what was commanded: with less a law sees a load, or an oscillation, that is none
_ROUNDING = 1e-9  # s
_UNMOVED = 2e-3  # rad. What the angle's noise and steps may make of a boom that stands


class _Lasting:
    """True once a condition has held without interruption for some time."""

    def __init__(self) -> None:
        self._since: float | None = None

    def __call__(self, holds: bool, now: float, least: float) -> bool:
        if not holds:
            self._since = None
            return False
        if self._since is None:
            self._since = now
        return now - self._since >= least


class MotionWatch:
    """Checks every cycle.

    Args:
        settings: the limits.
        angles: lowest and highest angle of the machine [rad].
        valve: currents at which its valve opens, and is open [A].
        weight: what its pressures have to carry, if they are to be watched.
    """

    def __init__(
        self, settings: SupervisionSettings, angles: tuple[float, float], valve: tuple[float, float],
        weight: CarriedWeight | None = None,
    ) -> None:  # fmt: skip
        self.settings = settings
        self.angles = angles
        self._wide = valve[0] + _WIDE_OPEN * (valve[1] - valve[0])
        self._weight = weight
        self.reset()

    @classmethod
    def of(cls, settings: SupervisionSettings, machine: Machine, pose: Pose) -> MotionWatch:
        """Of a machine in a pose."""
        return cls(
            settings, settings.angles(machine.angle_limits), valve_currents(machine), CarriedWeight(machine, pose)
        )

    def reset(self) -> None:
        """Start again."""
        self._fast, self._pressed, self._stays = _Lasting(), _Lasting(), _Lasting()
        if self._weight:
            self._weight.reset()
        self._missed: deque[float] = deque()
        self._opened: deque[tuple[float, float]] = deque()
        # time [s], both currents commanded and measured [A], how long they differed [s]
        self._given: deque[tuple[float, float, float, float]] = deque()
        self._measured_at = math.inf

    def cycle(self, gap: float, period: float, now: float) -> StopCause | None:
        """Check a cycle that comes `gap` [s] after the last one; cycles are due every `period` [s]."""
        if gap > 1.5 * period:
            self._missed.extend([now] * min(round(gap / period) - 1, self.settings.most_missed))
        while self._missed and now - self._missed[0] > 1.0:
            self._missed.popleft()
        if gap > self.settings.longest_cycle:
            return StopCause(
                "missed_deadlines",
                f"{1e3 * gap:.0f} ms between two cycles, more than {1e3 * self.settings.longest_cycle:.0f} ms",
            )
        if len(self._missed) >= self.settings.most_missed:
            return StopCause(
                "missed_deadlines",
                f"{len(self._missed)} periods without a cycle within one second, the last {1e3 * gap:.0f} ms after the one before: "
                f"sensors slower than sample_time ({1e3 * period:.0f} ms) need a longer one, else free the processor",
            )
        return None

    def motion(
        self, measurement: Measurement, reference: Reference, output: ControlOutput, now: float
    ) -> StopCause | None:
        """Check whether the motion is within its limits and near its reference."""
        s, m = self.settings, measurement
        if not (math.isfinite(output.retract) and math.isfinite(output.extend)):
            return StopCause("divergence", "the control law gave a current that is not a number")
        if output.reason:
            return self._interrupted() or StopCause(output.cause, output.reason)
        if self._fast(abs(m.rate) > s.largest_rate, now, s.persistence):
            return StopCause("speed_limit", f"{m.rate:.2f} rad/s, allowed is {s.largest_rate:g} rad/s")
        pressure = max(m.hose_pressure, m.rod_pressure)
        pressed = self._pressed(pressure > s.largest_pressure, now, s.persistence)
        stays = self._stays(pressed, now, _STAYS)
        if pressed:
            side = "hose" if m.hose_pressure >= m.rod_pressure else "rod"
            return StopCause(
                "pressure_stays" if stays else "pressure_limit",
                f"{pressure / 1e5:.0f} bar on the {side} side, allowed are {s.largest_pressure / 1e5:.0f} bar",
            )
        if self._weight and self._weight.lacks(now, m.angle, m.rate, m.hose_pressure, m.rod_pressure):
            return StopCause(
                "pressures_impossible",
                f"the boom is lifted, and {m.hose_pressure / 1e5:.3g} bar in the hose and {m.rod_pressure / 1e5:.3g} bar on "
                "the rod side do not carry even the empty boom",
            )
        error = reference.angle - m.angle
        if abs(error) > s.largest_angle_error:
            return StopCause("divergence", f"the boom is {error:.2f} rad away from its reference")
        if self._stands(m.angle, max(output.retract, output.extend) > self._wide, now):
            return StopCause(
                "no_motion",
                f"the valve has been wide open for {s.longest_stall:g} s, and the angle stays at {m.angle:.3f} rad",
            )
        low, high = self.angles
        if (m.angle > high and m.rate > MOVES) or (m.angle < low and m.rate < -MOVES):
            return StopCause("angle_limit", f"the boom is at {m.angle:.3f} rad, outside {low:.3f} .. {high:.3f} rad")
        return None

    def _stands(self, angle: float, wide: bool, now: float) -> bool:
        """Whether the valve has been ``wide`` open for ``longest_stall`` and the angle [rad] has not moved."""
        if not wide:
            self._opened.clear()
            return False
        self._opened.append((now, angle))
        if now - self._opened[0][0] < self.settings.longest_stall:
            return False
        seen = [a for _, a in self._opened]
        self._opened.popleft()
        return max(seen) - min(seen) < _UNMOVED

    def currents(
        self, commanded: tuple[float, float], measured: tuple[float, ...] | None, now: float
    ) -> StopCause | None:
        """Check whether the solenoids get the commanded currents [A]. ``measured`` None: not measured."""
        if measured is None:
            self._measured_at = math.inf
            return None
        worst, timeout = (
            max(abs(commanded[0] - measured[0]), abs(commanded[1] - measured[1])),
            self.settings.current_timeout,
        )
        passed = min(max(now - self._measured_at, 0.0), self.settings.longest_cycle)
        self._measured_at = now
        self._given.append((now, sum(commanded), sum(measured), passed if worst > self.settings.current_error else 0.0))
        while now - self._given[0][0] > max(_RECENT, 2.0 * timeout):
            self._given.popleft()
        if (
            self._given[-1][3]
            and sum(row[3] for row in self._given if row[0] > now - 2.0 * timeout) >= timeout - _ROUNDING
        ):
            none = ": is the motion enabled?" if max(measured) <= self.settings.current_error else ""
            return StopCause(
                "currents_not_followed",
                f"commanded {commanded[0]:.2f} and {commanded[1]:.2f} A, measured {measured[0]:.2f} and {measured[1]:.2f} A{none}",
            )
        return None

    def _interrupted(self) -> StopCause | None:
        """What the law takes for a load or an oscillation where the solenoids got the currents now and then only."""
        recent = [row for row in self._given if row[0] >= self._given[-1][0] - _RECENT]
        commanded, measured = (sum(row[k] for row in recent) for k in (1, 2))
        if measured >= _SHARE * commanded:
            return None
        return StopCause(
            "currents_not_followed",
            f"over {_RECENT:g} s the solenoids got {100 * measured / commanded:.0f} % of what was commanded: is the motion "
            "enabled all the time?",
        )
