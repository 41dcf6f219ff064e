"""A search begun again with other effects where much is left: of two that hide one another neither comes first alone."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from math import log

import numpy as np

from boom_diagnosis.case import Case
from boom_diagnosis.coordinates import all_coordinates
from boom_diagnosis.earning import WORSE, settle, temperature
from boom_diagnosis.fitting import Point
from boom_diagnosis.hypotheses import GLANCED, LOOSENESS
from boom_diagnosis.parallel import in_parallel
from boom_diagnosis.proof import worsening
from boom_diagnosis.rounds import FAR, Alone, Progress, rounds, taken_anew
from boom_diagnosis.weighing import Weighed

BEGUN = 3
"""Effects that the search is begun with anew where what was found leaves much."""
MOST = 0.5
"""Share of what the nominal machine leaves that such an effect must explain alone: with what hides beside it it explains all."""


def begun_elsewhere(case: Case, progress: Progress) -> None:
    """The search begun with other effects, where what was found leaves much, or where another serves better beside the later ones.

    Of two that hide one another neither is what explains most alone. The likelier search is kept.
    """
    if case.rest(case.last) < FAR and len(case.taken) < 2:
        return
    progress("other first effects", 0.0)
    for effect, values in _first_effects(case):
        if effect in case.named or (case.rest(case.last) < FAR and not _serves_better(case, effect, values)):
            continue
        before = case.kept_back()
        earned = taken_anew(case, _from_nominal(case, effect, values))
        borne = None if earned else _taken_for_now(case)
        if case.taken:
            rounds(case, progress, begun=True)
        if case.taken and case.taken[0] is borne:
            _weighed_together(case)
        proved = len(case.taken) > (0 if earned else 1) and worsening(case, case.trained[0], case.trained[-1]) <= WORSE
        if not proved or not _likelier(case, (_fitted_on(case), case.named), (_fitted_on(before), before.named)):
            case.go_back(before)


def _fitted_on(case: Case) -> Point:
    """All that was taken, fitted once more: the tolerances may go back from where they made up for what was found last."""
    at = case.last
    problem = case.problem(at.z, at.effects, case.rounds[-1].problem.predictor.looseness)
    (start,) = problem.points([(at.z, at.effects)])
    return problem.fit(start, problem.nuisance_jacobian(start), all_coordinates(case.named, case.size))[0]


def _taken_for_now(case: Case) -> Weighed | None:
    """An effect that alone does not earn its place, taken nevertheless. What is found beside it decides."""
    for weighed in [*case.disproved, *case.weighed[0]][:1]:
        f = weighed.fitted
        case.taken.append(weighed)
        case.trained.append(settle(case, 1, case.rounds[0].problem, f.point, f.jacobian, f.coordinates))
        case.weighed[0] = [weighed]
        case.disproved.clear()
    return case.taken[0] if case.taken else None


def _weighed_together(case: Case) -> None:
    """A first effect that was borne with counts by what all explain together."""
    gain, held_out, cost = (sum(v) for v in zip(*((w.gain, w.held_out_gain, w.cost) for w in case.taken), strict=True))
    case.taken[0] = replace(case.taken[0], gain=gain, held_out_gain=held_out, cost=cost)
    case.weighed[0] = [case.taken[0]]


def _serves_better(case: Case, effect: str, values: Mapping[str, float]) -> bool:
    """Whether an effect is likelier than the first one beside those that were found after it."""
    last, effects = case.last, (effect, *case.named[1:])
    names = all_coordinates(effects, case.size)
    beside = {c.name: last.effects.get(c.name, values.get(c.name, 0.0)) for c in names}
    problem = case.problem(last.z, last.effects, case.rounds[-1].problem.predictor.looseness)
    start = min(problem.points([(np.zeros(len(case.nuisances)), beside), (last.z, beside)]), key=lambda p: p.loss)
    point, _ = problem.fit(start, problem.nuisance_jacobian(start), names)
    return _likelier(case, (point, effects), (last, case.named))


def _likelier(case: Case, *two: tuple[Point, Sequence[str]]) -> bool:
    """Whether the first of two points, with its effects, is likelier, as sure as what is left at the better one lets that be."""
    problems = [case.problem(at.z, at.effects, LOOSENESS[0]) for at, _ in two]
    seen = [p.points([(at.z, at.effects)])[0] for p, (at, _) in zip(problems, two, strict=True)]
    sure = temperature(case, min(seen, key=lambda p: p.loss))
    one, other = (
        p.likelihood(at) / sure - _price(case, effects, at)
        for p, at, (_, effects) in zip(problems, seen, two, strict=True)
    )
    return one > other


def _price(case: Case, effects: Sequence[str], at: Point) -> float:
    """Nats that effects cost at a point: log n / 2 for each of their numbers."""
    return 0.5 * log(int(at.used.sum())) * len(all_coordinates(effects, case.size))


def _first_effects(case: Case) -> list[tuple[str, Mapping[str, float]]]:
    """Effects, and their numbers, that explain ``MOST`` with all tolerances at their nominal values, the likeliest first.

    Nats count by those that the best leaves per innovation, one at least.
    """
    first = case.nominal

    def fitted(effect: str) -> Point:
        begun = first.problem.points([(first.at.z, candidate.values) for candidate in first.seen[effect]])
        start = min(begun, key=lambda p: p.loss)
        return first.problem.fit_nominal(start.effects, all_coordinates([effect], case.size))

    effects = list(first.seen)[:GLANCED]
    points = in_parallel(fitted, effects)
    least = min(max(1.0, p.excess(case.floor)) for p in points)
    costs = [p.loss / least + _price(case, [e], p) for e, p in zip(effects, points, strict=True)]
    ranked = [(effects[k], points[k]) for k in np.argsort(costs, kind="stable")[:BEGUN]]
    enough = (1.0 - MOST) * first.at.over(case.floor)
    return [(effect, point.effects) for effect, point in ranked if point.over(case.floor) < enough]


def _from_nominal(case: Case, effect: str, values: Mapping[str, float]) -> Alone:
    """An effect fitted from the nominal machine, as the observer sees it that bears with one that is far from right."""
    zero = np.zeros(len(case.nuisances))
    problem = case.problem(zero, values, LOOSENESS[1])
    (start,) = problem.points([(zero, values)])
    fit = problem.fit(start, problem.nuisance_jacobian(start), all_coordinates([effect], case.size))
    return Alone((effect,), problem, *fit)
