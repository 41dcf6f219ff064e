"""Piston position over boom angle for a cylinder that acts on the boom through a four-bar linkage.

Equation (3.13a), s_p(q_2); the thesis does not print it, the linkage is that of the machine file:

    A = R(q_2) att,  d = A - pivot
    al = (L_1^2 - L_2^2 + |d|^2) / (2 |d|^2)
    be = -sqrt(((L_1 + L_2)^2 - |d|^2) (|d|^2 - (L_1 - L_2)^2)) / (2 |d|^2)
    C = pivot + al d + be (-d_y, d_x),  s_p = |C - foot| - l_min

Column frame: origin in the boom joint, x outward, y up. R is the plane rotation. C is the joint of both bars and the rod.
Valid where the square root is real; the machine file's ``q2_stroke_min`` .. ``q2_max`` lie inside.
"""

from __future__ import annotations

from typing import Any

import casadi as ca

from boom_model.regularisation import Expression
from boom_model.slots import Bar, Linkage, register
from boom_model.specification import Specification

SPECIFICATIONS = (
    Specification("kinematics.foot", "foot", "m", "foot of the cylinder on the column", -10.0, 10.0, "3.13a", "pair"),
    Specification(
        "kinematics.pivot", "pivot", "m", "pivot of the long bar on the column", -10.0, 10.0, "3.13a", "pair"
    ),
    Specification("kinematics.att", "att", "m", "joint of the short bar on the boom", -10.0, 10.0, "3.13a", "pair"),
    Specification("kinematics.L1", "L_1", "m", "length of the long bar", 1e-3, 10.0, "3.13a"),
    Specification("kinematics.L2", "L_2", "m", "length of the short bar", 1e-3, 10.0, "3.13a"),
    Specification("cylinder.l_min", "l_min", "m", "pin-to-pin length at s_p = 0", 1e-2, 20.0, "3.13a"),
)


def piston_position(angle: Expression, p: Any) -> Expression:
    """s_p(q_2) [m] for the boom angle q_2 [rad]; ``p`` holds the parameters ``kinematics`` and ``cylinder``."""
    k = p.kinematics
    joint = _rod_joint(_attachment(angle, k), k)
    c_x, c_y = joint[0] - k.foot[0], joint[1] - k.foot[1]
    return ca.sqrt(c_x * c_x + c_y * c_y) - p.cylinder.l_min


def bars(angle: Expression, p: Any) -> tuple[Bar, ...]:
    """Cylinder, long and short bar at the boom angle q_2 [rad]."""
    k = p.kinematics
    attachment = _attachment(angle, k)
    joint = _rod_joint(attachment, k)
    return Bar((k.foot[0], k.foot[1]), joint), Bar((k.pivot[0], k.pivot[1]), joint), Bar(attachment, joint)


def _attachment(angle: Expression, k: Any) -> tuple[Expression, Expression]:
    """A (x, y) [m]."""
    cos, sin = ca.cos(angle), ca.sin(angle)
    return cos * k.att[0] - sin * k.att[1], sin * k.att[0] + cos * k.att[1]


def _rod_joint(attachment: tuple[Expression, Expression], k: Any) -> tuple[Expression, Expression]:
    """C (x, y) [m]."""
    d_x, d_y = attachment[0] - k.pivot[0], attachment[1] - k.pivot[1]
    d_2 = d_x * d_x + d_y * d_y
    along = (k.L1**2 - k.L2**2 + d_2) / (2 * d_2)
    across = -ca.sqrt(((k.L1 + k.L2) ** 2 - d_2) * (d_2 - (k.L1 - k.L2) ** 2)) / (2 * d_2)
    return k.pivot[0] + along * d_x - across * d_y, k.pivot[1] + along * d_y + across * d_x


register(Linkage(
    name="four_bar", meaning="cylinder that acts through a four-bar linkage", term="s_p = |C(q_2) - foot| - l_min",
    equation="3.13a", specifications=SPECIFICATIONS, piston_position=piston_position, bars=bars,
))  # fmt: skip
