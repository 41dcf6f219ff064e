"""Oil that is pulled apart: below p_c gas comes out, the bulk modulus falls towards zero, the compensator has nothing to hold.

    beta(p) = beta / (1 + r),   r = (p_c / p_abs)^4,   p_abs = p + p_0
    supply flow q (1 - c r / (1 + r)) into a port at p

Shows at the meter-in port of a boom that falls faster than it is filled: p_b at 0, the speed is then set by meter-out alone.
``entrained_air`` is soft up to 15 bar, this one to p_c, the pressure (absolute) at which half of the stiffness is gone.
"""

from typing import Any

import casadi as ca

from boom_model.catalogue.effect import Effect, parameter
from boom_model.components.oil import AMBIENT_PRESSURE
from boom_model.regularisation import Expression

LOWEST_ABSOLUTE_PRESSURE = 1.0e4
"""Pa. Below it the law is frozen."""


def _ratio(pressure: Expression, own: Any) -> Expression:
    return (own.p_c / ca.fmax(pressure + AMBIENT_PRESSURE, LOWEST_ABSOLUTE_PRESSURE)) ** 4


def _supply(flow: Expression, own: Any, at: Any) -> Expression:
    gas = _ratio(at.pressure, own)
    return flow * (1 - own.c * gas / (1 + gas))


EFFECT = Effect(
    "cavitation", "oil", "5.39c,d,i", "beta / (1 + (p_c / p_abs)^4), supply flow q (1 - c) below p_c",
    ("the oil", "cavitates"), "p_b at 0 while lowering, the speed set by meter-out alone",
    (
        parameter("p_c", "Pa", 0.0, (2e4, 3e5), (0.0, 2e6), "absolute pressure at which half of the stiffness is gone",
                  positive=True, starts=(6e4, 1.5e5), almost_nothing=1e4),
        parameter("c", "-", 0.0, (0.0, 0.8), (0.0, 1.0), "share of the supply flow that is lost"),
    ),
    {"bulk_modulus": lambda beta, own, at: beta / (1 + _ratio(at.pressure, own)), "supply_flow": _supply},
    place=2, reach=1.0,
)  # fmt: skip
