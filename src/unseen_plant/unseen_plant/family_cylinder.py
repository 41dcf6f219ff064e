"""Friction, cylinder, oil, accumulators and hose burst valve."""

from __future__ import annotations

import numpy as np

from unseen_plant.families import Array, Laid, Site, among, decades, family, side, whole
from unseen_plant.layout import (
    BRISTLE,
    BRISTLE_2,
    BRISTLE_3,
    E_AIR,
    E_BREAKAWAY,
    E_BRISTLE,
    E_CAVITY,
    E_CUSHION,
    E_HEAT,
    E_HOLDING,
    E_LEAK,
    E_POPPET,
    E_RELIEF,
    E_RESTRICT,
    E_SETTING,
    E_STICKING,
    E_TIGHT,
    E_WARM,
    GAS_1,
    GAS_2,
    LATCH,
    POPPET,
    POPPET_RATE,
    RELIEF,
    RELIEF_RATE,
    U_FRICTION,
    U_PRECHARGE,
    U_THIN,
    WALL,
    WARMTH,
)  # fmt: skip


@family(
    "stribeck_friction", "friction", "5.39b", "-", (0.02, 5.0),
    "stretched exponential; rational; falls off within a band; more when lifting; grows with the time at rest", style="rocking",
)  # fmt: skip
def stribeck_friction(size: float, form: int, r: Array, _site: Site) -> Laid:
    """Friction is higher near rest by the factor 1 + size."""
    width = decades(r[0], 0.008, 0.06)
    row = (float(form), size, width, among(r[1], 1.0, 2.5), decades(r[2], 0.3, 4.0))
    return Laid(rows={E_BREAKAWAY: row}, moving=(BRISTLE_3,) if form == 5 else ())


@family(
    "presliding_friction", "friction", "5.39b", "-", (0.01, 1.0),
    "Dahl; LuGre; Bouc-Wen; Jenkin elements in parallel; elastic, then plastic", style="rocking",
)  # fmt: skip
def presliding_friction(size: float, form: int, r: Array, _site: Site) -> Laid:
    """The share ``size`` of the friction has to be bent before it slides."""
    row = (float(form), decades(r[0], 1e-4, 4e-3), min(size, 1.0), among(r[1], 0.2, 0.8))
    return Laid(rows={E_BRISTLE: row}, moving=(BRISTLE, BRISTLE_2, BRISTLE_3))


@family(
    "position_dependent_friction", "friction", "5.39b", "-", (0.05, 8.0),
    "flat-topped; raised cosine flanks; triangle; stiff beyond an angle; oval",
)  # fmt: skip
def position_dependent_friction(size: float, form: int, r: Array, site: Site) -> Laid:
    """A tight spot."""
    width = among(r[1], 0.08, 0.25) * max(site.high - site.low, 0.2)
    return Laid(rows={E_TIGHT: (float(form), size, site.angle(among(r[0], 0.25, 0.75)), width)})


@family(
    "friction_drift", "friction", "5.39b", "-", (0.004, 5.0),
    "settling; even; in an S; with the work done in the joint; back and forth",
)  # fmt: skip
def friction_drift(size: float, form: int, r: Array, site: Site) -> Laid:
    """Friction comes to be higher by the share ``size``, or lower."""
    share = site.time / site.duration
    amount = size if r[0] < 0.6 else -size / (1.0 + size)
    if form == 4:
        row = (4.0, amount, float(whole(r[1], 3)), r[2], decades(r[3], 3e3, 3e4), 60.0)
        return Laid(rows={E_WARM: row}, moving=(WARMTH,))
    course = {
        1: 1.0 - np.exp(-share / among(r[1], 0.1, 0.6)),
        2: share,
        3: 0.5 * (1.0 + np.tanh((share - among(r[1], 0.3, 0.7)) * 8.0)),
        5: 0.5 * (1.0 - np.cos(2.0 * np.pi * share * among(r[1], 0.7, 1.8))),
    }[form]
    return Laid(courses={U_FRICTION: amount * course})


@family(
    "piston_leakage", "cylinder", "5.39c,d", "m^3/s", (2e-7, 4e-4),
    "any law of the pressure drop; a scored stretch of the barrel; a lip that lifts one way; a seal that is pressed on",
)  # fmt: skip
def piston_leakage(size: float, form: int, r: Array, _site: Site) -> Laid:
    """Flow past the seal, ``size`` at 100 bar."""
    return Laid(rows={E_LEAK: (float(form), size, float(whole(r[0], 4)), r[1], among(r[2], 0.2, 0.7))})


