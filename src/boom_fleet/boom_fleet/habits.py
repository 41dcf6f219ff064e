"""What is usual in a fleet: how much of each effect its machines seem to have, and how much they differ from day to day.

A healthy machine seems to have an effect because the model's form is not its own: much of some, little of others. With z_me and
v_me the mean and variance of effect e in machine m if nothing had changed, and a wide prior, the fleet's ``form`` of it is

    f_e^2 = median over m of (z_me^2 + v_me) / 0.455        0.455: median of chi^2 with one degree of freedom

so that a minority of changed machines does not matter; with few machines it is drawn to that of all effects. A factor of all f_e
and ``wander`` are then those under which the machines are likeliest if nothing had changed, the median over them.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from boom_fleet.evidence import FORMS, WANDERS, NumberKinds, log_likelihood, spreads
from boom_fleet.past import Evidence, MachinePast

Array = NDArray[np.float64]

UNKNOWN = (0.1, 0.2)
"""``form`` and ``wander`` of a fleet without two recordings of one machine."""
WIDE = (FORMS[-1], 0.1)
"""``form`` and ``wander`` under which the effects of a machine are looked at."""
DRAWN_TO_ALL = 4.0
"""Machines that the mean of all effects counts for, where the form of one is found."""
_MEDIAN_CHI2 = 0.4549364231195724


def apparent(evidence: Sequence[Evidence], kinds: NumberKinds) -> Array:
    """(k,) z^2 + v of the numbers of a machine if nothing had changed."""
    spread, wander = spreads(kinds._replace(effects=np.sign(kinds.effects)), *WIDE)
    past = MachinePast(evidence, spread, wander)
    matrices, vectors = past.matrices(len(evidence))
    covariance = np.linalg.inv(np.diag(past.precision) + sum(matrices))
    mean = covariance @ np.sum(vectors, axis=0)
    return np.asarray(mean**2 + np.diag(covariance))


def profile(squares: Array) -> Array:
    """(e,) how much more of each effect healthy machines seem to have than of all on the mean; squares: (machines, e)."""
    logs = 0.5 * np.log(np.clip(np.median(squares, axis=0) / _MEDIAN_CHI2, FORMS[0] ** 2, FORMS[-1] ** 2))
    share = len(squares) / (len(squares) + DRAWN_TO_ALL)
    return np.asarray(np.exp(share * (logs - logs.mean())))


def likeliest(evidence: Sequence[Evidence], kinds: NumberKinds) -> tuple[float, float]:
    """``form`` and ``wander`` of a machine."""
    table = {
        (form, wander): log_likelihood(MachinePast(evidence, *spreads(kinds, form, wander)))
        for form in FORMS for wander in WANDERS
    }  # fmt: skip
    return max(table, key=lambda pair: table[pair])


def usual(pairs: Sequence[tuple[float, float]]) -> tuple[float, float]:
    """``form`` and ``wander`` of a fleet: the median over its machines (geometric where two are in the middle)."""
    if not pairs:
        return UNKNOWN
    form, wander = np.median(np.log(np.array(pairs)), axis=0)
    return float(np.exp(form)), float(np.exp(wander))
