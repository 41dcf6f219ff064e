"""The pressure compensator droops with the flow, q (1 - k (q / q_r)^n), q_r = 120 l/min.

A spring that lengthens by the stroke of the compensator takes n = 1 of its drop, the flow force on its edge up to 2.
"""

from typing import Any

import casadi as ca

from boom_model.catalogue.effect import Effect, parameter
from boom_model.regularisation import Expression, power

Q_REFERENCE, Q_LEAST = 2.0e-3, 1e-6
"""m^3/s. Full flow, and that below which no power is taken of it."""


def _supply_flow(flow: Expression, own: Any, _at: Any) -> Expression:
    return flow * (1 - own.k * power(ca.fmax(ca.fabs(flow), Q_LEAST) / Q_REFERENCE, own.n))


EFFECT = Effect(
    "compensator_droop", "main_valve", "5.39l,m", "supply flow q (1 - k (q / 120 l/min)^n)",
    ("the pressure compensator", "droops with the flow"), "top speed, supply side only",
    (
        parameter("k", "-", 0.0, (0.05, 0.5), (0.0, 50.0), "loss of supply flow at 120 l/min", possible=(0.0, 1.0), surely=True,
                  flow_power=-2, accuracy=0.05),  # data sheets: the flow of a compensated valve is constant within 2 to 5 %
        parameter("n", "-", 2.0, (1.0, 2.0), (0.5, 3.0), "power of the flow with which it droops"),
    ),
    {"supply_flow": _supply_flow},
    place=5, needs="compensator",
)  # fmt: skip
