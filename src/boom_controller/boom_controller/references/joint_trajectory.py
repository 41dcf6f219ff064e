"""A planned motion: points with times become a reference over time. No ROS.

The fields of the points decide, as in ros2_controllers: accelerations give quintics, rates alone cubics, angles alone straight
lines. Straight lines have corners that no crane can follow, so they pass through the trajectory generator (6.27), which
delays them by some 0.4 s. All points have the same fields. A first point later than zero is reached from the present reference.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import IntEnum
from itertools import pairwise

import numpy as np

from boom_controller.references.polynomial import Polynomial, cubic, linear, quintic
from boom_controller.types import Reference

SETTLING = 1.2
"""s. The generator's four poles at -10 1/s have come within 0.3 % of a straight line's end by then."""
MOST_POINTS = 1000
"""More points would delay the cycles while they are read and checked, some 10 us per point."""
LOOK_AHEAD = 0.3
"""s. As far as the laws extend a reference by its derivatives, dead time and the valve's lag included; those of a shorter piece say
nothing about the path that far on. Points of 0.01 to 0.3 s with rates of zero are followed so; with 0.2 s here those of 0.2 s are
not."""
THROWN = 0.05
"""rad. Further than that no planner swings beyond a point; as far a trajectory may begin from the boom."""
_SAMPLES = 25
_REST_RATE = 1e-3
_ROUNDING = 1e-6  # s


class Code(IntEnum):
    """Error codes of control_msgs/FollowJointTrajectory, and of boom_interfaces/TrackTrajectory."""

    SUCCESSFUL = 0
    INVALID_GOAL = -1
    INVALID_JOINTS = -2
    OLD_HEADER_TIMESTAMP = -3
    PATH_TOLERANCE_VIOLATED = -4
    GOAL_TOLERANCE_VIOLATED = -5


class TrajectoryError(ValueError):
    """A trajectory that is refused; the message is one line that says why. ``code``: for the action."""

    exit_status = 2

    def __init__(self, message: str, code: Code = Code.INVALID_GOAL) -> None:
        super().__init__(message)
        self.code = code


@dataclass(frozen=True)
class TrajectoryPoint:
    """Wanted position at `time` [s] after the start: angle [rad], rate [rad/s], acceleration [rad/s^2] or None."""

    time: float
    angle: float
    rate: float | None = None
    acceleration: float | None = None


@dataclass(frozen=True)
class Bounds:
    """Limits of a trajectory: angle [rad] between low and high, at most `rate` [rad/s]; the start may be off [rad].

    least, most: angles [rad] of a boom that stands beyond these: from there it may be led back, and no further out.
    """

    low: float
    high: float
    rate: float
    start: float
    least: float = math.inf
    most: float = -math.inf

    def from_where(self, *angles: float) -> Bounds:
        """The bounds of a boom that stands at these angles [rad], measured and by its reference."""
        return replace(self, least=min(angles), most=max(angles))

    def nearest(self, angle: float) -> float:
        """The angle [rad] within the bounds that is nearest to one that is asked for."""
        return min(max(angle, min(self.low, self.least)), max(self.high, self.most))


class JointTrajectory:
    """A checked trajectory.

    Attributes:
        duration: [s] from the start to the goal.
        goal: angle of the last point [rad].
        smoothed: True if only angles were given: the result of ``at`` has to pass through the trajectory generator.
    """

    def __init__(self, times: Sequence[float], pieces: Sequence[Polynomial], goal: float, smoothed: bool) -> None:
        self._begins = tuple(times[:-1])
        self._pieces = tuple(pieces)
        self._short = tuple(not smoothed and b - a < LOOK_AHEAD - _ROUNDING for a, b in pairwise(times))
        self._planned = times[-1]
        self.goal = goal
        self.smoothed = smoothed
        self.duration = self._planned + (SETTLING if smoothed else 0.0)

    def at(self, time: float) -> Reference:
        """The reference at `time` [s] since the start: before it the first point, after the end the last one, at rest.

        In a piece shorter than ``LOOK_AHEAD`` acceleration and jerk are those of the cubic that is on the path, with its rate, now
        and ``LOOK_AHEAD`` later: the piece's own jerk grows with the rounding of a point by T^-3.
        """
        k = bisect_right(self._begins, time) - 1
        if k < 0 or time >= self._planned or not self._short[k]:
            return self.exactly(time)
        here, then = self.exactly(time), self.exactly(time + LOOK_AHEAD)
        return cubic((here.angle, here.rate), (then.angle, then.rate), LOOK_AHEAD).at(0.0)

    def exactly(self, time: float) -> Reference:
        """The same with the path's own derivatives, however short its pieces are."""
        if time >= self._planned:
            return Reference(self.goal, 0.0, 0.0, 0.0)
        if time < 0.0:
            return Reference(self._pieces[0].at(0.0).angle, 0.0, 0.0, 0.0)
        k = max(bisect_right(self._begins, time) - 1, 0)
        return self._pieces[k].at(time - self._begins[k])


