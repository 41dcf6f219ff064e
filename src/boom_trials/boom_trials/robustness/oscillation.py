"""What a run shows of oscillations: when one began, when it was recognised, and what became of it.

y is the speed of the piston against its reference, without what is slower than the watch looks at. An oscillation begins when y
first passes ``LEAST`` and goes on to do so at least once in every ``LONGEST``, the longest half-wave.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import exp, nan

import numpy as np
from numpy.typing import NDArray

from boom_controller.observers.oscillation_watch import LONGEST, SLOWEST

Array = NDArray[np.float64]

LEAST = 0.01
"""m/s."""
AT_ONCE, SAFE = 1.0, 2.0
"""s from the beginning until it has to be recognised, and to be smaller than before."""
PRESENT = 4 * LONGEST
"""s. What lasts less has rung down and was none."""


@dataclass(frozen=True)
class Oscillation:
    """Of one run; times [s] since the oscillation began, NaN without one.

    Attributes:
        recognised: until the law said so; infinite if it never did.
        calmed: whether from ``SAFE`` on y is smaller than it was before, or the run was stopped.
    """

    recognised: float = nan
    calmed: bool = True


def oscillation_of(error: Array, period: float, noted: float | None, stopped: bool) -> Oscillation:
    """Of a run with these piston errors (n,) [m], one a ``period`` [s]; ``noted``: when the law recognised one [s]."""
    y = _high_passed(np.gradient(error, period), period)
    large = np.flatnonzero(np.abs(y) > LEAST)
    if not len(large):
        return Oscillation()
    for group in np.split(large, np.flatnonzero(np.diff(large) > LONGEST / period) + 1):
        begin, end = group[0] * period, group[-1] * period
        heard = noted is not None and begin <= noted <= end + LONGEST
        if heard or end - begin > PRESENT:
            late = round((begin + SAFE) / period)
            calmed = stopped or late >= len(y) or np.abs(y[late:]).max() < np.abs(y[group[0] : late]).max()
            return Oscillation(noted - begin if heard and noted is not None else np.inf, bool(calmed))
    return Oscillation()


def _high_passed(values: Array, period: float) -> Array:
    keep, y = exp(-SLOWEST * period), np.zeros_like(values)
    for k in range(1, len(values)):
        y[k] = keep * (y[k - 1] + values[k] - values[k - 1])
    return y
