"""A diagnosis by one likelihood: what is diagnosed, the hypotheses that were weighed, and the fits that prove the likeliest."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from boom_diagnosis.assumptions import EFFECT_LOG_ODDS, SIZES
from boom_diagnosis.bag_samples import OTHER_POSE, Bag, prepare
from boom_diagnosis.case import case_of
from boom_diagnosis.crane_system import CraneSystem, catalogue_effects, tolerance_numbers
from boom_diagnosis.fitting import WHITE, Point, Problem
from boom_diagnosis.freerun import Elsewhere
from boom_diagnosis.healthy import simulated
from boom_diagnosis.hypotheses import LOOSENESS, problem_at
from boom_diagnosis.learning import Learned, Setting
from boom_diagnosis.nuisances import Nuisance
from boom_diagnosis.onset import own, time_in
from boom_diagnosis.prediction import mean_squares
from boom_diagnosis.weighed_numbers import distinct
from boom_estimation.posterior import HypothesisFit, fit
from boom_estimation.search import Hypothesis, Search, WeighedHypothesis
from boom_model.machine import Machine, Pose
from boom_model.sensors import OUTPUTS

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

TRAINING_TURNS = 4
"""Passes of a fit to the data for training alone, from the one to all data."""
FITS = 12.0
"""Fits after which a search is two thirds done, as the progress counts it."""


@dataclass
class WeighedCase:
    """What is diagnosed, and what the search weighed.

    Attributes:
        pose: of the first recording. bags: fitted. proving: not fitted at all.
        select: samples that count, per bag; training, judged: two parts of them. Without recordings that are held out the
            second is the end of each recording, else it is empty.
        elsewhere: blocks of long recordings that only the proof looks at.
        weighed: every hypothesis with its probability, the likeliest first.
        named: effects of the likeliest one, what gains most first.
        base, last: the likeliest machine without effects, and with them. trained: the same, then with the first, the first two
            effects, ..., fitted to ``training`` alone.
        floor: loss per innovation of a healthy machine with the same currents; healthy: its recordings.
        own: as of ``case.Case``. learned: a term that explains what is unknown.
    """

    machine: Machine
    pose: Pose
    bags: list[Bag]
    proving: list[Bag]
    select: list[Flags]
    training: list[Flags]
    judged: list[Flags]
    nuisances: tuple[Nuisance, ...]
    seed: int
    elsewhere: tuple[Elsewhere, ...] = ()
    weighed: list[tuple[WeighedHypothesis, float]] = field(default_factory=list)
    named: tuple[str, ...] = ()
    trained: list[Point] = field(default_factory=list)
    floor: float = WHITE
    healthy: list[Bag] = field(default_factory=list)
    healthy_squares: Array = field(default_factory=lambda: np.ones(len(OUTPUTS)))
    twin: bool = False
    own: dict[str, float] = field(default_factory=dict)
    learned: Learned | None = None
    others: Mapping[str, Pose] = field(default_factory=dict)

    @property
    def best(self) -> WeighedHypothesis:
        """The likeliest hypothesis."""
        return self.weighed[0][0]

    def found(self, effects: Sequence[str], unknown: Sequence[str] = ()) -> WeighedHypothesis | None:
        """A hypothesis, if it was weighed."""
        wanted = Hypothesis(tuple(sorted(effects)), tuple(unknown))
        return next((w for w, _ in self.weighed if w.hypothesis == wanted), None)

    def values(self, z: Array, effects: Mapping[str, float]) -> dict[str, float]:
        """Components of the parameter vector."""
        return self._plain.values(z, effects)

    numbers = values

    def everywhere(self, at: Point) -> Array:
        """z: all recordings are fitted."""
        return at.z

    @cached_property
    def _plain(self) -> Problem:
        return self.problem(np.zeros(len(self.nuisances)), {}, LOOSENESS[0])

    def problem(self, z: Array, effects: Mapping[str, float], looseness: float) -> Problem:
        """Of all recordings that are fitted, with the observers' gains of this point."""
        return problem_at(self.machine, self.bags, self.select, self.nuisances, z, effects, looseness)

    def point(self, at: HypothesisFit) -> Point:
        """A fit as the observer that is right for a healthy machine sees it."""
        return self.seen(at.c[: len(self.nuisances)], effect_values(at))

    def seen(self, z: Array, effects: Mapping[str, float]) -> Point:
        """Numbers as that observer sees them."""
        return self.problem(z, effects, LOOSENESS[0]).points([(z, dict(effects))])[0]

    @cached_property
    def nominal(self) -> Point:
        """The machine as given."""
        return self.seen(np.zeros(len(self.nuisances)), {})

    @cached_property
    def base(self) -> Point:
        """The machine with the numbers that explain most without an effect."""
        alone = self.found(())
        assert alone is not None  # every search begins with it
        return self.point(alone.fit)

    @cached_property
    def last(self) -> Point:
        """The likeliest machine."""
        return self.point(self.best.fit)

    @cached_property
    def setting(self) -> Setting:
        """What a term is learnt from, with the observer that is likeliest for what the effects leave."""
        at = self.trained[-1]

        def likelihood(looseness: float) -> float:
            problem = self.problem(at.z, at.effects, looseness)
            return problem.likelihood_at(at.z, at.effects)

        looseness = max(LOOSENESS, key=likelihood)
        return Setting(self.machine, self.bags, self.training, self.judged, self.nuisances, self.proving, looseness)


