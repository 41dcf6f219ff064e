"""Main valve, pilot valves, supply and return line."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from unseen_plant.families import Array, Laid, Site, among, decades, family, side, whole
from unseen_plant.layout import (
    E_CENTRE,
    E_DROOP,
    E_FLOW_FORCE,
    E_KINK,
    E_PLAY,
    E_POLE,
    E_PUMP,
    E_RETURN,
    E_SAG,
    E_SEEP,
    E_SOFT_EDGE,
    E_SPRING,
    E_STUCK_SPOOL,
    PLAY,
    PLAY_2,
    RETURN,
    STEP,
    U_CENTRE,
    U_POLE,
    U_SUPPLY,
)  # fmt: skip

_EDGES = ("x_sa", "x_tb", "x_sb", "x_ta")


@family(
    "valve_dead_zone", "main_valve", "5.39l,m", "-", (2e-3, 0.25),
    "all edges; lifting only; lowering only; worn round, opening early; worn round, with a dead zone kept",
    twins=("main_valve_orifices.x0",),
)  # fmt: skip
def valve_dead_zone(size: float, form: int, r: Array, site: Site) -> Laid:
    """Overlap differs by ``size`` of the full stroke."""
    off = side(r[0]) * size
    if form > 3:
        return Laid(rows={E_SOFT_EDGE: (float(form - 3), size)})
    lift, lower = off * (form != 3), off * (form != 2)
    changes = {name: max(getattr(site.c, name) + (lift if name in _EDGES[:2] else lower), 0.01) for name in _EDGES}
    return Laid(changes, parameters={"d_extend": lift, "d_retract": lower})


@family(
    "edge_overlap", "main_valve", "5.39l,m", "-", (2e-3, 0.25),
    "pump to head; rod to tank; pump to rod; head to tank",
    twins=("main_valve_orifices.x0",),
)  # fmt: skip
def edge_overlap(size: float, form: int, r: Array, site: Site) -> Laid:
    """One edge opens earlier or later than its partner."""
    name = _EDGES[form - 1]
    return Laid({name: max(getattr(site.c, name) + side(r[0]) * size, 0.01)})


@family(
    "neutral_offset", "main_valve", "5.39l,m", "-", (1e-3, 0.2),
    "constant; near neutral only; on one side; creeping",
)  # fmt: skip
def neutral_offset(size: float, form: int, r: Array, site: Site) -> Laid:
    """The spool rests off its centre by ``size`` of the full stroke."""
    off = side(r[0]) * size
    if form == 4:
        return Laid(courses={U_CENTRE: off * (0.4 + 0.6 * site.time / site.duration)})
    return Laid(rows={E_CENTRE: (float(form), off, r[1])})


@family(
    "valve_hysteresis", "main_valve pilot_valves", "5.39l,m", "-", (1e-3, 0.2),
    "play; Bouc-Wen; two plays in parallel; a force that turns with the direction",
)  # fmt: skip
def valve_hysteresis(size: float, form: int, r: Array, _site: Site) -> Laid:
    """Edges lag the spool by ``size`` of the full stroke to either side."""
    return Laid(rows={E_PLAY: (float(form), size, among(r[0], 0.5, 1.5))}, moving=(PLAY, PLAY_2))


@family(
    "flow_force", "main_valve", "5.39n", "-", (2e-3, 0.6),
    "flow and root of the drop; a jet that turns as the edge opens; any law of the flow in; opening times drop; flow squared",
    needs=("piloted",),
)  # fmt: skip
def flow_force(size: float, form: int, r: Array, _site: Site) -> Laid:
    """Flow closes the spool, with some ``size`` of the spring's force at full stroke."""
    return Laid(rows={E_FLOW_FORCE: (float(form), size, r[0], float(whole(r[1], 4)))})


@family(
    "spring_rate", "main_valve pilot_valves", "5.39n", "-", (0.01, 0.8),
    "other rate; stiffens along the stroke; one of two springs; a second spring sets in", needs=("piloted",),
    twins=("main_valve_spool.A_s", "pilot_valves.h.0"),
)  # fmt: skip
def spring_rate(size: float, form: int, r: Array, _site: Site) -> Laid:
    """The return spring is stiffer by the share ``size``, or softer by half of it."""
    off = size if r[0] < 0.5 else -0.5 * size
    parameters = {"r": 1.0 + off} if form == 1 else {}
    return Laid(rows={E_SPRING: (float(form), off, r[1], float(whole(r[2], 4)))}, parameters=parameters)


@family(
    "compensator_droop", "main_valve", "5.39l,m", "-", (0.01, 0.9),
    "any law of the flow; more under load; any other law of the flow; late", needs=("compensated",),
    twins=("main_valve_orifices.dp_c", "main_valve_orifices.A_sa_max", "main_valve_orifices.A_sb_max"),
)  # fmt: skip
def compensator_droop(size: float, form: int, r: Array, _site: Site) -> Laid:
    """Supply flow sinks with itself by the share ``size`` at 120 l/min."""
    kind = {1: whole(r[0], 3), 2: whole(r[0], 4), 3: 6, 4: 5}[form]
    return Laid(rows={E_DROOP: (float(form), size, float(kind), r[1])})


