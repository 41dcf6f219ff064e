"""Which effects explain the experiments: proposed by a score test, weighed by evidence.

A hypothesis is a set of effects and a set of places where physics is unknown. It is fitted from the best poorer one, whose
likelihood it must reach.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from boom_estimation.numbers import Number, Priors, SizePriors
from boom_estimation.posterior import TURNS, Fit, Problem, best_start, fit, pairs_of
from boom_estimation.recursion import Linearised, difference_columns, huber_weights
from boom_estimation.system import Pass, System, Values

Array = NDArray[np.float64]


SHARES = (1.0, 0.3, 0.05)
"""Of the size that the score test proposes, from which an effect is fitted: the best of them."""


MOST_EFFECTS = 3
FITTED, FITTED_BESIDE = 6, 4
"""Proposals that are fitted: alone, and beside effects."""
SETTLING, RIVALS, NEAR = 2, 3, 30.0
"""Times that the best one's rivals are fitted from where it is, how many of them, and how far behind they may be [nats]."""
LEVELS = (0.1, 0.02, 0.004)
"""Sizes of the discrepancies at which the numbers are fitted first."""
LEAST_GAIN = 1.0
"""Nats that a proposal must promise."""
UNKNOWN_FROM = 0.02
"""Size from which a discrepancy is fitted where physics is unknown."""


@dataclass(frozen=True)
class Effect:
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
class Assumed:
    """Numbers that decide, see ``assumptions`` of the diagnosis.

    Attributes:
        nothing: mean of a discrepancy's size where nothing is missing, over the place's scale.
        form: mean share by which an effect wanders about its size: none has exactly the form of the catalogue.
        unknown: median and spread of the logarithm of a discrepancy's size where physics is unknown.
        unknown_log_odds: prior odds of unknown physics at one place against nothing there [nats].
    """

    nothing: float = 7e-4
    form: float = 0.1
    unknown: tuple[float, float] = (0.1, 1.5)
    unknown_log_odds: float = -3.5


@dataclass(frozen=True)
class Hypothesis:
    """A set of effects and a set of places with unknown physics."""

    effects: tuple[str, ...] = ()
    unknown: tuple[str, ...] = ()

    @property
    def label(self) -> str:
        """In words."""
        parts = [*self.effects, *(f"unknown at {place}" for place in self.unknown)]
        return " + ".join(parts) or "nothing"


@dataclass(frozen=True)
class Weighed:
    """A fitted hypothesis with its prior odds against the empty one [nats]."""

    hypothesis: Hypothesis
    fit: Fit
    log_prior: float

    @property
    def score(self) -> float:
        """Logarithm of the posterior, but for a constant [nats]."""
        return self.fit.evidence + self.log_prior


@dataclass(frozen=True)
class Proposal:
    """What the score test expects of an effect: nats gained, and values to start from."""

    effect: str
    gain: float
    values: dict[str, float]


