"""A check valve before the supply edges: what would flow back from a port while the supply is below it, does not.

    q_supply - c min(0, q_supply)

Sections of valves without a pressure compensator have one, so that a load does not sag while the pump builds up its pressure:
an open-centre pump, or a load-sensing one whose line is empty.
"""

from typing import Any

import casadi as ca

from boom_model.catalogue.effect import Effect, parameter
from boom_model.regularisation import Expression


def _supply(flow: Expression, own: Any, _at: Any) -> Expression:
    return flow - own.c * ca.fmin(flow, 0.0)


EFFECT = Effect(
    "load_check_valve", "main_valve", "5.39l,m", "supply flow q - c min(0, q)",
    ("a load check valve", "lets nothing flow back while the supply is below the port"),
    "at the beginning of a motion, a load that does not sag while the supply is below it",
    (
        parameter("c", "-", 0.0, (0.3, 1.0), (0.0, 1.2), "share of what would flow back that it holds; a tight one: 1",
                  starts=(1.0,)),
    ),
    {"supply_flow": _supply},
    place=10, needs="constant_supply", foreign=True,
)  # fmt: skip
