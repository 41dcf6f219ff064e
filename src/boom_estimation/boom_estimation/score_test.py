"""The score test: what each effect would gain beside a fit, without being fitted."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import exp, log, pi, sqrt

import numpy as np
from numpy.typing import NDArray

from boom_estimation.linearising import pairs_of
from boom_estimation.numbers import Number, Priors
from boom_estimation.posterior import HypothesisFit
from boom_estimation.recursion import LinearisedPass, difference_columns, huber_weights
from boom_estimation.system import Pass, Values

Array = NDArray[np.float64]


@dataclass(frozen=True)
class SearchedEffect:
    """Physics that a machine may have.

    Attributes:
        id: as the system knows it. numbers: its own, in order.
        starts: values by name from which it is tried. neutral: values at which it does nothing, or nothing yet.
        leading: names of the numbers that a probe moves in proportion; the others give its shape.
        light: it brings no states, so that its derivative is known without a pass.
        wanders: its form is not exactly known; that of a sensor's is.
        log_odds: logarithm of its prior odds against nothing [nats].
    """

    id: str
    numbers: tuple[Number, ...]
    starts: tuple[Values, ...]
    neutral: Values
    leading: tuple[str, ...]
    light: bool
    wanders: bool
    log_odds: float


@dataclass(frozen=True)
class ProposedEffect:
    """What the score test expects of an effect: nats gained, the same of the evidence, and values to start from."""

    effect: str
    gain: float
    evidence: float
    values: dict[str, float]


def proposals(at: HypothesisFit, wanted: Sequence[SearchedEffect]) -> list[ProposedEffect]:
    """What each effect would gain beside a fit, the machine's numbers following; the best first."""
    probes = [(effect, start) for effect in wanted for start in effect.starts]
    if not probes:
        return []
    neutral = {k: v for effect in wanted if effect.light for k, v in effect.neutral.items()}
    test = _ScoreTest(at, probes, neutral)
    found: dict[str, ProposedEffect] = {}
    for k, (effect, start) in enumerate(probes):
        gain, share = test.gain(k)
        values = dict(start)
        for name in effect.leading:
            values[name] = effect.neutral[name] + share * (start[name] - effect.neutral[name])
        values, gain = _allowed(effect, start, values, share, gain)
        if effect.id not in found or found[effect.id].gain < gain:
            found[effect.id] = ProposedEffect(effect.id, gain, gain - _cost(effect, values, gain), values)
    return sorted(found.values(), key=lambda p: -p.gain)


def _cost(effect: SearchedEffect, values: Values, gain: float) -> float:
    """What the leading numbers' ranges cost the evidence (Laplace): log(range / (sqrt(2 pi) sigma)), sigma by the parabola."""
    cost = 0.0
    for n in effect.numbers:
        away = abs(values[n.name] - effect.neutral[n.name])
        if n.name in effect.leading and away > 0.0:
            sigma = away / sqrt(2.0 * max(gain, 0.5))
            if n.value is exp:
                sigma /= max(values[n.name], 1e-12)
            cost += max(0.0, log((n.high - n.low) / (sqrt(2.0 * pi) * max(sigma, 1e-12))))
    return cost


def _allowed(
    effect: SearchedEffect, start: Values, values: dict[str, float], share: float, gain: float
) -> tuple[dict[str, float], float]:
    """Values inside their ranges; what a proposal gains at the end of a range, by the parabola."""
    kept = 1.0
    for n in effect.numbers:
        if n.name in effect.leading and start[n.name] != effect.neutral[n.name]:
            low, high = n.value(n.low), n.value(n.high)
            held = float(np.clip(values[n.name], low, high))
            if held != values[n.name]:
                reached = (held - effect.neutral[n.name]) / (start[n.name] - effect.neutral[n.name])
                kept = min(kept, max(0.0, 1.0 - (1.0 - reached / share) ** 2) if share else 0.0)
                values[n.name] = held if reached else start[n.name] * 0.05 + effect.neutral[n.name] * 0.95
    return values, gain * kept


