"""Drop dp over the edge from the supply to a port.

A pressure compensator holds it, dp = dp_c (3.25); without one it is what a constant supply pressure leaves, dp = p_s - p (3.23),
with p = p_h while extending, p_b while retracting.
"""

from __future__ import annotations

import casadi as ca

from boom_model.regularisation import signed_sqrt
from boom_model.slots import Supply, register
from boom_model.specification import Specification

MARGIN = Specification("main_valve_orifices.dp_c", "dp_c", "Pa", "margin of the pressure compensator", 1e4, 1e7, "3.25")
PRESSURE = Specification("fluid.p_s", "p_s", "Pa", "supply pressure", 1e5, 1e8, "3.23")

COMPENSATED = register(Supply(
    name=True, meaning="pressure compensator: the flow does not depend on the load", term="dp = dp_c", equation="3.25",
    specifications=(MARGIN,), offers=frozenset({"compensator"}), drop=lambda pressure, p: p.main_valve_orifices.dp_c,
    root=lambda pressure, p: ca.sqrt(p.main_valve_orifices.dp_c),
))  # fmt: skip
UNCOMPENSATED = register(Supply(
    name=False, meaning="constant supply pressure", term="dp = p_s - p", equation="3.23", specifications=(PRESSURE,),
    drop=lambda pressure, p: p.fluid.p_s - pressure, root=lambda pressure, p: signed_sqrt(p.fluid.p_s - pressure),
))  # fmt: skip
