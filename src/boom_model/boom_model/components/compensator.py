"""Drop dp over the edge from the supply to a port.

A pressure compensator holds it, dp = dp_c (3.25), as long as the supply allows where its pressure is measured: min(dp_c, p_s - p);
without one it is what the supply pressure leaves, dp = p_s - p (3.23), with p = p_h while extending, p_b while retracting.
"""

from __future__ import annotations

from typing import Any

import casadi as ca

from boom_model.regularisation import Expression, signed_sqrt
from boom_model.slots import Supply, register
from boom_model.specification import Specification

MARGIN = Specification("main_valve_orifices.dp_c", "dp_c", "Pa", "margin of the pressure compensator", 1e4, 1e7, "3.25")
PRESSURE = Specification("fluid.p_s", "p_s", "Pa", "supply pressure", 1e5, 1e8, "3.23")


def _measured(p: Any) -> bool:
    """With a compensator the supply pressure is among the numbers only where it is measured."""
    return hasattr(p.fluid, "p_s")


def _margin(pressure: Expression, p: Any) -> Expression:
    margin = p.main_valve_orifices.dp_c
    return ca.fmin(margin, p.fluid.p_s - pressure) if _measured(p) else margin


def _root(pressure: Expression, p: Any) -> Expression:
    return signed_sqrt(_margin(pressure, p)) if _measured(p) else ca.sqrt(p.main_valve_orifices.dp_c)


COMPENSATED = register(Supply(
    name=True, meaning="pressure compensator: the flow does not depend on the load", term="dp = dp_c", equation="3.25",
    specifications=(MARGIN,), offers=frozenset({"compensator"}), drop=_margin, root=_root,
))  # fmt: skip
UNCOMPENSATED = register(Supply(
    name=False, meaning="constant supply pressure", term="dp = p_s - p", equation="3.23", specifications=(PRESSURE,),
    offers=frozenset({"constant_supply"}), drop=lambda pressure, p: p.fluid.p_s - pressure,
    root=lambda pressure, p: signed_sqrt(p.fluid.p_s - pressure),
))  # fmt: skip
