"""Which effects explain the experiments: proposed by a score test, weighed by evidence.

A hypothesis is a set of effects and a set of places where physics is unknown. It is fitted from the best poorer one, whose
likelihood it must reach.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from boom_estimation.linearising import HypothesisProblem
from boom_estimation.numbers import Number, Priors, SizePriors
from boom_estimation.posterior import HypothesisFit, fit, nearby
from boom_estimation.score_test import SearchedEffect, proposals
from boom_estimation.system import System, Values

Array = NDArray[np.float64]


SHARES = (1.0, 0.3, 0.05)
"""Of the size that the score test proposes, from which an effect is fitted: the first that leads to more than nothing."""


MOST_EFFECTS, ROUNDS = 3, 5
"""Effects and places of a hypothesis, rounds of the search."""
FITTED, FITTED_BESIDE = 6, 4
"""Proposals that are fitted: alone, and beside effects."""
SETTLING, RIVALS, NEAR = 2, 3, 30.0
"""Times that the best one's rivals are fitted from where it is, how many of them, and how far behind they may be [nats]."""
LEVELS = (0.02,)
"""Sizes of the discrepancies at which the numbers are fitted first."""
WORTH = 3.0
"""Nats: a hypothesis that promises to stay this far behind the likeliest is not fitted."""
UNDERRATED = 3.0
"""Times that what an effect gains may be more than a score test promised, which sees it as linear."""
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
    _begun: dict[Hypothesis, tuple[Hypothesis, float]] = field(default_factory=dict)

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
        most = np.array([np.inf] * len(places) + [0.0] * wandering)  # a form's error is no larger than the effect
        return SizePriors(
            np.where(unknown, np.nan, mean), np.where(unknown, median, np.nan), np.full(len(mean), spread), most
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
        own: bool = False,
    ) -> WeighedHypothesis:
        """Fits a hypothesis from another one, with ``values`` of what it has beyond; ``own``: these are its own, as they are.

        The fit ends where it cannot come near the likeliest one any more.

        Raises:
            FloatingPointError: the model cannot be run with it.
        """
        problem = self.problem(hypothesis)
        if v is None:
            v = np.full(len(self.system.places), np.log(self.assumed.nothing)) if begin is None else begin.v
        v = self._sizes_from(problem, np.maximum(v, np.log(self.assumed.nothing)))
        effects = {n.name for effect in hypothesis.effects for n in self.by_id[effect].numbers}
        wanted = {name: value for name, value in (values or {}).items() if name in effects}
        if begin is None:
            found = fit(problem, self._start(problem, None, wanted), v, levels=LEVELS)
            return self._kept(WeighedHypothesis(hypothesis, found, self.log_prior(hypothesis)))
        least = self._best().score - WORTH - self.log_prior(hypothesis) - (begin.evidence - begin.objective)
        tried = list[HypothesisFit]()
        for nearer in [wanted] if own else self._nearer(hypothesis, wanted):
            start = self._start(problem, begin, nearer)
            with suppress(FloatingPointError):  # as far off as that no machine runs
                tried.append(fit(problem, start, v, hopeless=lambda promised: promised < least, known=begin.linearised))
                if tried[-1].log_likelihood > begin.log_likelihood:
                    break
        if not tried:
            raise FloatingPointError(f"the model cannot be run with {hypothesis.label}")
        found = max(tried, key=lambda at: at.objective)
        return self._kept(WeighedHypothesis(hypothesis, found, self.log_prior(hypothesis)))

    def _weighed(self, *args: Any, **how: Any) -> None:
        """As ``weigh``; a hypothesis with which no machine runs is none."""
        with suppress(FloatingPointError):
            self.weigh(*args, **how)

    def _kept(self, result: WeighedHypothesis) -> WeighedHypothesis:
        """The better of what is known of a hypothesis."""
        before = self.weighed.get(result.hypothesis)
        if before is None or before.score < result.score:
            self.weighed[result.hypothesis] = result
        self._best()
        self.report(f"{result.hypothesis.label}: {result.score:.1f} ({result.fit.log_likelihood:.1f})")
        return self.weighed[result.hypothesis]

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
        for depth in range(ROUNDS):
            begin = best
            self._beside(begin, FITTED if depth == 0 else FITTED_BESIDE)
            best = self._settled()
            if best.hypothesis == begin.hypothesis and best.score < begin.score + WORTH:
                break
        return self.posterior()

    def _settled(self) -> WeighedHypothesis:
        """The best hypothesis, once those near it and those without one of its parts were fitted from where it is, too.

        All know the same valley then.
        """
        for _ in range(SETTLING):
            best = self._best()
            rivals = sorted(self.weighed.values(), key=lambda w: -w.score)
            near = [w.hypothesis for w in rivals[1:] if w.score > best.score - NEAR][:RIVALS]
            for hypothesis in dict.fromkeys([*self._less(best.hypothesis), *near]):
                if self._begun.get(hypothesis) != (best.hypothesis, best.score):
                    self._begun[hypothesis] = (best.hypothesis, best.score)
                    known = self.weighed.get(hypothesis)
                    values = {} if known is None else known.fit.values(self.system.experiments[0])
                    self._weighed(hypothesis, best.fit, values, own=True)
            if self._best().hypothesis == best.hypothesis:
                break
        return self._best()

    def _less(self, hypothesis: Hypothesis) -> list[Hypothesis]:
        """It without one of its parts."""
        effects, unknown = hypothesis.effects, hypothesis.unknown
        return [
            *(Hypothesis(tuple(e for e in effects if e != effect), unknown) for effect in effects),
            *(Hypothesis(effects, tuple(p for p in unknown if p != place)) for place in unknown),
        ]

    def _best(self) -> WeighedHypothesis:
        """The likeliest; of the others the linearisations are let go, which are 100 MB a minute each."""
        best = max(self.weighed.values(), key=lambda w: w.score)
        for hypothesis, weighed in self.weighed.items():
            if weighed is not best and weighed.fit.linearised:
                self.weighed[hypothesis] = replace(weighed, fit=replace(weighed.fit, linearised=()))
        return best

    def _beside(self, at: WeighedHypothesis, count: int) -> None:
        """Unknown physics at each place and effects beside those of a hypothesis, where they may be the likeliest of all."""
        own = at.hypothesis.effects
        if len(own) + len(at.hypothesis.unknown) >= MOST_EFFECTS:
            return
        proposed = proposals(at.fit, [effect for effect in self.effects if effect.id not in own])[:count]
        self.report("proposed: " + ", ".join(f"{p.effect} {p.gain:.1f} ({p.evidence:.1f})" for p in proposed))
        wider = [self._wider(at, place) for place in self.system.places if place not in at.hypothesis.unknown]
        for proposal in proposed:
            added = Hypothesis(tuple(sorted((*own, proposal.effect))), at.hypothesis.unknown)
            for hypothesis in dict.fromkeys([added, Hypothesis(added.effects)]):  # what it explains is not unknown
                gain = proposal.evidence + self.log_prior(hypothesis) - at.log_prior
                if hypothesis not in self.weighed and self._worth(at, gain):
                    self._begun[hypothesis] = (at.hypothesis, at.score)
                    self._weighed(hypothesis, at.fit, proposal.values)
        for found in wider:
            if self._worth(at, found.score - at.score):
                self._weighed(found.hypothesis, at.fit, v=found.fit.v)

    def _worth(self, at: WeighedHypothesis, gain: float) -> bool:
        """Whether what promises so much over a hypothesis may come near the likeliest."""
        return gain > (self._best().score - at.score) / UNDERRATED - WORTH

    def _wider(self, at: WeighedHypothesis, place: str) -> WeighedHypothesis:
        """What unknown physics at one more place promises beside a fitted hypothesis, on its own linearisation."""
        hypothesis = Hypothesis(at.hypothesis.effects, (*at.hypothesis.unknown, place))
        v = at.fit.v.copy()
        k = self.system.places.index(place)
        v[k] = max(v[k], np.log(UNKNOWN_FROM))
        found = WeighedHypothesis(hypothesis, nearby(self.problem(hypothesis), at.fit, v), self.log_prior(hypothesis))
        self.report(f"{hypothesis.label} promises {found.score - at.score:.1f}")
        return found

    def posterior(self) -> list[tuple[WeighedHypothesis, float]]:
        """Everything that was weighed with its probability, the likeliest first."""
        ordered = sorted(self.weighed.values(), key=lambda w: -w.score)
        odds = np.exp(np.array([w.score for w in ordered]) - ordered[0].score)
        return list(zip(ordered, (odds / odds.sum()).tolist(), strict=True))
