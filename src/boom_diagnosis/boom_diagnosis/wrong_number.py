"""One number of the machine file that is wrong: a bore mistyped, the data sheet of another cylinder.

Its tolerance is right for what the owner meant. Where neither tolerances nor effects explain the recordings, or only with several
numbers of effects beside tolerances that stand at their ends, each number is looked at as if nothing were known of it: linearly
from the nominal machine, and the most promising are fitted beside all tolerances. One is taken where it explains nearly all that
the tolerances leave, and more than the effects that were found, or as much: it is simpler than they.

Of numbers that are wrong together the moments of mass are looked at, by one factor: tape measure and density make them all.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from boom_diagnosis.case import Case
from boom_diagnosis.hypotheses import Fits, Nominal
from boom_diagnosis.nuisances import LARGEST_Z, TWINS, Nuisance, masses, units
from boom_diagnosis.parallel import in_parallel
from boom_diagnosis.weighing import NEGLIGIBLE, TOO_SMALL

ANYTHING = 0.4
"""Standard deviation of the logarithm of a number of which nothing is known: off by a factor of 1.5, and up to one of five."""
TRIED = 3
NEARLY_ALL = 0.1
"""Share of what the tolerances leave that may stay."""


def with_wrong_number(case: Case) -> Case | None:
    """The case from its beginning with the number free that is wrong in the machine file; None where none explains enough."""
    left = case.rest(case.last)
    if case.learned or (left < NEGLIGIBLE and not _laboured(case)):
        return None
    most = min(left, max(NEGLIGIBLE, NEARLY_ALL * case.rest(case.kept(0))))
    if left < NEGLIGIBLE:
        most = left + TOO_SMALL
    every = replace(case, nuisances=(*case.nuisances, *units(case.machine, case.pose), *masses(case.nuisances)))
    tried = [(every.nuisances[i], _opened(case, every.nuisances[i])) for i in _promising(every)]
    found = in_parallel(lambda pair: _fitted(pair[1], case.floor), tried)
    able = [
        (rest, k) for k, ((own, _), (rest, away)) in enumerate(zip(tried, found, strict=True))
        if rest < most and abs(away) > LARGEST_Z * own.sigma
    ]  # fmt: skip
    return tried[min(able)[1]][1] if able else None


def _laboured(case: Case) -> bool:
    """Whether what explains all has several numbers of effects, and tolerances at their ends beside them."""
    several = bool(case.taken) and len(case.taken[-1].fitted.coordinates) > 1
    return several and bool(case.ended(case.last).any())


def in_words(wrong: Sequence[str]) -> str:
    """That these numbers are wrong in the machine file."""
    first, *others = wrong
    if not others:
        return f"{first} is wrong in the machine file"
    return f"{', '.join(wrong[:-1])} and {wrong[-1]} are wrong in the machine file, all by one factor; {first}"


def _promising(every: Case) -> list[int]:
    """Numbers whose being anything explains most of what the nominal machine leaves, by the linear look of its likeliest observer.

    Not those that an effect of the catalogue is a change of, nor those of which nothing is known anyway.
    """
    fits = Fits(every.machine, every.bags, every.select, every.nuisances)
    nominal = Nominal(fits.likeliest(np.zeros(len(every.nuisances)), {}))
    known = [
        i for i, n in enumerate(every.nuisances)
        if not (n.shift or n.difference or n.tail) and n.name not in TWINS
    ]  # fmt: skip
    return sorted(known, key=lambda i: -nominal.gain_of(i))[:TRIED]


def _opened(case: Case, number: Nuisance) -> Case:
    """The case as if nothing were known of a number."""
    return case.with_wrong(replace(number, sigma=ANYTHING, factor=True))


def _fitted(case: Case, floor: float) -> tuple[float, float]:
    """Of tolerances alone: loss per innovation over that of a healthy machine, and the logarithm of the number over the file's."""
    case.floor = floor
    fits, guess = Fits(case.machine, case.bags, case.select, case.nuisances), case.nominal.tolerances
    point = fits.settled(fits.likeliest(guess.z, {}), guess, ())[1]
    return case.rest(point), ANYTHING * float(point.z[0])
