"""A tracked trajectory: its tolerances on the way, at the end and in time, and its result. No ROS."""

from __future__ import annotations

from dataclasses import dataclass

from boom_controller.references.joint_trajectory import Code
from boom_controller.supervision.supervision_settings import SupervisionSettings


@dataclass(frozen=True)
class Tolerances:
    """Largest angle error on the way and at the end [rad], None = none; how much later the goal may be reached [s]."""

    path: float | None
    goal: float | None
    time: float

    @classmethod
    def asked(cls, path: float, goal: float, time: float, settings: SupervisionSettings) -> Tolerances:
        """From the fields of the action: 0 = value of the settings, negative = none; in the settings 0 = none."""

        def chosen(given: float, default: float) -> float | None:
            value = default if given == 0.0 else given
            return value if value > 0.0 else None

        return cls(
            chosen(path, settings.path_tolerance),
            chosen(goal, settings.goal_tolerance),
            settings.goal_time_tolerance if time == 0.0 else max(time, 0.0),
        )


@dataclass(frozen=True)
class Ending:
    """How a tracked trajectory ended: code, one sentence (empty on success), largest angle error [rad]."""

    code: Code
    text: str
    largest_error: float


class TrackingGoal:
    """Watches one trajectory.

    Args:
        tolerances: of the way and the end.
        duration: planned time [s].
        goal: angle at the end [rad].
    """

    def __init__(self, tolerances: Tolerances, duration: float, goal: float) -> None:
        self.tolerances, self.duration, self.goal = tolerances, duration, goal
        self.largest_error, self._due = 0.0, duration

    def look(self, elapsed: float, wanted: float, angle: float, changing: bool = False) -> Ending | None:
        """`elapsed` [s] since the start, wanted and measured angle [rad]. Returns an ending, or None while it continues.

        changing: something of the reference before is left; it does not end before that has faded, and is late from then on.
        """
        error = abs(wanted - angle)
        if elapsed >= 0.0:
            self.largest_error = max(self.largest_error, error)
        path, goal = self.tolerances.path, self.tolerances.goal
        if changing:
            self._due = max(self._due, elapsed)
        if elapsed < self.duration or changing:
            if path is not None and error > path:
                return self._end(
                    Code.PATH_TOLERANCE_VIOLATED, f"{error:.3g} rad away from the path, tolerance {path:g} rad"
                )
            return None
        left = abs(self.goal - angle)
        if goal is None or left <= goal:
            return self._end(Code.SUCCESSFUL, "")
        if elapsed >= self._due + self.tolerances.time:
            return self._end(
                Code.GOAL_TOLERANCE_VIOLATED,
                f"{left:.3g} rad away from the goal {self.tolerances.time:g} s after its time, tolerance {goal:g} rad",
            )
        return None

    def ended(self, code: Code, text: str) -> Ending:
        """End by another cause: a stop, another goal, a cancel."""
        return self._end(code, text)

    def _end(self, code: Code, text: str) -> Ending:
        return Ending(code, text, self.largest_error)


class Goals:
    """At most one trajectory at a time, by its number, and the endings that have not been reported yet."""

    def __init__(self) -> None:
        self._running: tuple[int, TrackingGoal] | None = None
        self._count = 0
        self._endings: list[tuple[int, Ending]] = []

    def start(self, goal: TrackingGoal) -> int:
        """Start a new one, after ending the one before. Returns its number."""
        self._count += 1
        self._running = (self._count, goal)
        return self._count

    def runs(self, number: int) -> bool:
        """True while the trajectory of that number is tracked."""
        return self._running is not None and self._running[0] == number

    def look(self, elapsed: float, wanted: float, angle: float, changing: bool = False) -> Ending | None:
        """As :meth:`TrackingGoal.look`, for the tracked one."""
        if self._running is None:
            return None
        number, goal = self._running
        ending = goal.look(elapsed, wanted, angle, changing)
        if ending is not None:
            self._running = None
            self._endings.append((number, ending))
        return ending

    def end(self, code: Code, text: str) -> None:
        """End the tracked trajectory by another cause."""
        if self._running is not None:
            number, goal = self._running
            self._running = None
            self._endings.append((number, goal.ended(code, text)))

    def pop_endings(self) -> list[tuple[int, Ending]]:
        """Trajectories that ended since the last call, by their number."""
        endings, self._endings = self._endings, []
        return endings
