"""Whether numbers within their tolerances explain all recordings at once, those that were held out among them.

Recordings that are fitted may leave numbers open that others need. Physics is left out only where no numbers explain both.
"""

from __future__ import annotations

from boom_diagnosis.case import Case
from boom_diagnosis.fitting import Point
from boom_diagnosis.freerun import Errors
from boom_diagnosis.hypotheses import LOOSENESS, problem_at
from boom_diagnosis.proof import Spans, free_runs, held_out, machine_at

FITS = 3
"""With fresh derivatives, from where the fit to less ended."""


def errors_of_all_fitted(case: Case, spans: Spans) -> Errors:
    """(NY,) errors of free runs over what was held out of parameters that were fitted to it as well; median over recordings."""
    return held_out({"all": free_runs(machine_at(case, _fitted(case)), case, spans)}, spans)["all"]


def _fitted(case: Case) -> Point:
    """The parameters at all recordings."""
    point = case.kept(0)
    if not case.proving:  # held out is the end of what the search goes by
        return point
    bags, select = [*case.bags, *case.proving], [*case.select, *(bag.counted for bag in case.proving)]
    for _ in range(FITS):
        problem = problem_at(case.machine, bags, select, case.nuisances, point.z, {}, LOOSENESS[0])
        start = problem.points([(point.z, {})])[0]
        point, _ = problem.fit(start, problem.nuisance_jacobian(start), ())
    return point
