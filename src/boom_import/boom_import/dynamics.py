"""What columns are together: statistics of pairs that a boom's physics fixes, each with the distribution that it has over cranes.

With v the angular rate in the direction in which the boom is lifted, p_h and p_b the pressures and i_e, i_r the currents:

- rate:     v is the derivative of the angle, so their ratio is one and their correlation, too;
- currents: i_e - i_r precedes v and is correlated with it;
- pressure: p_h - p_b is larger while lifting than while lowering (friction, and the side that is fed from the pump);
- gravity:  at rest p_h - 0.6 p_b carries the boom, so it is positive;
- lowering: p_b rises with i_r.

Each statistic counts as the ratio of its likelihood over cranes (with and without a load-holding valve, folded and stretched) to
that over unrelated columns; floored, because a crane may be broken.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from boom_import.source import Column, Floats

PERIOD = 0.02
_LONGEST = 60_000  # samples: 20 minutes tell as much as a day
_SMOOTH = 0.2
_LAGS = np.arange(0, 0.6, 0.06)


@dataclass(frozen=True)
class Grid:
    """Times (n,) [s] at which all columns are compared, and the stamp [ns] of their zero."""

    time: Floats
    start_ns: int

    def of(self, column: Column, values: Floats) -> Floats:
        """`values` of the column at the times of the grid, held to its ends."""
        own = (column.stamps_ns - self.start_ns) / 1e9
        order = np.argsort(own, kind="stable") if (np.diff(own) < 0).any() else slice(None)
        return np.asarray(np.interp(self.time, own[order], values[order]))


def grid(columns: list[Column]) -> Grid | None:
    """The time that all have in common; None where that is less than a second."""
    start = max(int(column.stamps_ns.min()) for column in columns)
    end = min(int(column.stamps_ns.max()) for column in columns)
    count = int((end - start) / 1e9 / PERIOD)
    if count < 1.0 / PERIOD:
        return None
    return Grid(np.asarray(np.arange(min(count, _LONGEST)) * PERIOD, np.float64), start)


def smooth(values: Floats, width: float = _SMOOTH) -> Floats:
    """Moving average over `width` [s]."""
    n = max(1, round(width / PERIOD)) | 1
    padded = np.pad(values, n // 2, mode="edge")
    total = np.cumsum(np.insert(padded, 0, 0.0))
    return np.asarray((total[n:] - total[:-n]) / n)


def derivative(angle: Floats) -> Floats:
    """Rate of a quantised angle [unit/s], smoothed."""
    return np.asarray(np.gradient(smooth(angle), PERIOD))


def rate_fit(angle: Floats, rate: Floats) -> tuple[float, float]:
    """Log-likelihood that `rate` is the derivative of `angle`, and the sign of one in the other."""
    a, b = smooth(derivative(angle)), smooth(smooth(rate))
    r = _correlation(a, b)
    if not r:
        return _RATE_ALIKE.floor, 1.0
    ratio = abs(float(np.std(b) / np.std(a)))
    return _RATE_ALIKE.ratio(abs(r)) + _RATE_RATIO.ratio(math.log(ratio)), math.copysign(1.0, r)


def current_fit(lift_rate: Floats, extend: Floats, retract: Floats) -> float:
    """Correlation of i_e - i_r with the rate that follows it: the largest over the lags of 0 to 0.5 s."""
    drive = _scaled(extend) - _scaled(retract)
    best = 0.0
    for lag in _LAGS:
        n = round(lag / PERIOD)
        r = _correlation(drive[: len(drive) - n], lift_rate[n:])
        best = r if abs(r) > abs(best) else best
    return best


def pressure_difference(lift_rate: Floats, hose: Floats, rod: Floats) -> float:
    """How much larger p_h - p_b is while lifting than while lowering, in its standard deviations; NaN without motion."""
    threshold = 0.2 * float(np.quantile(np.abs(lift_rate), 0.98))
    up, down = lift_rate > threshold, lift_rate < -threshold
    difference = hose - rod
    spread = float(np.std(difference))
    if up.sum() < 10 or down.sum() < 10 or spread <= 0.0:
        return math.nan
    return float((difference[up].mean() - difference[down].mean()) / spread)


def gravity(lift_rate: Floats, hose: Floats, rod: Floats) -> float:
    """What p_h - 0.6 p_b is at rest, as a part of p_h + p_b."""
    threshold = 0.1 * float(np.quantile(np.abs(lift_rate), 0.98))
    rest = np.abs(lift_rate) <= threshold
    if rest.sum() < 10:
        rest = np.ones(len(hose), bool)
    total = float(np.mean(np.abs(hose[rest]) + np.abs(rod[rest])))
    return float(np.mean(hose[rest] - 0.6 * rod[rest])) / total if total > 0.0 else 0.0


def lowering(rod: Floats, retract: Floats) -> float:
    """Correlation of p_b with i_r."""
    return _correlation(rod, smooth(_scaled(retract)))


@dataclass(frozen=True)
class Expected:
    """Distribution of a statistic over cranes against that over columns that have nothing to do with each other.

    Attributes:
        mean, spread: of the Gaussian over cranes.
        width: range over which the statistic of unrelated columns is spread evenly.
        floor: least log-likelihood ratio.
    """

    mean: float
    spread: float
    width: float
    floor: float = -8.0

    def ratio(self, value: float) -> float:
        """Log-likelihood ratio of a value; zero where it is not known."""
        if math.isnan(value):
            return 0.0
        density = -0.5 * ((value - self.mean) / self.spread) ** 2 - math.log(self.spread * math.sqrt(2.0 * math.pi))
        return max(density + math.log(self.width), self.floor)


CURRENTS = Expected(0.85, 0.25, 2.0, -12.0)
DIFFERENCE = Expected(1.2, 0.6, 4.0)
GRAVITY = Expected(0.4, 0.3, 1.6)
LOWERING = Expected(0.6, 0.35, 2.0)
_RATE_ALIKE, _RATE_RATIO = Expected(1.0, 0.1, 1.0, -8.0), Expected(0.0, 0.15, 6.0, -8.0)


def _scaled(values: Floats) -> Floats:
    top = float(np.quantile(np.abs(values), 0.99))
    return values / top if top > 0.0 else values


def _correlation(a: Floats, b: Floats) -> float:
    a, b = a - a.mean(), b - b.mean()
    norm = float(np.sqrt((a @ a) * (b @ b)))
    return float(a @ b) / norm if norm > 0.0 else 0.0
