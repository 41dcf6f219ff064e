"""Pressure build-up in the chambers of the boom cylinder, (3.9), (3.11) = (5.39c,d), force (3.12).

    p_a' = beta / (V_0a + s_p A_a) (q_a - w_p A_a - q_l)
    p_b' = beta / (V_0b + (l_p - s_p) A_b) (q_b + w_p A_b + q_l)
    f_p = p_a A_a - p_b A_b

a is the head side (extends, lifts), b the rod side; q_l, the flow past the piston seal, is zero but for effects. Valid for
0 <= s_p <= l_p.
"""

from __future__ import annotations

from typing import Any

import casadi as ca

from boom_model.regularisation import PRESSURE_EPSILON, Expression
from boom_model.specification import Specification

SPECIFICATIONS = (
    Specification("cylinder.A_a", "A_a", "m^2", "piston area, head side", 1e-5, 1.0, "3.9"),
    Specification("cylinder.A_b", "A_b", "m^2", "piston area, rod side", 1e-5, 1.0, "3.9"),
    Specification("cylinder.l_p", "l_p", "m", "stroke", 1e-2, 10.0, "3.9"),
    Specification("cylinder.V_0a", "V_0,a", "m^3", "dead volume, head side", 1e-6, 0.1, "3.9"),
    Specification("cylinder.V_0b", "V_0,b", "m^3", "dead volume, rod side, its hose included", 1e-6, 0.1, "3.9"),
)


def head_volume(position: Expression, p: Any) -> Expression:
    """V_a [m^3] at the piston position s_p [m], (3.9a)."""
    return p.cylinder.V_0a + position * p.cylinder.A_a


def rod_volume(position: Expression, p: Any) -> Expression:
    """V_b [m^3] at the piston position s_p [m], (3.9b)."""
    return p.cylinder.V_0b + (p.cylinder.l_p - position) * p.cylinder.A_b


def pressure_rate(bulk_modulus: Expression, volume: Expression, net_flow: Expression) -> Expression:
    """p' [Pa/s] of a volume [m^3] into which net_flow [m^3/s] is pressed, (3.8)."""
    return bulk_modulus / volume * net_flow


def cushioned(flow: Expression, drop: Expression, cushion: Expression, edge: Expression, p: Any) -> Expression:
    """q_a [m^3/s] where what flows out goes through a throttle, too: q / sqrt(1 + (q / q_c)^2), both as orifices in series.

    q_c = C_d A_c sqrt(2 / rho) sqrt(-dp), kappa^2 = (A / A_c)^2 = ``cushion``, A [m^2] = ``edge``.

    flow: without the throttle at the ``drop`` [Pa] towards the head side; what flows in goes through a check valve.
    """
    out, orifice = ca.fmin(flow, 0.0), p.fluid.C_d**2 * edge**2 * 2 / p.fluid.rho
    return flow / ca.sqrt(1 + cushion * out**2 / (orifice * ca.fmax(-drop, PRESSURE_EPSILON)))


def cushions_at_the_valve(position: Expression, p: Any, e: Any) -> tuple[Expression, Expression]:
    """(A_tb / A_c)^2 [-] of the throttles in the ways back of the rod side and of the hose at the piston position s_p [m]."""
    ahead = {"b": p.cylinder.l_p - position, "h": position}
    rod, hose = (e.through("cushion", 0.0, distance=distance, way=way) for way, distance in ahead.items())
    return rod, hose


def force(head_pressure: Expression, rod_pressure: Expression, p: Any) -> Expression:
    """f_p [N], (3.12)."""
    return head_pressure * p.cylinder.A_a - rod_pressure * p.cylinder.A_b


def cushion_drop(velocity: Expression, cushion: Expression, edge: Expression, p: Any) -> Expression:
    """dp = rho / 2 (A_b max(0, s_p') kappa / (C_d A))^2 [Pa] over the rod side's throttle; the way back is free.

    velocity: s_p' [m/s]. cushion: kappa^2 = (A / A_c)^2. edge: A [m^2].
    """
    return p.fluid.rho / 2 * cushion * (p.cylinder.A_b * ca.fmax(velocity, 0.0) / (p.fluid.C_d * edge)) ** 2


def leakage(head_pressure: Expression, rod_pressure: Expression, e: Any) -> Expression:
    """q_l [m^3/s] from the head to the rod side."""
    return e.through("leakage", 0.0, head_pressure=head_pressure, rod_pressure=rod_pressure)
