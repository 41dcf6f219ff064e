"""How sure an estimate is: intervals that mean what they say, and what the recordings cannot tell.

The covariance of a fit is the inverse of its information, widened in two ways. Where innovations are not white, because the
model is not quite right, the gradient's real scatter between blocks of one second replaces the scatter that white ones would
have (sandwich estimator; White 1982). Where the cost is not quadratic, the profile likelihood along the ridge (the unknown
moved, all others following linearly) tells how far 90 % reach.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from boom_diagnosis.estimation.fit import Fit, cost_at
from boom_diagnosis.estimation.problem import Problem
from boom_diagnosis.estimation.unknown import Unknown

Array = NDArray[np.float64]

NINETY = 1.6449
"""Standard deviations to either side that hold 90 % of a normal distribution; its square is the rise of the cost there."""
TOGETHER = 0.97
"""Correlation from which two unknowns can be told only together."""
TOLD = 0.5
"""Standard deviation after over before the recordings, from which they have told next to nothing."""
_BLOCK = 1.0
_WIDEST = 4.0


@dataclass(frozen=True)
class Uncertainty:
    """What is known of each unknown after a fit, in the order of its unknowns.

    Attributes:
        sigma: (m,) standard deviations of z, after the recordings.
        correlation: (m, m).
        low, high: (m,) ends of the 90 % intervals, numbers [SI].
        widened: (m,) by how much colour and curvature widened the interval of the plain information.
        shrinkage: (m,) sigma over that of the prior: near 1 the recordings told nothing.
    """

    unknowns: tuple[Unknown, ...]
    sigma: Array
    correlation: Array
    low: Array
    high: Array
    widened: Array
    shrinkage: Array

    def partners(self, j: int) -> list[int]:
        """Unknowns that unknown j can be told only together with."""
        return [k for k in range(len(self.sigma)) if k != j and abs(self.correlation[j, k]) > TOGETHER]


def uncertainty(problem: Problem, fit: Fit, *, profile: bool = True) -> Uncertainty:
    """Intervals of a fit of a problem; ``profile``: look along the ridges, at the price of two predictions an unknown."""
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


def _colour(problem: Problem, fit: Fit, covariance: Array) -> Array:
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


def _curvature(problem: Problem, fit: Fit, covariance: Array) -> tuple[Array, Array]:
    """Factors (m,) below and above by which the cost rises more slowly along the ridge than its quadratic model."""
    sigma = np.sqrt(np.diag(covariance))
    bounds = np.array([u.bounds for u in fit.unknowns])
    moved = []
    for sign in (-1.0, 1.0):
        for j in range(len(sigma)):
            step = sign * NINETY * covariance[:, j] / sigma[j]
            moved.append(np.clip(fit.z + step, bounds[:, 0], bounds[:, 1]))
    rise = np.array([cost_at(problem, fit.gains, z) for z in moved]) - fit.cost
    factor = np.sqrt(NINETY**2 / np.clip(rise, NINETY**2 / _WIDEST**2, NINETY**2))
    return factor[: len(sigma)], factor[len(sigma) :]


def companions(problem: Problem, fit: Fit, extra: Sequence[Unknown]) -> tuple[tuple[Unknown, ...], Array, Array]:
    """What would be known if ``extra`` numbers, which the fit held, were unknown, too.

    Returns:
        All unknowns, their standard deviations (z) and correlations, from the sensitivities at the fitted values.
    """
    both = (*fit.unknowns, *extra)
    wider = Problem(problem.experiments, both)
    z = np.concatenate((fit.z, np.zeros(len(extra))))
    m = len(fit.z)
    _, derivatives = wider.sensitivities(z, fit.gains, columns=range(m, len(both)))
    information = np.zeros((len(both), len(both)))
    for g, held, d in zip(fit.gains, fit.derivatives, derivatives, strict=True):
        flat = np.concatenate((held, g.whiten(d)), axis=2).reshape(-1, len(both))
        information += flat.T @ flat
    information += np.diag([1.0 if u.prior else 0.0 for u in both])
    covariance = np.linalg.inv(information)
    sigma = np.sqrt(np.diag(covariance))
    return both, sigma, covariance / np.outer(sigma, sigma)
