"""Equation of motion of the boom with all other joints locked, (3.15) = (5.39a).

    D q_2'' + g(q_2) = J(q_2) f_p - tau_f
    D = D_0 + m |tip|^2
    g(q_2) = g_0 ((S_x + m t_x) cos q_2 - (S_y + m t_y) sin q_2)

D_0 and (S_x, S_y) are inertia and first moment about the boom joint of everything that moves, in the boom's frame
(x along the boom), without the load; tip = (t_x, t_y) is the tip hinge, at which the load m hangs as a point mass
(machine notes; the thesis has D and g as MATLAB functions only). m is the mass that the configuration tells.
"""

from __future__ import annotations

from typing import Any

import casadi as ca

from boom_model.regularisation import Expression
from boom_model.specification import Specification

SPECIFICATIONS = (
    Specification("constants.g", "g_0", "m/s^2", "gravity", 9.7, 9.9, "3.4"),
    Specification("pose.D0", "D_0", "kg m^2", "inertia about the boom joint, no load", 1.0, 1e7, "3.4"),
    Specification("pose.Sx", "S_x", "kg m", "first moment along the boom, no load", -1e6, 1e6, "3.4"),
    Specification("pose.Sy", "S_y", "kg m", "first moment across the boom, no load", -1e6, 1e6, "3.4"),
    Specification("pose.tip", "tip", "m", "tip hinge in the boom's frame", -50.0, 50.0, "3.4", "pair"),
    Specification("pose.load", "m_L", "kg", "load at the tip that the configuration tells", 0.0, 1e5, "3.4"),
)
"""The section ``pose`` is not in the machine file: it follows from it, the pose of the locked joints and the load."""


def load_mass(p: Any, e: Any, position: Expression = 0.0, steps: Expression = 0.0) -> Expression:
    """m [kg] at the piston position [m], with the ``steps`` of the load [kg]."""
    return e.through("load_mass", p.pose.load + steps, position=position)


def inertia(load: Expression, p: Any) -> Expression:
    """D [kg m^2] with the load [kg]."""
    return p.pose.D0 + load * (p.pose.tip[0] ** 2 + p.pose.tip[1] ** 2)


def gravity_torque(angle: Expression, load: Expression, p: Any, e: Any) -> Expression:
    """g(q_2) [N m] at the boom angle q_2 [rad] with the load [kg]."""
    along = p.pose.Sx + load * p.pose.tip[0]
    across = p.pose.Sy + load * p.pose.tip[1]
    return e.through(
        "gravity_torque", p.constants.g * (along * ca.cos(angle) - across * ca.sin(angle)), angle=angle, p=p
    )


def torque(gravity: Expression, jacobian: Expression, force: Expression, friction: Expression) -> Expression:
    """D q_2'' [N m] from g(q_2), J [m/rad], f_p [N] and tau_f [N m]."""
    return jacobian * force - friction - gravity
