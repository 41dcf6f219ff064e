"""Whether free runs over data not used err because the recordings that were fitted leave numbers open, and not for missing physics.

By how much these numbers may make them err, to first order:

    s_c^2 = mean over the samples of channel c of (J S J')_kk,    J = d(free run)/d(numbers) over the channel's deviation

S: covariance of the numbers that the stated intervals are made of. A number of which the recordings tell nothing has its
tolerance: in a motion that needs it a sound machine errs by that. Where that is not enough: whether parameters within their
tolerances that are fitted to all recordings, to one-step errors first and then to free runs, run through the data not used as noise
lets them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from boom_diagnosis.assumptions import FAR_FROM_FLOOR
from boom_diagnosis.bag_samples import Bag
from boom_diagnosis.case import Case, Flags
from boom_diagnosis.document import Fit
from boom_diagnosis.fitting import Point, Problem
from boom_diagnosis.free_fit import FreeRunPredictor, fitted_to_free_runs, spread_of
from boom_diagnosis.freerun import Errors, median
from boom_diagnosis.hypotheses import LOOSENESS, problem_at
from boom_diagnosis.must_keep import far_channels, open_channels
from boom_diagnosis.proof import Spans, free_runs, held_out, machine_at
from boom_diagnosis.weighing import COLDEST, FORM, trusted
from boom_model.errors import SimulationError
from boom_model.sensors import OUTPUTS

Array = NDArray[np.float64]


def doubted_by_numbers(case: Case, spans: Spans, fit: Fit) -> Fit:
    """The fit of parameters only with what its far channels may come from."""
    fit = replace(fit, open_numbers=number_spread(case))
    if far_channels(fit.held_out, fit.noise_floor, FAR_FROM_FLOOR, but=open_channels(fit)):
        fit = replace(fit, all_fitted=errors_of_all_fitted(case, spans))
    return fit


def number_spread(case: Case) -> Errors:
    """s (NY,), median over the recordings; empty where a free run ends early."""
    point, jacobian = case.last, case.final.jacobian if case.final else case.rounds[0].jacobian
    names = case.final.coordinates if case.final else ()
    discount = max(1.0, case.temperature / COLDEST) * FORM**2
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


def errors_of_all_fitted(case: Case, spans: Spans) -> Errors:
    """(NY,) errors of free runs over what was held out of parameters that were fitted to it as well; median over recordings."""
    bags, select = [*case.bags, *case.proving], [*case.select, *(bag.counted for bag in case.proving)]
    start = _likeliest(case, bags, select) if case.proving else case.kept(0)  # which has seen the end of each recording
    machine = machine_at(case, fitted_to_free_runs(case, start, bags, select))
    return held_out({"all": free_runs(machine, case, spans)}, spans)["all"]


def _likeliest(case: Case, bags: Sequence[Bag], select: Sequence[Flags]) -> Point:
    """The parameters by one-step errors, with fresh derivatives twice."""
    point = case.kept(0)
    for _ in range(2):
        problem = problem_at(case.machine, bags, select, case.nuisances, point.z, {}, LOOSENESS[0])
        start = problem.points([(point.z, {})])[0]
        point, _ = problem.fit(start, problem.nuisance_jacobian(start), ())
    return point
