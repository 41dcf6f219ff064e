"""Bounded Gauss-Newton with Levenberg-Marquardt damping for the most probable unknowns (maximum a posteriori).

    cost(z) = sum over segments and samples |L_k^-1 e_k(z)|^2 + sum over priors z_j^2

with the innovations e of an observer and its gains (``whitening``), which stay fixed during a step and are renewed along the
new states afterwards. ``level``, the model error that the gains assume, starts where the innovations have unit variance and
falls as the fit improves, never below one. Far from the solution the observer stays near the measurement, which widens the
range of convergence; near it, the observer is a Kalman filter, and the estimate is the prediction-error estimate. At the
end ``level`` measures the error of the best model.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from boom_estimation.problem import EstimationProblem
from boom_estimation.unknown import Unknown
from boom_estimation.whitening import PredictorGains
from boom_model.plant import FAST, FINE

Array = NDArray[np.float64]
Progress = Callable[[str], None]
"""Called with a short sentence before every step that takes time."""

DIVERGED = 25.0
"""Cost of a sample that a prediction did not reach: as for an innovation of five standard deviations."""
HIGHEST_LEVEL = 100.0
_TRIALS = 6
_ENOUGH, _SMALL = 0.02, 0.1
"""Predicted, and achieved, change of cost (twice a log-likelihood ratio) below which the search ends."""
_FIRST_RADIUS, _LARGEST_RADIUS = 0.5, 1.0
"""Size of the trust region, in standard deviations of the prior."""
_EXPECTED, _FAR, _FALL = 1.1, 2.0, 3.0
"""Size of the innovations up to which the level is lowered, the factor, and the size above which it was lowered too far."""
_UNDERSTATED = 1.15
"""Ratio of achieved to predicted change of cost above which a step is tried at twice its length: corners of the cost, such as that
of a pre-charge, are not quadratic."""
_NEAR, _REACH, _SMALLEST_STEP, _WIDEST_STEP = 1.5, 2.0, 1e-4, 10.0
"""Below the level ``_NEAR`` finite differences span this many standard deviations of the estimate, and at least this much of z;
above, the level times their usual step, at most this many."""
_FINER, _STUCK = 0.2, 2
"""If no step helps, differences are refined by this factor, so many times, before the search ends."""
_STALL_STEPS, _STALL_SHARE = 4, 0.01
"""This many iterations above level 1 that together lower the cost by less than this share end the search: another start is
better than more iterations."""
_RENEW = 0.02
"""Step of z above which the whiteners are renewed."""


@dataclass(frozen=True)
class FitResult:
    """Result of a search.

    Attributes:
        unknowns: in the order of z.
        z: (m,) most probable values; ``values`` the same as numbers [SI].
        cost: squared innovations and priors at z, with the whiteners of ``level``.
        level: ratio of the best model's error to what the currents' noise explains (1: explained).
        information: (m, m) of z, from data and priors; ``data_information`` without the priors.
        samples: number of samples that were used.
        innovations: per segment (n, NY), unit variance where the model is right; derivatives: (n, NY, m) by z.
        gains: per segment, of the observer that predicted.
        iterations: number needed. converged: whether the last step was small.
    """

    unknowns: tuple[Unknown, ...]
    z: Array
    values: Array
    cost: float
    level: float
    information: Array
    data_information: Array
    samples: int
    innovations: tuple[Array, ...]
    derivatives: tuple[Array, ...]
    gains: tuple[PredictorGains, ...]
    iterations: int
    converged: bool

    def number(self, name: str) -> float:
        """Estimated value of an unknown, by name."""
        return float(self.values[[u.name for u in self.unknowns].index(name)])

    @property
    def covariance(self) -> Array:
        """(m, m) of z."""
        return np.asarray(np.linalg.inv(self.information), dtype=float)


def fit(
    problem: EstimationProblem,
    start: Array | None = None,
    *,
    iterations: int = 15,
    level: float | None = None,
    progress: Progress | None = None,
) -> FitResult:
    """Search from ``start`` (m,) in z, by default zero, the nominal values.

    level: fixed at this value; by default adapted as described above.

    Raises:
        ValueError: no run succeeds from the start.
    """
    say = progress or (lambda text: None)
    z = np.zeros(len(problem.unknowns)) if start is None else np.array(start, dtype=float)
    bounds = np.array([u.bounds for u in problem.unknowns]).reshape(-1, 2)
    z = np.clip(z, bounds[:, 0], bounds[:, 1])
    now = HIGHEST_LEVEL if level is None else level
    radius, converged, count, stuck = _FIRST_RADIUS, False, 0, 0
    widest = np.array([u.step for u in problem.unknowns])
    steps = _steps(now, widest, widest)
    prior = np.array([1.0 if u.prior else 0.0 for u in problem.unknowns])
    costs: list[tuple[float, float]] = []
    gains = problem.gains(z, problem.first_gains(), level=now)
    while True:
        if level is None:
            now, gains = _settle(problem, z, gains, now)
        innovations, derivatives = problem.sensitivities(z, gains, steps=steps, tolerance=_tolerance(now))
        white = [_white(g, e, d) for g, e, d in zip(gains, innovations, derivatives, strict=True)]
        gradient, data = _normal_equations(white, len(z))
        cost = _cost(problem, gains, innovations, z)
        costs.append((now, cost))
        if converged or count >= iterations or _stalled(costs):
            break
        count += 1
        local = _LocalModel(z, cost, gradient, data, prior, bounds)
        found, radius, settled = _improvement(problem, gains, local, radius, _tolerance(now))
        spread = np.sqrt(np.diag(np.linalg.inv(data + np.diag(np.maximum(prior, 1e-6)))))
        if settled and (now <= 1.0 or level is not None):
            converged = True
            break
        stuck = stuck + 1 if found is None else 0
        steps = _steps(now, spread, widest) * _FINER**stuck
        if found is None:
            converged = stuck > _STUCK
            radius = _FIRST_RADIUS
            continue
        say(f"iteration {count}: cost {found[1]:.0f}, noise level {now:.2f}")
        converged = cost - found[1] < _SMALL and now <= 1.0
        moved, z = np.abs(found[0] - z).max(), found[0]
        if converged or moved > _RENEW:
            gains = problem.gains(z, gains, level=now)
    return FitResult(
        tuple(problem.unknowns), z, problem.values(z), cost, now, data + np.diag(prior), data,
        sum(int(g.used.sum()) for g in gains), tuple(i for i, _ in white), tuple(d for _, d in white), tuple(gains),
        count, converged,
    )  # fmt: skip


@dataclass(frozen=True)
class _LocalModel:
    """The cost around z (m,), as gradient, matrix and prior of its quadratic model, and the bounds (m, 2)."""

    z: Array
    cost: float
    gradient: Array
    data: Array
    prior: Array
    bounds: Array


def _improvement(
    problem: EstimationProblem, gains: Sequence[PredictorGains], local: _LocalModel, radius: float, tolerance: float
) -> tuple[tuple[Array, float] | None, float, bool]:
    """A step that lowers the cost, by trust region.

    Returns z and cost where it leads (None where no trial lowers it), the radius of the next one, and whether no step within
    the radius even promises to lower it.
    """
    z = local.z
    for _ in range(_TRIALS):
        wanted, promised = _step(z, local.gradient, local.data, local.prior, radius, local.bounds)
        if promised < _ENOUGH:
            return None, radius, True
        reached = cost_at(problem, gains, wanted, tolerance)
        ratio = (local.cost - reached) / promised
        length = float(np.abs(wanted - z).max())
        if ratio > 0.1:
            found = wanted, reached
            if ratio > 0.7:
                radius = min(max(radius, 2.0 * length), _LARGEST_RADIUS)
            elif ratio < 0.3:
                radius = 0.5 * length
            if ratio > _UNDERSTATED:
                found = _further(problem, gains, z, found, radius, local.bounds, tolerance)
            return found, radius, False
        radius = 0.25 * length
    return None, radius, False


def _stalled(costs: Sequence[tuple[float, float]]) -> bool:
    """Whether the last iterations, all at one level above 1, changed almost nothing; costs: (level, cost) of each."""
    if len(costs) <= _STALL_STEPS or costs[-1][0] <= _NEAR:
        return False
    level, cost = costs[-1]
    earlier_level, earlier = costs[-1 - _STALL_STEPS]
    return level == earlier_level and earlier - cost < _STALL_SHARE * cost


def _further(
    problem: EstimationProblem, gains: Sequence[PredictorGains], z: Array, found: tuple[Array, float], radius: float, bounds: Array,
    tolerance: float,
) -> tuple[Array, float]:  # fmt: skip
    """Lengthen a step that gained more than predicted, while that helps and it stays inside the radius."""
    while 2.0 * float(np.abs(found[0] - z).max()) <= radius:
        longer = np.clip(z + 2.0 * (found[0] - z), bounds[:, 0], bounds[:, 1])
        reached = cost_at(problem, gains, longer, tolerance)
        if reached >= found[1]:
            break
        found = longer, reached
    return found


def _steps(level: float, spread: Array, usual: Array) -> Array:
    """Steps of the finite differences: a secant over the range of uncertainty smooths the corners of the cost."""
    if level > _NEAR:
        return np.asarray(usual * min(level, _WIDEST_STEP), dtype=float)
    return np.clip(_REACH * spread, _SMALLEST_STEP, usual)


def _tolerance(level: float) -> float:
    """Tolerance of the integrator: fine enough for differences at the end, coarse and three times as fast before."""
    return min(FINE * level**2, FAST)


def _white(g: PredictorGains, innovations: Array, derivatives: Array) -> tuple[Array, Array]:
    both = g.whiten(np.concatenate((innovations[:, :, None], derivatives), axis=2))
    return both[:, :, 0], both[:, :, 1:]


def _normal_equations(white: Sequence[tuple[Array, Array]], count: int) -> tuple[Array, Array]:
    gradient, data = np.zeros(count), np.zeros((count, count))
    for innovations, derivatives in white:
        flat = derivatives.reshape(-1, count)
        gradient -= flat.T @ innovations.ravel()
        data += flat.T @ flat
    return gradient, data


def cost_at(problem: EstimationProblem, gains: Sequence[PredictorGains], z: Array, tolerance: float = FINE) -> float:
    """Squared innovations and priors at z (m,), with given gains."""
    return _cost(problem, gains, [run.innovations for run in problem.observed(z, gains, tolerance=tolerance)], z)


def _cost(problem: EstimationProblem, gains: Sequence[PredictorGains], innovations: Sequence[Array], z: Array) -> float:
    total = float(sum(v**2 for u, v in zip(problem.unknowns, z, strict=True) if u.prior))
    for g, e in zip(gains, innovations, strict=True):
        lost = g.used & ~np.isfinite(e)
        total += float(np.sum(g.whiten(e[:, :, None]) ** 2)) + DIVERGED * int(lost.sum())
    return total


def _settle(
    problem: EstimationProblem, z: Array, gains: list[PredictorGains], level: float
) -> tuple[float, list[PredictorGains]]:
    """The level, lowered as long as the innovations are hardly larger than it predicts, and the gains for it."""
    size = _size(problem, z, gains, level)
    while level > 1.0 and size < _EXPECTED:
        lower = max(level / _FALL, 1.0)
        tried = problem.gains(z, gains, level=lower)
        size = _size(problem, z, tried, lower)
        if size > _FAR:
            lower = float(np.sqrt(level * lower))
            return lower, problem.gains(z, gains, level=lower)
        level, gains = lower, tried
    return level, gains


def _size(problem: EstimationProblem, z: Array, gains: Sequence[PredictorGains], level: float) -> float:
    """Root mean square of the innovations, in units of their predicted size."""
    total, count = 0.0, 0
    for g, run in zip(gains, problem.observed(z, gains, tolerance=_tolerance(level)), strict=True):
        total += float(np.sum(g.whiten(run.innovations[:, :, None]) ** 2))
        count += int((g.used & np.isfinite(run.innovations)).sum())
    if count == 0:
        raise ValueError("no prediction succeeds with these parameters: start from others")
    return float(np.sqrt(total / count))


def _step(z: Array, gradient: Array, data: Array, prior: Array, radius: float, bounds: Array) -> tuple[Array, float]:
    """The best step with no |dz_j| above ``radius``, inside the bounds, and its predicted decrease of the cost."""
    pull = gradient - prior * z  # minus half of the cost's gradient
    matrix = data + np.diag(prior)
    damping = 0.0
    while True:
        delta = _bounded(z, pull, matrix + damping * np.eye(len(z)), bounds)
        if np.abs(delta).max(initial=0.0) <= radius:
            break
        damping = max(3.0 * damping, 1e-3)
    return z + delta, float(2 * pull @ delta - delta @ matrix @ delta)


def _bounded(z: Array, pull: Array, matrix: Array, bounds: Array) -> Array:
    """Solution of ``matrix`` delta = ``pull`` in which unknowns stop at their bounds and the others adapt."""
    free = np.ones(len(z), dtype=bool)
    delta = np.zeros(len(z))
    while free.any():
        block = matrix[np.ix_(free, free)]
        delta[free] = np.linalg.solve(
            block + 1e-12 * np.eye(len(block)), pull[free] - matrix[np.ix_(free, ~free)] @ delta[~free]
        )
        outside = free & ((z + delta < bounds[:, 0]) | (z + delta > bounds[:, 1]))
        if not outside.any():
            break
        delta[outside] = np.clip(z + delta, bounds[:, 0], bounds[:, 1])[outside] - z[outside]
        free &= ~outside
    return delta
