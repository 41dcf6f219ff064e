"""The fit of a hypothesis: its numbers and the sizes of its discrepancies together, and the evidence for it.

    objective(c, v) = sum of log-likelihoods + log prior(c) + log prior(v),   v = log s
    evidence = objective + (dim / 2) log(2 pi) - log det(H) / 2     (Laplace)

c: inner coordinates of the numbers, s: stationary deviations of the discrepancies. Each turn passes the model once through the
experiments, linearises it there, and climbs on that linearisation; it ends when a turn gains less than ``SETTLED``.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import log, pi

import numpy as np
from numpy.typing import NDArray

from boom_estimation.linearising import HypothesisProblem, Known, linearise
from boom_estimation.numbers import Priors, SizePriors
from boom_estimation.recursion import Filtered, LinearisedPass, huber_weights

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

SETTLED = 0.5
"""Nats."""
TURNS, CLIMBS = 12, 6
"""At most: passes of a fit, steps on one linearisation."""
LEVEL_TURNS = 2
"""Passes at each size at which the numbers are fitted first."""
V_STEP = 1e-3
"""Of v, for differences."""
DULL = 0.05
"""Nats by which a size must matter to the likelihood in a step of one for its derivatives to be taken again."""
FIRST_RADIUS, LEAST_RADIUS = 1.0, 0.02
"""How far numbers may move in a turn: standard deviations of the prior, or quarters of the range where it is flat."""
LARGEST_MOVE = 1.5
"""Of v in one step."""


@dataclass(frozen=True)
class HypothesisFit:
    """A fitted hypothesis.

    Attributes:
        c: (m,) inner coordinates of ``problem.numbers``. v: (q,) log sizes of the discrepancies.
        log_likelihood, log_prior: at (c, v) [nats]. hessian: (m + q, m + q) of minus the objective.
        linearised: each experiment along its pass at (c, v).
    """

    problem: HypothesisProblem
    c: Array
    v: Array
    log_likelihood: float
    log_prior: float
    hessian: Array
    linearised: tuple[LinearisedPass, ...]

    @property
    def objective(self) -> float:
        """Log posterior density [nats]."""
        return self.log_likelihood + self.log_prior

    @property
    def free(self) -> NDArray[np.bool_]:
        """(m + q,) which coordinates do not stand at an end of their range."""
        p = Priors.of(self.problem.numbers)
        inside = (self.c > p.low + 1e-9) & (self.c < p.high - 1e-9)
        return np.concatenate([inside, np.ones(len(self.v), dtype=bool)])

    @property
    def _precision(self) -> tuple[NDArray[np.bool_], Array, Array]:
        """The free coordinates, the roots of the diagonal of their precision, and that precision scaled to a unit diagonal.

        Along a coordinate that the experiments do not tell, Laplace's integral is as wide as a flat prior's range, not infinite.
        """
        p, free = Priors.of(self.problem.numbers), self.free
        h = self.hessian.copy()
        flat = np.flatnonzero(p.precision == 0.0)
        h[flat, flat] += 2.0 * pi / np.square(p.high[flat] - p.low[flat])
        h = h[np.ix_(free, free)]
        scale = np.sqrt(np.diag(h))
        return free, scale, h / np.outer(scale, scale)

    @property
    def evidence(self) -> float:
        """Log marginal likelihood [nats], but for a constant that all hypotheses share; minus infinity where it is not defined."""
        free, scale, unit = self._precision
        sign, log_det = np.linalg.slogdet(unit)
        if sign <= 0.0 or not np.isfinite(self.objective):
            return -np.inf
        log_det += 2.0 * float(np.sum(np.log(scale)))
        return self.objective + 0.5 * float(free.sum()) * log(2.0 * pi) - 0.5 * float(log_det)

    @property
    def covariance(self) -> Array:
        """(m + q, m + q) of the free coordinates; zero for those at an end of their range."""
        free, scale, unit = self._precision
        result = np.zeros_like(self.hessian)
        result[np.ix_(free, free)] = np.linalg.inv(unit) / np.outer(scale, scale)
        return result

    @property
    def sizes(self) -> dict[str, float]:
        """Place -> stationary deviation of its discrepancy, over the place's scale."""
        return dict(zip(self.problem.system.places, np.exp(self.v).tolist(), strict=False))

    def values(self, experiment: str = "") -> dict[str, float]:
        """The numbers by name; those of an experiment's own where it is named."""
        return self.problem.values(self.c, experiment)


@dataclass(frozen=True)
class _Local:
    """Objective on a linearisation, with derivatives where they were asked for."""

    value: float
    log_likelihood: float
    gradient: Array
    curvature: Array


