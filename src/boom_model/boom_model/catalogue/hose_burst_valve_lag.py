"""The poppet of the hose burst valve needs time to throttle.

While oil leaves the cylinder, q_a = G dp with the conductance G as a state, tau G' = G_limited(min(dp, 0)) - G, where G_limited is
the stationary q_a / dp of the limited branches; towards the cylinder the check valve opens without delay (neutral tau = 0: no
state, G is stationary).
"""

from collections.abc import Mapping
from typing import Any

from boom_model.catalogue.effect import Effect, parameter
from boom_model.components import hose_burst_valve
from boom_model.regularisation import Expression
from boom_model.state import State

NOISE = 4e-9
"""m^3/s/Pa/sqrt(s). With nothing flowing through it, a valve stays where it likes, and how far open a lowering finds it is not
known."""


def _conductance(stationary: Expression, own: Any, _at: Any) -> Expression:
    g = own.state("hose_burst_valve_conductance")
    own.rates["hose_burst_valve_conductance"] = (stationary - g) / own.tau
    return g


def _at_rest(_states: Mapping[str, Expression], p: Any, e: Any) -> dict[str, Expression]:
    return {"hose_burst_valve_conductance": hose_burst_valve.limited_conductance(0.0, p, e)}


EFFECT = Effect(
    "hose_burst_valve_lag", "hose_burst_valve", "5.39f", "q_a = G (p_h - p_a) outwards, tau G' = G_limited - G",
    ("the poppet of the hose burst valve", "needs time to follow"), "first 0.3 s of fast lowering",
    (
        parameter("tau", "s", 0.0, (0.005, 0.15), (1e-4, 2.0), "time constant of the poppet", positive=True,
                  starts=(0.008, 0.03, 0.1), almost_nothing=3e-4, ordinary=0.0025),
    ),
    {"limited_conductance": _conductance},
    place=1, needs="hose_burst_valve", at_rest=_at_rest,
    states=(
        State("hose_burst_valve_conductance", "G", "m^3/s/Pa", 1e-8, 2e-11, equation="5.39f", standstill_noise=NOISE),
    ),
)  # fmt: skip