def plan(points: Sequence[TrajectoryPoint], present: Reference, measured: float, bounds: Bounds) -> JointTrajectory:
    """A trajectory from `points`, beginning at the `present` reference of a boom at the `measured` angle [rad].

    Raises:
        TrajectoryError: no points, times that do not ascend, fields that are missing or not finite, a motion at the end, a
            start away from the boom, angles or rates beyond the bounds.
    """
    _check_fields(points, bounds)
    last = points[-1]
    if last.rate is not None and abs(last.rate) > _REST_RATE:
        raise TrajectoryError(
            f"the last point has a rate of {last.rate:g} rad/s: the boom holds there, so give a rate of 0"
        )
    first = points[0]
    if first.time <= 0.0 and abs(first.angle - measured) > bounds.start:
        raise TrajectoryError(
            f"the first point is {abs(first.angle - measured):.4g} rad away from the boom at {measured:.3f} rad: begin within "
            f"{bounds.start:g} rad, or give the first point a time above 0 to move there"
        )
    if first.time > 0.0:
        begin = TrajectoryPoint(
            0.0,
            present.angle,
            None if first.rate is None else present.rate,
            None if first.acceleration is None else present.acceleration,
        )
        points = [begin, *points]
    pieces = [_piece(a, b) for a, b in pairwise(points)]
    if not pieces:  # one point at time zero: be there
        pieces, points = [Polynomial(first.angle)], [first, first]
    result = JointTrajectory([point.time for point in points], pieces, last.angle, smoothed=last.rate is None)
    _check_bounds(points, pieces, bounds)
    _check_accelerations(points)
    return result


def _check_accelerations(points: Sequence[TrajectoryPoint]) -> None:
    """A point may have the acceleration with which planners pass it, and none that throws the boom beyond both ends of a piece."""
    for k, (a, b) in enumerate(pairwise(points)):
        if not (a.acceleration or b.acceleration):
            continue
        (_, calm), (farthest, most) = (
            _farthest(replace(a, acceleration=u), replace(b, acceleration=v))
            for u, v in ((0.0, 0.0), (a.acceleration, b.acceleration))
        )
        if most - calm > THROWN:
            raise TrajectoryError(
                f"by the accelerations at points {k} and {k + 1} the boom would go to {farthest:.3f} rad and back: give 0, "
                "or points closer together"
            )


def _farthest(a: TrajectoryPoint, b: TrajectoryPoint) -> tuple[float, float]:
    """Angle [rad] at which a piece is farthest beyond both of its ends, and by how much [rad]."""
    low, high = sorted((a.angle, b.angle))
    angle = np.polynomial.polynomial.polyval(np.linspace(0.0, b.time - a.time, _SAMPLES), _piece(a, b).coefficients)
    beyond = np.maximum(low - angle, angle - high)
    return float(angle[np.argmax(beyond)]), float(beyond.max())


