"""Filters of chapter 5: the moving average over a PWM period, smoothed derivatives, stretches of samples."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from scipy.signal import savgol_filter

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

POLYNOMIAL_ORDER = 3
"""Of the Savitzky-Golay filter (ch. 5.1)."""


def moving_average(values: Array, window: float) -> Array:
    """Mean over a window centred at each sample.

    values (n,); window [samples] need not be whole: samples count as steps that last one period each, and the window
    cuts the outer two. At the ends the window is truncated.
    """
    n = len(values)
    total = np.concatenate(([0.0], np.cumsum(values)))
    edge = np.arange(n + 1, dtype=float)
    centre = np.arange(n) + 0.5
    low, high = np.maximum(centre - window / 2, 0.0), np.minimum(centre + window / 2, float(n))
    return np.asarray((np.interp(high, edge, total) - np.interp(low, edge, total)) / (high - low))


def smoothed(values: Array, period: float, window: float, derivative: int = 0) -> Array:
    """Savitzky-Golay filter of order 3: the values, or their ``derivative``-th derivative [unit / s^derivative].

    values (n,) at a period [s]; window [s]. Fewer samples than the window give NaN.
    """
    length = window_samples(period, window)
    if len(values) < length:
        return np.full(len(values), np.nan)
    return np.asarray(savgol_filter(values, length, POLYNOMIAL_ORDER, deriv=derivative, delta=period), float)


def window_samples(period: float, window: float) -> int:
    """Odd number of samples, at least 5, that a Savitzky-Golay window [s] has."""
    return max(5, 2 * math.floor(window / period / 2) + 1)


def stretches(flags: Flags) -> list[tuple[int, int]]:
    """(first, one after the last) of every run of true flags."""
    padded = np.concatenate(([False], flags, [False])).astype(np.int8)
    edges = np.flatnonzero(np.diff(padded))
    return list(zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True))


def pwm_period(voltage: Array) -> float | None:
    """Period of a PWM voltage [samples], from its rising edges; None if there are fewer than three.

    Edges fall between samples: the mean over all of them has the precision of one sample over the whole trace.
    """
    high = voltage > 0.5 * (float(np.min(voltage)) + float(np.max(voltage)))
    edges = np.flatnonzero(high[1:] & ~high[:-1])
    if len(edges) < 3:
        return None
    steps = np.diff(edges)
    usual = float(np.median(steps))
    kept = steps[np.abs(steps - usual) <= max(2.0, 0.05 * usual)]  # a full or an empty period has no edge
    return float(np.mean(kept)) if len(kept) else None
