"""Flow through the hose burst valve over its pressure drop, (5.28) = (5.39e,f), and its inverse for (5.41).

With dp = p_h - p_a in bar and q_a in l/min, positive towards the cylinder:

    q_a = a_11 dp + a_12 dp / sqrt(dp + dp_lin)   for dp >= 0
    q_a = a_21 dp + a_22 dp^2                     for node <= dp < 0
    q_a = a_30 + a_31 dp                          below the node

dp_lin regularises the square root at zero. Both first branches hold as they stand but for 0 < dp < ``OPENING``, where the first
takes over from the second without a corner: a boom at rest stands there, and a corner in equations so stiff costs an observer,
which jumps across it with every sample, ten times the steps (docs/performance.md). (5.29) demands that the second and third
branch meet with equal slope, so two coefficients follow from the others: a_22 = (a_21 - a_31)^2 / (-4 a_30),
node = 2 a_30 / (a_21 - a_31); the rounded numbers that the thesis prints differ from these by under 1.5 %.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import casadi as ca

from boom_model.errors import MachineError
from boom_model.regularisation import Expression
from boom_model.slots import HoseBurstValve, register
from boom_model.specification import Specification, number

OPENING = 1.0e3
"""Pa. Drop over which the check valve opens; a tenth of a step of the pressure sensors."""

SPECIFICATIONS = (
    Specification(
        "hose_burst_valve.unit_flow", "l/min", "m^3/s per l/min", "unit of its flow", 1e-5, 2e-5, "5.36",
        default=1e-3 / 60,
    ),
    Specification(
        "hose_burst_valve.unit_pressure", "bar", "Pa per bar", "unit of its drop", 9e4, 1.1e5, "5.36",
        default=1e5,
    ),
    Specification("hose_burst_valve.a11", "a_11", "l/min/bar", "free flow, linear", 0.0, 1e3, "5.36"),
    Specification("hose_burst_valve.a12", "a_12", "l/min/bar^0.5", "free flow, square root", 1e-3, 1e3, "5.36"),
    Specification("hose_burst_valve.a21", "a_21", "l/min/bar", "limited flow, slope at zero", 1e-3, 1e3, "5.36"),
    Specification("hose_burst_valve.a30", "a_30", "l/min", "limited flow, plateau", -1e4, -1e-2, "5.36"),
    Specification("hose_burst_valve.a31", "a_31", "l/min/bar", "limited flow, slope of the plateau", 1e-6, 1e3, "5.36"),
    Specification(
        "hose_burst_valve.dp_lin", "dp_lin", "bar", "regularisation at zero", 1e-4, 1.0, "5.28", default=0.02
    ),
)  # fmt: skip


def smooth_node(a21: Expression, a30: Expression, a31: Expression) -> tuple[Expression, Expression]:
    """(a_22 [l/min/bar^2], node [bar]) with which the branches of (5.28) meet with equal slope, (5.29)."""
    return (a21 - a31) ** 2 / (-4 * a30), 2 * a30 / (a21 - a31)


def limited_branches(p: Any, e: Any) -> tuple[Expression, Expression, Expression]:
    """(a_21 [l/min/bar], a_30 [l/min], a_31 [l/min/bar])."""
    v = p.hose_burst_valve
    return v.a21, e.through("limited_flow", v.a30), v.a31


def limited_conductance(drop: Expression, p: Any, e: Any) -> Expression:
    """Stationary G = q_a / dp [m^3/s/Pa] of the limited branches at dp = p_h - p_a [Pa]; that of dp = 0 above zero."""
    v = p.hose_burst_valve
    a21, a30, a31 = limited_branches(p, e)
    a22, node = smooth_node(a21, a30, a31)
    d = ca.fmin(drop / v.unit_pressure, 0.0)
    plateau = a31 + a30 / ca.fmin(d, node)
    return ca.if_else(d >= node, a21 + a22 * d, plateau) * (v.unit_flow / v.unit_pressure)


def flow(drop: Expression, p: Any, e: Any) -> Expression:
    """q_a [m^3/s] at dp = p_h - p_a [Pa], (5.28)."""
    v = p.hose_burst_valve
    d = ca.fmax(drop / v.unit_pressure, 0.0)
    free = (v.a11 * d + v.a12 * d / ca.sqrt(d + v.dp_lin)) * v.unit_flow
    limited = e.through("limited_conductance", limited_conductance(drop, p, e)) * drop
    open_ = ca.fmin(ca.fmax(drop / OPENING, 0.0), 1.0)
    share = open_**2 * (3 - 2 * open_)
    return ca.if_else(drop > 0, (1 - share) * limited + share * free, limited)


def pressure_drop(flow: Expression, p: Any, e: Any) -> Expression:
    """dp_ha [Pa] that drives the flow q_a [m^3/s]: the inverse of (5.28), needed in (5.41).

    The branches are inverted in closed form; the positive one without dp_lin (0.02 bar), which is below resolution.
    """
    v = p.hose_burst_valve
    a21, a30, a31 = limited_branches(p, e)
    a22, node = smooth_node(a21, a30, a31)
    q = flow / v.unit_flow
    up = ca.fmax(q, 0.0)
    root = 2 * up / (v.a12 + ca.sqrt(v.a12**2 + 4 * v.a11 * up))
    at_node = a21 * node + a22 * node**2
    inside = ca.fmin(ca.fmax(q, at_node), 0.0)
    quadratic = 2 * inside / (a21 + ca.sqrt(ca.fmax(a21**2 + 4 * a22 * inside, 1e-12)))
    linear = (q - a30) / a31
    drop = ca.if_else(q >= 0, root**2, ca.if_else(q >= at_node, quadratic, linear))
    return drop * v.unit_pressure


def _check(p: Any, section: Mapping[str, Any]) -> None:
    """a_22 and the node follow from the other coefficients (5.29); printed ones must agree with them."""
    v = p.hose_burst_valve
    if v.a21 <= v.a31:
        raise MachineError(f"hose_burst_valve.a31: {v.a31:g} must be below a21, {v.a21:g} l/min/bar")
    a22, node = smooth_node(v.a21, v.a30, v.a31)
    for key, value in (("a22", a22), ("a22_c1", a22), ("node", node), ("node_c1", node)):
        if key in section and not abs(number(section[key]) / value - 1) <= 0.02:
            raise MachineError(
                f"hose_burst_valve.{key}: {number(section[key]):g} does not fit a21, a30, a31, with which the branches "
                f"meet smoothly at {value:.4g} (5.29); correct it or leave it out"
            )


register(HoseBurstValve(
    name="flow_limiting", meaning="limits the flow out of the cylinder",
    term="q_a = a_11 dp + a_12 sqrt(dp), a_21 dp + a_22 dp^2, a_30 + a_31 dp", equation="5.39e,f",
    specifications=SPECIFICATIONS, information=frozenset({"a22", "node", "a22_c1", "node_c1"}),
    offers=frozenset({"hose_burst_valve", "valve_at_the_cylinder"}), check=_check,
    flow=lambda w, hose, head, rod: flow(hose - head, w.p, w.e),
    pressure_drop=pressure_drop,
))  # fmt: skip
register(HoseBurstValve(name="none", meaning="hose and head side are one volume", term="p_h = p_a", separates=False))
