"""A point cloud of a log on the ground, as a sensor beside the cab sees it: one side of the log, noise, and the ground."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Points = NDArray[np.float64]
SENSOR = np.array([0.6, 0.8, 3.0])
"""m, in ``base_link``: beside the column, as high as a cab's roof."""


@dataclass(frozen=True)
class LogOnGround:
    """A straight log: centre (3,) [m], yaw of its axis [rad], length [m], radius [m]."""

    center: tuple[float, float, float]
    yaw: float = 1.4
    length: float = 3.0
    radius: float = 0.16


def seen(log: LogOnGround | None, rng: np.random.Generator, count: int = 3000, sigma: float = 0.01) -> Points:
    """Points (n, 3) [m] in ``base_link``: `count` on the ground and a third of it on the log, with noise `sigma` [m]."""
    ground = np.column_stack([rng.uniform(4.0, 9.0, count), rng.uniform(-3.0, 3.0, count), np.zeros(count)])
    if log is None:
        return ground + rng.normal(0.0, sigma, ground.shape)
    axis = np.array([np.cos(log.yaw), np.sin(log.yaw), 0.0])
    side = np.array([-axis[1], axis[0], 0.0])
    around = rng.uniform(0.0, 2.0 * np.pi, count)
    outward = np.cos(around)[:, None] * side + np.sin(around)[:, None] * np.array([0.0, 0.0, 1.0])
    along = rng.uniform(-0.5, 0.5, count) * log.length
    points = np.array(log.center) + along[:, None] * axis + log.radius * outward
    visible = np.einsum("ij,ij->i", outward, SENSOR - points) > 0.0
    off = ground[:, :2] - np.array(log.center)[:2]
    covered = (np.abs(off @ axis[:2]) < log.length / 2) & (np.abs(off @ side[:2]) < log.radius)
    cloud = np.vstack([ground[~covered], points[visible][: count // 3]])
    return cloud + rng.normal(0.0, sigma, cloud.shape)
