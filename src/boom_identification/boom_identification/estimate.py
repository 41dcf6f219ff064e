"""Result of an identification for one number: its value and interval, or why it is not determined."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

NORMAL_90 = 1.6449
"""Half width of a 90 % interval in standard errors."""
METHOD_FACTOR = 2.3
"""Factor that widens standard errors. Averages, filters and the steady state are approximations whose errors do not appear as
scatter: over five recordings of the simulation, each taken by itself, errors were 2.3 times (rms of 34 numbers) as large as the
scatter between stretches indicates; over seven campaigns of several recordings 1.5 times."""


@dataclass(frozen=True)
class Identified:
    """One parameter that the recordings determine; the others are `NotDetermined`.

    Attributes:
        key: of the machine file, joined with dots (``.0 .1 .2`` for the components of a vector).
        value: [unit].
        unit: as the machine file states it.
        interval_90: (low, high) [unit].
        how: short phrase: equation and kind of data.
    """

    key: str
    value: float
    unit: str
    interval_90: tuple[float, float]
    how: str

    def document(self) -> dict[str, Any]:
        """As in ``identify --json``."""
        return {
            "value": self.value,
            "unit": self.unit,
            "interval_90": list(self.interval_90),
            "determined": True,
            "how": self.how,
        }


@dataclass(frozen=True)
class NotDetermined:
    """A parameter or group of parameters that the recordings do not determine, and why.

    excitation: whether other motions would determine it; False if no recording of this kind can.
    """

    parameter: str
    why: str
    excitation: bool = True

    def document(self) -> dict[str, str]:
        """As in ``identify --json``."""
        return {"parameter": self.parameter, "why": self.why}


def least_squares(design: Array, target: Array, groups: NDArray[np.int64]) -> tuple[Array, Array]:
    """Solution (m,) of min |target - design x| and its covariance (m, m); see `cluster_covariance`.

    design (n, m), target (n,), groups (n,).

    Raises:
        ValueError: fewer than two groups, or columns that depend on each other.
    """
    if len(target) < design.shape[1]:
        raise ValueError("fewer samples than unknowns")
    x = np.asarray(np.linalg.lstsq(design, target, rcond=None)[0], np.float64)
    return x, cluster_covariance(design, target - design @ x, groups)


def cluster_covariance(jacobian: Array, residual: Array, groups: NDArray[np.int64]) -> Array:
    """Covariance (m, m) of a least-squares estimate whose residuals may be correlated within a group.

    jacobian (n, m), residual (n,), groups (n,): errors of one group (a stretch of a recording) may be correlated; groups
    count as independent (cluster-robust sandwich estimate, Liang and Zeger 1986, small-sample factor G / (G - 1)). A few
    groups estimate their spread badly: the covariance is widened so that a normal 90 % interval is as wide as Student's with
    G - 1 degrees of freedom, and by `METHOD_FACTOR`.

    Raises:
        ValueError: fewer than two groups, or columns that depend on each other.
    """
    scale = np.linalg.norm(jacobian, axis=0)
    if (scale == 0.0).any():
        raise ValueError("nothing depends on one of the unknowns")
    scaled = jacobian / scale
    normal = scaled.T @ scaled
    if np.linalg.cond(normal) > 1e12:
        raise ValueError("the data do not separate the unknowns")
    _, index = np.unique(groups, return_inverse=True)
    count = int(index.max()) + 1
    if count < 2:
        raise ValueError("one stretch of data only, so its error is unknown")
    scores = np.zeros((count, jacobian.shape[1]))
    np.add.at(scores, index, scaled * residual[:, None])
    inverse = np.linalg.inv(normal)
    from scipy.special import stdtrit  # takes a quarter of a second to load

    student = METHOD_FACTOR * float(stdtrit(count - 1, 0.95)) / NORMAL_90
    covariance = inverse @ (scores.T @ scores) @ inverse * (count / (count - 1) * student**2)
    return np.asarray(covariance / np.outer(scale, scale))


def interval(value: float, variance: float) -> tuple[float, float]:
    """90 % interval of a normally distributed value."""
    half = NORMAL_90 * math.sqrt(max(variance, 0.0))
    return value - half, value + half


def too_wide(found: Identified, tolerance: float) -> str:
    """Why an estimate adds nothing to the prior (relative ``tolerance``); empty if it does."""
    half = max(abs(bound - found.value) for bound in found.interval_90)
    if half <= tolerance * abs(found.value):
        return ""
    share = half / max(abs(found.value), 1e-300)
    return f"known to +-{100 * share:.0f} % only (90 %), +-{100 * tolerance:.0f} % was known before"


def gradient(function: Any, x: Array) -> Array:
    """Central differences of a scalar function of x (m,), for the propagation of a covariance."""
    result = np.zeros(len(x))
    for i in range(len(x)):
        step = 1e-5 * max(abs(float(x[i])), 1e-6)
        up, down = x.copy(), x.copy()
        up[i] += step
        down[i] -= step
        result[i] = (function(up) - function(down)) / (2 * step)
    return result
