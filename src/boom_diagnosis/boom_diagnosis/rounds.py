"""Rounds of a search: what explains most is taken, all is computed anew, and what was found is doubted."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from boom_diagnosis.calibration import calibrate
from boom_diagnosis.case import Case
from boom_diagnosis.coordinates import Coordinate, all_coordinates
from boom_diagnosis.earning import chance, clear, least, placed_by_itself, settle, take, temperature, weigh
from boom_diagnosis.fitting import Point, Problem, strained
from boom_diagnosis.hypotheses import LOOSENESS, Nominal, Round, afresh, rebased, run_round
from boom_diagnosis.learning import learn_plainly
from boom_diagnosis.restarts import other_valley
from boom_diagnosis.search import Fitted
from boom_diagnosis.weighing import NEGLIGIBLE, OTHER_FORM
from boom_diagnosis.wrong_number import with_number_that_explains_all
from boom_model.learned import PLACES

Array = NDArray[np.float64]
Progress = Callable[[str, float], None]

MOST_EFFECTS = 3
LITTLE = 0.25
"""Share of what the tolerances cannot take up that a first effect may leave without a second look at all others."""
OUTDONE = 0.1
"""Share of what the best effect leaves that a term which is plain to see may leave, for no further effect to be looked for."""
FIRST_LOOK = 0.6
"""Share of a round's time that is over before a second look, as the progress counts it."""
FAR = 1.0
"""Loss per innovation over that of a healthy machine from which on the likeliest observer is looked for again; below, the one
that is right for a healthy machine sees what is left best."""


def rounds(case: Case, progress: Progress, begun: bool = False) -> Case:
    """Round after round until nothing earns its place, or ``MOST_EFFECTS`` have; the case is changed, or another is returned.

    begun: with what the case has taken already.
    """
    near, k = False, len(case.taken) if begun else 0
    alone = set[int]()  # of two and of three, once each: what takes the place of those before may bring them back
    while k < MOST_EFFECTS:
        look = share(progress, 0.8 * k / MOST_EFFECTS, 0.8 / MOST_EFFECTS)
        taken = _look(case, share(look, 0.0, FIRST_LOOK), near)
        if k == 0:
            other = with_number_that_explains_all(case)
            if other:
                return rounds(other, progress)
            taken = _first_doubted(case, share(look, FIRST_LOOK, 1.0 - FIRST_LOOK), taken)
            if case.learned:
                return case
        elif not taken:
            taken = _seen_sharply(case, share(look, FIRST_LOOK, 1.0 - FIRST_LOOK), near)
        if not taken:
            return case
        if len(case.taken) > 1 and len(case.taken) not in alone:
            alone.add(len(case.taken))
            _without_those_before(case)
            if len(case.taken) == 2 and _at_the_end(case):
                _without_stand_in(case, look)
        k = len(case.taken)
        left = case.rest(case.last)
        if left < NEGLIGIBLE:
            return case
        near = left < FAR
    return case


def _seen_sharply(case: Case, progress: Progress, near: bool) -> bool:
    """The last round once more with the observer that sees most, where its own followed; whether an effect is taken then."""
    before = case.kept_back()
    if not near and _followed(case) and _look(case, progress, True):
        return True
    found = case.rounds[len(case.taken)]
    case.go_back(before)
    _fitted_better(case, found)
    return False


def _fitted_better(case: Case, found: Round) -> None:
    """What was taken as a later round fitted it, where the observer that is right for a healthy machine sees less left so."""
    last = case.taken[-1]
    if case.rest(found.base) >= case.rest(case.last):
        return
    better = replace(last, fitted=replace(last.fitted, point=found.base, jacobian=found.jacobian))
    case.taken[-1] = better
    case.weighed[len(case.taken) - 1] = [better if w is last else w for w in case.weighed[len(case.taken) - 1]]
    names = better.fitted.coordinates
    case.trained[-1] = settle(case, len(case.taken), found.problem, found.base, found.jacobian, names)


def _first_doubted(case: Case, progress: Progress, taken: bool) -> bool:
    """What the first round took, looked at again where that does not satisfy, and from other starts; whether anything is taken."""
    if not _satisfied(case) or _strained(case) or _at_the_end(case):
        taken = _look_again(case, progress)
        if not _satisfied(case) and _plain(case):
            return taken
    return _restarted(case) or taken


def _followed(case: Case) -> bool:
    """Whether the last round's observer was so loose that it follows what the tight one sees."""
    found = case.rounds[-1]
    return found.problem.predictor.looseness > LOOSENESS[0] and not clear(case, found.base)


def share(progress: Progress, begin: float, size: float) -> Progress:
    """Progress of a part that begins at a share of the whole and has a size of it."""
    return lambda text, share: progress(text, begin + size * share)


