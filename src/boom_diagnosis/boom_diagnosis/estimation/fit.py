"""Bounded Gauss-Newton with Levenberg-Marquardt damping for the most probable unknowns (maximum a posteriori).

    cost(z) = sum over segments |L e(z)|^2 + sum over priors z_j^2

with the free runs' errors e and the whiteners L (``whitening``), which are held while a step is sought and renewed along the
new runs afterwards. ``level``, by which the whiteners let the model be wrong, starts where the innovations have unit variance
and falls as the fit improves, never below one: far from the solution the angle's drift counts little and the speed much, which
widens the range from which the search finds home. At the end it tells how wrong the best model still is.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from boom_diagnosis.estimation.problem import DIVERGED, Problem
from boom_diagnosis.estimation.unknown import Unknown
from boom_diagnosis.estimation.whitening import Whitener

Array = NDArray[np.float64]
Progress = Callable[[str], None]
"""Called with one short sentence whenever something that takes time is done."""

HIGHEST_LEVEL = 100.0
_TRIALS = 6
_ENOUGH = 0.02
"""Change of cost, in units of a log-likelihood ratio, below which a step is not worth another."""


@dataclass(frozen=True)
class Fit:
    """Result of a search.

    Attributes:
        unknowns: in the order of z.
        z: (m,) most probable values; ``values`` the same as numbers [SI].
        cost: squared innovations and priors at z, with the whiteners of ``level``.
        level: how far the best model's error exceeds what the currents' noise explains (1: not at all).
        information: (m, m) of z, the data's and the priors'; ``data_information`` without the priors.
        samples: number of samples that were used.
        innovations: per segment (K, 4), unit variance where the model is right.
        iterations: that were needed. converged: whether the last step was small.
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
    iterations: int
    converged: bool

    def number(self, name: str) -> float:
        """Estimated number of an unknown, by name."""
        return float(self.values[[u.name for u in self.unknowns].index(name)])

    @property
    def covariance(self) -> Array:
        """(m, m) of z."""
        return np.asarray(np.linalg.inv(self.information), dtype=float)


@dataclass(frozen=True)
class _Point:
    """Errors, sensitivities and the quadratic model of the cost at one z, for given whiteners."""

    z: Array
    errors: list[Array]
    derivatives: list[Array]


def fit(
    problem: Problem,
    start: Array | None = None,
    *,
    iterations: int = 15,
    level: float | None = None,
    progress: Progress | None = None,
) -> Fit:
    """Searches from ``start`` (m,) in z, by default zero: the nominal values.

    level: held at this number; by default adapted as described above.

    Raises:
        ValueError: no run gets anywhere from the start.
    """
    say = progress or (lambda text: None)
    z = np.zeros(len(problem.unknowns)) if start is None else np.array(start, dtype=float)
    bounds = np.array([u.bounds for u in problem.unknowns]).reshape(-1, 2)
    z = np.clip(z, bounds[:, 0], bounds[:, 1])
    now = 10.0 if level is None else level
    damping, converged, count = 1e-3, False, 0
    errors, derivatives = problem.sensitivities(z)
    whiteners = problem.whiteners(z, level=now)
    while True:
        if level is None:
            now, whiteners = _settle(problem, z, errors, whiteners, now)
        white = [_white(w, e, d) for w, e, d in zip(whiteners, errors, derivatives, strict=True)]
        gradient, data = _normal_equations(white, len(z))
        prior = np.array([1.0 if u.prior else 0.0 for u in problem.unknowns])
        cost = _cost(problem, whiteners, errors, z)
        if converged or count >= iterations:
            break
        count += 1
        step = None
        for _ in range(_TRIALS):
            wanted, promised = _step(z, gradient, data, prior, damping, bounds)
            if promised < _ENOUGH:
                break
            trial = problem.errors(wanted)
            reached = _cost(problem, whiteners, trial, wanted)
            ratio = (cost - reached) / promised
            if ratio > 0.05:
                step = wanted
                damping = max(damping * (0.1 if ratio > 0.7 else 1.0 if ratio > 0.3 else 3.0), 1e-6)
                break
            damping = max(damping * 10.0, 1e-2)
        if step is None:
            converged = True
            continue
        say(f"iteration {count}: cost {reached:.0f}, noise level {now:.2f}")
        small = cost - reached < _ENOUGH * 5 and now <= 1.0
        z = step
        errors, derivatives = problem.sensitivities(z)
        whiteners = problem.whiteners(z, level=now)
        converged = small
    return Fit(
        tuple(problem.unknowns), z, problem.values(z), cost, now, data + np.diag(prior), data,
        sum(int(w.used.sum()) for w in whiteners if w is not None), tuple(i for i, _ in white), count, converged,
    )  # fmt: skip


