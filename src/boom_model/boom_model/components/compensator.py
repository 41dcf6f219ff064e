"""Drop over the edge from the supply to a port: held by a pressure compensator, (3.25), or what a constant supply leaves, (3.23).

with:     dp = dp_c
without:  dp = p_s - p,  p = p_h while extending, p_b while retracting
"""

from __future__ import annotations

from typing import Any

import casadi as ca

from boom_model.regularisation import Expression, signed_sqrt
from boom_model.slots import Supply, register
from boom_model.specification import Specification

COMPENSATED = register(
    Supply(
        name=True,
        meaning="pressure compensator: the flow does not depend on the load",
        term="dp = dp_c",
        equation="3.25",
        specifications=(
            Specification(
                "main_valve_orifices.dp_c", "dp_c", "Pa", "margin of the pressure compensator", 1e4, 1e7, "3.25"
            ),
        ),
        offers=frozenset({"compensator"}),
        drop=lambda pressure, p: p.main_valve_orifices.dp_c,
        root=lambda pressure, p: ca.sqrt(p.main_valve_orifices.dp_c),
    )
)


def drop(pressure: Expression, p: Any) -> Expression:
    """Dp [Pa] from a constant supply pressure to a port at ``pressure`` [Pa]."""
    return p.fluid.p_s - pressure


UNCOMPENSATED = register(
    Supply(
        name=False,
        meaning="constant supply pressure",
        term="dp = p_s - p",
        equation="3.23",
        specifications=(Specification("fluid.p_s", "p_s", "Pa", "supply pressure", 1e5, 1e8, "3.23"),),
        drop=drop,
        root=lambda pressure, p: signed_sqrt(drop(pressure, p)),
    )
)
