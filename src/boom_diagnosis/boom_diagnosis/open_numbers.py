"""How far free runs over data not used may err because the recordings that were fitted leave numbers open.

    s_c^2 = mean over the samples of channel c of (J S J')_kk,    J = d(free run)/d(numbers) over the channel's deviation

S: covariance of the numbers that the stated intervals are made of. A number of which the recordings tell nothing has its
tolerance: in a motion that needs it a sound machine errs by that.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from boom_diagnosis.case import Case
from boom_diagnosis.fitting import Problem
from boom_diagnosis.free_fit import FreeRunPredictor, spread_of
from boom_diagnosis.freerun import Errors, median
from boom_diagnosis.weighing import FORM, trusted
from boom_model.errors import SimulationError
from boom_model.sensors import OUTPUTS

Array = NDArray[np.float64]


def number_spread(case: Case) -> Errors:
    """s (NY,), median over the recordings; empty where a free run ends early."""
    point, jacobian = case.last, case.final.jacobian if case.final else case.rounds[0].jacobian
    names = case.final.coordinates if case.final else ()
    discount = max(1.0, case.temperature / 3.0) * FORM**2
    covariance = trusted(point, jacobian, len(point.z), [c.precision for c in names], discount)
    own = case.of_held_out_alone()
    covariance[own], covariance[:, own] = 0.0, 0.0  # fitted to what is not used
    z, effects = case.everywhere(point), {**point.effects, **case.own_beside(point)}
    rows = []
    bags = case.proving or case.bags
    for bag, select in zip(bags, [b.counted for b in case.proving] or case.judged, strict=True):
        weights = 1.0 / spread_of(bag.samples().measured)
        problem = Problem(FreeRunPredictor(case.machine, [bag], [weights]), case.nuisances, [select])
        try:
            at = problem.points([(z, effects)])[0]
            columns = np.concatenate([problem.nuisance_jacobian(at), problem.effect_jacobian(at, names)], axis=1)
        except SimulationError:
            return ()
        variance = np.sum((columns @ covariance) * columns, axis=1)
        channel = np.broadcast_to(np.arange(len(OUTPUTS)), select.shape)[select]
        rows.append(tuple(_root_mean(variance[channel == c]) for c in range(len(OUTPUTS))))
    return median(rows)


def _root_mean(squares: Array) -> float:
    known = squares[np.isfinite(squares)]
    return float(np.sqrt(np.mean(np.maximum(known, 0.0)))) if len(known) else float("nan")
