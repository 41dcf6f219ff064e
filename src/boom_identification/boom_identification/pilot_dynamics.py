"""Linear part G of the pilot valves: ARX by least squares (5.3)-(5.5), output error beside it, Tustin and state space (5.7).

    A(d^-1) nu_k = B(d^-1) i_{k-d} + e_k,   nu_k = h^-1(p_k)                                   (3.26), (5.6)

ARX minimises the one-step error. If the noise is on the output and not in the equation, the regressor carries the noise
too, which biases the pole. The output-error estimate minimises the error of the simulated output, which
depends on the input only and has no such bias. Both use signals averaged over the PWM period.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares
from scipy.signal import lfilter

from boom_identification import estimate

Array = NDArray[np.float64]
Pair = tuple[Array, Array]
"""Input i (n,) [A] and output nu (n,) [A] of one stretch."""

GROUP = 0.2
"""s. Residuals this far apart count as independent: four time constants of the valve, twenty periods of the average."""


@dataclass(frozen=True)
class Arx:
    """A of order n and B of order m with delay d [samples]: (3.26), (3.28). ``one_step``: rms of e [A]."""

    a: Array
    b: Array
    delay: int
    one_step: float

    @property
    def stable(self) -> bool:
        """All poles inside the unit circle."""
        return bool((np.abs(np.roots(np.concatenate(([1.0], self.a)))) < 1.0).all())

    def simulate(self, current: Array, start: float) -> Array:
        """nu (n,) for the current (n,) [A], stationary at ``start`` before it."""
        return _filtered(np.concatenate((np.zeros(self.delay), self.b)), self.a, current, start)


@dataclass(frozen=True)
class FirstOrder:
    """G of order one in all three forms of (5.7).

    Attributes:
        discrete: (a_1^d, b_0^d, b_1^d) of (3.30). period: [s].
        covariance: (3, 3) of the discrete parameters.
        residual: rms of the output error [A] (of the one-step error for ARX).
    """

    discrete: tuple[float, float, float]
    period: float
    covariance: Array
    residual: float

    @property
    def continuous(self) -> tuple[float, float, float]:
        """(a_1^c [1/s], b_0^c [-], b_1^c [1/s]) of (3.32), by (3.31)."""
        a, b, c = tustin(np.array(self.discrete), self.period)
        return float(a), float(b), float(c)

    @property
    def state_space(self) -> tuple[float, float, float]:
        """(a_1^s [1/s], b_0^s [1/s], b_1^s [-]) of (3.33)."""
        a, b, c = state_space(np.array(self.discrete), self.period)
        return float(a), float(b), float(c)

    @property
    def held(self) -> tuple[float, float, float]:
        """``state_space`` if the current were held from sample to sample, instead of linear between samples as in (3.31)."""
        x = np.array(self.discrete)
        a, b, c = held_state_space(x, self.period)
        return float(a), float(b), float(c)

    def intervals(self) -> tuple[tuple[float, float], ...]:
        """90 % intervals of ``state_space``, wide enough for both assumptions about the current between samples."""
        x = np.array(self.discrete)
        result = []
        for k, value in enumerate(self.state_space):
            slope = estimate.gradient(partial(_entry, self.period, k), x)
            low, high = estimate.interval(value, float(slope @ self.covariance @ slope))
            other = self.held[k] - value
            result.append((low + min(other, 0.0), high + max(other, 0.0)))
        return tuple(result)

    @property
    def gain(self) -> float:
        """G(0), which is one in the Wiener model."""
        a, b0, b1 = self.discrete
        return (b0 + b1) / (1.0 + a)

    def simulate(self, current: Array, start: float) -> Array:
        """nu (n,) for the current (n,) [A], stationary at ``start`` before it."""
        a, b0, b1 = self.discrete
        return _filtered(np.array([b0, b1]), np.array([a]), current, start)


def tustin(discrete: Array, period: float) -> Array:
    """(a^c, b_0^c, b_1^c) of (b_0 s + b_1) / (s + a) from (a^d, b_0^d, b_1^d): z = (1 + s T/2) / (1 - s T/2), (3.31)."""
    a, b0, b1 = discrete
    leading = (1.0 - a) * period / 2
    return np.array([(1.0 + a) / leading, (b0 - b1) * period / 2 / leading, (b0 + b1) / leading])


def state_space(discrete: Array, period: float) -> Array:
    """(a_1^s, b_0^s, b_1^s) of (3.33): -a^c, b_1^c - a^c b_0^c, b_0^c."""
    a, b0, b1 = tustin(discrete, period)
    return np.array([-a, b1 - a * b0, b0])


def held_state_space(discrete: Array, period: float) -> Array:
    """(a_1^s, b_0^s, b_1^s) of (3.33) whose exact samples with held input are ``discrete``.

    exp(a_1^s T) = -a^d, b_1^s = b_0^d, b_0^s (exp(a_1^s T) - 1) / a_1^s = b_1^d - a^d b_0^d; NaN if no decay has such a
    pole (a^d >= 0).
    """
    a, b0, b1 = discrete
    pole = np.log(-a) / period if a < 0.0 else np.nan
    return np.array([pole, (b1 - a * b0) * pole / (-a - 1.0), b0])


def _entry(period: float, k: int, discrete: Array) -> float:
    return float(state_space(discrete, period)[k])


def arx(pairs: Sequence[Pair], n: int, m: int, delay: int) -> Arx:
    """ARX by least squares (5.4) over stretches; n, m orders of A and B, delay [samples].

    Raises:
        ValueError: stretches too short, or regressors that depend on each other.
    """
    design, target = _regressors(pairs, n, m, delay)
    if len(target) < 10 * (n + m + 1):
        raise ValueError("the trace is too short")
    x = np.asarray(np.linalg.lstsq(design, target, rcond=None)[0], np.float64)
    residual = target - design @ x
    return Arx(x[:n], x[n:], delay, float(np.sqrt(np.mean(residual**2))))


def first_order_arx(pairs: Sequence[Pair], period: float) -> FirstOrder:
    """ARX with n = 1, m = 1, d = 0 (3.29), as in the thesis.

    Raises:
        ValueError: too short, no excitation.
    """
    design, target = _regressors(pairs, 1, 1, 0)
    groups = _groups([len(y) - 1 for _, y in pairs], period)
    x, covariance = estimate.least_squares(design, target, groups)
    residual = float(np.sqrt(np.mean((target - design @ x) ** 2)))
    return FirstOrder((float(x[0]), float(x[1]), float(x[2])), period, covariance, residual)


def output_error(pairs: Sequence[Pair], period: float, start: FirstOrder) -> FirstOrder:
    """Minimises |nu - G i| of the simulated output; the initial state of each stretch is estimated too.

    Raises:
        ValueError: no excitation, or no stable answer.
    """
    lengths = [len(y) for _, y in pairs]

    def simulated(x: Array) -> Array:
        a, b0, b1 = x[:3]
        parts = [lfilter([b0, b1], [1.0, a], i, zi=[z])[0] for (i, _), z in zip(pairs, x[3:], strict=True)]
        return np.concatenate(parts)

    target = np.concatenate([y for _, y in pairs])
    a, b0, b1 = start.discrete
    if not -1.0 < a < 0.0:
        a, b0, b1 = -np.exp(-20.0 * period), 0.0, 1.0 - np.exp(-20.0 * period)
    states = [float(y[0] - b0 * i[0]) for i, y in pairs]
    scale = np.array([1.0 + a, 0.01, 0.01, *[0.1] * len(states)])

    def residuals(x: Array) -> Array:
        return np.asarray(simulated(x) - target, np.float64)

    fit = least_squares(residuals, np.array([a, b0, b1, *states]), x_scale=scale)
    if not -1.0 < fit.x[0] < 1.0:
        raise ValueError("the output-error fit found no stable pole")
    covariance = estimate.cluster_covariance(np.asarray(fit.jac), np.asarray(fit.fun), _groups(lengths, period))
    residual = float(np.sqrt(np.mean(fit.fun**2)))
    return FirstOrder((float(fit.x[0]), float(fit.x[1]), float(fit.x[2])), period, covariance[:3, :3], residual)


def _regressors(pairs: Sequence[Pair], n: int, m: int, delay: int) -> tuple[Array, Array]:
    """S and y of (5.5), stacked over the stretches."""
    first = max(n, m + delay)
    rows, targets = [], []
    for u, y in pairs:
        if len(y) <= first:
            continue
        past = [-y[first - k : len(y) - k] for k in range(1, n + 1)]
        past += [u[first - delay - k : len(u) - delay - k] for k in range(m + 1)]
        rows.append(np.column_stack(past))
        targets.append(y[first:])
    if not rows:
        raise ValueError("the trace is too short")
    return np.concatenate(rows), np.concatenate(targets)


def _groups(lengths: Sequence[int], period: float) -> NDArray[np.int64]:
    size = max(1, round(GROUP / period))
    parts, first = [], 0
    for length in lengths:
        own = np.arange(length) // size + first
        first = int(own[-1]) + 1 if length else first
        parts.append(own)
    return np.concatenate(parts).astype(np.int64)


def _filtered(b: Array, a: Array, current: Array, start: float) -> Array:
    """B / A applied to the current (n,), with a past in which the input was constant and the output ``start``."""
    denominator = np.concatenate(([1.0], a))
    gain = float(np.sum(b) / np.sum(denominator))
    level = start / gain if abs(gain) > 1e-9 else 0.0
    # deviations from that past: they begin at zero
    return start + np.asarray(lfilter(b, denominator, current - level), float)
