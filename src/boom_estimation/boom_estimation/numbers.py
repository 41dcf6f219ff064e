"""The numbers that a fit may move, each with its prior.

A number is moved in an inner coordinate c, in which its prior is normal or flat: a factor in its logarithm, a number that a
machine file gives in standard deviations from there.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import exp, inf, log, pi

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Number:
    """A number of a model.

    Attributes:
        name: as the model knows it.
        value: inner coordinate -> number in its unit.
        low, high: ends of the inner coordinate.
        sigma: standard deviation of the inner coordinate's normal prior about ``centre``; infinite for a flat one on [low, high].
        step: of the inner coordinate, for differences.
        own: name of the experiment whose own it is; "" for a number that all share.
    """

    name: str
    value: Callable[[float], float]
    low: float = -inf
    high: float = inf
    sigma: float = 1.0
    centre: float = 0.0
    step: float = 0.05
    own: str = ""

    def inner(self, value: float) -> float:
        """Inner coordinate of a value, by what ``value`` is."""
        return log(max(value, 1e-300)) if self.value is exp else value

    @property
    def log_height(self) -> float:
        """Logarithm of the prior's density where it is highest [nats]."""
        return -log(self.high - self.low) if self.sigma == inf else -log(self.sigma) - 0.5 * log(2.0 * pi)


@dataclass(frozen=True)
class Priors:
    """The priors of several numbers as arrays (m,) in their order; ``width``: standard deviation, or a quarter of a flat one."""

    low: Array
    high: Array
    precision: Array
    centre: Array
    log_height: float
    width: Array

    @classmethod
    def of(cls, numbers: Sequence[Number]) -> Priors:
        """Those of these numbers."""
        sigma = np.array([n.sigma for n in numbers])
        return cls(
            np.array([n.low for n in numbers]),
            np.array([n.high for n in numbers]),
            np.where(np.isinf(sigma), 0.0, 1.0 / np.square(sigma)),
            np.array([n.centre for n in numbers]),
            sum(n.log_height for n in numbers),
            np.array([0.25 * (n.high - n.low) if n.sigma == inf else n.sigma for n in numbers]),
        )

    def density(self, c: Array) -> float:
        """Logarithm of their density [nats] at inner coordinates (m,)."""
        return self.log_height - 0.5 * float(np.sum(self.precision * (c - self.centre) ** 2))

    def slope(self, c: Array) -> Array:
        """Its derivative (m,)."""
        return np.asarray(-self.precision * (c - self.centre))


@dataclass(frozen=True)
class SizePriors:
    """Priors of the discrepancies' sizes s_k (q,), in v = log s.

    Where ``mean`` is given s is exponential, p(v) = (s / mean) exp(-s / mean); where ``median`` is, v is normal about its logarithm
    with ``spread``; where neither is (nan), v is flat on ``RANGE``. most: largest v, ``RANGE``'s where it is not given.
    """

    mean: Array
    median: Array
    spread: Array
    most: Array | None = None

    @property
    def limits(self) -> tuple[Array, Array]:
        """Least and largest v (q,)."""
        high = np.full(len(self.mean), RANGE[1])
        return np.full(len(high), RANGE[0]), high if self.most is None else np.minimum(high, self.most)

    def density(self, v: Array) -> float:
        """Logarithm of the density [nats] of v (q,)."""
        s, unknown = np.exp(v), np.isfinite(self.median)
        exponential = np.isfinite(self.mean)
        total = np.where(exponential, v - np.log(np.where(exponential, self.mean, 1.0)) - s / self.mean, 0.0)
        away = (v - np.log(np.where(unknown, self.median, 1.0))) / self.spread
        normal = -0.5 * away**2 - np.log(self.spread) - 0.5 * log(2.0 * pi)
        flat = ~exponential & ~unknown
        return float(np.sum(np.where(unknown, normal, total)) - np.sum(flat) * log(RANGE[1] - RANGE[0]))

    def slope(self, v: Array) -> Array:
        """Its derivative (q,)."""
        unknown = np.isfinite(self.median)
        away = (v - np.log(np.where(unknown, self.median, 1.0))) / self.spread**2
        exponential = np.where(np.isfinite(self.mean), 1.0 - np.exp(v) / self.mean, 0.0)
        return np.asarray(np.where(unknown, -away, exponential))

    def curvature(self, v: Array) -> Array:
        """Minus its second derivative (q,), not negative."""
        unknown = np.isfinite(self.median)
        exponential = np.where(np.isfinite(self.mean), np.exp(v) / self.mean, 0.0)
        return np.asarray(np.where(unknown, 1.0 / self.spread**2, exponential))


RANGE = (log(1e-6), log(1e2))
"""Of v = log s, s over the scale of its place."""
