"""The uncertainty of an estimate: calibrated intervals, and numbers that the recordings do not determine.

The covariance of a fit is the inverse of its information, widened in two ways. Where innovations are not white, because the
model is not quite right, the gradient's real scatter between blocks of one second replaces the scatter that white ones would
have (sandwich estimator; White 1982). Where the cost is not quadratic, the profile likelihood along the ridge (the unknown
moved, all others following linearly) determines the 90 % interval.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from boom_estimation.fit import FitResult, cost_at
from boom_estimation.problem import EstimationProblem
from boom_estimation.unknown import Unknown

Array = NDArray[np.float64]

NINETY = 1.6449
"""Standard deviations to either side that hold 90 % of a normal distribution; its square is the rise of the cost there."""
TOGETHER = 0.97
"""Correlation from which two unknowns are determined only together."""
TOLD = 0.5
"""Ratio of posterior to prior standard deviation from which the recordings determine almost nothing."""
_BLOCK = 1.0
_WIDEST, _DOUBTFUL = 4.0, 1.3
"""Longest, and first doubtful, 90 % interval over that of the quadratic model."""


@dataclass(frozen=True)
class Uncertainty:
    """Knowledge of each unknown after a fit, in the order of its unknowns.

    Attributes:
        sigma: (m,) standard deviations of z, after the recordings.
        correlation: (m, m).
        low, high: (m,) ends of the 90 % intervals, numbers [SI].
        widened: (m,) factor by which colour and curvature widened the interval of the plain information.
        shrinkage: (m,) sigma over that of the prior: near 1 the recordings gave no information.
    """

    unknowns: tuple[Unknown, ...]
    sigma: Array
    correlation: Array
    low: Array
    high: Array
    widened: Array
    shrinkage: Array

    def partners(self, j: int) -> list[int]:
        """Unknowns together with which unknown j is determined only."""
        return [k for k in range(len(self.sigma)) if k != j and abs(self.correlation[j, k]) > TOGETHER]


def uncertainty(problem: EstimationProblem, fit: FitResult, *, profile: bool = True) -> Uncertainty:
    """Intervals of a fit of a problem; ``profile``: examine the ridges, at a cost of two predictions per unknown."""
    covariance = fit.covariance
    sigma = np.sqrt(np.diag(covariance))
    colour = _colour(problem, fit, covariance)
    below, above = colour.copy(), colour.copy()
    if profile and len(sigma):
        curvature = _curvature(problem, fit, covariance)
        below, above = below * curvature[0], above * curvature[1]
    ends = [
        (u.value(z - NINETY * s * b), u.value(z + NINETY * s * a))
        for u, z, s, b, a in zip(fit.unknowns, fit.z, sigma, below, above, strict=True)
    ]
    prior = np.array([1.0 if u.prior else np.inf for u in fit.unknowns])
    widened = 0.5 * (below + above)
    return Uncertainty(
        fit.unknowns, sigma * widened, covariance / np.outer(sigma, sigma),
        np.array([e[0] for e in ends]), np.array([e[1] for e in ends]), widened, np.minimum(sigma * widened / prior, 1.0),
    )  # fmt: skip


def _colour(problem: EstimationProblem, fit: FitResult, covariance: Array) -> Array:
    """Factor (m,), at least one, by which the gradient scatters more than that of white innovations."""
    count = len(fit.z)
    scatter = np.zeros((count, count))
    for (experiment, _), e, d in zip(problem.segments, fit.innovations, fit.derivatives, strict=True):
        block = max(1, round(_BLOCK / experiment.period))
        scores = np.einsum("kij,ki->kj", d, e)
        whole = len(scores) // block * block
        sums = scores[:whole].reshape(-1, block, count).sum(axis=1)
        scatter += sums.T @ sums
    real = np.diag(covariance @ scatter @ covariance)
    plain = np.diag(covariance @ fit.data_information @ covariance)
    return np.sqrt(np.maximum(1.0, real / np.maximum(plain, 1e-300)))


def _curvature(problem: EstimationProblem, fit: FitResult, covariance: Array) -> tuple[Array, Array]:
    """Factors (m,) below and above by which the cost rises more slowly along the ridge than its quadratic model.

    Where that is doubtful, the ridge is curved, and the others move to their best fit (profile likelihood).
    """
    count = len(fit.z)
    sigma = np.sqrt(np.diag(covariance))
    bounds = np.array([u.bounds for u in fit.unknowns])
    factors = np.ones((2, count))
    for side, sign in enumerate((-1.0, 1.0)):
        for j in range(count):
            z = np.clip(fit.z + sign * NINETY * covariance[:, j] / sigma[j], bounds[:, 0], bounds[:, 1])
            rise = cost_at(problem, fit.gains, z) - fit.cost
            if _widening(rise) > _DOUBTFUL:
                rise = min(rise, _followed(problem, fit, z, j, bounds) - fit.cost)
            factors[side, j] = _widening(rise)
    return factors[0], factors[1]


def _widening(rise: float) -> float:
    """Ratio of the distance to the 90 % end to the distance that raised the cost by ``rise``."""
    return float(np.sqrt(NINETY**2 / np.clip(rise, NINETY**2 / _WIDEST**2, NINETY**2)))


def _followed(problem: EstimationProblem, fit: FitResult, z: Array, held: int, bounds: Array) -> float:
    """Cost with all unknowns but ``held`` moved from z (m,) by one Gauss-Newton step."""
    innovations, derivatives = problem.sensitivities(z, fit.gains)
    others = np.arange(len(z)) != held
    prior = np.array([1.0 if u.prior else 0.0 for u in fit.unknowns])
    pull, matrix = -prior * z, np.diag(prior)
    for g, e, d in zip(fit.gains, innovations, derivatives, strict=True):
        flat = g.whiten(d).reshape(-1, len(z))
        pull -= flat.T @ g.whiten(e[:, :, None]).ravel()
        matrix += flat.T @ flat
    moved = z.copy()
    moved[others] += np.linalg.solve(matrix[np.ix_(others, others)], pull[others])
    return cost_at(problem, fit.gains, np.clip(moved, bounds[:, 0], bounds[:, 1]))
