"""Asymmetric friction torque of the cylinder, (3.7) = (5.39b).

    tau_f = tau_C+ tanh(w / sigma) + k_v+ w   for w >= 0 (lifting)
    tau_f = tau_C- tanh(w / sigma) + k_v- w   for w <  0 (lowering)

w is the boom's angular velocity [rad/s]. Effects that act here, with their neutral values:

* ``stribeck_friction``: the Coulomb torque is raised by tau_s exp(-(w / w_s)^2) (neutral tau_s = 0).
* ``position_dependent_friction``: the Coulomb torque is multiplied by 1 + b exp(-((q_2 - q_c) / width)^2) (neutral b = 0).
* ``presliding_friction``: bristles (LuGre, without bristle damping) instead of the tanh. Their torque z is a state,
  c z' = w - |w| z / tau_C, with the compliance c of the bristles (neutral c = 0: no state). Source: Canudas de Wit et al. 1995.
* ``friction_drift``: all of tau_f is multiplied by 1 + (r - 1) (1 - exp(-t / T)), t since the start of the run (neutral r = 1).
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


def torque(angle: Expression, rate: Expression, p: Any, e: Any, bristle: Expression | None = None) -> Expression:
    """tau_f [N m] at boom angle q_2 [rad] and angular velocity [rad/s]; ``e`` holds the effects' parameters.

    ``bristle`` [N m]: state of ``presliding_friction``, which then stands for the Coulomb term.
    """
    c = p.friction
    sliding = coulomb(angle, rate, p, e) * ca.tanh(rate / c.sigma) if bristle is None else bristle
    return sliding + ca.if_else(rate >= 0, c.k_v_pos, c.k_v_neg) * rate


def coulomb(angle: Expression, rate: Expression, p: Any, e: Any) -> Expression:
    """tau_C [N m], its size without direction, with what Stribeck and a tight spot add."""
    c, s, b = p.friction, e.stribeck_friction, e.position_dependent_friction
    size = ca.if_else(rate >= 0, c.tau_C_pos, c.tau_C_neg) + s.tau_s * ca.exp(-((rate / s.w_s) ** 2))
    return size * (1 + b.b * ca.exp(-(((angle - b.q_c) / b.width) ** 2)))


def bristle_rate(angle: Expression, rate: Expression, bristle: Expression, p: Any, e: Any) -> Expression:
    """d/dt of the bristles' torque [N m/s] of ``presliding_friction``."""
    return (rate - ca.fabs(rate) * bristle / coulomb(angle, rate, p, e)) / e.presliding_friction.compliance


def drift(elapsed: Expression, e: Any) -> Expression:
    """Factor of the whole friction torque after ``elapsed`` [s]."""
    d = e.friction_drift
    return 1 + (d.r - 1) * (1 - ca.exp(-elapsed / d.T))
