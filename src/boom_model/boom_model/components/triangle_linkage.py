"""Piston position over boom angle for a cylinder pinned directly to column and boom: the law of cosines.

Equation (3.13a) with s_p = sqrt(a^2 + b^2 - 2 a b cos(q_2 + phi_0)) - l_min.

a and b are the distances of the cylinder's pins on column and boom from the boom joint, phi_0 the angle between
them at q_2 = 0. Valid for 0 < q_2 + phi_0 < pi.
"""

from __future__ import annotations

from typing import Any

import casadi as ca

from boom_model.regularisation import Expression
from boom_model.slots import Bar, Linkage, register
from boom_model.specification import Specification

SPECIFICATIONS = (
    Specification("kinematics.a", "a", "m", "boom joint to cylinder pin on the column", 1e-2, 10.0, "3.13a"),
    Specification("kinematics.b", "b", "m", "boom joint to cylinder pin on the boom", 1e-2, 10.0, "3.13a"),
    Specification("kinematics.phi0", "phi_0", "rad", "angle between a and b at q_2 = 0", -3.1416, 3.1416, "3.13a"),
    Specification("cylinder.l_min", "l_min", "m", "pin-to-pin length at s_p = 0", 1e-2, 20.0, "3.13a"),
)


def piston_position(angle: Expression, p: Any) -> Expression:
    """s_p(q_2) [m] for the boom angle q_2 [rad]; ``p`` holds the parameters ``kinematics`` and ``cylinder``."""
    k = p.kinematics
    return ca.sqrt(k.a**2 + k.b**2 - 2 * k.a * k.b * ca.cos(angle + k.phi0)) - p.cylinder.l_min


def bars(angle: Expression, p: Any) -> tuple[Bar, ...]:
    """The cylinder at q_2 [rad]. Only the angle between a and b is known: b is drawn along the boom."""
    k = p.kinematics
    foot, pin = (k.a * ca.cos(k.phi0), -k.a * ca.sin(k.phi0)), (k.b * ca.cos(angle), k.b * ca.sin(angle))
    return (Bar(foot, pin),)


register(Linkage(
    name="triangle", meaning="cylinder pinned directly to column and boom",
    term="s_p = sqrt(a^2 + b^2 - 2 a b cos(q_2 + phi_0)) - l_min", equation="3.13a", specifications=SPECIFICATIONS,
    piston_position=piston_position, bars=bars,
))  # fmt: skip
