"""The pump's torque limiter: what it delivers times its pressure is no more than a power.

Behind a pressure compensator the pump stands by the compensator's drop above the port. The limit sets in as that of the flow does.
"""

from typing import Any

from boom_model.catalogue.effect import Effect, parameter
from boom_model.catalogue.pump_flow_limit import STOP
from boom_model.regularisation import Expression, under_limit


def _supply(flow: Expression, own: Any, at: Any) -> Expression:
    power = flow * (at.pressure + at.p.main_valve_orifices.dp_c)
    return flow * under_limit(power * own.inverse_P, own.w)


# It does nothing up to some size and soon far too much, as the limit of the flow.
EFFECT = Effect(
    "pump_power_limit", "supply", "5.39l,m", "supply flow q / (1 + (q (p + dp_c) / P)^(1/w))^w",
    ("the pump", "cannot give the power that flow and pressure ask for"), "speed saturates, the more the higher the load",
    (
        parameter("inverse_P", "1/W", 0.0, (1 / 30e3, 1 / 5e3), (0.0, 1.0),
                  "1 / largest power of the pump that is left for the boom", almost_nothing=1 / 200e3,
                  starts=tuple(1 / P for P in (40e3, 30e3, 24e3, 19e3, 15e3, 12e3, 9e3, 7e3, 5e3, 3.5e3, 2.5e3))),
        parameter("w", "-", STOP, (STOP, 0.25), (0.01, 1.0), "how softly it sets in", positive=True),
    ),
    {"supply_flow": _supply},
    place=3, needs="compensator", sets_in=(1.0, 0.96, 0.92, 0.88, 0.84), reach=2.0, margin=12.0,
)  # fmt: skip
