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
from boom_estimation.recursion import Filtered, LinearisedPass, huber_weights, threads

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

SETTLED = 0.5
"""Nats."""
TURNS, CLIMBS = 12, 6
"""At most: passes of a fit, steps on one linearisation."""
LEVEL_TURNS = 2
"""Passes at each size at which the numbers are fitted first."""
WAKENINGS = 2
"""Times that sizes which did not matter where a fit began are looked at again."""
V_STEP = 1e-3
"""Of v, for differences."""
DULL = 0.2
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
class _Around:
    """A problem linearised about c."""

    priors: Priors
    sizes: SizePriors
    linearised: Sequence[LinearisedPass]
    c: Array


@dataclass(frozen=True)
class _Local:
    """Objective on a linearisation at (c, v), and what the filter gave with its derivatives by the numbers."""

    c: Array
    v: Array
    value: float
    log_likelihood: float
    filtered: tuple[Filtered, ...]


@dataclass(frozen=True)
class _Slopes:
    """Gradient (m + q,) of the objective and its expected curvature (m + q, m + q), negated."""

    gradient: Array
    curvature: Array


def _local(around: _Around, c: Array, v: Array) -> _Local:
    seen = tuple(lin.run(np.exp(v), c - around.c, by=True) for lin in around.linearised)
    total = sum(lin.log_likelihood(here) for lin, here in zip(around.linearised, seen, strict=True))
    return _Local(c, v, total + around.priors.density(c) + around.sizes.density(v), total, seen)


def _slopes(around: _Around, at: _Local, active: Flags) -> _Slopes:
    """At a point with derivatives by the numbers; ``active``: (q,) the sizes by which it is differentiated, too."""
    m, q = len(at.c), len(at.v)
    gradient = np.concatenate([around.priors.slope(at.c), around.sizes.slope(at.v)])
    curvature = np.diag(np.concatenate([around.priors.precision, around.sizes.curvature(at.v)]))
    for lin, here in zip(around.linearised, at.filtered, strict=True):
        g, h = _derivatives(lin, here, at.c - around.c, at.v, active)
        gradient[: m + q] += g
        curvature += h
    return _Slopes(gradient, curvature)


def _derivatives(lin: LinearisedPass, here: Filtered, moved: Array, v: Array, active: Flags) -> tuple[Array, Array]:
    """Gradient (m + q,) of the log-likelihood by numbers and log sizes, and its expected curvature (Fisher scoring)."""
    counted = lin.model.counted
    assert here.by is not None
    by, w = here.by[counted], here.white[counted]
    omega = huber_weights(w)
    inverse = np.linalg.inv(here.factor[counted])
    base, s0 = lin.log_likelihood(here), here.factor[counted]
    s0 = s0 @ s0.transpose(0, 2, 1)

    def by_size(k: int) -> tuple[float, Array, Array]:
        """Slope, whitened change of the covariance and of the innovations by one size."""
        other = v.copy()
        other[k] += V_STEP
        there = lin.run(np.exp(other), moved)
        s1 = there.factor[counted]
        change = (s1 @ s1.transpose(0, 2, 1) - s0) / V_STEP
        e = (there.innovations[counted] - here.innovations[counted]) / V_STEP
        grown = inverse @ change @ inverse.transpose(0, 2, 1)
        return (lin.log_likelihood(there) - base) / V_STEP, grown, (inverse @ e[:, :, None])[:, :, 0]

    m, which = by.shape[2], np.flatnonzero(active)
    found = list(threads().map(by_size, which))
    gradient = np.concatenate([-np.einsum("ni,nij->j", omega * w, by), np.zeros(len(v))])
    gradient[m + which] = [slope for slope, _, _ in found]
    whole = np.zeros((*by.shape[:2], m + len(v)))
    whole[:, :, :m] = by
    for k, (_, _, e) in zip(which, found, strict=True):
        whole[:, :, m + k] = e
    flat = (whole * np.sqrt(omega)[:, :, None]).reshape(-1, m + len(v))
    curvature = flat.T @ flat
    grown = np.array([g.ravel() for _, g, _ in found]).reshape(len(which), s0.size)
    curvature[np.ix_(m + which, m + which)] += 0.5 * grown @ grown.T
    return gradient, curvature


