"""One number of the machine file that is wrong: a bore mistyped, the data sheet of another cylinder, a mass in pounds.

Its tolerance is right for what the owner meant. Where neither tolerances nor effects explain the recordings, each number is looked
at as if nothing were known of it: linearly from the nominal machine, and the most promising are fitted beside all tolerances. One
is taken where it explains nearly all that the tolerances leave, and more than the effects that were found: it is simpler than they.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from boom_diagnosis.case import Case
from boom_diagnosis.hypotheses import LOOSENESS, Fits, Nominal
from boom_diagnosis.nuisances import Nuisance, units
from boom_diagnosis.parallel import in_parallel
from boom_diagnosis.weighing import NEGLIGIBLE

ANYTHING = 0.4
"""Standard deviation of the logarithm of a number of which nothing is known: off by a factor of 1.5, and up to one of five."""
TRIED = 3
NEARLY_ALL = 0.1
"""Share of what the tolerances leave that may stay."""


def with_wrong_number(case: Case) -> Case | None:
    """The case from its beginning with the number free that is wrong in the machine file; None where none explains enough."""
    most = min(case.rest(case.last), max(NEGLIGIBLE, NEARLY_ALL * case.rest(case.kept(0))))
    if case.learned or case.rest(case.last) < NEGLIGIBLE:
        return None
    opened = [_opened(case, name) for name in _promising(case)]
    rests = in_parallel(lambda other: _rest(other, case.floor), opened)
    least, best = min(zip(rests, range(len(opened)), strict=True), default=(np.inf, 0))
    return opened[best] if least < most else None


def _promising(case: Case) -> list[str]:
    """Numbers whose being anything explains most of what the nominal machine leaves, by the linear look."""
    every = replace(case, nuisances=(*case.nuisances, *units(case.machine, case.pose)))
    nominal = Nominal(every.problem(np.zeros(len(every.nuisances)), {}, LOOSENESS[1]))
    relative = [i for i, n in enumerate(every.nuisances) if not (n.shift or n.difference)]
    gains = {every.nuisances[i].name: nominal.gain_of(i) for i in relative}
    return sorted(gains, key=lambda name: -gains[name])[:TRIED]


def _opened(case: Case, name: str) -> Case:
    """The case as if nothing were known of a number."""
    known: Sequence[Nuisance] = [*case.nuisances, *(n for n in units(case.machine, case.pose) if n.name == name)]
    free = tuple(replace(n, sigma=ANYTHING, factor=True, tail=0.0) if n.name == name else n for n in known)
    return case.with_nuisances(free, name)


def _rest(case: Case, floor: float) -> float:
    """Loss per innovation over that of a healthy machine with the tolerances alone."""
    case.floor = floor
    fits, guess = Fits(case.machine, case.bags, case.select, case.nuisances), case.nominal.tolerances
    return case.rest(fits.settled(fits.likeliest(guess.z, {}), guess, ())[1])
