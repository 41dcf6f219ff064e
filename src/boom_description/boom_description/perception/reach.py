"""Plans a motion of the boom that brings the gripper to a log, from the robot description alone.

The boom turns one joint, so the gripper moves on an arc: the angle wanted is where the arc comes closest to the log. The motion
is a quintic from rest to rest, ``q = q_0 + dq (10 s^3 - 15 s^4 + 6 s^5)``, s = t/T, whose largest rate is 15/8 dq/T and
whose largest acceleration is 5.77 dq/T^2.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from boom_description.perception.log_fit import PerceptionError
from boom_description.tip_pose import TipKinematics

Vector = NDArray[np.float64]
_GRID = 0.002
STEP = 0.1
"""s between two points of a trajectory."""


@dataclass(frozen=True)
class Gripper:
    """How far below the tip it grasps [m], and how far from its middle a log may lie [m]."""

    depth: float = 1.2
    opening: float = 0.4


@dataclass(frozen=True)
class PlannedMotion:
    """Points of a trajectory: times [s], angles [rad], rates [rad/s], accelerations [rad/s^2], each (n,)."""

    times: Vector
    angles: Vector
    rates: Vector
    accelerations: Vector


def grasp_point(tip: Vector, gripper: Gripper) -> Vector:
    """Middle of the gripper, which hangs plumb below the tip (3,) [m]."""
    point: Vector = tip - np.array([0.0, 0.0, gripper.depth])
    return point


def angle_at(
    kinematics: TipKinematics, joints: Mapping[str, float], joint: str, target: Vector, gripper: Gripper
) -> tuple[float, float]:
    """The angle [rad] of `joint` at which the gripper is closest to `target` (3,) [m], and that distance [m].

    Raises:
        PerceptionError: it does not come within the gripper's opening.
    """

    def distance(angle: float) -> float:
        tip = kinematics.pose({**joints, joint: angle}).position
        return float(np.linalg.norm(grasp_point(tip, gripper) - target))

    best = _least(distance, *kinematics.limits[joint])
    left = distance(best)
    if left > gripper.opening:
        raise PerceptionError(
            f"the gripper comes no closer than {left:.2f} m to the log ({gripper.opening:g} m are needed): slew, or move outer "
            "boom and telescope first"
        )
    return best, left


def motion(begin: float, end: float, rate: float, acceleration: float) -> PlannedMotion:
    """From rest at `begin` to rest at `end` [rad] with at most `rate` [rad/s] and `acceleration` [rad/s^2]."""
    way = abs(end - begin)
    duration = max(15.0 / 8.0 * way / rate, float(np.sqrt(5.7735 * way / acceleration)), 5 * STEP)
    s = np.linspace(0.0, 1.0, int(np.ceil(duration / STEP)) + 1)
    turned = end - begin
    return PlannedMotion(
        s * duration,
        begin + turned * s**3 * (10 - 15 * s + 6 * s**2),
        turned * 30 * s**2 * (1 - s) ** 2 / duration,
        turned * 60 * s * (1 - s) * (1 - 2 * s) / duration**2,
    )


def _least(distance: Callable[[float], float], low: float, high: float) -> float:
    """The angle of the least distance: the best of a grid, refined by a parabola through it and its neighbours."""
    grid = np.linspace(low, high, int((high - low) / _GRID) + 2)
    values = np.array([distance(float(angle)) for angle in grid])
    k = int(np.clip(np.argmin(values), 1, len(grid) - 2))
    before, here, after = values[k - 1 : k + 2] ** 2
    bend = before - 2 * here + after
    shift = 0.5 * (before - after) / bend if bend > 0.0 else 0.0
    return float(np.clip(grid[k] + np.clip(shift, -1.0, 1.0) * (grid[1] - grid[0]), low, high))
