"""Whole turns that an angle's sensor adds: an inclinometer of 0 to 360 degrees shows -0.1 as 359.9."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

TURN = 2.0 * math.pi
"""rad."""
NEAR = 0.02
"""Of a turn: by how much a step may differ from a whole one to be no motion, and the readings span more than one."""


def without_turns(values: Array, turn: float = TURN) -> tuple[Array, NDArray[np.intp]]:
    """An angle (n,) in the order of its samples, without steps of a whole ``turn``, and the samples (k,) before which it jumps.

    The readings of a sensor that wraps lie within a turn; what jumps further is damage. Where most samples are, they stay. values
    and turn have one unit.
    """
    steps = np.diff(values) / turn
    whole = np.rint(steps)
    whole[(np.abs(steps - whole) > NEAR) | (np.abs(whole) != 1.0)] = 0.0
    if not whole.any() or float(np.ptp(values)) > (1.0 + NEAR) * turn:
        return values, np.zeros(0, dtype=np.intp)
    turned = np.concatenate(([0.0], np.cumsum(whole)))
    levels, counts = np.unique(turned, return_counts=True)
    return values - turn * (turned - levels[np.argmax(counts)]), np.flatnonzero(whole) + 1


def turns_away(values: Array) -> int:
    """By how many whole turns an angle (n,) [rad] lies away from zero: one at most, as no sensor shows more."""
    away = round(float(np.median(values)) / TURN)
    return away if abs(away) <= 1 else 0
