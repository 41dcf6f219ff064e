"""The search of a refinement from several starts: if one ends in disagreement with the recordings, another begins.

The first start is the machine file. Pre-charges make corners in the pressure that a search notices only near them, so that
two accumulators easily change places or merge into one. The next starts therefore keep all other numbers and take the
accumulators from a grid of pre-charges, the most probable points first; without accumulators, starts are drawn from the priors.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import product

import numpy as np
from numpy.typing import NDArray

from boom_estimation.fit import FitResult, cost_at, fit
from boom_estimation.problem import EstimationProblem
from boom_model.plant import FAST

Array = NDArray[np.float64]
Progress = Callable[[str], None]

GOOD_LEVEL = 1.1
"""Noise level up to which a fit agrees with the recordings, so that no other start is needed: 1.00 in all searches that found the
truth, 1.23 in one that missed it (docs/identification.md)."""
PASSABLE_LEVEL = 2.6
"""Noise level up to which a fit is informative about the machine."""
ITERATIONS = 30
_GRID = (-1.2, -0.6, 0.0, 0.6, 1.2)
"""Grid of each pre-charge, in standard deviations of the prior."""
_APART = 0.7
"""Least grid distance between two starts: neighbours end in the same place."""
_DRAWN = 0.5


def search(problem: EstimationProblem, starts: int, seed: int, say: Progress) -> tuple[FitResult, int, int]:
    """The best of at most ``starts`` searches, all iterations, and the number of searches.

    The first that agrees with the recordings is the last. seed: of the drawn starts.
    """
    best = fit(problem, None, iterations=ITERATIONS, progress=lambda text: say("start 1: " + text))
    iterations, used = best.iterations, 1
    if best.level <= GOOD_LEVEL or starts < 2:
        return best, iterations, used
    for begin in _others(problem, best, starts - 1, seed):
        used += 1
        label = f"start {used}: "
        found = fit(problem, begin, iterations=ITERATIONS, progress=lambda text, label=label: say(label + text))  # type: ignore[misc]
        iterations += found.iterations
        if (found.level, found.cost) < (best.level, best.cost):
            best = found
        if best.level <= GOOD_LEVEL:
            break
    return best, iterations, used


def _others(problem: EstimationProblem, best: FitResult, count: int, seed: int) -> list[Array]:
    """``count`` starting points z (m,) after ``best``."""
    names = [u.name for u in problem.unknowns]
    block = [j for j, name in enumerate(names) if name.startswith("accumulators.")]
    charges = [j for j in block if names[j].startswith("accumulators.p_g0")]
    chosen: list[Array] = []
    if charges:
        places = []
        for point in product(_GRID, repeat=len(charges)):
            z = best.z.copy()
            z[block], z[charges] = 0.0, point
            places.append((cost_at(problem, best.gains, z, FAST), z))
        for _, z in sorted(places, key=lambda place: place[0]):
            if all(np.abs(z - other).max() > _APART for other in chosen) and len(chosen) < count:
                chosen.append(z)
    rng = np.random.default_rng(seed)
    chosen += [rng.normal(0.0, _DRAWN, len(names)) for _ in range(count - len(chosen))]
    return chosen