def effect_values(at: HypothesisFit) -> dict[str, float]:
    """The numbers of a fit's effects by dotted name."""
    return {name: value for name, value in at.values().items() if name.startswith("effects.")}


def searched(case: WeighedCase, progress: Callable[[str, float], None]) -> None:
    """Weighs the hypotheses, and fits the likeliest to the data for training."""
    prepared = (prepare(bag.recording, case.machine, aligned=True) for bag in case.bags)
    aligned = [bag for bag in prepared if bag is not None]
    system = CraneSystem(case.machine, aligned)
    longest = max(bag.recording.duration for bag in case.bags)
    done = 0

    def report(text: str) -> None:
        nonlocal done
        done += 1
        progress(text.partition(":")[0], 0.75 * done / (done + FITS / 2.0))

    numbers = tolerance_numbers(system.nuisances)
    search = Search(system, numbers, catalogue_effects(case.machine, longest, EFFECT_LOG_ODDS), SIZES, report)
    progress("the machine's own numbers", 0.0)
    search.run()
    case.weighed = _answers(search)
    case.named = _order(case)
    for k in range(1, len(case.named)):  # what the ladder shows was weighed, too
        if case.found(case.named[:k]) is None:
            search.weigh(Hypothesis(tuple(sorted(case.named[:k]))), case.best.fit, case.best.fit.values(), own=True)
            case.weighed = [*case.weighed, (search.weighed[Hypothesis(tuple(sorted(case.named[:k])))], 0.0)]
    progress("proving", 0.75)
    _calibrate(case)
    _train(case, system)


def _answers(search: Search) -> list[tuple[WeighedHypothesis, float]]:
    """The hypotheses whose effects differ from doing nothing, with their probabilities: others are poorer ones once more."""
    told = [(w, p) for w, p in search.posterior() if distinct(w.fit)]
    whole = sum(p for _, p in told)
    if whole <= 0.0:  # all that is likely does nothing
        best = max(w.score for w, _ in told)
        odds = [float(np.exp(w.score - best)) for w, _ in told]
        return [(w, p / sum(odds)) for (w, _), p in zip(told, odds, strict=True)]
    return [(w, p / whole) for w, p in told]


def _order(case: WeighedCase) -> tuple[str, ...]:
    """The effects of the likeliest hypothesis: first what gains most alone, then what gains most beside it."""
    left, taken = list(case.best.hypothesis.effects), list[str]()

    def reached(effect: str) -> float:
        known = [w.fit.log_likelihood for w, _ in case.weighed if set(w.hypothesis.effects) == {*taken, effect}]
        return max(known, default=-np.inf)

    while left:
        first = max(left, key=reached)
        taken.append(first)
        left.remove(first)
    return tuple(taken)


def _train(case: WeighedCase, system: CraneSystem) -> None:
    """The likeliest machine without effects, with the first, the first two, ..., fitted to the data for training alone."""
    part = system if case.proving else system.counting(case.training)
    for k in range(len(case.named) + 1):
        known = case.best if k == len(case.named) else case.found(case.named[:k])
        assert known is not None  # see ``searched``
        at = known.fit
        if part is not system:
            at = fit(replace(at.problem, system=part), at.c, at.v, turns=TRAINING_TURNS, known=at.linearised or None)
        case.trained.append(case.seen(at.c[: len(case.nuisances)], effect_values(at)))
    if case.proving and time_in(case.last.effects):
        z, effects = case.trained[-1].z, case.trained[-1].effects
        select = [bag.counted for bag in case.proving]
        case.own = own(problem_at(case.machine, case.proving, select, case.nuisances, z, effects, 1.0), z, effects)


def _calibrate(case: WeighedCase) -> None:
    """The loss of a healthy machine with the same currents; that of white noise where none gets far with them."""
    made = [
        simulated(bag, case.machine, case.values(case.base.z, {}), case.seed + 1 + i) for i, bag in enumerate(case.bags)
    ]
    case.healthy = [copy or bag for copy, bag in zip(made, case.bags, strict=True)]
    known = [copy for copy in made if copy is not None]
    if not known:
        return
    case.twin = True
    select = [bag.counted for bag in known]
    zero = np.zeros(len(case.nuisances))
    problem = problem_at(case.machine, known, select, case.nuisances, zero, {}, LOOSENESS[0])
    exact = problem.predictor.predict([case.values(case.base.z, {})])[0]
    case.healthy_squares = mean_squares([r.whitened for r in exact], select)
    case.floor = float(0.5 * np.mean(case.healthy_squares))


def weighed_case_of(machine: Machine, bags: Sequence[Bag], proving: Sequence[Bag], seed: int) -> WeighedCase:
    """The case of recordings, before anything is searched; see ``case.case_of``."""
    c = case_of(machine, bags, proving, seed)
    # a difference has the name of an effect's number, which it weighs; moments of other poses stay
    own = tuple(n for n in c.nuisances if not n.difference and OTHER_POSE not in n.name)
    return WeighedCase(machine, c.pose, c.bags, c.proving, c.select, c.training, c.judged, own, seed)