@family(
    "end_cushioning", "cylinder", "5.39f,m", "-", (0.3, 60.0),
    "power of the depth; saturating; hyperbola; Hill curve; from a threshold", style="ends",
)  # fmt: skip
def end_cushioning(size: float, form: int, r: Array, _site: Site) -> Laid:
    """Near the ends of stroke the oil leaves through a narrow passage in series."""
    return Laid(rows={E_CUSHION: (float(form), size, among(r[0], 0.03, 0.12), r[1])})


@family(
    "entrained_air", "oil", "5.39c,d,i", "-", (5e-5, 0.3),
    "isothermal; polytropic; dissolves with pressure; trapped in one volume; an exponential law",
    twins=("fluid.beta",),
)  # fmt: skip
def entrained_air(size: float, form: int, r: Array, _site: Site) -> Laid:
    """Free air, as a share of the oil at ambient pressure."""
    scale = among(r[1], 30e5, 150e5) if form == 3 else among(r[1], 8e5, 40e5)
    return Laid(rows={E_AIR: (float(form), size, among(r[0], 1.1, 1.4), scale, float(whole(r[2], 3) - 1))})


@family(
    "cavitation", "oil", "5.39c,d,i", "-", (20.0, 5000.0),
    "power of the depth; saturating; hyperbola; exponential", style="joystick",
)  # fmt: skip
def cavitation(size: float, form: int, r: Array, site: Site) -> Laid:
    """Gas comes out of the oil near zero pressure, and the refill valves hardly open."""
    return Laid(
        {"A_ac": site.c.A_ac * among(r[0], 0.02, 0.3)},
        rows={E_CAVITY: (float(form), size, among(r[1], 0.0, 2e5), r[2])},
    )


@family(
    "accumulator_precharge", "accumulators", "5.39g,h", "-", (0.01, 0.9),
    "both alike; the 75 bar one; the 55 bar one; lost while it works; both, unequally", needs=("gas",),
    twins=("accumulators.p_g0_1", "accumulators.p_g0_2"),
)  # fmt: skip
def accumulator_precharge(size: float, form: int, r: Array, site: Site) -> Laid:
    """Gas is lost: the share ``size`` of the pre-charge."""
    left, c = 1.0 - size, site.c
    if form == 4:
        return Laid(courses={U_PRECHARGE: -size * (0.5 + 0.5 * site.time / site.duration)})
    first, second = {1: (1.0, 1.0), 2: (1.0, 0.0), 3: (0.0, 1.0), 5: (1.0, among(r[0], 0.3, 0.7))}[form]
    changes = {"p_1": c.p_1 * (1.0 - first * size), "p_2": c.p_2 * (1.0 - second * size)}
    return Laid(changes, parameters={"r": left} if form == 1 else {})


@family(
    "accumulator_heat_loss", "accumulators", "5.39g,h", "1/s", (2e-3, 3.0),
    "Newton's law; natural convection; stirred by the flow; with a wall that warms; in one of them", needs=("gas",),
    twins=("accumulators.kappa",),
)  # fmt: skip
def accumulator_heat_loss(size: float, form: int, r: Array, _site: Site) -> Laid:
    """The gas exchanges heat with the wall at the rate ``size``."""
    row = (float(form), size, 0.0, among(r[0], 10.0, 60.0), float(r[1] < 0.5))
    parameters = {"inverse_tau": size} if form == 1 else {}
    return Laid(rows={E_HEAT: row}, moving=(GAS_1, GAS_2, WALL), parameters=parameters)


@family(
    "accumulator_restrictor", "accumulators", "5.39j,k", "-", (0.02, 0.97),
    "both orifices; the larger one; the smaller one; only on the way in; clogged so that it is laminar", needs=("gas",),
    twins=("accumulators.d_1", "accumulators.d_2"),
)  # fmt: skip
def accumulator_restrictor(size: float, form: int, r: Array, site: Site) -> Laid:
    """Orifices narrower by the share ``size`` of their diameter."""
    c, left = site.c, 1.0 - size
    if form > 3:
        return Laid(rows={E_RESTRICT: (float(form), left**2 - 1.0, among(r[0], 3e5, 15e5))})
    changes = {"d_1": c.d_1 * (left if form != 3 else 1.0), "d_2": c.d_2 * (left if form != 2 else 1.0)}
    return Laid(changes, parameters={"r": left} if form == 1 else {})


