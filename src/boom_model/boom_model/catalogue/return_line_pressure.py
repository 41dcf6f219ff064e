"""The pressure of the return line rises with the flow, p_t + k q_r^2 (q / q_r)^n, q_r = 100 l/min: in series with the orifice.

An orifice or a filter in the line is n = 2, a long hose with turbulent flow 1.75 (Blasius), cold oil 1. With C = q / sqrt(dp) of
the port alone and its flow q_0, y = q / q_0 is the root of y^2 + A y^n = 1, A = k C^2 (q_0 / q_r)^(n - 2): two steps of Newton's
from that of n = 2, which is 1 / sqrt(1 + A).
"""

from typing import Any

import casadi as ca

from boom_model.catalogue.effect import Effect, parameter
from boom_model.regularisation import Expression, power

Q_REFERENCE, Q_LEAST = 0.1 / 60.0, 1e-6
"""m^3/s. Flow at which k is the rise per squared flow, and below which no power is taken of it."""


def _tank_flow(flow: Expression, own: Any, at: Any) -> Expression:
    share = ca.fmax(ca.fabs(flow), Q_LEAST) / Q_REFERENCE
    line = own.k * at.conductance * at.conductance * power(share, own.n - 2)
    y = 1 / ca.sqrt(1 + line)
    for _ in range(2):
        risen = line * power(y, own.n)
        y = y - (y * y + risen - 1) / (2 * y + own.n * risen / y)
    return flow * y


# The margin is that of a return line that is nearly shut, or of a small crane: 10 bar at 30 l/min.
EFFECT = Effect(
    "return_line_pressure", "return_line", "5.39l,m", "p_t + k q_r^2 (q / q_r)^n",
    ("the pressure of the return line", "rises with the flow"), "p_b when extending, p_h when lowering slowly",
    (
        parameter("k", "Pa s^2/m^6", 0.0, (2e5 / 2.17e-3**2, 2e6 / 2.17e-3**2), (0.0, 1e13), "rise per squared flow, at 100 l/min"),
        parameter("n", "-", 2.0, (1.0, 2.0), (0.5, 3.0), "power of the flow with which it rises"),
    ),
    {"tank_flow": _tank_flow},
    place=1, margin=25.0,
)  # fmt: skip
