"""Asymmetric friction torque of the cylinder, (3.7) = (5.39b).

    tau_f = tau_C+ tanh(w / sigma) + k_v+ w   for w >= 0 (lifting)
    tau_f = tau_C- tanh(w / sigma) + k_v- w   for w <  0 (lowering)

w is the boom's angular velocity [rad/s]. Effects that act here, with their neutral values:

* ``stribeck_friction``: the Coulomb torque is raised by tau_s exp(-(w / w_s)^2) (neutral tau_s = 0).
* ``position_dependent_friction``: the Coulomb torque is multiplied by 1 + b exp(-((q_2 - q_c) / width)^2) (neutral b = 0).
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
    """tau_f [N m] at boom angle q_2 [rad] and angular velocity [rad/s]; ``e`` holds the effects' parameters."""
    c, s, b = p.friction, e.stribeck_friction, e.position_dependent_friction
    lifting = rate >= 0
    coulomb = ca.if_else(lifting, c.tau_C_pos, c.tau_C_neg)
    viscous = ca.if_else(lifting, c.k_v_pos, c.k_v_neg)
    coulomb = coulomb + s.tau_s * ca.exp(-((rate / s.w_s) ** 2))
    coulomb = coulomb * (1 + b.b * ca.exp(-(((angle - b.q_c) / b.width) ** 2)))
    return coulomb * ca.tanh(rate / c.sigma) + viscous * rate