def _white(w: Whitener | None, errors: Array, derivatives: Array) -> tuple[Array, Array]:
    if w is None:
        return np.zeros(errors.shape), np.zeros(derivatives.shape)
    both = w.apply(np.concatenate((errors[:, :, None], derivatives), axis=2))
    lost = ~np.isfinite(errors)
    both[lost] = 0.0
    return both[:, :, 0], both[:, :, 1:]


def _normal_equations(white: Sequence[tuple[Array, Array]], count: int) -> tuple[Array, Array]:
    gradient, data = np.zeros(count), np.zeros((count, count))
    for innovations, derivatives in white:
        flat = derivatives.reshape(-1, count)
        gradient += flat.T @ innovations.ravel()
        data += flat.T @ flat
    return gradient, data


def _cost(problem: Problem, whiteners: Sequence[Whitener | None], errors: Sequence[Array], z: Array) -> float:
    total = 0.0
    for w, e in zip(whiteners, errors, strict=True):
        if w is None:
            total += DIVERGED * e.size
            continue
        innovations = w.apply(e[:, :, None])[:, :, 0]
        lost = w.used & ~np.isfinite(e)
        total += float(np.sum(innovations[w.used & ~lost] ** 2)) + DIVERGED * int(lost.sum())
    return total + float(sum(v**2 for u, v in zip(problem.unknowns, z, strict=True) if u.prior))


def _settle(
    problem: Problem, z: Array, errors: Sequence[Array], whiteners: list[Whitener | None], level: float
) -> tuple[float, list[Whitener | None]]:
    """Level at which the innovations have about unit variance, and the whiteners for it."""
    for _ in range(2):
        size = _spread(whiteners, errors)
        wanted = min(max(level * size, 1.0), HIGHEST_LEVEL)
        if size <= 1.1 and level <= 1.0 or abs(np.log(wanted / level)) < 0.2:
            break
        level = wanted
        whiteners = problem.whiteners(z, level=level)
    return level, whiteners


def _spread(whiteners: Sequence[Whitener | None], errors: Sequence[Array]) -> float:
    """Root mean square of the innovations."""
    total, count = 0.0, 0
    for w, e in zip(whiteners, errors, strict=True):
        if w is not None:
            good = w.used & np.isfinite(e)
            total += float(np.sum(w.apply(e[:, :, None])[:, :, 0][good] ** 2))
            count += int(good.sum())
    if count == 0:
        raise ValueError("no run with these parameters gets anywhere: start from others")
    return float(np.sqrt(total / count))


def _step(z: Array, gradient: Array, data: Array, prior: Array, damping: float, bounds: Array) -> tuple[Array, float]:
    """The damped step, held inside the bounds, and by how much it promises to lower the cost."""
    pull = gradient - prior * z  # minus half of the cost's gradient
    matrix = data + np.diag(prior)
    free = np.ones(len(z), dtype=bool)
    delta = np.zeros(len(z))
    for _ in range(len(z) + 1):
        index = np.flatnonzero(free)
        if len(index) == 0:
            break
        block = matrix[np.ix_(index, index)]
        right = pull[index] - matrix[np.ix_(index, np.flatnonzero(~free))] @ delta[~free]
        delta[index] = np.linalg.solve(block + damping * np.diag(np.diag(block) + 1e-12), right)
        outside = free & ((z + delta < bounds[:, 0]) | (z + delta > bounds[:, 1]))
        if not outside.any():
            break
        delta[outside] = np.clip(z + delta, bounds[:, 0], bounds[:, 1])[outside] - z[outside]
        free &= ~outside
    promised = float(2 * pull @ delta - delta @ matrix @ delta)
    return z + delta, promised
