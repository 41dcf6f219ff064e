"""The pump cannot deliver the flow that the valve asks for.

A regulated pump's limit is a stop: w = 1 / 32, 2 % are missing at the limit. One whose engine slows, or whose leakage grows, as it
comes near gives way long before: w = 1 / 5, an eighth is missing there. A torque limiter gives less flow the higher the pressure:
s = 1, a power. What leaks in the pump does so less: s = 0.1.
"""

from typing import Any

import casadi as ca

from boom_model.catalogue.effect import Effect, parameter
from boom_model.regularisation import Expression, power, under_limit

STOP = 1 / 32
"""w of a limit that is a stop."""
P_REFERENCE, P_LEAST = 1.0e7, 1.0e5
"""Pa. Pressure of the pump at which q_max is told, and below which it falls no further."""


def _supply(flow: Expression, own: Any, at: Any) -> Expression:
    falls = power(ca.fmax(at.pump, P_LEAST) / P_REFERENCE, own.s)
    return flow * under_limit(flow * own.inverse_q_max * falls, own.w)


# Softer than w = 1 / 2, with a third missing at the limit, it is a droop. It does nothing up to some size and soon far too much,
# hence many starts and shares. The watch looks as far as it takes to see anything: a pump of 120 l/min limits nothing that the
# valve asks.
EFFECT = Effect(
    "pump_flow_limit", "supply", "5.39l,m", "supply flow q / (1 + (q / q_max (p / 100 bar)^s)^(1/w))^w, p of the pump",
    ("the pump", "cannot deliver the flow that the valve asks for"), "speed saturates",
    (
        parameter("inverse_q_max", "s/m^3", 0.0, (60_000 / 120, 60_000 / 50), (0.0, 60_000.0),
                  "1 / largest flow that the pump has left for the boom, at 100 bar", almost_nothing=60_000 / 400,
                  starts=tuple(60_000 / q for q in (120, 100, 85, 70, 60, 50, 42, 35, 28, 22, 17, 13))),
        parameter("w", "-", STOP, (STOP, 0.25), (0.01, 0.5), "how softly it sets in", positive=True, starts=(STOP, 0.15)),
        parameter("s", "-", 0.0, (0.0, 1.0), (0.0, 3.0), "how it falls with the pump's pressure: 0 a flow, 1 a power"),
    ),
    {"supply_flow": _supply},
    place=1, sets_in=(1.0, 0.96, 0.92, 0.88, 0.84), reach=2.0, margin=12.0,  # other functions take their share
)  # fmt: skip
