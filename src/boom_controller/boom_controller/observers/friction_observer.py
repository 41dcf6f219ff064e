"""Friction told from load: what the load observer takes for a load that comes and goes with the direction of motion is friction.

Friction that is phi times the machine file's has the load observer find m^ = m + (phi - phi^) tau_f / g_m, g_m = dg/dm. A load
stays where it is when the boom turns, friction changes its sign:

    r = g_m (m^ - m_s),   phi^' = gamma r tau_f / (tau_f^2 + tau_0^2),   m_s' = (m^ - m_s) / T_s

A residual beyond all friction is a load that was grasped or released, with which m_s begins anew.
"""

from __future__ import annotations

from typing import NamedTuple

import casadi as ca

from boom_controller.blocks.control_model import ModelQuantities
from boom_controller.blocks.limits import limited
from boom_model.regularisation import Expression

LEARNING = 0.4
"""1/s, gamma."""
STEADY = 5.0
"""s, T_s."""
LEAST = 1000.0
"""N m, tau_0: below this much friction little is learnt."""
LOWEST, HIGHEST = 0.3, 2.5
BEYOND = 1.5
"""Residual over friction from which it is a load."""


class FrictionState(NamedTuple):
    """phi^ [-], m_s [kg]."""

    factor: Expression = 1.0
    steady: Expression = 0.0


def observe_friction(x: FrictionState, q: ModelQuantities, load: Expression, sample_time: float) -> FrictionState:
    """One sample time with the model at the present load, and the observed load [kg]."""
    residual = q.tip_gravity * (load - x.steady)
    size = ca.fabs(q.sliding)
    grasped = ca.fabs(residual) > BEYOND * ca.fmax(size, LEAST)
    change = LEARNING * residual * q.sliding / (size * size + LEAST * LEAST)
    factor = limited(x.factor + sample_time * change, LOWEST, HIGHEST)
    steady = x.steady + sample_time / STEADY * (load - x.steady)
    return FrictionState(ca.if_else(grasped, x.factor, factor), ca.if_else(grasped, load, steady))
