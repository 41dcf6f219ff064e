"""How fast valve, pump and currents can move the piston: by the model, and by what has come while the valve was wide open.

    v_max = c q_max / A,   c' = (v / Q - c) / T   while Q > WIDE q_max / A,   Q = q / A of the side that the supply feeds

The compensated side sets the speed; the other side's pressure follows. A pump, a supply pressure or a solenoid that gives less than
the machine file tells shows only when the valve is wide open, and c stays what it was until it is so again.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import casadi as ca

from boom_model.regularisation import Expression

WIDE = 0.6
AVERAGING = 0.4
"""s, T."""
LEAST = 0.05


class ReachState(NamedTuple):
    """c of lifting and of lowering [-]."""

    lift: Expression = 1.0
    lower: Expression = 1.0


def watch_reach(
    x: ReachState,
    velocity: Expression,
    supplied: tuple[Expression, Expression],
    widest: tuple[Expression, Expression],
    s: Any,
) -> tuple[ReachState, Expression, Expression]:
    """One sample time.

    Args:
        x: the state.
        velocity: v [m/s], positive lifts.
        supplied: Q [m/s] of lifting and of lowering by the model of the valve, each positive.
        widest: the same at the widest opening.
        s: settings.

    Returns:
        State, and v_max of lifting and lowering [m/s], each positive.
    """
    shares = []
    for share, speed, flow, most in zip(x, (velocity, -velocity), supplied, widest, strict=True):
        come = ca.fmin(ca.fmax(speed / ca.fmax(flow, 1e-3), LEAST), 1.0)
        learnt = share + s.sample_time / AVERAGING * (come - share)
        shares.append(ca.if_else(ca.logic_and(flow > WIDE * most, most > 0), learnt, share))
    return ReachState(*shares), shares[0] * widest[0], shares[1] * widest[1]
