"""Inputs of which the currents act late: dead time between command and pilot stage, none of what is measured at the crane."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from boom_model.structure import CURRENTS

Array = NDArray[np.float64]


def delayed(time: Array, inputs: Array, delay: float) -> tuple[Array, Array]:
    """Times (k,) [s] from which the inputs (k, NU) act, if the currents among them act ``delay`` [s] late."""
    count = len(CURRENTS)
    if delay == 0.0 or inputs.shape[1] == count:
        return time + delay, inputs
    both = np.unique(np.concatenate((time, time + delay)))
    late, prompt = (np.maximum(np.searchsorted(t, both, side="right") - 1, 0) for t in (time + delay, time))
    return both, np.ascontiguousarray(np.hstack((inputs[late, :count], inputs[prompt, count:])))
