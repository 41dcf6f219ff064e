"""Fewer points for a chart, with all peaks kept."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

LOST = 3.0
"""Times the usual distance of samples, between which some were lost."""
POINTS = 4000
"""So many points a trace at most, breaks not counted."""


def decimate(time: Array, values: Array, points: int = POINTS, gap: float = 0.05) -> tuple[Array, Array]:
    """The smallest and the largest value of each of points/2 stretches, in the order in which they came.

    Args:
        time: (n,) [s], increasing.
        values: (n,); NaN where there is nothing to show.
        points: so many at most are left, where there are more.
        gap: [s]. Samples further apart are not joined by a line, nor three times as far as usual.

    Returns:
        time and values of the points, with one NaN wherever the line is to be broken.
    """
    known = np.flatnonzero(np.isfinite(values) & np.isfinite(time))
    if len(known) == 0:
        return np.empty(0), np.empty(0)
    chosen = known
    if len(known) > points:
        edges = np.linspace(0, len(known), max(1, points // 2) + 1).astype(int)
        smallest = [known[a + np.argmin(values[known[a:b]])] for a, b in pairwise(edges)]
        largest = [known[a + np.argmax(values[known[a:b]])] for a, b in pairwise(edges)]
        chosen = np.unique(np.concatenate((smallest, largest)))
    # A break lies between neighbouring samples, whether or not both are drawn: where a sample is missing, or known to
    # be wrong.
    apart = np.diff(time[known])
    lost = max(gap, LOST * float(np.median(apart))) if len(apart) else gap
    broken = np.concatenate(([0], np.cumsum((np.diff(known) > 1) | (apart > lost))))
    stretch = broken[np.searchsorted(known, chosen)]
    at = np.flatnonzero(np.diff(stretch)) + 1
    return np.insert(time[chosen], at, time[chosen][at]), np.insert(values[chosen], at, np.nan)