@dataclass
class Search:
    """Hypotheses for one system.

    Attributes:
        numbers: the machine's own, moved under every hypothesis.
    """

    system: System
    numbers: tuple[Number, ...]
    effects: tuple[Effect, ...]
    assumed: Assumed = field(default_factory=Assumed)
    report: Callable[[str], None] = lambda _: None
    weighed: dict[Hypothesis, Weighed] = field(default_factory=dict)

    @cached_property
    def by_id(self) -> dict[str, Effect]:
        """The effects by id."""
        return {effect.id: effect for effect in self.effects}

    def problem(self, hypothesis: Hypothesis) -> Problem:
        """The hypothesis as a problem."""
        effects = [self.by_id[effect] for effect in hypothesis.effects]
        numbers = (*self.numbers, *(n for effect in effects for n in effect.numbers))
        leading = {name: effect.neutral[name] for effect in effects for name in effect.leading if effect.wanders}
        wandering = tuple(k for k, n in enumerate(numbers) if n.name in leading)
        neutral = np.array([numbers[k].inner(leading[numbers[k].name]) for k in wandering])

        def scales(c: Array) -> Array:
            return np.asarray(np.abs(c[list(wandering)] - neutral))

        sizes = self._sizes(hypothesis, len(wandering))
        return Problem(self.system, hypothesis.effects, numbers, sizes, wandering, scales)

    def _sizes(self, hypothesis: Hypothesis, wandering: int) -> SizePriors:
        places = self.system.places
        unknown = np.array([place in hypothesis.unknown for place in places] + [False] * wandering)
        mean = np.array([self.assumed.nothing] * len(places) + [self.assumed.form] * wandering)
        median, spread = self.assumed.unknown
        return SizePriors(
            np.where(unknown, np.nan, mean), np.where(unknown, median, np.nan), np.full(len(mean), spread)
        )

    def log_prior(self, hypothesis: Hypothesis) -> float:
        """Of a hypothesis against the empty one [nats]."""
        return (
            sum(self.by_id[effect].log_odds for effect in hypothesis.effects)
            + len(hypothesis.unknown) * self.assumed.unknown_log_odds
        )  # fmt: skip

    def weigh(
        self,
        hypothesis: Hypothesis,
        begin: Fit | None,
        values: Values | None = None,
        v: Array | None = None,
        turns: int = TURNS,
        own: bool = False,
    ) -> Weighed:
        """Fits a hypothesis from another one, with ``values`` of what it has beyond; ``own``: these are its own, as they are."""
        problem = self.problem(hypothesis)
        if v is None:
            v = np.full(len(self.system.places), np.log(self.assumed.nothing)) if begin is None else begin.v
        v = self._sizes_from(problem, np.maximum(v, np.log(self.assumed.nothing)))
        effects = {n.name for effect in hypothesis.effects for n in self.by_id[effect].numbers}
        wanted = {name: value for name, value in (values or {}).items() if name in effects}
        points = [
            self._start(problem, begin, nearer) for nearer in ([wanted] if own else self._nearer(hypothesis, wanted))
        ]
        known = None if begin is None else begin.linearised
        start = best_start(problem, points, v, known)
        found = fit(problem, start, v, levels=LEVELS if begin is None else (), turns=turns, known=known)
        result = Weighed(hypothesis, found, self.log_prior(hypothesis))
        before = self.weighed.get(hypothesis)
        if before is None or before.score < result.score:
            self.weighed[hypothesis] = result
        if begin is not None:
            self._best()
        self.report(f"{hypothesis.label}: {result.score:.1f} ({found.log_likelihood:.1f})")
        return self.weighed[hypothesis]

    def _sizes_from(self, problem: Problem, v: Array) -> Array:
        """Log sizes to start from: those of the places, and of each number that wanders."""
        places = len(self.system.places)
        return np.concatenate([v[:places], np.full(len(problem.wandering), np.log(0.5 * self.assumed.form))])

    def _nearer(self, hypothesis: Hypothesis, values: Values) -> list[dict[str, float]]:
        """Values to start from: as they are, and with what leads closer to nothing."""
        leading = {name for effect in hypothesis.effects for name in self.by_id[effect].leading}
        neutral = self._without(hypothesis)
        if not any(name in leading for name in values):
            return [dict(values)]
        return [
            {k: neutral[k] + share * (v - neutral[k]) if k in leading else v for k, v in values.items()} for share in SHARES
        ]  # fmt: skip

    def _without(self, hypothesis: Hypothesis) -> dict[str, float]:
        return {k: v for effect in hypothesis.effects for k, v in self.by_id[effect].neutral.items()}

    def _start(self, problem: Problem, begin: Fit | None, values: Values) -> Array:
        known = {} if begin is None else dict(zip((n.name for n in begin.problem.numbers), begin.c, strict=True))
        priors = Priors.of(problem.numbers)
        c = np.array([
            n.inner(values[n.name]) if n.name in values else known.get(n.name, 0.0) for n in problem.numbers
        ])  # fmt: skip
        return np.asarray(np.clip(c, priors.low, priors.high))

    def run(self) -> list[tuple[Weighed, float]]:
        """The whole search: add, swap and drop, until no hypothesis weighed is likelier than the best."""
        best = self.weigh(Hypothesis(), None)
        for depth in range(MOST_EFFECTS):
            begin = best
            self._beside(begin, FITTED if depth == 0 else FITTED_BESIDE)
            best = self._settled()
            if best.hypothesis == begin.hypothesis:
                break
        return self.posterior()

    def _settled(self) -> Weighed:
        """The best hypothesis, once those near it were fitted from where it is, too: all know the same valley then."""
        for _ in range(SETTLING):
            best = self._best()
            rivals = sorted(self.weighed.values(), key=lambda w: -w.score)
            near = [w.hypothesis for w in rivals[1:] if w.score > best.score - NEAR][:RIVALS]
            less = [
                Hypothesis(tuple(e for e in best.hypothesis.effects if e != effect), best.hypothesis.unknown)
                for effect in best.hypothesis.effects
            ]  # fmt: skip
            for hypothesis in dict.fromkeys([*less, *near]):
                known = self.weighed.get(hypothesis)
                self.weigh(
                    hypothesis,
                    best.fit,
                    {} if known is None else known.fit.values(self.system.experiments[0]),
                    own=True,
                )
            if self._best().hypothesis == best.hypothesis:
                break
        return self._best()

    def _best(self) -> Weighed:
        """The likeliest; of the others the linearisations are let go, which are 100 MB a minute each."""
        best = max(self.weighed.values(), key=lambda w: w.score)
        for hypothesis, weighed in self.weighed.items():
            if weighed is not best and weighed.fit.linearised:
                self.weighed[hypothesis] = replace(weighed, fit=replace(weighed.fit, linearised=()))
        return best

    def _beside(self, at: Weighed, count: int) -> None:
        """The likeliest effects beside those of a hypothesis, and unknown physics at each place."""
        own = at.hypothesis.effects
        others = [effect for effect in self.effects if effect.id not in own]
        proposals = self.proposals(at.fit, others)
        self.report("proposed: " + ", ".join(f"{p.effect} {p.gain:.1f}" for p in proposals[: count + 3]))
        for place in self.system.places:
            if place not in at.hypothesis.unknown:
                wider = Hypothesis(own, (*at.hypothesis.unknown, place))
                v = at.fit.v[: len(self.system.places)]
                wide = np.where([p == place for p in self.system.places], np.maximum(v, np.log(UNKNOWN_FROM)), v)
                self.weigh(wider, at.fit, v=wide, turns=1)
        taken = [p for p in proposals[:count] if p.gain > LEAST_GAIN]
        for proposal in taken:
            added = Hypothesis(tuple(sorted((*own, proposal.effect))), at.hypothesis.unknown)
            if added not in self.weighed:
                self.weigh(added, at.fit, proposal.values)
            if at.hypothesis.unknown:  # what it explains is not unknown
                alone = Hypothesis(added.effects)
                if alone not in self.weighed:
                    self.weigh(alone, at.fit, proposal.values)

    def proposals(self, at: Fit, wanted: Sequence[Effect]) -> list[Proposal]:
        """The score test at a fit: what each effect would gain, the machine's numbers following; the best first."""
        probes = [(effect, start) for effect in wanted for start in effect.starts]
        if not probes:
            return []
        test = _ScoreTest(at, probes, self._neutral(wanted))
        found: dict[str, Proposal] = {}
        for k, (effect, start) in enumerate(probes):
            gain, share = test.gain(k)
            values = dict(start)
            for name in effect.leading:
                values[name] = effect.neutral[name] + share * (start[name] - effect.neutral[name])
            values, gain = _allowed(effect, start, values, share, gain)
            if effect.id not in found or found[effect.id].gain < gain:
                found[effect.id] = Proposal(effect.id, gain, values)
        return sorted(found.values(), key=lambda p: -p.gain)

    def _neutral(self, wanted: Sequence[Effect]) -> dict[str, float]:
        return {k: v for effect in wanted if effect.light for k, v in effect.neutral.items()}

    def posterior(self) -> list[tuple[Weighed, float]]:
        """Everything that was weighed with its probability, the likeliest first."""
        ordered = sorted(self.weighed.values(), key=lambda w: -w.score)
        odds = np.exp(np.array([w.score for w in ordered]) - ordered[0].score)
        return list(zip(ordered, (odds / odds.sum()).tolist(), strict=True))


def _allowed(
    effect: Effect, start: Values, values: dict[str, float], share: float, gain: float
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

    def __init__(self, at: Fit, probes: Sequence[Probe], neutral: Values) -> None:
        normal, self._cross, score, self._power, self._slope = self._sums(at, probes, neutral)
        priors = Priors.of(at.problem.numbers)
        normal += np.diag(priors.precision + 1e-9)
        score = score - priors.precision * (at.c - priors.centre)
        free = (at.c > priors.low + 1e-9) & (at.c < priors.high - 1e-9)
        self._solve = np.zeros_like(normal)
        self._solve[np.ix_(free, free)] = np.linalg.inv(normal[np.ix_(free, free)])
        self._score = score

    def _sums(self, at: Fit, probes: Sequence[Probe], neutral: Values) -> tuple[Array, Array, Array, Array, Array]:
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


Probe = tuple[Effect, Values]
"""An effect and values at which it is looked at."""


def probed(at: Fit, lin: Linearised, probes: Sequence[Probe], neutral: Values) -> tuple[Array, Array]:
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


def _heavy_pass(at: Fit, lin: Linearised, probe: Probe, own: Values) -> Pass:
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