class _ScoreTest:
    """Innovations of a fit, with its numbers projected out."""

    def __init__(self, at: HypothesisFit, probes: Sequence[Probe], neutral: Values) -> None:
        normal, self._cross, score, self._power, self._slope = self._sums(at, probes, neutral)
        priors = Priors.of(at.problem.numbers)
        normal += np.diag(priors.precision + 1e-9)
        score = score - priors.precision * (at.c - priors.centre)
        free = (at.c > priors.low + 1e-9) & (at.c < priors.high - 1e-9)
        self._solve = np.zeros_like(normal)
        self._solve[np.ix_(free, free)] = np.linalg.inv(normal[np.ix_(free, free)])
        self._score = score

    def _sums(
        self, at: HypothesisFit, probes: Sequence[Probe], neutral: Values
    ) -> tuple[Array, Array, Array, Array, Array]:
        m, k = len(at.c), len(probes)
        normal, cross, score, power, slope = np.zeros((m, m)), np.zeros((m, k)), np.zeros(m), np.zeros(k), np.zeros(k)
        for lin in at.linearised:
            here, found = probed(at, lin, probes, neutral)
            omega = huber_weights(here)[:, :, None]
            own = found[:, :, :m]
            other = found[:, :, m:]
            flat, wide = (own * np.sqrt(omega)).reshape(-1, m), (other * np.sqrt(omega)).reshape(-1, k)
            w = (here[:, :, None] * np.sqrt(omega)).ravel()
            normal += flat.T @ flat
            cross += flat.T @ wide
            score -= flat.T @ w
            power += np.sum(wide * wide, axis=0)
            slope -= wide.T @ w
        return normal, cross, score, power, slope

    def gain(self, k: int) -> tuple[float, float]:
        """Nats gained by probe k in the right proportion, and the proportion."""
        c = self._cross[:, k]
        h = self._power[k] - c @ self._solve @ c
        g = self._slope[k] - c @ self._solve @ self._score
        if h <= 1e-9 * self._power[k] or h <= 0.0:
            return 0.0, 0.0
        return float(0.5 * g * g / h), float(g / h)


Probe = tuple[SearchedEffect, Values]
"""An effect and values at which it is looked at."""


def probed(at: HypothesisFit, lin: LinearisedPass, probes: Sequence[Probe], neutral: Values) -> tuple[Array, Array]:
    """Whitened innovations (n, NY) that count and their changes (n, NY, m + k): by the numbers of a fit, by each probe."""
    model = lin.model
    own = at.problem.values(at.c, model.name)
    values = {**neutral, **own}
    light = [probe for probe in probes if probe[0].light]
    passes = iter(pairs_of(model, values, [{**values, **start} for _, start in light], lin.pass_gain))
    base = model.observe(values, lin.pass_gain)
    pairs = [next(passes) if probe[0].light else (base, _heavy_pass(at, lin, probe, own)) for probe in probes]
    none = [pair if pair is not None and pair[1].complete else None for pair in pairs]
    changes = difference_columns(
        model.name, none, np.ones(len(probes)), lin.pass_gain, lin.pass_transition, lin.pass_output
    )
    filtered = lin.with_columns(changes).run(np.exp(at.v), by=True)
    assert filtered.by is not None
    return filtered.white[model.counted], filtered.by[model.counted]


def _heavy_pass(at: HypothesisFit, lin: LinearisedPass, probe: Probe, own: Values) -> Pass:
    """A pass with an effect that brings states; those are not corrected, and left out of what is compared."""
    names = lin.model.state_names
    system = at.problem.system
    k = system.experiments.index(lin.model.name)
    model = system.models((*at.problem.effects, probe[0].id))[k]
    gain = np.zeros((len(lin.pass_gain), len(model.state_names), lin.pass_gain.shape[2]))
    where = [model.state_names.index(name) for name in names]
    gain[:, where] = lin.pass_gain
    found = model.observe({**own, **probe[1]}, gain)
    return replace(found, states=np.ascontiguousarray(found.states[:, where]))