@dataclass(frozen=True)
class _Around:
    """A problem linearised about c."""

    priors: Priors
    sizes: SizePriors
    linearised: Sequence[LinearisedPass]
    c: Array


def _local(around: _Around, c: Array, v: Array, derivatives: bool, active: Flags | None = None) -> _Local:
    """The objective at (c, v) on a linearisation; ``active``: the sizes that matter to it, all by default."""
    priors, sizes, origin = around.priors, around.sizes, around.c
    m, q = len(c), len(v)
    total = 0.0
    gradient, curvature = np.zeros(m + q), np.zeros((m + q, m + q))
    for lin in around.linearised:
        here = lin.run(np.exp(v), c - origin, by=derivatives)
        total += lin.log_likelihood(here)
        if derivatives:
            g, h = _derivatives(lin, here, c - origin, v, np.ones(q, dtype=bool) if active is None else active)
            gradient += g
            curvature += h
    value = total + priors.density(c) + sizes.density(v)
    if derivatives:
        gradient += np.concatenate([priors.slope(c), sizes.slope(v)])
        curvature += np.diag(np.concatenate([priors.precision, sizes.curvature(v)]))
    return _Local(value, total, gradient, curvature)


def _derivatives(lin: LinearisedPass, here: Filtered, moved: Array, v: Array, active: Flags) -> tuple[Array, Array]:
    """Gradient (m + q,) of the log-likelihood by numbers and log sizes, and its expected curvature (Fisher scoring)."""
    counted = lin.model.counted
    assert here.by is not None
    w = here.white[counted]
    omega = huber_weights(w)
    inverse = np.linalg.inv(here.factor[counted])
    base = lin.log_likelihood(here)
    empty = np.zeros_like(here.factor[counted])
    columns, growth, slopes = [], [], []
    for k in range(len(v)):
        if not active[k]:
            slopes.append(0.0)
            growth.append(empty)
            columns.append(empty[:, :, 0])
            continue
        other = v.copy()
        other[k] += V_STEP
        there = lin.run(np.exp(other), moved)
        slopes.append((lin.log_likelihood(there) - base) / V_STEP)
        s0, s1 = here.factor[counted], there.factor[counted]
        change = (s1 @ s1.transpose(0, 2, 1) - s0 @ s0.transpose(0, 2, 1)) / V_STEP
        growth.append(inverse @ change @ inverse.transpose(0, 2, 1))
        e = (there.innovations[counted] - here.innovations[counted]) / V_STEP
        columns.append((inverse @ e[:, :, None])[:, :, 0])
    by = here.by[counted]
    gradient = np.concatenate([-np.einsum("ni,nij->j", omega * w, by), slopes])
    whole = np.concatenate([by, np.stack(columns, axis=-1)], axis=2).reshape(-1, by.shape[2] + len(v))
    root = np.sqrt(omega).reshape(-1, 1)
    curvature = (whole * root).T @ (whole * root)
    m = by.shape[2]
    for a in range(len(v)):
        for b in range(len(v)):
            curvature[m + a, m + b] += 0.5 * float(np.sum(growth[a] * growth[b]))
    return gradient, curvature


def _climb(
    around: _Around, v: Array, climbs: int = CLIMBS, radius: float = np.inf, *, sized: bool = True
) -> tuple[Array, Array, float]:
    """The maximum of the objective on a linearisation: c, v, objective."""
    priors, c = around.priors, around.c
    m = len(c)
    reach = radius * priors.width
    least, most = around.sizes.limits
    low = np.concatenate([np.maximum(priors.low, c - reach), least])
    high = np.concatenate([np.minimum(priors.high, c + reach), most])
    at = _local(around, c, v, True, None if sized else np.zeros(len(v), dtype=bool))
    if not sized:
        low[m:] = high[m:] = v
    active = (
        np.abs(at.gradient[m:] - around.sizes.slope(v)) + np.diag(at.curvature)[m:] - around.sizes.curvature(v) > DULL
    )
    here = np.concatenate([c, v])
    damping = 1e-6
    for _ in range(climbs):
        gained = 0.0
        for _ in range(8):
            step = _step(here, at.gradient, at.curvature, low, high, damping)
            step[m:] = np.clip(step[m:], -LARGEST_MOVE, LARGEST_MOVE)
            there = np.clip(here + step, low, high)
            trial = _local(around, there[:m], there[m:], False)
            if trial.value > at.value:
                gained = trial.value - at.value
                here, damping = there, damping * 0.2
                break
            damping = max(damping, 1e-4) * 8.0
        if gained < 0.2 * SETTLED:
            break
        at = _local(around, here[:m], here[m:], True, active)
    return here[:m], here[m:], at.value


