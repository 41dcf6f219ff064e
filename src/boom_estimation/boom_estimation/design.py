"""Which parts of recordings tell most of numbers together: a D-optimal choice (Fedorov 1972).

Part k tells A_k = sum D'D of numbers z that are standard normal beforehand. All that is known of them after some parts is
log det(I + sum A_k): half of it, over the number of them, is by how much their standard deviations have shrunk on the mean [ln].
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from math import log1p

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

SHARPER = 0.15
"""By which a further part of long recordings must sharpen the numbers, on the mean, to be worth its time."""


def knowledge(information: Array) -> float:
    """Log det(I + A) of an information A (m, m)."""
    return float(np.linalg.slogdet(np.eye(len(information)) + information)[1])


def sharpens(before: float, after: float, count: int) -> bool:
    """Whether ``count`` numbers are sharper by ``SHARPER`` on the mean; before, after: their :func:`knowledge`."""
    return after - before >= 2.0 * count * log1p(SHARPER)


def most_telling(told: Sequence[Array]) -> Iterator[tuple[int, float]]:
    """All parts by index, the next always the one that adds most to what is known already, and the knowledge with it.

    told: information (m, m) of each part.
    """
    left = list(range(len(told)))
    known = np.zeros_like(told[0]) if left else np.zeros((0, 0))
    while left:
        reached = {k: knowledge(known + told[k]) for k in left}
        best = max(left, key=lambda k: reached[k])
        known = known + told[best]
        left.remove(best)
        yield best, reached[best]
