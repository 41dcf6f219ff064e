"""A planned motion that is asked for: whether it can be joined now, and from when on it counts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from boom_controller.references.joint_trajectory import (
    Bounds,
    Code,
    JointTrajectory,
    TrajectoryError,
    TrajectoryPoint,
    plan,
)
from boom_controller.types import Reference

LATEST_BEGIN = 60.0
"""s. A trajectory whose stamp lies further ahead is of another clock."""


@dataclass(frozen=True)
class Request:
    """Points, the stamp of their beginning [s] (None: at once), and the reference that they go on from."""

    points: Sequence[TrajectoryPoint]
    begin: float | None
    present: Reference

    def planned(self, angle: float, stamp: float, now: float, bounds: Bounds) -> tuple[JointTrajectory, float]:
        """The trajectory and the stamp of its beginning [s].

        Args:
            angle: that was measured last [rad].
            stamp: of that sample [s].
            now: from when on it counts where it has no stamp of its own [s].
            bounds: of the motion.

        Raises:
            TrajectoryError: it is refused; says why.
        """
        if self.begin is not None:
            self._check_stamp(self.begin, stamp)
        begin = now if self.begin is None else self.begin
        # one for later waits at its first angle, and so begins from rest
        present = self.present if begin <= now else Reference(self.present.angle)
        trajectory = plan(self.points, present, angle, bounds)
        first = trajectory.at(stamp - begin).angle
        if abs(first - self.present.angle) > bounds.start:
            raise TrajectoryError(
                f"the trajectory is at {first:.3f} rad now and the boom at {self.present.angle:.3f} rad: "
                f"begin within {bounds.start:g} rad"
            )
        return trajectory, begin

    def _check_stamp(self, begin: float, stamp: float) -> None:
        if self.points and begin + self.points[-1].time < stamp:
            raise TrajectoryError(
                f"the trajectory ended {stamp - begin - self.points[-1].time:.1f} s ago by its stamp: "
                "stamp it with the present, or with zero for at once",
                Code.OLD_HEADER_TIMESTAMP,
            )
        if begin - stamp > LATEST_BEGIN:
            raise TrajectoryError(
                f"the trajectory begins in {begin - stamp:.0f} s by its stamp: at most {LATEST_BEGIN:g} s ahead are waited for",
                Code.OLD_HEADER_TIMESTAMP,
            )