def _step(here: Array, gradient: Array, curvature: Array, low: Array, high: Array, damping: float) -> Array:
    """Damped Newton step; coordinates that would leave their range stay at its end."""
    free = np.ones(len(here), dtype=bool)
    step = np.zeros(len(here))
    for _ in range(len(here)):
        scale = np.sqrt(np.maximum(np.diag(curvature)[free], 1e-12))
        a = curvature[np.ix_(free, free)] / np.outer(scale, scale) + damping * np.eye(int(free.sum()))
        step[:] = 0.0
        step[free] = np.linalg.solve(a + 1e-10 * np.eye(len(a)), gradient[free] / scale) / scale
        leaving = free & (((here <= low) & (step < 0.0)) | ((here >= high) & (step > 0.0)))
        if not leaving.any():
            break
        free &= ~leaving
    return step


def fit(
    problem: HypothesisProblem,
    c: Array,
    v: Array,
    *,
    levels: Sequence[float] = (),
    turns: int = TURNS,
    hopeless: Callable[[float], bool] = lambda _: False,
    known: Known = None,
) -> HypothesisFit:
    """Fits a hypothesis from (c, v).

    levels: sizes at which the numbers are fitted first: with free ones a discrepancy would take what the numbers can explain.
    hopeless: told what a turn promises; where it says so the fit ends there.

    Raises:
        FloatingPointError: the model cannot be run at the start.
    """
    for level in levels:
        c = _turns(problem, c, np.maximum(v, log(level)), LEVEL_TURNS, hopeless, known, sized=False)[0].c
    around, v, at = _turns(
        problem, c, np.maximum(v, log(levels[-1])) if levels else v, turns, hopeless, known, sized=True
    )
    at = _local(around, around.c, v, True)
    return HypothesisFit(
        problem, around.c, v, at.log_likelihood, at.value - at.log_likelihood, at.curvature, tuple(around.linearised)
    )


def nearby(problem: HypothesisProblem, fitted: HypothesisFit, v: Array) -> HypothesisFit:
    """A problem with the numbers of a fitted one and other priors of sizes, from log sizes v, on the linearisations of that fit."""
    around = _Around(Priors.of(problem.numbers), problem.sizes, fitted.linearised, fitted.c)
    c, v, _ = _climb(around, v, radius=FIRST_RADIUS)
    at = _local(around, c, v, True)
    return HypothesisFit(problem, c, v, at.log_likelihood, at.value - at.log_likelihood, at.curvature, ())


def _turns(
    problem: HypothesisProblem,
    c: Array,
    v: Array,
    turns: int,
    hopeless: Callable[[float], bool],
    known: Known,
    *,
    sized: bool,
) -> tuple[_Around, Array, _Local]:
    """Turns of passing, linearising and climbing, within a radius that follows how well the last turn kept its promise."""
    around = _around(problem, c, v, None, known)
    at = _local(around, c, v, False)
    radius = FIRST_RADIUS
    for _ in range(turns):
        nc, nv, promised = _climb(around, v, radius=radius, sized=sized)
        if promised - at.value < SETTLED:
            break
        if hopeless(promised) and np.all(np.abs(nc - around.c) < 0.9 * radius * around.priors.width):
            break
        other, there = _at(problem, around, nc, nv)
        ratio = -np.inf if there is None else (there.value - at.value) / (promised - at.value)
        radius = radius * (2.0 if ratio > 0.7 else 1.0 if ratio > 0.3 else 0.3)
        if ratio <= 0.0 or other is None or there is None:
            if radius < LEAST_RADIUS:
                break
            continue
        gain = there.value - at.value
        around, v, at = other, nv, there
        if gain < SETTLED:
            break
    return around, v, at


def _at(problem: HypothesisProblem, around: _Around, c: Array, v: Array) -> tuple[_Around | None, _Local | None]:
    """The problem at another point, with the gains that suit it; None where the model cannot be run."""
    gains = [
        np.ascontiguousarray(lin.run(np.exp(v), c - around.c, gain=True).gain[:, : lin.along.states.shape[1]])  # type: ignore[index]
        for lin in around.linearised
    ]
    try:
        other = _around(problem, c, v, gains, around.linearised)
        return other, _local(other, c, v, False)
    except FloatingPointError:
        return None, None


def _around(problem: HypothesisProblem, c: Array, v: Array, gains: Sequence[Array] | None, known: Known) -> _Around:
    lins = linearise(problem, c, v, gains, known)
    return _Around(Priors.of(problem.numbers), problem.sizes, lins, c)
