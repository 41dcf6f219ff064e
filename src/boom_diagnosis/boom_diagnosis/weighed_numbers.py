"""The numbers of a fitted hypothesis' effects with their intervals."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from boom_diagnosis.coordinates import all_coordinates
from boom_diagnosis.document import Estimate
from boom_diagnosis.must_keep import told
from boom_diagnosis.weighing import GRASP, Z90, is_none
from boom_estimation.posterior import HypothesisFit


def estimates(at: HypothesisFit) -> dict[str, Estimate]:
    """The numbers of a fit's effects with 90 % intervals, by dotted name.

    Of a number at the end of its range: as far as its own curvature lets it come back.
    """
    coordinates = {c.name: c for e in at.problem.effects for c in all_coordinates([e])}
    deviations, curvature = np.sqrt(np.diag(at.covariance)), np.diag(at.hessian)
    result = {}
    for k, n in enumerate(at.problem.numbers):
        coordinate = coordinates.get(n.name)
        if coordinate is None or is_none(n.name, n.value(float(at.c[k]))):
            continue
        own = deviations[k] if at.free[k] else 1.0 / np.sqrt(max(float(curvature[k]), 1e-12))
        spread = Z90 * float(np.hypot(own, coordinate.form))
        if coordinate.onset:
            spread = max(spread, GRASP)
        c = float(at.c[k])
        low, high = (n.value(min(max(c + s, n.low), n.high)) for s in (-spread, spread))
        result[n.name] = Estimate(n.value(c), coordinate.unit, (low, high))
    return result


def distinct(at: HypothesisFit) -> bool:
    """Whether each effect of a fit differs from doing nothing."""
    numbers = estimates(at)
    return all(told(effect, own_numbers(numbers, effect)) for effect in at.problem.effects)


def own_numbers(numbers: Mapping[str, Estimate], effect: str) -> dict[str, Estimate]:
    """Those of one effect by their own names."""
    return {name.split(".")[2]: e for name, e in numbers.items() if name.split(".")[1] == effect}
