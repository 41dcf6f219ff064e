"""Steps of a bounded search: the normal equations with those unknowns fixed that they would take out of their limits."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def inside(normal: Array, gradient: Array, lowest: NDArray[np.bool_], highest: NDArray[np.bool_]) -> Array:
    """The step that solves the normal equations with those unknowns fixed that it would take out of their limits."""
    free = np.ones(len(gradient), dtype=bool)
    step = np.zeros(len(gradient))
    for _ in range(len(gradient)):
        scale = np.sqrt(np.diag(normal)[free]) + 1e-12
        a = normal[np.ix_(free, free)] / np.outer(scale, scale) + 1e-9 * np.eye(int(free.sum()))
        step[:] = 0.0
        step[free] = -np.linalg.solve(a, gradient[free] / scale) / scale
        leaving = free & ((lowest & (step < 0.0)) | (highest & (step > 0.0)))
        if not leaving.any():
            break
        free &= ~leaving
    return step
