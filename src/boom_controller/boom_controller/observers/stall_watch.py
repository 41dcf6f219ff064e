"""Recognises a load that cannot be held: the valve is open to lift, and the supply does not deliver enough.

Uses the head side only: delivered speed v + f_h' / K_h, f_h = A_a p_h, against the speed Q = q_h / A_a that the open valve
would give with its full pressure margin: less than a quarter of it for ``stall_time``. With an unlimited supply that does not
happen for any load: flow that does not move the piston compresses the oil.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import casadi as ca

from boom_model.regularisation import Expression

LEAST_SPEED = 0.02
"""m/s. Below this the valve counts as closed."""
DELIVERED_SHARE = 0.25
SMOOTHING = 10.0
"""1/s, of the delivered speed."""


class StallState(NamedTuple):
    """Delivered speed [m/s] smoothed, for how long it has been too low [s], f_h [N] of the sample before."""

    delivered: Expression = 0.0
    elapsed: Expression = 0.0
    force: Expression = 0.0


def watch_supply(
    x: StallState, velocity: Expression, modelled: Expression, force: Expression, stiffness: Expression, s: Any
) -> StallState:
    """One sample time: v and Q [m/s], f_h [N], K_h [N/m], settings ``s``. The load cannot be held once ``stalled``."""
    t = s.sample_time
    delivered = x.delivered + SMOOTHING * (t * (velocity - x.delivered) + (force - x.force) / stiffness)
    short = ca.logic_and(modelled > LEAST_SPEED, delivered < DELIVERED_SHARE * modelled)
    return StallState(delivered, ca.if_else(short, x.elapsed + t, 0.0), force)


def stalled(x: StallState, s: Any) -> Expression:
    """Whether the supply has delivered too little for too long."""
    return x.elapsed > s.stall_time


def reason(load: float, pressure: float) -> str:
    """For the operator: estimated load [kg], p_h [Pa]."""
    return (
        f"the load of about {load:.0f} kg cannot be held: the valve is open to lift and the supply delivers too little "
        f"at p_h = {pressure / 1e5:.0f} bar"
    )
