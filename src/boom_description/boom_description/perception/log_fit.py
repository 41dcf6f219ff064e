"""Finds a log in a point cloud: what stands out from the ground, its axis, and the circle of its cross-section.

The ground is the height at which most points lie. The axis is the first principal direction of what is above it. Across the axis
the points lie on a circle, ``|p|^2 = 2 c.p + (r^2 - |c|^2)``, which is linear in centre c and ``r^2 - |c|^2`` (Kasa, 1976).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Points = NDArray[np.float64]
LEAST_POINTS = 100
FARTHEST = 100.0
"""m. No crane reaches as far: what is beyond is a fault of the sensor, as is what is no number."""
CLEARANCE = 0.06
"""m. Points lower above the ground belong to it: grass, noise."""
_THICK = (0.03, 0.6)
_TRIMMED = 3.0


class PerceptionError(Exception):
    """No motion can be planned from what is seen; one line that says why."""

    exit_status = 2


@dataclass(frozen=True)
class SeenLog:
    """Centre (3,) [m], unit axis (3,), length [m] and radius [m], in the frame of the cloud."""

    center: Points
    axis: Points
    length: float
    radius: float

    @property
    def volume(self) -> float:
        """m^3."""
        return float(np.pi * self.radius**2 * self.length)


def find_log(cloud: Points) -> SeenLog:
    """The log in points (n, 3) [m], z up.

    Raises:
        PerceptionError: nothing stands out from the ground, or it is no log.
    """
    cloud = cloud[(np.abs(cloud) < FARTHEST).all(axis=1)]
    if len(cloud) < LEAST_POINTS:
        raise PerceptionError(f"the cloud has {len(cloud)} points within {FARTHEST:.0f} m: {LEAST_POINTS} are needed")
    above = cloud[cloud[:, 2] > _ground(cloud[:, 2]) + CLEARANCE]
    if len(above) < LEAST_POINTS:
        raise PerceptionError(f"no log in the cloud: {len(above)} points stand out from the ground")
    for _ in range(2):  # once with all, once without what lies far from the first log
        middle = above.mean(axis=0)
        axis = np.linalg.svd(above - middle, full_matrices=False)[2][0]
        center, radius, off = _circle(above, axis)
        above = above[off <= _TRIMMED * max(float(off.std()), 1e-3)]
        if len(above) < LEAST_POINTS:
            raise PerceptionError("no log in the cloud: what stands out from the ground is not round")
    along = (above - center) @ axis
    low, high = np.percentile(along, [1.0, 99.0])
    log = SeenLog(center + axis * (low + high) / 2, axis, float(high - low), radius)
    if not _THICK[0] <= radius <= _THICK[1] or log.length < 4 * radius:
        raise PerceptionError(
            f"no log in the cloud: what stands out is {log.length:.2f} m long and {2 * radius:.2f} m thick"
        )
    return log


def _ground(heights: Points) -> float:
    """The height [m] at which most points lie, to a centimetre."""
    edges = np.arange(heights.min(), heights.max() + 0.04, 0.02)
    counts, edges = np.histogram(heights, edges)
    k = int(np.argmax(counts))
    return float(edges[k] + edges[k + 1]) / 2


def _circle(points: Points, axis: Points) -> tuple[Points, float, Points]:
    """Centre (3,) and radius of the circle across the axis, and how far each point lies from it [m]."""
    side = np.cross(axis, [0.0, 0.0, 1.0])
    length = float(np.linalg.norm(side))
    if length < 0.5:
        raise PerceptionError("no log in the cloud: what stands out is upright")
    side /= length
    up = np.cross(side, axis)
    middle = points.mean(axis=0)
    flat = np.column_stack([(points - middle) @ side, (points - middle) @ up])
    unknown = np.linalg.lstsq(np.column_stack([2 * flat, np.ones(len(flat))]), (flat**2).sum(axis=1), rcond=None)[0]
    radius = float(np.sqrt(max(unknown[2] + unknown[0] ** 2 + unknown[1] ** 2, 0.0)))
    off = np.abs(np.hypot(flat[:, 0] - unknown[0], flat[:, 1] - unknown[1]) - radius)
    return middle + unknown[0] * side + unknown[1] * up, radius, off