def _check_fields(points: Sequence[TrajectoryPoint], bounds: Bounds) -> None:
    if not points:
        raise TrajectoryError("the trajectory has no points: give at least one")
    before = -math.inf
    for k, point in enumerate(points):
        numbers = [point.time, point.angle, point.rate or 0.0, point.acceleration or 0.0]
        if not all(math.isfinite(number) for number in numbers):
            raise TrajectoryError(f"point {k}: a number is not finite")
        if point.time < 0.0 or point.time <= before:
            raise TrajectoryError(f"point {k} is at {point.time:g} s: times have to ascend strictly, from 0 s on")
        before = point.time
        outer = point is not points[-1]
        low, high = (
            (min(bounds.low, bounds.least), max(bounds.high, bounds.most)) if outer else (bounds.low, bounds.high)
        )
        if not low <= point.angle <= high:
            raise TrajectoryError(f"point {k} is at {point.angle:.4g} rad: {_between(bounds)}")
        if (point.rate is None, point.acceleration is None) != (points[0].rate is None, points[0].acceleration is None):
            raise TrajectoryError(
                f"point {k} has other fields than the first one: give rates and accelerations for all"
            )
        if point.rate is None and point.acceleration is not None:
            raise TrajectoryError(f"point {k} has an acceleration but no rate: give the rate too")


def _between(bounds: Bounds) -> str:
    return f"the boom moves between {bounds.low:.3f} and {bounds.high:.3f} rad"


def _piece(a: TrajectoryPoint, b: TrajectoryPoint) -> Polynomial:
    duration = b.time - a.time
    if a.rate is None or b.rate is None:
        return linear(a.angle, b.angle, duration)
    if a.acceleration is None or b.acceleration is None:
        return cubic((a.angle, a.rate), (b.angle, b.rate), duration)
    return quintic((a.angle, a.rate, a.acceleration), (b.angle, b.rate, b.acceleration), duration)


def _check_bounds(points: Sequence[TrajectoryPoint], pieces: Sequence[Polynomial], bounds: Bounds) -> None:
    count = max(2, min(_SAMPLES, 20_000 // len(pieces)))
    begins = np.array([point.time for point in points])
    t = np.diff(begins)[:, None] * np.linspace(0.0, 1.0, count)
    with np.errstate(over="ignore", invalid="ignore"):  # what is no number any more is out of bounds, too
        c0, c1, c2, c3, c4, c5 = np.array([piece.coefficients for piece in pieces]).T[:, :, None]
        angle = c0 + t * (c1 + t * (c2 + t * (c3 + t * (c4 + t * c5))))
        rate = c1 + t * (2 * c2 + t * (3 * c3 + t * (4 * c4 + t * 5 * c5)))
        inside = (bounds.low <= angle) & (angle <= bounds.high)
        inside |= (bounds.least <= angle) & (angle < bounds.low) & (rate >= -_REST_RATE)  # led back
        inside |= (bounds.high < angle) & (angle <= bounds.most) & (rate <= _REST_RATE)
        wrong = ~(inside & (np.abs(rate) <= bounds.rate))
    if not wrong.any():
        return
    k, i = (int(index) for index in np.unravel_index(np.argmax(wrong), wrong.shape))
    when = begins[k] + t[k, i]
    if not inside[k, i]:
        where = f"at {angle[k, i]:.4g} rad" if math.isfinite(angle[k, i]) else "too far away for a number"
        raise TrajectoryError(f"at {when:.2f} s the trajectory is {where}: {_between(bounds)}")
    speed = f"at {rate[k, i]:.4g} rad/s" if math.isfinite(rate[k, i]) else "too fast for a number"
    raise TrajectoryError(
        f"at {when:.2f} s the trajectory moves {speed}: at most {bounds.rate:g} rad/s is allowed; give it more time"
    )
