"""Several starts of one effect: numbers that trade off against one another lie in valleys, and a search ends in the first one.

Set pressure and pilot ratio of a load-holding valve do: along p_set - R p_b they are nearly one number. From each start of the
catalogue the effect is fitted with nominal tolerances to begin with; the likelihood decides, with gains of each point's own.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

import numpy as np
from numpy.typing import NDArray

from boom_diagnosis import search
from boom_diagnosis.bag_samples import visited
from boom_diagnosis.case import Case
from boom_diagnosis.coordinates import Coordinate, coordinates, has_valleys, starts
from boom_diagnosis.earning import settle
from boom_diagnosis.fitting import Point, Problem
from boom_diagnosis.hypotheses import LOOSENESS
from boom_diagnosis.parallel import in_parallel
from boom_diagnosis.proof import worsening
from boom_model.catalogue import EFFECTS

Array = NDArray[np.float64]
Fitted = tuple[Problem, Point, Array]

FITS = 3
"""Fits with fresh derivatives."""
FOLLOWED = 3
"""Starts that are followed further, the likeliest after these fits."""


def other_valley(case: Case, first: search.Fitted) -> Fitted | None:
    """Problem, point and Jacobian (rows, z then coordinates) of an effect in the likeliest valley, its own among them.

    None where the catalogue has starts of fewer than two of its numbers, and of effects that begin at a time.
    """
    effect = EFFECTS[first.effect]
    if not has_valleys(effect):
        return None
    names = coordinates(effect, case.size)
    here = [case.problem(first.point.z, first.point.effects, looseness) for looseness in LOOSENESS]
    problem = max(here, key=lambda p: p.likelihood_at(first.point.z, first.point.effects))
    looseness = problem.predictor.looseness
    begun = _begun(case, starts(effect, 0.0, case.size, visited(case.bags)), names, looseness)
    begun.append(_fit(case, first.point.z, first.point.effects, names, looseness))
    ahead = sorted(begun, key=_likelihood)[-FOLLOWED:]
    settled = in_parallel(lambda f: _fit(case, f[1].z, f[1].effects, names, looseness), ahead)
    return max(settled, key=_likelihood)


def _begun(
    case: Case, begin: Sequence[dict[str, float]], names: tuple[Coordinate, ...], looseness: float
) -> list[Fitted]:
    """Fits from nominal tolerances and each of these numbers; after each, longer ones than before, the less likely half is left."""
    zero = np.zeros(len(case.nuisances))

    def start(values: dict[str, float]) -> tuple[Problem, Point]:
        problem = case.problem(zero, values, looseness)
        return problem, problem.points([(zero, values)])[0]

    def further(at: tuple[Problem, Point], iterations: int) -> tuple[Problem, Point]:
        problem, point = at
        return problem, problem.fit(point, problem.nuisance_jacobian(point), names, iterations=iterations)[0]

    ahead = in_parallel(start, begin)
    for k in range(FITS):
        ahead = in_parallel(partial(further, iterations=2 * (k + 1)), ahead)
        ahead = sorted(ahead, key=lambda at: at[0].likelihood(at[1]))[-max(FOLLOWED, len(ahead) // 2) :]
    return in_parallel(lambda at: _fit(case, at[1].z, at[1].effects, names, looseness, 0), ahead)


def in_deepest_valley(case: Case, last: Fitted, names: tuple[Coordinate, ...]) -> Fitted:
    """The ``last`` fit of all that was taken, or one in a likelier valley where free runs over data not used are no worse.

    Of effects that the catalogue has starts of several numbers together of: two pre-charges, beside the volumes of their gas.
    """
    effects = [EFFECTS[w.fitted.effect] for w in case.taken if EFFECTS[w.fitted.effect].points]
    problem, point, _ = last
    zero, looseness = np.zeros(len(case.nuisances)), problem.predictor.looseness
    begin = [{**point.effects, **start} for effect in effects for start in starts(effect, 0.0, case.size)]
    if not begin:
        return last
    tried = in_parallel(lambda values: _fit(case, zero, values, names, looseness, 1), begin)
    ahead = [last, *sorted(tried, key=_likelihood)[-FOLLOWED:]]
    here, *others = in_parallel(lambda f: _fit(case, f[1].z, f[1].effects, names, looseness), ahead)
    best = max(others, key=_likelihood)
    if _likelihood(best) <= _likelihood(here):
        return last
    k = len(case.taken)
    trained = settle(case, k, *best, names)
    case.spared.pop(k, None)
    if worsening(case, case.trained[k], trained) > 1.0:
        return last
    case.trained[k] = trained
    return best


def _likelihood(found: Fitted) -> float:
    problem, point, _ = found
    return problem.likelihood(point)


def _fit(
    case: Case, z: Array, values: dict[str, float], names: tuple[Coordinate, ...], looseness: float, fits: int = FITS
) -> Fitted:
    """From a point, with gains of its end."""
    problem = case.problem(z, values, looseness)
    point = problem.points([(z, values)])[0]
    for _ in range(fits):
        point, _ = problem.fit(point, problem.nuisance_jacobian(point), names)
    problem = case.problem(point.z, point.effects, looseness)
    point = problem.points([(point.z, point.effects)])[0]
    point, jacobian = problem.fit(point, problem.nuisance_jacobian(point), names)
    return problem, point, jacobian
