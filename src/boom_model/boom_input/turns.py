"""Whole turns that an angle's sensor adds: an inclinometer of 0 to 360 degrees shows -0.1 as 359.9."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

NEAR = 0.1
"""Of a turn: by how much a step may differ from whole ones to be no motion."""


def without_turns(values: Array, turn: float) -> tuple[Array, NDArray[np.intp], int]:
    """An angle (n,) in the order of its samples, without whole ``turn``s, so that its median lies about zero.

    Returns the values, the samples (k,) before which it jumps, and how many turns away from zero it lay besides: one at most, as
    no sensor shows more; what lies further off is something else.
    """
    steps = np.diff(values) / turn
    whole = np.rint(steps)
    whole[np.abs(steps - whole) > NEAR] = 0.0
    even = values - turn * np.concatenate(([0.0], np.cumsum(whole)))
    away = round(float(np.median(even)) / turn)
    away = away if abs(away) <= 1 else 0
    return even - away * turn, np.flatnonzero(whole) + 1, away
