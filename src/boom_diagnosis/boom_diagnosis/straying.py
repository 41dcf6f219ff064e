"""A log whose samples of the currents stray from their stamps, which looks like physics that is missing.

A logger that races the controller writes now this command, now the one before it. In the gains of the observer that is noise of
the currents where they change, (du/dt) sigma_t; sigma_t is estimated by the innovations' likelihood, as the disturbances are.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from boom_diagnosis.bag_samples import Bag
from boom_diagnosis.case import Case, Flags
from boom_diagnosis.earning import chance
from boom_diagnosis.fitting import Point
from boom_diagnosis.hypotheses import LOOSENESS, problem_at
from boom_diagnosis.locating import disturbed, links

SHARES = (0.25, 0.125, 0.5)
"""Of the time between two samples: standard deviations that are tried. One sample late in half of all cases is the most."""


def strayed(case: Case) -> tuple[list[Bag], list[Bag]] | None:
    """The recordings, fitted and held out, as ones that stray, where that is likelier than all that was found; else None.

    It must gain more than chance over the best that a disturbance anywhere in the machine gains: what strays is the log's, and
    where the machine is astray, too, it is physics.
    """
    at = case.last
    fitted = [_likeliest(case, bag, select, at, {}) for bag, select in zip(case.bags, case.select, strict=True)]
    gained = sum(gain for _, gain in fitted) - chance(case)
    base = case.problem(at.z, at.effects, LOOSENESS[0])
    if gained < 0.0 or gained < disturbed(base, at, links(case.machine)) - base.likelihood_at(at.z, at.effects):
        return None
    return [bag for bag, _ in fitted], [
        _likeliest(case, bag, bag.counted, at, case.own_beside(at))[0] for bag in case.proving
    ]


def _likeliest(case: Case, bag: Bag, select: Flags, at: Point, own: Mapping[str, float]) -> tuple[Bag, float]:
    """The recording as it strays likeliest at a point, seen by the observer of a healthy machine, and what that gains [nats].

    own: numbers that are the recording's own.
    """
    effects = {**at.effects, **own}

    def likelihood(tried: Bag) -> float:
        problem = problem_at(case.machine, [tried], [select], case.nuisances, at.z, effects, LOOSENESS[0])
        return problem.likelihood_at(at.z, effects)

    before, period = likelihood(bag), float(np.median(np.diff(bag.currents.sampled_at)))
    best, most = bag, 0.0
    for share in SHARES:
        tried = bag.straying(share * period)
        gain = likelihood(tried) - before
        if gain > most:
            best, most = tried, gain
        elif best is bag:  # the middle one gains nothing
            break
    return best, most
