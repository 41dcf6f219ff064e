"""The way up from a size that does nothing to the detectable one: which size is looked at next."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

COARSE, FINE, NEAR = 3.0, 1.7, 1.25
"""Factors between sizes that are tried, far from and near the detectable one; d that is near enough for a straight line."""
STRAIGHT, FURTHEST, BEYOND = 0.1, 10.0, 1.05
"""Share by which d may differ from being proportional to the size for the next one to be where d would be ``BEYOND`` times the
detectable one, and the largest factor to there."""
CLOSE = 1.02
"""Factor between a size that is imitated and one that is not, from which on the first counts."""
LOOKS = 3
"""Times that what imitates an effect is looked for more thoroughly where it seems to be seen."""


@dataclass
class Climb:
    """The way up to the detectable size.

    Attributes:
        at: size that is looked at next. factor: to the one after it.
        least: largest size so far that is imitated, with d and z of ``NUMBERS`` there.
        overshot: whether a larger size was not. bent: sensitivities of the bent crane. looks: thorough ones that are left.
    """

    at: float
    least: float
    d: float = 0.0
    z: Array | None = None
    factor: float = COARSE
    overshot: bool = False
    bent: Array | None = None
    looks: int = LOOKS

    @property
    def ratio(self) -> float:
        """Of the next size to the largest one that is imitated."""
        return self.at / self.least

    def go_up(self, d: float, z: Array, detectable: float, largest: float) -> None:
        """From ``at``, which is imitated with d, to a larger size."""
        at = self.at
        straight = not self.overshot and abs(d * self.least - self.d * at) < STRAIGHT * self.d * at
        self.least, self.d, self.z = at, d, z
        if d > 0.2 * detectable:
            self.factor = min(self.factor, FINE)
        self.at = min(at * (min(BEYOND * detectable / d, FURTHEST) if straight else self.factor), largest)

    def go_back(self, d: float, detectable: float) -> None:
        """From ``at``, which shows with d, to a size between it and the largest that is imitated."""
        self.overshot = True
        share = (detectable - self.d) / (min(d, 1e3 * detectable) - self.d)
        self.factor = 1.0 + (self.ratio - 1.0) * float(np.clip(share, 0.25, 0.6))
        self.at = self.least * self.factor
