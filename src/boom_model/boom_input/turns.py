"""Whole turns that an angle's sensor adds: an inclinometer of 0 to 360 degrees shows -0.1 as 359.9."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

NEAR = 0.1
"""Of a turn: by how much a step may differ from whole ones to be no motion."""


def without_turns(values: Array, turn: float) -> tuple[Array, NDArray[np.intp]]:
    """An angle (n,) in the order of its samples, without whole ``turn``s, and the samples (k,) before which it jumps.

    Its median then lies within half a turn of zero, or where it was if that is more than one away: no sensor shows so much.
    """
    steps = np.diff(values) / turn
    whole = np.rint(steps)
    whole[np.abs(steps - whole) > NEAR] = 0.0
    even = values - turn * np.concatenate(([0.0], np.cumsum(whole)))
    away = round(float(np.median(even)) / turn)
    return even - (away if abs(away) <= 1 else 0) * turn, np.flatnonzero(whole) + 1
