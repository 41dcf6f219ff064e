"""One number of the machine file that is wrong: a bore mistyped, the data sheet of another cylinder.

Its tolerance is right for what the owner meant. Where neither tolerances nor effects explain the recordings, or only with
tolerances strained at their ends, or effects where these stood at their ends without them, each number is looked at as if nothing
were known of it: linearly from where the tolerances end, and the most promising are fitted beside all tolerances. One is taken
where it explains nearly all that the tolerances leave, and more than the effects that were found, or as much: it is simpler than
they. One that explains all is taken before anything is looked for beside a first effect. Of several that do as well the one that
is least off is told, with the others: the pins of a linkage do much the same.

Of numbers that are wrong together the moments of mass are looked at, by one factor: tape measure and density make them all; and
both areas of the cylinder, which one diameter of the piston makes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from math import exp, hypot, inf, sqrt

import numpy as np

from boom_diagnosis.case import Case, Flags, Opened
from boom_diagnosis.coordinates import Coordinate
from boom_diagnosis.fitting import LEAST_STEP, Point
from boom_diagnosis.free_fit import far_from_noise
from boom_diagnosis.hypotheses import LOOSENESS, Fits, noticed
from boom_diagnosis.nuisances import LARGEST_Z, ROD_SIDE, TWINS, Nuisance, bore, known, masses
from boom_diagnosis.parallel import in_parallel
from boom_diagnosis.search import Scanner
from boom_diagnosis.weighing import COLDEST, NEGLIGIBLE, TOO_SMALL, Z90, of_tolerances

ANYTHING = 0.4
"""Standard deviation of the logarithm of a number of which nothing is known: off by a factor of 1.5, and up to one of five."""
TRIED = 2
GUESSES = 17
"""Values of a number within one standard deviation of ``ANYTHING`` that are looked at: 5 % apart. The loosest observer's valley is
15 % wide to either side (twenty-sixth hand, a pin of a linkage), so that none is between two. A quarter of a pass each.
"""
NEARLY_ALL = 0.1
"""Share of what the tolerances leave that may stay."""


def with_wrong_number(case: Case) -> Case | None:
    """The case from its beginning with the number free that is wrong in the machine file; None where none explains enough."""
    left = case.rest(case.last)
    if case.learned or case.wrong:
        return None
    if left < NEGLIGIBLE:
        if strained := _laboured(case):
            return _wrong(case, left + TOO_SMALL, strained=strained)
        return _wrong(case, left + TOO_SMALL, instead=True) if case.taken and case.ended(case.kept(0)).any() else None
    return _wrong(case, min(left, max(NEGLIGIBLE, NEARLY_ALL * case.rest(case.kept(0)))))


def with_number_that_explains_all(case: Case) -> Case | None:
    """The same after a first look at effects that leaves something: a number that leaves nothing needs no search beside them."""
    return None if case.wrong or case.rest(case.last) < NEGLIGIBLE else _wrong(case, NEGLIGIBLE)


def _wrong(case: Case, most: float, *, strained: float = inf, instead: bool = False) -> Case | None:
    """The case with the number that leaves less than ``most`` and is off by less than others that leave no more.

    strained: nats by which tolerances are strained without it; it must strain them less by what counts.
    instead: of effects that explain all. It must have stood at its end where tolerances were all, and explain more than they do by
    what counts: one number that does is simpler than they.
    """
    at_ends = _at_ends(case) if instead else set()
    if case.opened is None:
        numbers = (*case.nuisances, *known(case.machine, case.pose))
        every = replace(case, nuisances=(*numbers, *masses(numbers), *bore(numbers)))
        promising = _promising(case, every)
        if instead and at_ends.isdisjoint(c for i in promising for c in every.nuisances[i].components):
            return None
        tried = [(every.nuisances[i], _opened(case, every.nuisances[i])) for i in promising]
        case.opened = in_parallel(lambda pair: _fitted(*pair, case.floor), tried)
    able = [o for o in case.opened if o.rest < most and _wrong_for_sure(o)]
    able = [o for o in able if strained == inf or noticed(strained - o.strain(), 1)]
    if instead and able:
        without = _left(case, case.last, case.taken[-1].fitted.coordinates)
        able = [o for o in able if not at_ends.isdisjoint(o.number.components) and noticed(without - o.loss(), 1)]
    if not able:
        return None
    least = min(o.rest for o in able)
    first, *others = sorted((o for o in able if o.rest <= least + TOO_SMALL), key=lambda o: abs(o.away))
    first.case.filed = case
    first.case.or_wrong = tuple((o.number.components, exp(o.away)) for o in others)
    return first.case


def _at_ends(case: Case) -> set[str]:
    """Numbers that stand at their ends where tolerances are all."""
    return {c for n, end in zip(case.nuisances, case.ended(case.kept(0)), strict=True) if end for c in n.components}


def _wrong_for_sure(opened: Opened) -> bool:
    """Whether a number is further off than its tolerance reaches, and its interval leaves that out."""
    reach = LARGEST_Z * opened.number.sigma
    return abs(opened.away) > reach and abs(opened.away) > Z90 * hypot(opened.within, opened.number.sigma)


def _laboured(case: Case) -> float:
    """Nats by which all being explained strains tolerances, alone or beside effects; 0 where these may as well be nominal.

    Alone only where free runs err far more than noise would: a number that bends to make up for a little is no mistake.
    """
    if not (case.taken or far_from_noise(case, case.trained[0])):
        return 0.0
    nats = _strain(case, case.last, case.taken[-1].fitted.coordinates if case.taken else ())
    return nats if noticed(nats, int(case.ended(case.last).sum())) else 0.0


def _left(case: Case, at: Point, names: Sequence[Coordinate] = (), held: Flags | None = None) -> float:
    """Loss [nats], priors included, of a fit from here by the observer that is right for a healthy machine; held: at nominal."""
    problem, z = case.problem(at.z, at.effects, LOOSENESS[0]), at.z
    if held is not None:
        problem.limits[:, held], z = 0.0, np.where(held, 0.0, z)
    fits = Fits(case.machine, case.bags, case.select, case.nuisances)
    return fits.fit(problem, z, at.effects, names, enough=LEAST_STEP)[0].loss


def _strain(case: Case, at: Point, names: Sequence[Coordinate] = ()) -> float:
    """Nats that it costs to hold the tolerances nominal that stand at their ends, all others and ``names`` fitted beside them.

    Beside an effect that does what they do, as a load and the moments of mass, they stand anywhere.
    """
    ended = case.ended(at)
    if not ended.any():
        return 0.0
    return max(0.0, _left(case, at, names, ended) - _left(case, at, names))


def in_words(wrong: Sequence[str], instead: Sequence[str] = ()) -> str:
    """That these numbers are wrong in the machine file, or one of those ``instead``."""
    first, *others = wrong
    if not others:
        return f"{' or '.join([first, *instead])} is wrong in the machine file"
    if ROD_SIDE in others:
        return f"{first} and {ROD_SIDE} are wrong in the machine file, by one amount, as of another piston; {first}"
    return f"{', '.join(wrong[:-1])} and {wrong[-1]} are wrong in the machine file, all by one factor; {first}"


def _promising(case: Case, every: Case) -> list[int]:
    """Numbers whose being anything explains most of what the tolerances leave, by the linear look from where they end.

    Not those that an effect of the catalogue is a change of, nor those of which nothing is known anyway.
    """
    z = np.zeros(len(every.nuisances))
    z[: len(case.nuisances)] = case.rounds[0].base.z
    problem = every.problem(z, {}, case.rounds[0].problem.predictor.looseness)
    at = problem.points([(z, {})])[0]
    jacobian = problem.nuisance_jacobian(at)
    look = Scanner(problem, at, jacobian)
    open_to_doubt = [
        i for i, n in enumerate(every.nuisances)
        if not (n.shift or n.difference or n.tail) and n.name not in TWINS and n.sigma < ANYTHING
    ]  # fmt: skip
    best = sorted(open_to_doubt, key=lambda i: -look.gain(jacobian[:, [i]])[0])
    numbers = [every.nuisances[i] for i in best[:TRIED]]
    return best[:TRIED] + [i for i in best[TRIED:] if _together_with(every.nuisances[i], numbers)]


def _together_with(other: Nuisance, numbers: Sequence[Nuisance]) -> bool:
    """Whether numbers that are wrong together are one of ``numbers`` and more: the linear look tells these apart badly."""
    return any(len(other.components) > len(n.components) and set(n.components) & set(other.components) for n in numbers)


def _opened(case: Case, number: Nuisance) -> Case:
    """The case as if nothing were known of a number."""
    return case.with_wrong(replace(number, sigma=ANYTHING, factor=True, ends=(-inf, inf)))


def _fitted(number: Nuisance, case: Case, floor: float) -> Opened:
    """The case with a number free, by tolerances alone, from where less is left of two: a far start has many valleys.

    From the tolerances as the nominal machine has them beside it, and from the nominal ones with the number that a loose observer
    likes best, by observers that are not loose: these lead into other valleys.
    """
    case.floor = floor
    fits, guess = Fits(case.machine, case.bags, case.select, case.nuisances), case.nominal.tolerances
    settled = fits.settled(fits.likeliest(guess.z, {}), guess, ())[1:]
    point = _alone(case)
    for looseness in LOOSENESS[1::-1]:
        point, jacobian = fits.fit(case.problem(point.z, {}, looseness), point.z, {}, ())
    point, jacobian = min(settled, (point, jacobian), key=lambda found: case.rest(found[0]))
    case.nominal.tolerances = case.nominal.problem.points([(point.z, {})])[0]  # a search of this case begins there
    ended = case.ended(point)
    spread = of_tolerances(point, jacobian, (), COLDEST, ended)[0, 0]
    away, within = ANYTHING * float(point.z[0]), ANYTHING * sqrt(float(spread))
    return Opened(
        number, case, case.rest(point), away, within, partial(_strain, case, point), partial(_left, case, point)
    )


def _alone(case: Case) -> Point:
    """Nominal tolerances, with the first number where the loosest observer finds it likeliest."""
    guesses = np.zeros((GUESSES, len(case.nuisances)))
    guesses[:, 0] = np.linspace(-1.0, 1.0, GUESSES)
    problem = case.problem(np.zeros(len(case.nuisances)), {}, LOOSENESS[-1])
    return min(problem.points([(z, {}) for z in guesses]), key=lambda point: point.loss)