def _look(case: Case, progress: Progress, tight: bool) -> bool:
    """One round: whether an effect was found that earns its place."""
    z, values = (case.last.z, case.last.effects) if case.taken else (np.zeros(len(case.nuisances)), {})
    found = run_round(
        case.machine, case.bags, case.select, case.nuisances, z, values, progress,
        nominal=None if case.taken else case.nominal, tight=tight, least=partial(least, case),
    )  # fmt: skip
    if case.taken and _dissatisfied(case, found):
        found = _beside_nominal(case, found)
    return _judge(case, found)


def _dissatisfied(case: Case, found: Round) -> bool:
    """Whether a round beside other effects begins with a clear rest, and its best effect leaves much of it."""
    best = found.fitted[0].gain if found.fitted else 0.0
    return clear(case, found.base) and best < (1.0 - LITTLE) * found.base.over(case.floor)


def _beside_nominal(case: Case, found: Round) -> Round:
    """The round with effects that are seen where the tolerances are nominal: those fitted may have bent to do what they do."""
    zero, names = np.zeros(len(case.nuisances)), all_coordinates(found.accepted, case.size)
    loose = case.problem(zero, found.base.effects, LOOSENESS[1])
    values = loose.fit_nominal(found.base.effects, names).effects
    problem = case.problem(zero, values, LOOSENESS[1])
    return afresh(found, Nominal(problem, values), [f.effect for f in found.fitted[:1]], case.floor)


def _judge(case: Case, found: Round) -> bool:
    """Weighs what a round found, in the place of a round before that nothing was taken from; whether the best is taken."""
    k = len(case.taken)
    found = rebased(found)
    case.rounds[k:] = [found]
    if k == 0:
        if not case.healthy:
            calibrate(case, found)
        if case.proving:
            case.own = placed_by_itself(case, found)
        case.trained[:] = [settle(case, 0, found.problem, found.base, found.jacobian, ())]
    case.weighed[k:] = [weigh(case, found)]
    taken = take(case)
    best = case.weighed[k][0].fitted.point if case.weighed[k] else found.base
    case.temperature = temperature(case, best)
    return taken


def _strained(case: Case) -> bool:
    """Whether the tolerances have gone to improbable places: one effect may be likelier than so many numbers that are off."""
    return strained(case.last, (case.taken[-1].fitted if case.taken else case.rounds[0]).jacobian)


def _at_the_end(case: Case) -> bool:
    """Whether what was taken lies at the end of a range: it may stand in for something else."""
    if not case.taken:
        return False
    found = case.taken[0].fitted
    values = found.point.effects
    return any(c.high <= values[c.name] or (c.positive and values[c.name] <= c.low) for c in found.coordinates)


def _explained(case: Case) -> bool:
    """Whether an effect leaves little of what the tolerances cannot take up."""
    return bool(case.taken) and case.rest(case.last) < LITTLE * case.rest(case.kept(0))


def _satisfied(case: Case) -> bool:
    """Whether the first round leaves next to nothing, or little of what the tolerances cannot take up."""
    return case.rest(case.last) < NEGLIGIBLE or _explained(case)


def _look_again(case: Case, progress: Progress) -> bool:
    """The first round once more, with the observer that sees most, and with what the nominal machine shows.

    What the first look took stays where the second leaves more unexplained.
    """
    first = case.kept_back()
    case.likeliest = case.kept(0), case.trained[0]
    wanted = [case.taken[0].fitted.effect] if case.taken else []
    case.taken.clear()
    case.spared.clear()
    case.disproved.clear()
    found = case.rounds[0]
    if found.problem.predictor.looseness > LOOSENESS[0]:
        found = run_round(
            case.machine, case.bags, case.select, case.nuisances, found.base.z, {}, progress, tight=True,
            least=partial(least, case),
        )  # fmt: skip
    found = afresh(found, case.nominal, [*wanted, *(f.effect for f in found.fitted[:1])], case.floor)
    taken = _judge(case, found)
    known = {w.fitted.effect for w in (*case.weighed[0], *case.disproved)}
    case.disproved += [w for w in (*first.taken, *first.disproved) if w.fitted.effect not in known]
    if not first.taken:
        return taken
    left, before = (c.rest(c.last) for c in (case, first))
    if left <= before + NEGLIGIBLE:
        return taken
    case.go_back(first)
    return True


def _without_those_before(case: Case) -> None:
    """Effects that gain nothing beside those found later go, all of them or one: they stood in for these."""
    last = case.taken[-1].fitted.point
    for gone in (case.named[:-1], *([effect] for effect in case.named[:-1] if len(case.taken) > 2)):
        before = case.kept_back()
        kept = [w for w in case.taken if w.fitted.effect not in gone]
        alone = _by_themselves(case, [w.fitted.effect for w in kept])
        together = alone.problem.points([(last.z, last.effects)])[0]
        if alone.point.loss - together.loss <= len(gone) * chance(case) + OTHER_FORM * sum(w.net for w in kept):
            if _taken_in_turn(case, alone):
                return
            case.go_back(before)


