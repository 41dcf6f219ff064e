"""A load-holding valve stands between hose and cylinder, which the file does not have: in place of what the file has there.

Equations and numbers: ``components.load_holding_valve``. Hose and head side are two volumes then, and the head side keeps what
carries the boom while the hose's pressure falls (neutral p_set = 0: no valve, no states). The check valve's two numbers hardly
show beside the others; the rise of its drop with the flow does.
"""

from collections.abc import Mapping
from typing import Any

from boom_model.catalogue.effect import Effect, parameter
from boom_model.components import load_holding_valve as valve
from boom_model.regularisation import Expression
from boom_model.state import State

BAR, LPM = 1e5, 1 / 60_000
GAIN, CONDUCTANCE = LPM / BAR**1.5, LPM / BAR**0.5
"""(l/min)/sqrt(bar) per bar, (l/min)/sqrt(bar)."""
NOISE = 2e5
"""Pa/sqrt(s). Where in its play a valve at rest stands is not known."""


def _flow(_: Expression, own: Any, at: Any) -> Expression:
    pilot = own.state("holding_valve_pilot")
    own.rates["holding_valve_pilot"] = valve.following(pilot, valve.excess(at.head, at.rod, own), own.play)
    return valve.flow(at.hose, at.head, pilot, own)


def _at_rest(states: Mapping[str, Expression], _p: Any, e: Any) -> dict[str, Expression]:
    return {"holding_valve_pilot": valve.rest(states, e.numbers("load_holding_valve"))}


def pressure_drop(machine: Any, flow: Expression, p: Any, e: Any) -> Expression:
    """p_h - p_a [Pa] that drives a flow q_a [m^3/s] through the valve at the cylinder: the machine's own, or this in its place."""
    if EFFECT.id in machine.effects:
        return valve.pressure_drop(flow, e.numbers(EFFECT.id))
    return machine.structure.hose_burst_valve.pressure_drop(flow, p, e)


def conductance(machine: Any, head: Expression, rod: Expression, p: Any, e: Any) -> tuple[Expression, Expression]:
    """G of a valve that holds the load at p_a, p_b [Pa], and the largest there is [m^3/s/Pa^0.5]; whose as of ``pressure_drop``."""
    if EFFECT.id in machine.effects:
        return valve.conductance(head, rod, e.numbers(EFFECT.id))
    opening, most = machine.structure.hose_burst_valve.conductance(head, rod, p, e)
    return opening, most


EFFECT = Effect(
    "load_holding_valve", "hose_burst_valve", "5.39f",
    "q_a = max(0, p_h - p_a - p_check) / r_check + min(g max(0, z), G_max) sqrt(p_h - p_a), z ~ p_a + R p_b - p_set",
    ("a load-holding valve at the cylinder", "is opened by the rod pressure"),
    "hose pressure falls to a few bar at rest and while lowering",
    (
        parameter("p_set", "Pa", 0.0, (40 * BAR, 180 * BAR), (0.0, 6e7), "pressure at which it opens", positive=True,
                  starts=(60 * BAR, 100 * BAR, 140 * BAR), almost_nothing=1e5),
        parameter("R", "-", 3.0, (0.0, 4.5), (0.0, 20.0), "how much more p_b opens it than p_a", starts=(0.5, 2.0, 4.0)),
        parameter("gain", "m^3/s/Pa^1.5", 0.1 * GAIN, (0.03 * GAIN, 0.3 * GAIN), (1e-16, 1e-9), "opening per pressure above p_set",
                  positive=True),
        parameter("G_max", "m^3/s/Pa^0.5", 10 * CONDUCTANCE, (5 * CONDUCTANCE, 40 * CONDUCTANCE), (1e-9, 1e-4),
                  "flow over root of the drop, open", positive=True),
        parameter("play", "Pa", 3 * BAR, (2 * BAR, 4 * BAR), (0.0, 1e7), "play of the pilot", positive=True),
        parameter("p_check", "Pa", 2 * BAR, (1 * BAR, 3 * BAR), (0.0, 1e7), "opening pressure of the check valve", positive=True),
        parameter("r_check", "Pa s/m^3", 0.14 * BAR / LPM, (0.1 * BAR / LPM, 0.2 * BAR / LPM), (1e6, 1e11),
                  "resistance of the check valve", positive=True),
    ),
    {"valve_flow": _flow},
    place=3, holds=True, needs="no_load_holding_valve", at_rest=_at_rest, watched=False,
    states=(State("holding_valve_pilot", "z", "Pa", 1e7, equation="5.39f", standstill_noise=NOISE),),
)  # fmt: skip
