"""Which effects explain the experiments: proposed by a score test, weighed by evidence.

A hypothesis is a set of effects and a set of places where physics is unknown. It is fitted from the best poorer one, whose
likelihood it must reach.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from boom_estimation.linearising import HypothesisProblem
from boom_estimation.numbers import Number, Priors, SizePriors
from boom_estimation.posterior import TURNS, HypothesisFit, best_start, fit
from boom_estimation.score_test import SearchedEffect, proposals
from boom_estimation.system import System, Values

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
class WeighedHypothesis:
    """A fitted hypothesis with its prior odds against the empty one [nats]."""

    hypothesis: Hypothesis
    fit: HypothesisFit
    log_prior: float

    @property
    def score(self) -> float:
        """Logarithm of the posterior, but for a constant [nats]."""
        return self.fit.evidence + self.log_prior


@dataclass
class Search:
    """Hypotheses for one system.

    Attributes:
        numbers: the machine's own, moved under every hypothesis.
    """

    system: System
    numbers: tuple[Number, ...]
    effects: tuple[SearchedEffect, ...]
    assumed: Assumed = field(default_factory=Assumed)
    report: Callable[[str], None] = lambda _: None
    weighed: dict[Hypothesis, WeighedHypothesis] = field(default_factory=dict)

    @cached_property
    def by_id(self) -> dict[str, SearchedEffect]:
        """The effects by id."""
        return {effect.id: effect for effect in self.effects}

    def problem(self, hypothesis: Hypothesis) -> HypothesisProblem:
        """The hypothesis as a problem."""
        effects = [self.by_id[effect] for effect in hypothesis.effects]
        numbers = (*self.numbers, *(n for effect in effects for n in effect.numbers))
        leading = {name: effect.neutral[name] for effect in effects for name in effect.leading if effect.wanders}
        wandering = tuple(k for k, n in enumerate(numbers) if n.name in leading)
        neutral = np.array([numbers[k].inner(leading[numbers[k].name]) for k in wandering])

        def scales(c: Array) -> Array:
            return np.asarray(np.abs(c[list(wandering)] - neutral))

        sizes = self._sizes(hypothesis, len(wandering))
        return HypothesisProblem(self.system, hypothesis.effects, numbers, sizes, wandering, scales)

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
        begin: HypothesisFit | None,
        values: Values | None = None,
        v: Array | None = None,
        turns: int = TURNS,
        own: bool = False,
    ) -> WeighedHypothesis:
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
        result = WeighedHypothesis(hypothesis, found, self.log_prior(hypothesis))
        before = self.weighed.get(hypothesis)
        if before is None or before.score < result.score:
            self.weighed[hypothesis] = result
        if begin is not None:
            self._best()
        self.report(f"{hypothesis.label}: {result.score:.1f} ({found.log_likelihood:.1f})")
        return self.weighed[hypothesis]

    def _sizes_from(self, problem: HypothesisProblem, v: Array) -> Array:
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

    def _start(self, problem: HypothesisProblem, begin: HypothesisFit | None, values: Values) -> Array:
        known = {} if begin is None else dict(zip((n.name for n in begin.problem.numbers), begin.c, strict=True))
        priors = Priors.of(problem.numbers)
        c = np.array([
            n.inner(values[n.name]) if n.name in values else known.get(n.name, 0.0) for n in problem.numbers
        ])  # fmt: skip
        return np.asarray(np.clip(c, priors.low, priors.high))

    def run(self) -> list[tuple[WeighedHypothesis, float]]:
        """The whole search: add, swap and drop, until no hypothesis weighed is likelier than the best."""
        best = self.weigh(Hypothesis(), None)
        for depth in range(MOST_EFFECTS):
            begin = best
            self._beside(begin, FITTED if depth == 0 else FITTED_BESIDE)
            best = self._settled()
            if best.hypothesis == begin.hypothesis:
                break
        return self.posterior()

    def _settled(self) -> WeighedHypothesis:
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

    def _best(self) -> WeighedHypothesis:
        """The likeliest; of the others the linearisations are let go, which are 100 MB a minute each."""
        best = max(self.weighed.values(), key=lambda w: w.score)
        for hypothesis, weighed in self.weighed.items():
            if weighed is not best and weighed.fit.linearised:
                self.weighed[hypothesis] = replace(weighed, fit=replace(weighed.fit, linearised=()))
        return best

    def _beside(self, at: WeighedHypothesis, count: int) -> None:
        """The likeliest effects beside those of a hypothesis, and unknown physics at each place."""
        own = at.hypothesis.effects
        others = [effect for effect in self.effects if effect.id not in own]
        proposed = proposals(at.fit, others)
        self.report("proposed: " + ", ".join(f"{p.effect} {p.gain:.1f}" for p in proposed[: count + 3]))
        for place in self.system.places:
            if place not in at.hypothesis.unknown:
                wider = Hypothesis(own, (*at.hypothesis.unknown, place))
                v = at.fit.v[: len(self.system.places)]
                wide = np.where([p == place for p in self.system.places], np.maximum(v, np.log(UNKNOWN_FROM)), v)
                self.weigh(wider, at.fit, v=wide, turns=1)
        taken = [p for p in proposed[:count] if p.gain > LEAST_GAIN]
        for proposal in taken:
            added = Hypothesis(tuple(sorted((*own, proposal.effect))), at.hypothesis.unknown)
            if added not in self.weighed:
                self.weigh(added, at.fit, proposal.values)
            if at.hypothesis.unknown:  # what it explains is not unknown
                alone = Hypothesis(added.effects)
                if alone not in self.weighed:
                    self.weigh(alone, at.fit, proposal.values)

    def posterior(self) -> list[tuple[WeighedHypothesis, float]]:
        """Everything that was weighed with its probability, the likeliest first."""
        ordered = sorted(self.weighed.values(), key=lambda w: -w.score)
        odds = np.exp(np.array([w.score for w in ordered]) - ordered[0].score)
        return list(zip(ordered, (odds / odds.sum()).tolist(), strict=True))