@family(
    "hose_burst_valve_lag", "hose_burst_valve", "5.39f", "s", (1e-3, 2.0),
    "first order; a poppet with mass; moves at a rate; quicker to close than to open; in ratios",
    needs=("burst",), style="joystick",
)  # fmt: skip
def hose_burst_valve_lag(size: float, form: int, r: Array, _site: Site) -> Laid:
    """The poppet needs the time ``size``."""
    row = (float(form), size, among(r[0], 0.4, 0.9), among(r[1], 1.5, 4.0))
    return Laid(
        rows={E_POPPET: row}, moving=(POPPET, POPPET_RATE) if form == 2 else (POPPET,), starts={POPPET: 8.0},
        parameters={"tau": size} if form == 1 else {},
    )  # fmt: skip


@family(
    "hose_burst_valve_setting", "hose_burst_valve", "5.39f", "-", (0.003, 0.8),
    "limit, with the slope at zero kept; whole branch; sets in with the drop; a bend of the curve",
    needs=("burst",), style="joystick",
    twins=("hose_burst_valve.a21", "hose_burst_valve.a30", "hose_burst_valve.a31"),
)  # fmt: skip
def hose_burst_valve_setting(size: float, form: int, r: Array, _site: Site) -> Laid:
    """It limits at a flow lower by the share ``size``, or higher by half of it."""
    off = -size if r[0] < 0.7 else 0.5 * size
    return Laid(rows={E_SETTING: (float(form), off, r[1], float(whole(r[2], 4)))})


@family(
    "load_holding_valve", "hose_burst_valve", "5.39f", "-", (0.05, 1.0),
    "opens evenly; opens as a root; smooth; its poppet needs time", needs=("burst",),
)  # fmt: skip
def load_holding_valve(size: float, form: int, r: Array, site: Site) -> Laid:
    """Oil leaves only as p_a + R p_b exceeds a setting; ``size`` is how far it shuts."""
    ratio = among(r[0], 1.0, 4.5)
    row = (float(form), min(size, 0.995), site.pressure[1] + ratio * among(r[1], 8e5, 30e5), ratio, among(r[2], 2e5, 12e5),
           decades(r[3], 0.01, 0.06))  # fmt: skip
    return Laid(rows={E_HOLDING: row}, moving=(LATCH,) if form == 4 else ())


@family(
    "sticking_poppet", "hose_burst_valve", "5.39f", "-", (0.05, 1.0),
    "frees itself at a drop; frees itself reluctantly; stays free for long; sticks both ways",
    known=False, needs=("burst",), style="joystick",
)  # fmt: skip
def sticking_poppet(size: float, form: int, r: Array, _site: Site) -> Laid:
    """The poppet sticks nearly shut until a drop frees it; ``size`` is how far it shuts."""
    row = (float(form), min(size, 0.99), decades(r[0], 3e5, 30e5), decades(r[1], 0.01, 0.08))
    return Laid(rows={E_STICKING: row}, moving=(LATCH,))


@family(
    "hunting_relief_valve", "main_valve supply", "5.39i", "m^3/s", (2e-7, 1e-3),
    "underdamped; shuts late; the jet pulls it open; play",
    known=False,
)  # fmt: skip
def hunting_relief_valve(size: float, form: int, r: Array, site: Site) -> Laid:
    """A relief valve at the hose opens too early and hunts."""
    low, high = site.pressure[1], site.pressure[2]
    row = (float(form), size, low + among(r[0], 0.3, 0.9) * (high - low), among(r[1], 1e5, 6e5),
           2.0 * np.pi * among(r[2], 3.0, 12.0), decades(r[3], 0.01, 0.1))  # fmt: skip
    return Laid(rows={E_RELIEF: row}, moving=(RELIEF, RELIEF_RATE))


@family(
    "thinning_oil", "hose_burst_valve oil friction", "5.39f", "-", (0.05, 5.0),
    "settling; even; in an S; back and forth", known=False, needs=("burst",),
)  # fmt: skip
def thinning_oil(size: float, form: int, r: Array, site: Site) -> Laid:
    """Oil that warms: the laminar part of the burst valve's flow grows, viscous friction sinks; or oil that cools."""
    share = site.time / site.duration
    course = {
        1: 1.0 - np.exp(-share / among(r[0], 0.1, 0.5)),
        2: share,
        3: 0.5 * (1.0 + np.tanh((share - among(r[0], 0.3, 0.7)) * 8.0)),
        4: np.sin(np.pi * share * among(r[0], 1.0, 2.0)) ** 2,
    }[form]
    amount = size if side(r[1]) > 0 else -size / (1.0 + size)
    return Laid(courses={U_THIN: amount * course})
