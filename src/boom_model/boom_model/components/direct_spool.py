"""Spool of a valve that the currents command directly, without a pilot stage: a first-order lag.

    T_s s_s' = s_c - s_s,   s_c = min(max(K_i (i_+ - i_-), -s_max), s_max)

Beyond the current of the full stroke nothing opens further: the electronics limit the command, and the spool stands at its stop.
i_+ retracts (s_s > 0), i_- extends (s_s < 0). Not in the thesis: for machines of another make, e.g. a proportional valve with
on-board position control. Effects that need a pilot stage or a spring do not apply; ``spool_lag`` and ``command_delay`` do.
"""

from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np

from boom_model.regularisation import Expression
from boom_model.slots import Spool, Wiring, register
from boom_model.specification import Specification

SPECIFICATIONS = (
    Specification("main_valve_spool.s_max", "s_s^max", "m", "full stroke to either side", 1e-4, 0.1, "5.9"),
    Specification("main_valve_spool.K_i", "K_i", "m/A", "spool position per current", 1e-5, 1.0, "-"),
    Specification("main_valve_spool.T_s", "T_s", "s", "time constant of the spool", 1e-4, 10.0, "-"),
)


OFF = 0.04
"""Of full stroke: what a discrepancy of one is. About as much as 1 bar of pilot pressure moves a piloted spool."""


def velocity(
    position: Expression, retract: Expression, extend: Expression, p: Any, e: Any, off: Expression = 0.0
) -> Expression:
    """s_s' [m/s] for s_s [m], the two currents [A] and what is missing of the commanded position [m]."""
    return (commanded(retract, extend, p) + off - position) / time_constant(p, e)


def commanded(retract: Expression, extend: Expression, p: Any) -> Expression:
    """s_c [m] for the two currents [A]."""
    s = p.main_valve_spool
    return ca.fmin(ca.fmax(s.K_i * (retract - extend), -s.s_max), s.s_max)


def at_rest(retract: Any, extend: Any, p: Any, _pilot: Any) -> Any:
    """:func:`commanded` for numbers (n,) [A]."""
    s = p.main_valve_spool
    return np.clip(s.K_i * (retract - extend), -s.s_max, s.s_max)


def time_constant(p: Any, e: Any) -> Expression:
    """T_s [s]."""
    return 1.0 / e.through("spool_rate", 1.0 / p.main_valve_spool.T_s)


def _motion(w: Wiring, position: Expression, _force: Expression) -> None:
    off = w.discrepancy("spool", OFF * w.p.main_valve_spool.s_max)
    w.rates["spool_position"] = velocity(position, w.u[0], w.u[1], w.p, w.e, off)


register(Spool(
    name="direct", meaning="follows its current with a lag", term="T_s s_s' = s_c - s_s, s_c = K_i (i_+ - i_-), at most s_max",
    specifications=SPECIFICATIONS, motion=_motion,
    position=at_rest,
    current=lambda position, p, pilot: position / p.main_valve_spool.K_i,
    settling=lambda p, e, pilot: time_constant(p, e),
))  # fmt: skip
