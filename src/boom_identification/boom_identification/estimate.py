"""What an identification says of one number: its value, how sure it is, and why it is not known where it is not."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

NORMAL_90 = 1.6449
"""Half width of a 90 % interval in standard errors."""
METHOD_FACTOR = 1.6
"""By which standard errors are widened. Averages, filters and the steady state are approximations whose errors no scatter
shows: over seven simulated campaigns errors were 1.5 times (rms) as large as the scatter between stretches tells."""


@dataclass(frozen=True)
class Estimate:
    """One parameter that the recordings determine; those that they do not are `NotDetermined`.

    Attributes:
        key: of the machine file, joined with dots (``.0 .1 .2`` for the components of a vector).
        value: [unit].
        unit: as the machine file states it.
        interval_90: (low, high) [unit].
        how: a few words: equation and kind of data.
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
    """A parameter, or a group of them, that the recordings cannot tell, and why.

    excitation: whether other motions would tell it; False where no recording of this kind can.
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
    """Covariance (m, m) of a least-squares estimate whose residuals may be alike within a group.

    jacobian (n, m), residual (n,), groups (n,): samples of one group (a stretch of a recording) may err together; groups
    are taken as independent (cluster-robust sandwich estimate, Liang and Zeger 1986, small-sample factor G / (G - 1)). Few
    groups tell their own spread badly: the covariance is widened so that a normal 90 % interval is as wide as Student's with
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
        raise ValueError("the unknowns cannot be told from each other")
    _, index = np.unique(groups, return_inverse=True)
    count = int(index.max()) + 1
    if count < 2:
        raise ValueError("one stretch of data only, so that its error cannot be told")
    scores = np.zeros((count, jacobian.shape[1]))
    np.add.at(scores, index, scaled * residual[:, None])
    inverse = np.linalg.inv(normal)
    from scipy.special import stdtrit  # takes a quarter of a second to load

    student = METHOD_FACTOR * float(stdtrit(count - 1, 0.95)) / NORMAL_90
    covariance = inverse @ (scores.T @ scores) @ inverse * (count / (count - 1) * student**2)
    return np.asarray(covariance / np.outer(scale, scale))


def interval(value: float, variance: float) -> tuple[float, float]:
    """90 % interval of a value with a variance, normal."""
    half = NORMAL_90 * math.sqrt(max(variance, 0.0))
    return value - half, value + half


def too_wide(found: Estimate, tolerance: float) -> str:
    """Why an estimate says no more than what was believed before (relative ``tolerance``); empty if it says more."""
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
