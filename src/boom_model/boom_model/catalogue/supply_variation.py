"""The supply pressure is not the constant of the file: another level, and it falls with the flow that is taken.

    p_s (1 + a) - x,   tau x' = r q + k q^2 - x

of the flow q that is taken: r a pump that slips or an engine that slows, k lines and filters. A pump's controller lets it fall and
rise in its time tau. Where nothing lags, in closed form: with C the conductance of the edge and h = p_s (1 + a) - p of the port

    q = 2 C sqrt(h) / (u + sqrt(u^2 + 4 (1 + k C^2))),   u = r C / sqrt(h)

Where the supply pressure is recorded it drives the model, and a does not act.
"""

from typing import Any

import casadi as ca

from boom_model.catalogue.effect import Effect, parameter
from boom_model.regularisation import Expression
from boom_model.state import State

SHORTEST = 2e-3
"""s. Beside tau: the state has to be one; far below a spool's."""
LEAST_FLOW = 1e-8
"""m^3/s. Below it nothing falls by r; a hundredth of what a seal lets through."""


def _fallen(fall: Expression, own: Any, _at: Any) -> Expression:
    return fall + own.state("supply_fall") if own.stateful else fall


def _taken(flow: Expression, own: Any, at: Any) -> Expression:
    """q; flow: what the edge and other effects let through."""
    if own.stateful:
        own.rates["supply_fall"] = (own.r * flow + own.k * flow * ca.fabs(flow) - own.state("supply_fall")) / (
            own.tau + SHORTEST
        )
        return flow
    square = at.conductance**2
    linear = own.r * square / ca.sqrt(flow * flow + LEAST_FLOW * LEAST_FLOW)
    return 2 * flow / (linear + ca.sqrt(linear * linear + 4 * (1 + own.k * square)))


EFFECT = Effect(
    "supply_variation", "supply", "5.39l,m", "p_s (1 + a) - x, tau x' = r q + k q^2 - x",
    ("the supply pressure", "is not the one of the file"), "speed, most against a high load",
    (
        parameter("a", "-", 0.0, (-0.15, 0.15), (-0.9, 2.0), "how far its level is off"),
        parameter("k", "Pa s^2/m^6", 0.0, (0.0, 4e12), (0.0, 1e14), "fall per squared flow",
                  accuracy=2.5e11),  # 10 bar at 120 l/min: lines and filters between gauge and valve
        parameter("r", "Pa s/m^3", 0.0, (0.0, 4e9), (0.0, 1e11), "fall per flow"),
        parameter("tau", "s", 0.0, (0.0, 0.3), (0.0, 3.0), "time constant with which it falls and rises", of="k",
                  almost_nothing=1e-4),
    ),
    {"supply_pressure": lambda pressure, own, at: pressure * (1 + own.a), "supply_fall": _fallen, "supply_flow": _taken},
    place=2, needs="constant_supply", independent=True, changes=("fluid.p_s",), stateless=("supply_pressure", "supply_flow"),
    moving=("tau",), not_in_laws=("tau",), states=(State("supply_fall", "x", "Pa", 1e6, -1e8, 1e8, equation="5.39l,m"),),
)  # fmt: skip
