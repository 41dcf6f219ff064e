"""Load-holding valve between hose and head side (counterbalance or over-centre valve). Not in the thesis.

A check valve lets the oil in to lift; to lower, the pressures of both chambers push it open against a set spring:

    q_a = max(0, p_h - p_a - p_check) / r_check + G sgn(p_h - p_a) sqrt(|p_h - p_a|)
    G = min(gain max(0, z), G_max),   z follows p_a + R p_b - p_set with a play

z [Pa], by how much the pilot pressure is above the set one, is a state: T z' = max(0, x - play / 2 - z) + min(0, x + play / 2 - z)
with x = p_a + R p_b - p_set. The corners are rounded over ``WIDTH``. At rest the valve is shut, so p_a carries the boom.
Numbers of valves in use: set 60 to 180 bar, R 0 to 4.5, play 2 to 4 bar, check valve 1 to 3 bar + 0.1 to 0.2 bar/(l/min),
gain 0.05 to 0.3 (l/min)/sqrt(bar) per bar.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import casadi as ca

from boom_model.regularisation import Expression, ramp, signed_sqrt
from boom_model.slots import HoseBurstValve, Wiring, register
from boom_model.specification import Specification

WIDTH = 1.0e4
"""Pa. Over which check valve and pilot begin to open; a step of a pressure sensor."""
ROUNDED = 0.05
"""Of G_max: from there below the limit of the opening is rounded."""
PLAY_TIME = 2.0e-3
"""s. How quickly the poppet follows."""

SPECIFICATIONS = (
    Specification("hose_burst_valve.p_set", "p_set", "Pa", "set pressure of the load-holding valve", 1e5, 6e7, "-"),
    Specification("hose_burst_valve.R", "R", "-", "pilot ratio: how much more p_b opens it than p_a", 0.0, 20.0, "-"),
    Specification("hose_burst_valve.gain", "g", "m^3/s/Pa^1.5", "opening per pilot pressure", 1e-16, 1e-9, "-"),
    Specification(
        "hose_burst_valve.G_max", "G_max", "m^3/s/Pa^0.5", "flow over root of the drop, open", 1e-9, 1e-4, "-"
    ),
    Specification("hose_burst_valve.play", "play", "Pa", "play of the pilot, both ways together", 0.0, 1e7, "-"),
    Specification("hose_burst_valve.p_check", "p_check", "Pa", "opening pressure of the check valve", 0.0, 1e7, "-"),
    Specification("hose_burst_valve.r_check", "r_check", "Pa s/m^3", "resistance of the check valve", 1e6, 1e11, "-"),
)


def excess(head: Expression, rod: Expression, v: Any, p_set: Expression | None = None) -> Expression:
    """x = p_a + R p_b - p_set [Pa]; ``v``: the valve's numbers, ``p_set`` [Pa] where it is set to another pressure."""
    return head + v.R * rod - (v.p_set if p_set is None else p_set)


def following(pilot: Expression, x: Expression, play: Expression, time: Expression = PLAY_TIME) -> Expression:
    """z' [Pa/s] of the pilot's state z [Pa], which follows x [Pa] with a play [Pa] and a time constant [s]."""
    return (ca.fmax(x - play / 2 - pilot, 0.0) + ca.fmin(x + play / 2 - pilot, 0.0)) / time


def flow(hose: Expression, head: Expression, pilot: Expression, v: Any) -> Expression:
    """q_a [m^3/s] at p_h, p_a and z [Pa]."""
    wanted, rounded = v.gain * ramp(pilot, WIDTH), ROUNDED * v.G_max
    short = v.G_max - wanted
    below = ca.fmin(
        ca.fmax(short + rounded, 0.0), 2 * rounded
    )  # 0 where the limit holds, 2 rounded where it does not yet
    opening = v.G_max - below * below / (4 * rounded) - ca.fmax(short - rounded, 0.0)
    return ramp(hose - head - v.p_check, WIDTH) / v.r_check + opening * signed_sqrt(hose - head)


def conductance(
    head: Expression, rod: Expression, v: Any, p_set: Expression | None = None
) -> tuple[Expression, Expression]:
    """G at p_a, p_b [Pa] of a valve whose poppet has followed, and G_max [m^3/s/Pa^0.5]; ``p_set`` as of ``excess``."""
    return ca.fmin(v.gain * ca.fmax(excess(head, rod, v, p_set), 0.0), v.G_max), v.G_max


def _flow(w: Wiring, hose: Expression, head: Expression, rod: Expression) -> Expression:
    v = w.p.hose_burst_valve
    pilot = w.add("holding_valve_pilot", "z", "Pa", 1e7)
    x = excess(head, rod, v, w.e.through("set_pressure", v.p_set))
    w.rates["holding_valve_pilot"] = following(pilot, x, v.play, w.e.through("poppet_time", PLAY_TIME))
    return flow(hose, head, pilot, v)


def pressure_drop(flow: Expression, v: Any) -> Expression:
    """p_h - p_a [Pa] of the check valve at a flow q_a [m^3/s] into the cylinder; what holds it open to lower is not told by q_a."""
    return ca.if_else(flow > 0, v.p_check * ca.tanh(flow * v.r_check / WIDTH) + v.r_check * flow, 0.0)


def rest(states: Mapping[str, Expression], v: Any, p_set: Expression | None = None) -> Expression:
    """z [Pa] of a valve that has rested, in the middle of its play; ``p_set`` as of ``excess``."""
    return excess(states["head_pressure"], states["rod_pressure"], v, p_set)


def _rest(states: Mapping[str, Expression], p: Any, e: Any) -> dict[str, Expression]:
    v = p.hose_burst_valve
    return {"holding_valve_pilot": rest(states, v, e.through("set_pressure", v.p_set))}


def _data(p: Any) -> tuple[tuple[str, str], ...]:
    v = p.hose_burst_valve
    return (
        ("load-holding valve: set, ratio", f"{v.p_set / 1e5:.0f} bar, {v.R:.2g}"),
        ("load-holding valve: check valve", f"{v.p_check / 1e5:.1f} bar + {v.r_check / 6e9:.2g} bar/(l/min)"),
        ("load-holding valve: fully open after", f"{v.G_max / v.gain / 1e5:.0f} bar"),
    )


register(HoseBurstValve(
    name="pilot_opened", meaning="load-holding valve: shut unless the rod pressure opens it",
    term="q_a = max(0, p_h - p_a - p_check) / r_check + min(g max(0, z), G_max) sqrt(p_h - p_a), z ~ p_a + R p_b - p_set",
    specifications=SPECIFICATIONS,
    offers=frozenset({"load_holding_valve", "valve_at_the_cylinder"}), holds=True, flow=_flow,
    pressure_drop=lambda flow, p, _: pressure_drop(flow, p.hose_burst_valve),
    data=_data, rest=_rest,
    conductance=lambda head, rod, p, e: conductance(
        head, rod, p.hose_burst_valve, e.through("set_pressure", p.hose_burst_valve.p_set)
    ),
))  # fmt: skip
