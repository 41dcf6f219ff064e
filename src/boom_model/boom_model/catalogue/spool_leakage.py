"""Oil passes the worn lands of the main valve's spool, whatever its position: from a port to the tank, or from the supply.

Laminar, c_s (p_s - p) - c_t (p - p_t) at each port, in two numbers that a recording tells: the flow q_r at a usual pressure p_r,
and c = c_s + c_t, by which it falls with the port's.
"""

from typing import Any

from boom_model.catalogue.effect import Effect, EffectParameter, parameter
from boom_model.regularisation import Expression

LPM, BAR = 1.0 / 60_000.0, 1e5
USUAL = {"hose": 100.0, "rod": 50.0}
"""bar. Pressures of a boom that is carried."""
SOUND = 0.03 * LPM
"""m^3/s. Data sheets of mobile valves: 20 to 30 cm^3/min out of a port at 100 bar."""


def _flow(port: str) -> EffectParameter:
    meaning = f"flow that leaks into the {port}'s port at {USUAL[port]:.0f} bar (out of it: negative)"
    return parameter(port, "m^3/s", 0.0, (-5 * LPM, 5 * LPM), (-1e-3, 1e-3), meaning, ordinary=SOUND)


def _slope(port: str) -> EffectParameter:
    meaning = f"how much less leaks into the {port}'s port per pressure in it"
    return parameter(
        f"{port}_slope", "m^3/s/Pa", 0.0, (0.1 * LPM / 1e7, 5 * LPM / 1e7), (0.0, 1e-9), meaning, ordinary=SOUND / 1e7
    )


def _leak(flow: Expression, own: Any, at: Any) -> Expression:
    here, slope = {"hose": (own.hose, own.hose_slope), "rod": (own.rod, own.rod_slope)}[at.port]
    return flow + here - slope * (at.pressure - USUAL[at.port] * BAR)


EFFECT = Effect(
    "spool_leakage", "main_valve", "5.39d,i", "q_r - c (p - p_r) into each port",
    ("the main valve", "leaks past its spool"), "sinks or creeps with the spool in neutral, slower one way than the other",
    (_flow("hose"), _flow("rod"), _slope("hose"), _slope("rod")),
    {"port_leakage": _leak},
    independent=True, watched=False, foreign=True,
)  # fmt: skip
