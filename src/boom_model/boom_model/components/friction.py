"""Friction of the cylinder: as a torque in the joint, (3.7) = (5.39b), or as a force of its seals, which acts through the linkage.

    joint:     tau_f = tau_C+- tanh(w / sigma) + k_v+- w
    cylinder:  tau_f = (J F_C+- + tau_p+-) tanh(w_p / sigma) + (J^2 d+- + k_p+-) w,   w_p = J w

+ for w >= 0 (lifting), - for w < 0 (lowering); w is the boom's angular velocity [rad/s], J = ds_p/dq_2. The second is not in the
thesis; seals of a loader crane rub with 300 to 900 N. tau_p and k_p are the share of the joint's pins, 0 unless given: how much of
a crane's friction follows the lever of its cylinder, no data sheet says.
"""

from __future__ import annotations

from typing import Any

import casadi as ca

from boom_model.regularisation import Expression
from boom_model.slots import Friction, register
from boom_model.specification import Specification, none_unless_given

SPECIFICATIONS = (
    Specification("friction.tau_C_pos", "tau_C+", "N m", "Coulomb friction, lifting", 0.0, 1e5, "3.7"),
    Specification("friction.tau_C_neg", "tau_C-", "N m", "Coulomb friction, lowering", 0.0, 1e5, "3.7"),
    Specification("friction.k_v_pos", "k_v+", "N m s/rad", "viscous friction, lifting", 0.0, 1e6, "3.7"),
    Specification("friction.k_v_neg", "k_v-", "N m s/rad", "viscous friction, lowering", 0.0, 1e6, "3.7"),
    Specification("friction.sigma", "sigma", "rad/s", "width of the tanh", 1e-4, 1.0, "3.7"),
)
AT_SEALS = (
    Specification("friction.F_C_pos", "F_C+", "N", "Coulomb friction of the seals, lifting", 0.0, 1e5, "-"),
    Specification("friction.F_C_neg", "F_C-", "N", "Coulomb friction of the seals, lowering", 0.0, 1e5, "-"),
    Specification("friction.d_pos", "d_+", "N s/m", "viscous friction of the seals, lifting", 0.0, 1e6, "-"),
    Specification("friction.d_neg", "d_-", "N s/m", "viscous friction of the seals, lowering", 0.0, 1e6, "-"),
    Specification("friction.sigma_p", "sigma_p", "m/s", "width of the tanh", 1e-5, 1.0, "-"),
    *(
        Specification(
            f"friction.{key}_{way}",
            f"{key}{sign}",
            unit,
            f"{what} friction of the pins, {word}",
            0.0,
            most,
            "-",
            entry=none_unless_given,
        )
        for key, unit, what, most in (("tau_p", "N m", "Coulomb", 1e6), ("k_p", "N m s/rad", "viscous", 1e7))
        for way, sign, word in (("pos", "+", "lifting"), ("neg", "-", "lowering"))
    ),
)


def torque(angle: Expression, rate: Expression, p: Any, e: Any) -> Expression:
    """tau_f [N m] in the joint at boom angle q_2 [rad] and angular velocity [rad/s]; ``e``: the active effects."""
    c = p.friction
    return _torque(angle, rate, e, (c.tau_C_pos, c.tau_C_neg), (c.k_v_pos, c.k_v_neg), c.sigma)


def torque_of_seals(angle: Expression, rate: Expression, jacobian: Expression, p: Any, e: Any) -> Expression:
    """tau_f [N m] of the seals and pins at q_2 [rad], angular velocity [rad/s] and J [m/rad]."""
    c = p.friction
    coulomb = (jacobian * c.F_C_pos + c.tau_p_pos, jacobian * c.F_C_neg + c.tau_p_neg)
    viscous = (jacobian**2 * c.d_pos + c.k_p_pos, jacobian**2 * c.d_neg + c.k_p_neg)
    return _torque(angle, rate, e, coulomb, viscous, c.sigma_p / jacobian)


def _torque(
    angle: Expression, rate: Expression, e: Any, coulomb: tuple[Any, Any], viscous: tuple[Any, Any], sigma: Expression
) -> Expression:
    """coulomb [N m] and viscous [N m s/rad] friction of lifting and lowering, sigma [rad/s]."""
    size = ca.if_else(rate >= 0, *coulomb)
    size = e.through("coulomb_friction", size, angle=angle, rate=rate)
    sliding = e.through("sliding_friction", size * ca.tanh(rate / sigma), rate=rate, coulomb=size)
    torque = sliding + ca.if_else(rate >= 0, *viscous) * rate
    return e.through("friction_torque", torque, angle=angle, rate=rate)


def _sizes(specifications: tuple[Specification, ...]) -> tuple[str, ...]:
    return tuple(spec.key for spec in specifications[:4])


register(Friction(
    name="joint", meaning="friction as a torque in the joint", term="tau_f = tau_C tanh(w / sigma) + k_v w", equation="5.39b",
    specifications=SPECIFICATIONS, torque=lambda angle, rate, jacobian, p, e: torque(angle, rate, p, e),
    sizes=_sizes(SPECIFICATIONS),
))  # fmt: skip
register(Friction(
    name="cylinder", meaning="friction of the cylinder's seals, through the linkage, and of the pins",
    term="tau_f = (J F_C + tau_p) tanh(w_p / sigma_p) + (J^2 d + k_p) w", specifications=AT_SEALS, torque=torque_of_seals,
    sizes=_sizes(AT_SEALS),
))  # fmt: skip