def _without_stand_in(case: Case, progress: Progress) -> None:
    """Where the first effect lies at the end of a range: the second one, and what is found beside it, if they leave less."""
    before, left = case.kept_back(), case.rest(case.last)
    if taken_anew(case, _by_themselves(case, case.named[-1:])):
        _look(case, progress, case.rest(case.last) < FAR)
        if case.rest(case.last) < left:
            return
    case.go_back(before)


@dataclass(frozen=True)
class Alone:
    """Effects fitted without any others. jacobian: (rows, z then coordinates) at the point."""

    effects: tuple[str, ...]
    problem: Problem
    point: Point
    jacobian: Array


def _by_themselves(case: Case, effects: Sequence[str]) -> Alone:
    """Some of the effects that were taken without the others."""
    last, looseness = case.taken[-1].fitted.point, case.rounds[len(case.taken) - 1].problem.predictor.looseness
    names = all_coordinates(effects, case.size)
    values = {c.name: last.effects[c.name] for c in names}
    return _fitted(case.problem(last.z, values, looseness), effects, last.z, values, names)


def _fitted(
    problem: Problem, effects: Sequence[str], z: Array, values: Mapping[str, float], names: Sequence[Coordinate]
) -> Alone:
    """From z, or the nominal numbers, whichever is likelier."""
    start = min(problem.points([(z, values), (np.zeros_like(z), values)]), key=lambda p: p.loss)
    return Alone(tuple(effects), problem, *problem.fit(start, problem.nuisance_jacobian(start), names))


def _taken_in_turn(case: Case, alone: Alone) -> bool:
    """The search begun again, as if its rounds had found these effects, what explains most first; whether all are taken."""
    problem, at, left = alone.problem, alone.point, alone.effects
    accepted: tuple[str, ...] = ()
    while left:
        tried = [alone] if len(alone.effects) == 1 else []
        for effect in left if not tried else ():
            names = all_coordinates([*accepted, effect], case.size)
            values = {c.name: at.effects[c.name] for c in names}
            tried.append(_fitted(problem, (*accepted, effect), at.z, values, names))
        found = min(tried, key=lambda a: a.point.loss)
        if not taken_anew(case, found, accepted):
            return False
        accepted = found.effects
        left = tuple(effect for effect in left if effect not in accepted)
    return True


def _restarted(case: Case) -> bool:
    """The first effect, or the best that was not taken, from another start, where the likeliest observer finds a better valley.

    Whether it is taken from there. What was taken stays where that leaves more unexplained: a loose observer is blind to it.
    """
    tried = case.taken[:1] or sorted((*case.weighed[0], *case.disproved), key=lambda w: -w.gain)[:1]
    left = case.rest(case.last)
    if not tried or left <= NEGLIGIBLE:
        return False
    found = other_valley(case, tried[0].fitted)
    if found is None:
        return False
    before = case.kept_back()
    taken = taken_anew(case, Alone((tried[0].fitted.effect,), *found))
    if not taken or (before.taken and case.rest(case.last) > left + NEGLIGIBLE):
        case.go_back(before)
        return False
    return taken


def taken_anew(case: Case, alone: Alone, accepted: tuple[str, ...] = ()) -> bool:
    """The search begun again, as if this effect had been all that the first round found; whether it is taken.

    accepted: effects that were taken so before; then it is what the next round found beside them.
    """
    first, problem, point = case.rounds[0], alone.problem, alone.point
    if not accepted:
        for part in (case.taken, case.spared, case.disproved):
            part.clear()
    z, values = (case.last.z, case.last.effects) if accepted else (first.base.z, {})
    beside = all_coordinates(accepted, case.size)
    base, columns = problem.fit(problem.points([(z, values)])[0], alone.jacobian[:, : len(point.z)], beside)
    (effect,) = (e for e in alone.effects if e not in accepted)
    names = all_coordinates([*accepted, effect], case.size)
    fitted = Fitted(effect, point, names, alone.jacobian, base.loss - point.loss, (point.loss,))
    return _judge(
        case, replace(first, accepted=accepted, base=base, jacobian=columns, fitted=(fitted,), problem=problem)
    )


def _plain(case: Case) -> bool:
    """Whether a term that is plain to see explains what no effect does; it is kept then, and no effect is."""
    learned = learn_plainly(case.setting, case.trained[0], list(PLACES))
    if not learned or learned.point.excess(case.floor) > OUTDONE * case.rest(case.last):
        return False
    case.learned = learned
    case.taken.clear()
    case.spared = {k: v for k, v in case.spared.items() if k == 0}
    del case.trained[1:]
    return True
