"""What a healthy machine with the same currents looks like: the level that losses are counted from."""

from __future__ import annotations

import numpy as np

from boom_diagnosis.case import Case
from boom_diagnosis.fitting import WHITE
from boom_diagnosis.healthy import simulated
from boom_diagnosis.hypotheses import Round, problem_at
from boom_diagnosis.prediction import mean_squares

RAN = 0.95
"""Share of a recording from which on a healthy copy counts as whole."""


def calibrate(case: Case, first: Round) -> None:
    """The loss of a healthy machine with the same currents; that of white noise where none gets far with them.

    With the tolerances as fitted, or nominal where that machine gets further.
    """
    tried = []
    for values in (first.problem.values(first.base.z, {}), dict[str, float]()):
        made = [simulated(bag, case.machine, values, case.seed + 1 + i) for i, bag in enumerate(case.bags)]
        reached = [len(copy.grid) / len(bag.grid) if copy else 0.0 for copy, bag in zip(made, case.bags, strict=True)]
        tried.append((min(reached), values, made))
        if tried[0][0] > RAN:
            break
    _, values, copies = max(tried, key=lambda t: t[0])
    case.healthy = [copy or bag for copy, bag in zip(copies, case.bags, strict=True)]
    known = [copy for copy in copies if copy is not None]
    if not known:
        case.floor = WHITE
        return
    select = [bag.counted for bag in known]
    problem = problem_at(case.machine, known, select, case.nuisances, np.zeros(len(case.nuisances)), {}, 1.0)
    exact = problem.predictor.predict([values])[0]
    case.healthy_squares = mean_squares([r.whitened for r in exact], select)
    case.floor = float(0.5 * np.mean(case.healthy_squares))
