"""Pilot valve: a Wiener model, first order in the solenoid current and a static curve behind it, (3.34) with (5.2), (5.7c).

    lambda' = a_1 lambda + i,  nu = b_0 lambda + b_1 i,  p = h(nu) = h_0 nu^2 + h_1 nu + h_2   (p in bar, nu and i in A)

Identified for 0.30 A .. 0.55 A.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import casadi as ca

from boom_model.errors import MachineError
from boom_model.regularisation import Expression
from boom_model.slots import PilotStage, Wiring, register
from boom_model.specification import Specification

BAR = 1.0e5
"""Pa."""
SMALLEST_CURVATURE = 1e-6
"""bar/A^2."""

SPECIFICATIONS = (
    Specification("pilot_valves.a1_s", "a_1^s", "1/s", "pole of the first order", -1e4, -1e-2, "3.34a"),
    Specification("pilot_valves.b0_s", "b_0^s", "1/s", "gain of the first order", 1e-2, 1e4, "3.34b"),
    Specification("pilot_valves.b1_s", "b_1^s", "-", "feedthrough", -1.0, 1.0, "3.34b"),
    Specification(
        "pilot_valves.h", "h", "bar/A^2, bar/A, bar", "static curve: h_0, h_1, h_2", -1e4, 1e4, "5.2", "triple"
    ),
)


def pole(p: Any, e: Any) -> Expression:
    """a_1 [1/s]."""
    return e.through("pilot_rate", p.pilot_valves.a1_s)


def gain(p: Any, e: Any) -> Expression:
    """b_0 [1/s]."""
    return e.through("pilot_rate", p.pilot_valves.b0_s)


def state_rate(state: Expression, current: Expression, p: Any, e: Any) -> Expression:
    """lambda' [A] for lambda [A s] and the solenoid current [A]."""
    return e.through("pilot_state_rate", pole(p, e) * state + current)


def pressure(state: Expression, current: Expression, p: Any, e: Any) -> Expression:
    """Pilot control pressure p [Pa]."""
    v = p.pilot_valves
    return static_pressure(gain(p, e) * state + v.b1_s * current, v.h)


def static_pressure(nu: Expression, h: Any) -> Expression:
    """h(nu) [Pa] for nu [A], (5.2); ``h`` = (h_0, h_1, h_2) [bar/A^2, bar/A, bar]. At rest nu is the current."""
    return BAR * ((h[0] * nu + h[1]) * nu + h[2])


def static_inverse(pressure: Expression, h: Any) -> Expression:
    """nu = h^-1(p) [A] for p [Pa], (5.6), on the rising branch; the vertex of h below its smallest pressure."""
    discriminant = h[1] ** 2 + 4 * h[0] * (pressure / BAR - h[2])
    return (ca.sqrt(ca.fmax(discriminant, 0.0)) - h[1]) / (2 * h[0])


def _difference(w: Wiring) -> Expression:
    p, e, u = w.p, w.e, w.u
    plus = w.add("pilot_retract", "lambda_+", "A s", 2e-2, -1.0, 1.0)
    minus = w.add("pilot_extend", "lambda_-", "A s", 2e-2, -1.0, 1.0)
    w.rates["pilot_retract"] = state_rate(plus, u[0], p, e)
    w.rates["pilot_extend"] = state_rate(minus, u[1], p, e)
    return pressure(plus, u[0], p, e) - pressure(minus, u[1], p, e)


def _check(p: Any, _: Mapping[str, Any]) -> None:
    """(5.6) is the rising branch of h."""
    if not p.pilot_valves.h[0] >= SMALLEST_CURVATURE:
        raise MachineError(
            f"pilot_valves.h: the first number must be at least {SMALLEST_CURVATURE:g} bar/A^2, so that h rises"
        )


register(PilotStage(
    name="wiener", meaning="two pilot valves: first order, then a static curve",
    term="lambda' = a_1 lambda + i, p = h(b_0 lambda + b_1 i)", equation="5.39p-u", specifications=SPECIFICATIONS,
    offers=frozenset({"pilot_valves"}), check=_check, invertible=True, difference=_difference,
    pressure=lambda current, p: static_pressure(current, p.pilot_valves.h),
    current=lambda pressure, p: static_inverse(pressure, p.pilot_valves.h),
    settling=lambda p, e: e.through("pilot_settling", -1 / pole(p, e)),
))  # fmt: skip
register(PilotStage(name="none", meaning="no pilot stage", term="p_+ = p_- = 0", present=False))