@family(
    "pilot_lag", "pilot_valves", "5.39p,s", "-", (0.03, 12.0),
    "both coils; other when the pressure falls; slow at small currents; unlike coils; oil that warms or cools", needs=("piloted",),
    twins=("pilot_valves.a1_s",),
)  # fmt: skip
def pilot_lag(size: float, form: int, r: Array, site: Site) -> Laid:
    """The stage is slower by the share ``size`` of its time constant."""
    if form == 5:
        share = site.time / site.duration if r[1] < 0.5 else 1.0 - site.time / site.duration
        return Laid(courses={U_POLE: 1.0 / (1.0 + size * share) - 1.0})
    shape = float(r[0] < 0.5) if form == 4 else r[0]
    parameters = {"r": 1.0 + size} if form == 1 else {}
    return Laid(rows={E_POLE: (float(form), size, shape, float(whole(r[1], 3)))}, parameters=parameters)


@family(
    "command_delay", "pilot_valves", "5.39p,s", "s", (2e-3, 0.4),
    "constant; unlike coils; a slow bus that passes on what it last had; varies slowly",
)  # fmt: skip
def command_delay(size: float, form: int, r: Array, site: Site) -> Laid:
    """The valve gets the current ``size`` later."""
    time = site.time
    later = np.full((len(time), 2), size)
    if form == 2:
        later *= (0.6, 1.4) if r[0] < 0.5 else (1.4, 0.6)
    elif form == 4:
        later *= 1.0 + 0.5 * np.sin(2.0 * np.pi * (time[:, None] / among(r[0], 5.0, 20.0) + site.late[2]))
    slots = among(r[1], 0.6, 1.2) * size

    def late(currents: Array) -> Array:
        count, result = len(currents), np.empty_like(currents)
        asked = np.floor(time[:count] / slots) * slots if form == 3 else time[:count]
        for k in range(2):
            at = np.rint((asked - later[:count, k] * (0.5 if form == 3 else 1.0)) / STEP).astype(np.int64)
            result[:, k] = currents[np.clip(at, 0, count - 1), k]
        return result

    return Laid(currents=(late,), parameters={"T": size} if form == 1 else {})


@family(
    "pump_flow_limit", "supply", "5.39l,m", "-", (0.02, 0.9),
    "a flow; a power; less under load; round",
)  # fmt: skip
def pump_flow_limit(size: float, form: int, r: Array, site: Site) -> Laid:
    """The pump lacks the share ``size`` of the largest flow that was asked for."""
    return Laid(rows={E_PUMP: (float(form), (1.0 - size) * site.peak, r[0])})


@family(
    "supply_variation", "supply", "5.39l,m", "-", (3e-3, 0.7),
    "wanders; another function takes its share; swings; sags with the load; drifts",
)  # fmt: skip
def supply_variation(size: float, form: int, r: Array, site: Site) -> Laid:
    """The supplied flow varies by the share ``size``."""
    if form == 4:
        return Laid(rows={E_SAG: (4.0, size, float(whole(r[0], 3)), r[1])})
    makers: dict[int, Callable[[], Array]] = {
        1: lambda: np.clip(site.wander(among(r[0], 1.0, 5.0)), -1.5, 1.5),
        2: lambda: -site.switching(among(r[0], 2.0, 6.0)),
        3: lambda: np.sin(2.0 * np.pi * (site.time / among(r[0], 3.0, 12.0) + site.late[1])),
        5: lambda: side(r[1]) * site.time / site.duration,
    }
    course = makers[form]()
    return Laid(courses={U_SUPPLY: size * course})


@family(
    "return_line_pressure", "return_line", "5.39l,m", "Pa", (2e4, 8e6),
    "straight to square; a filter with a bypass; turbulent line; a check valve and a line",
    twins=("fluid.p_t",),
)  # fmt: skip
def return_line_pressure(size: float, form: int, r: Array, _site: Site) -> Laid:
    """Tank pressure rises by ``size`` at 120 l/min, a few hundredths of a second later."""
    return Laid(rows={E_RETURN: (float(form), size, among(r[0], 0.2, 0.8), among(r[1], 0.005, 0.03))}, moving=(RETURN,))


@family(
    "kinked_hose", "main_valve return_line", "5.39l", "-", (0.2, 60.0),
    "near an angle; above an angle; below an angle; always", known=False,
)  # fmt: skip
def kinked_hose(size: float, form: int, r: Array, site: Site) -> Laid:
    """The hose is narrow where the boom bends it, on the way to tank."""
    width = among(r[1], 0.05, 0.2) * max(site.high - site.low, 0.2)
    return Laid(rows={E_KINK: (float(form), size, site.angle(among(r[0], 0.3, 0.7)), width)})


@family(
    "seeping_valve", "main_valve", "5.39i", "m^3/s", (1e-7, 3e-4),
    "laminar to tank; through a nick; beyond a pressure; from the supply", known=False,
)  # fmt: skip
def seeping_valve(size: float, form: int, _r: Array, site: Site) -> Laid:
    """Oil passes the closed spool."""
    return Laid(rows={E_SEEP: (float(form), size, site.pressure[0])})


@family(
    "sticking_spool", "main_valve", "5.39n", "-", (0.02, 1.5),
    "at one place; near neutral; on one side; in ridges", known=False, needs=("piloted",), style="positioning",
)  # fmt: skip
def sticking_spool(size: float, form: int, r: Array, _site: Site) -> Laid:
    """Dry friction of the spool, ``size`` of the spring's force at full stroke."""
    return Laid(rows={E_STUCK_SPOOL: (float(form), size, decades(r[0], 0.25, 0.6))})
