"""Asymmetric friction torque of the cylinder, (3.7) = (5.39b).

    tau_f = tau_C+ tanh(w / sigma) + k_v+ w   for w >= 0 (lifting)
    tau_f = tau_C- tanh(w / sigma) + k_v- w   for w <  0 (lowering)

w is the boom's angular velocity [rad/s].
"""

from __future__ import annotations

from typing import Any

import casadi as ca

from boom_model.regularisation import Expression
from boom_model.specification import Specification

SPECIFICATIONS = (
    Specification("friction.tau_C_pos", "tau_C+", "N m", "Coulomb friction, lifting", 0.0, 1e5, "3.7"),
    Specification("friction.tau_C_neg", "tau_C-", "N m", "Coulomb friction, lowering", 0.0, 1e5, "3.7"),
    Specification("friction.k_v_pos", "k_v+", "N m s/rad", "viscous friction, lifting", 0.0, 1e6, "3.7"),
    Specification("friction.k_v_neg", "k_v-", "N m s/rad", "viscous friction, lowering", 0.0, 1e6, "3.7"),
    Specification("friction.sigma", "sigma", "rad/s", "width of the tanh", 1e-4, 1.0, "3.7"),
)


def torque(angle: Expression, rate: Expression, p: Any, e: Any) -> Expression:
    """tau_f [N m] at boom angle q_2 [rad] and angular velocity [rad/s]; ``e``: the active effects."""
    c = p.friction
    size = ca.if_else(rate >= 0, c.tau_C_pos, c.tau_C_neg)
    size = e.through("coulomb_friction", size, angle=angle, rate=rate)
    sliding = e.through("sliding_friction", size * ca.tanh(rate / c.sigma), rate=rate, coulomb=size)
    torque = sliding + ca.if_else(rate >= 0, c.k_v_pos, c.k_v_neg) * rate
    return e.through("friction_torque", torque, angle=angle, rate=rate)
