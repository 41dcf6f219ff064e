"""What a refinement cannot determine in principle: numbers that act only in combination, and which orifice is whose.

No sensor measures the spool: if pilot pressures, spring, friction, damping and mass of the spool scale alike, it moves as before.
Orifice areas are multiplied by A_0, C_d and the root of the compensator's margin. Such numbers are held at the values of the
machine file. That they act only in combination is tested: with all numbers of a group changed by a factor, the recordings must
be reproduced as well as before.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from math import log

import numpy as np

from boom_estimation.fit import FitResult, cost_at
from boom_estimation.problem import EstimationProblem
from boom_estimation.uncertainty import NINETY, Uncertainty
from boom_estimation.unknown import Unknown
from boom_identification.estimate import NotDetermined
from boom_model.machine import Machine

_VALVE, _SPOOL = "main_valve_orifices", "main_valve_spool"
AREAS = tuple(f"{_VALVE}.{name}" for name in ("A_sa_max", "A_tb_max", "A_sb_max"))
CHARGES = ("accumulators.p_g0_1", "accumulators.p_g0_2")
ORIFICES = ("accumulators.d_1", "accumulators.d_2")
_GAIN = tuple(f"pilot_valves.h.{i}" for i in range(3))
_SPOOL_ALIKE: Mapping[str, float] = dict.fromkeys((*_GAIN, *(f"{_SPOOL}.{n}" for n in ("k", "f_c", "d_v", "m_s"))), 1.0)
_LAW = (f"{_VALVE}.A_ta_law.c0", f"{_VALVE}.A_ta_law.c1")
_GROUPS: tuple[tuple[str, tuple[str, ...], Mapping[str, float]], ...] = (
    ("pilot gain and spring cannot be separated", (*_GAIN, f"{_SPOOL}.k"), _SPOOL_ALIKE),
    ("only pilot pressure times area acts", (f"{_SPOOL}.A_s",), {f"{_SPOOL}.A_s": 1.0} | dict.fromkeys(_GAIN, -1.0)),
    (
        "only area times root of the margin acts",
        (f"{_VALVE}.dp_c",),
        {f"{_VALVE}.dp_c": 1.0, AREAS[0]: -0.5, AREAS[2]: -0.5} | dict.fromkeys(_LAW, -0.5),
    ),
    (
        "only areas times coefficient act",
        ("fluid.C_d",),
        {"fluid.C_d": 1.0, f"{_VALVE}.anti_cavitation.A_ac": -1.0}
        | dict.fromkeys(AREAS, -1.0)
        | dict.fromkeys(ORIFICES, -0.5),
    ),
)
"""Reason, numbers that are named if held, and exponents of the common factor."""
NORMALISATION = f"{_VALVE}.A_0"
FACTOR = 1.25
_RISE = 1.0
"""Change of cost (twice a log-likelihood ratio) below which the recordings do not show the change."""
_PAIRING = 3.0
"""Standard deviations by which both accumulators must differ in pre-charge and in orifice."""


def tied(
    problem: EstimationProblem, best: FitResult, machine: Machine
) -> list[tuple[str, tuple[str, ...], tuple[str, ...]]]:
    """Groups of numbers that the recordings determine only in combination: reason, numbers to name, all members.

    Args:
        problem: what the fit solved.
        best: the fit.
        machine: machine of these numbers.
    """
    has = {c for p in machine.parameters.values() for c in p.specification.components}
    result = []
    for why, named, exponents in _GROUPS:
        if not set(exponents) <= has:
            continue
        factors = [
            Unknown(f"factor of {name}", "", 1.0, abs(log(FACTOR)), 0.1, 10.0, True, (name,), prior=False)
            for name in exponents
        ]
        wider = EstimationProblem(problem.experiments, (*best.unknowns, *factors))
        costs = [
            cost_at(wider, best.gains, np.concatenate((best.z, step * np.array(list(exponents.values())))))
            for step in (0.0, 1.0)
        ]
        if abs(costs[1] - costs[0]) < _RISE:
            result.append((why, named, tuple(exponents)))
    if set(AREAS) <= has:
        # by definition (5.27a): the areas are A_0 times what is dimensionless
        result.append(("only the product with the areas acts", (NORMALISATION,), (NORMALISATION, *AREAS)))
    return result


def held_numbers(
    groups: list[tuple[str, tuple[str, ...], tuple[str, ...]]], estimated: Collection[str]
) -> list[NotDetermined]:
    """Held numbers of the groups, each with its group."""
    missing: dict[str, NotDetermined] = {}
    for why, named, members in groups:
        for name in named:
            if name not in estimated and name not in missing:
                missing[name] = NotDetermined(name, f"held: {why} ({', '.join(members)} go together)", False)
    return list(missing.values())


def pairing_told(spread: Uncertainty, vague: Collection[str]) -> bool:
    """Whether the recordings determine which orifice belongs to which accumulator.

    The equations of both accumulators are the same: exchanging all their numbers changes nothing. The pairing is determined only if
    pre-charges and orifices both clearly differ. A pre-charge that is not estimated counts as known; one of ``vague``, the
    unknowns that are not determined, does not.
    """
    names = [u.name for u in spread.unknowns]
    for first, second in (CHARGES, ORIFICES):
        if first in vague or second in vague:
            return False
        if first not in names or second not in names:
            continue
        i, j = names.index(first), names.index(second)
        middle = [0.5 * (spread.low[k] + spread.high[k]) for k in (i, j)]
        sigma = [0.5 * (spread.high[k] - spread.low[k]) / m / NINETY for k, m in zip((i, j), middle, strict=True)]
        variance = sigma[0] ** 2 + sigma[1] ** 2 - 2 * spread.correlation[i, j] * sigma[0] * sigma[1]
        if np.log(middle[0] / middle[1]) ** 2 < _PAIRING**2 * variance:
            return False
    return True