def _climb(around: _Around, at: _Local, radius: float, active: Flags) -> _Local:
    """The maximum of the objective on a linearisation, from where it was made; ``active``: (q,) the sizes that are moved."""
    priors, c, v = around.priors, around.c, at.v
    m = len(c)
    reach = radius * priors.width
    least, most = (np.where(active, end, v) for end in around.sizes.limits)
    low = np.concatenate([np.maximum(priors.low, c - reach), least])
    high = np.concatenate([np.minimum(priors.high, c + reach), most])
    damping = 1e-6
    for _ in range(CLIMBS):
        gained, slopes = 0.0, _slopes(around, at, active)
        here = np.concatenate([at.c, at.v])
        for _ in range(8):
            step = _step(here, slopes.gradient, slopes.curvature, low, high, damping)
            step[m:] = np.clip(step[m:], -LARGEST_MOVE, LARGEST_MOVE)
            there = np.clip(here + step, low, high)
            trial = _local(around, there[:m], there[m:])
            if trial.value > at.value:
                gained = trial.value - at.value
                at, damping = trial, damping * 0.2
                break
            damping = max(damping, 1e-4) * 8.0
        if gained < 0.2 * SETTLED:
            break
    return at


def _matter(around: _Around, slopes: _Slopes, v: Array) -> Flags:
    """(q,) the sizes that matter to the likelihood at a point with all derivatives."""
    m = len(around.c)
    by_data = np.abs(slopes.gradient[m:] - around.sizes.slope(v))
    by_data += np.diag(slopes.curvature)[m:] - around.sizes.curvature(v)
    return np.asarray(by_data > DULL)


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
    none, every = np.zeros(len(v), dtype=bool), np.ones(len(v), dtype=bool)
    for level in levels:
        around = _around(problem, c, np.maximum(v, log(level)), None, known)
        at = _local(around, c, np.maximum(v, log(level)))
        c = _turns(problem, around, at, LEVEL_TURNS, hopeless, none)[1].c
    v = np.maximum(v, log(levels[-1])) if levels else v
    around = _around(problem, c, v, None, known)
    at = _local(around, c, v)
    slopes = _slopes(around, at, every)
    active = _matter(around, slopes, v)
    for _ in range(WAKENINGS):
        around, at = _turns(problem, around, at, turns, hopeless, active)
        slopes = _slopes(around, at, every)
        woken = _matter(around, slopes, at.v) & ~active
        if not woken.any():
            break
        active = active | woken
    return HypothesisFit(
        problem, at.c, at.v, at.log_likelihood, at.value - at.log_likelihood, slopes.curvature, tuple(around.linearised)
    )


def nearby(problem: HypothesisProblem, fitted: HypothesisFit, v: Array) -> HypothesisFit:
    """A problem with the numbers of a fitted one and other priors of sizes, from log sizes v, on the linearisations of that fit."""
    around = _Around(Priors.of(problem.numbers), problem.sizes, fitted.linearised, fitted.c)
    every = np.ones(len(v), dtype=bool)
    at = _local(around, fitted.c, v)
    at = _climb(around, at, FIRST_RADIUS, _matter(around, _slopes(around, at, every), v))
    slopes = _slopes(around, at, every)
    return HypothesisFit(problem, at.c, at.v, at.log_likelihood, at.value - at.log_likelihood, slopes.curvature, ())


def _turns(
    problem: HypothesisProblem,
    around: _Around,
    at: _Local,
    turns: int,
    hopeless: Callable[[float], bool],
    active: Flags,
) -> tuple[_Around, _Local]:
    """Turns of passing, linearising and climbing, within a radius that follows how well the last turn kept its promise."""
    radius = FIRST_RADIUS
    for _ in range(turns):
        there = _climb(around, at, radius, active)
        if there.value - at.value < SETTLED:
            break
        if hopeless(there.value) and np.all(np.abs(there.c - around.c) < 0.9 * radius * around.priors.width):
            break
        moved = _at(problem, around, there)
        ratio = -np.inf if moved is None else (moved[1].value - at.value) / (there.value - at.value)
        if ratio > 0.3:
            radius *= 2.0 if ratio > 0.7 else 1.0
        else:
            radius = 0.3 * min(radius, float(np.max(np.abs(there.c - at.c) / around.priors.width)))
        if ratio <= 0.0 or moved is None:
            if radius < LEAST_RADIUS:
                break
            continue
        gain = moved[1].value - at.value
        around, at = moved
        if gain < SETTLED:
            break
    return around, at


def _at(problem: HypothesisProblem, around: _Around, there: _Local) -> tuple[_Around, _Local] | None:
    """The problem linearised at another point, with the gains that suit it; None where the model cannot be run."""
    gains = []
    for lin in around.linearised:
        found = lin.run(np.exp(there.v), there.c - around.c, gain=True).gain
        assert found is not None
        gains.append(np.ascontiguousarray(found[:, : lin.along.states.shape[1]]))
    try:
        other = _around(problem, there.c, there.v, gains, around.linearised)
        return other, _local(other, there.c, there.v)
    except FloatingPointError:
        return None


def _around(problem: HypothesisProblem, c: Array, v: Array, gains: Sequence[Array] | None, known: Known) -> _Around:
    lins = linearise(problem, c, v, gains, known)
    return _Around(Priors.of(problem.numbers), problem.sizes, lins, c)
