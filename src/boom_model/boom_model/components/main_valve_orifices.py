"""Flows through the metering edges of the main valve: (3.25) = (5.39l,m) with, (3.23) without pressure compensator.

    s_s < 0 (extend):  q_h = C_d A_sa sqrt(2/rho) sqrt(dp_c),         q_b = -C_d A_tb sqrt(2/rho) sqrt(p_b - p_t)
    s_s > 0 (retract): q_h = -C_d A_ta sqrt(2/rho) sqrt(p_h - p_t),   q_b =  C_d A_sb sqrt(2/rho) sqrt(dp_c)

Without compensator the drop dp_c is p_s - p_h (extend) and p_s - p_b (retract). Square roots carry the sign of their
argument. The thesis has the areas in figures only; here, with x = min(|s_s| / s_max, 1.2), u = max(0, (x - x_0) / (1 - x_0))^n:

    A_sa = A_sa_max u,  A_sb = A_sb_max u,  A_tb = A_tb_max u,  A_ta = A_sb_max u / (c_0 - c_1 min(u, 1.3)^2)

No two edges have the same notches, and none is a power of the opening. With w = max(0, (x - x_0) / (1 - x_0)), u of an edge e is

    u_e = w^(n + dn_e) exp(4 b_e w max(0, 1 - w)),   e = sa, tb, sb, ta,   dn_sa = 0

so n is the exponent of sa, and half open an edge has exp(b_e) times the area. All are 0 unless given; where the file says how far
its areas may be off, or that they are a guess, a form may be off, too (``FORMS``).

In the dead zone x <= x_0 every area is exactly zero. F_q, with which the flow closes the spool, is zero but for effects.

The passages and lines in series with an edge, of an area A_p common to all, make of its area A_e, with kappa = (A_sa_max / A_p)^2,

    A_e / sqrt(1 + kappa (A_e / A_sa_max)^2)

The thesis' areas include them, and kappa = 0. Where the areas are a guess, kappa may be up to 1.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from typing import Any, Literal

import casadi as ca

from boom_model.errors import MachineError
from boom_model.regularisation import Expression, power, signed_sqrt
from boom_model.slots import NO_CUSHIONS, Metering, Supply, ValveFlows, register
from boom_model.specification import Specification, none_unless_given
from boom_model.tolerance import check_tolerance

Areas = Callable[[Expression, Any, Any], tuple[Expression, Expression]]
LARGEST_OPENING = 1.2
LARGEST_METER_OUT = 1.3
LARGEST_PASSAGE, SOUND_PASSAGE = 1.0, 0.15
"""Tolerance of kappa where the areas are a guess: the passages take half of the drop at full opening; and where the areas'
``tol`` is told: passages are two and a half times as large as the edges.
"""
FORMS = {"dn": 0.3, "b": 0.3}
"""Tolerances of dn and b where the areas have one: round holes, triangles and slots that are passed for one another. With more
than b = n / 4, 0.3 and a little, an edge would shut again before it is fully open.
"""
EDGES = {"sa": "supply to a", "tb": "b to tank", "sb": "supply to b", "ta": "a to tank"}
"""Lifting opens sa and tb, lowering sb and ta."""
LEAST_EXPONENT = 0.5
"""Of a single edge: a hole opens with 1.5, a slot with 1."""
SMALLEST_OPENING = 1e-12
"""Keeps the logarithm of the exponentiation finite; the area in the dead zone itself is exactly zero."""
_NUMBER = r"([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)"
_METER_OUT = re.compile(rf"^\s*A_sb\s*/\s*\(\s*{_NUMBER}\s*([+-])\s*{_NUMBER}\s*\*\s*u\^2\s*\)\s*$")


def _meter_out(section: Mapping[str, Any], spec: Specification) -> dict[str, Any]:
    """The law of A_ta is a text in the file, A_sb/(c0-c1*u^2); its ``tol`` is that of c0 and of c1."""
    if "A_ta_law" not in section:
        raise MachineError('main_valve_orifices.A_ta_law: missing; expected e.g. {value: "A_sb/(2.27-0.7*u^2)"}')
    entry = section["A_ta_law"]
    text = entry.get("value") if isinstance(entry, dict) else entry
    match = _METER_OUT.match(str(text))
    if match is None:
        raise MachineError(f"main_valve_orifices.A_ta_law: {text!r} is not of the form A_sb/(2.27-0.7*u^2)")
    c0, c1 = float(match[1]), float(match[3]) * (1 if match[2] == "-" else -1)
    if c0 - max(c1, 0.0) * LARGEST_METER_OUT**2 <= 0.0:
        raise MachineError(f"main_valve_orifices.A_ta_law: {text!r} is not positive up to u = {LARGEST_METER_OUT}")
    given = {"conf": "low", **entry} if isinstance(entry, dict) else {"conf": "low"}
    value = c0 if spec.key.endswith("c0") else c1
    said = {"value": value, "unit": spec.unit, "prov": given.get("prov", ""), "conf": given["conf"]}
    if "tol" not in given:
        return said
    if isinstance(given["tol"], dict) and "factor" not in given["tol"]:
        raise MachineError(
            "main_valve_orifices.A_ta_law.tol: a share of the area, 0.4, or {factor: 2}, for both its numbers"
        )
    tolerance = check_tolerance(given["tol"], "main_valve_orifices.A_ta_law", (1.0,))
    return {**said, "tol": given["tol"] if value > 0.0 else tolerance.relative(1.0)}


def _told(section: Mapping[str, Any]) -> Literal["", "guessed", "tol"]:
    """Whether the areas are a guess, or have a ``tol``."""
    area = section.get("A_sa_max")
    if not isinstance(area, dict):
        return ""
    if area.get("conf") == "low" or "factor" in str(area.get("tol", "")):
        return "guessed"
    return "tol" if "tol" in area else ""


def _passage(section: Mapping[str, Any], spec: Specification) -> dict[str, Any]:
    """Unless the file gives it: next to none, and where the areas are a guess that is one, too."""
    own: dict[str, dict[str, Any]] = {
        "guessed": {"tol": {"abs": LARGEST_PASSAGE}, "conf": "low"}, "tol": {"tol": {"abs": SOUND_PASSAGE}},
    }  # fmt: skip
    return none_unless_given(section, spec, **own.get(_told(section), {}))


def _form(section: Mapping[str, Any], spec: Specification) -> dict[str, Any]:
    """Unless the file gives it: none, and where the areas have a tolerance, forms have one, too."""
    own = {"tol": {"abs": FORMS[spec.key.split(".")[1].partition("_")[0]]}} if _told(section) else {}
    return none_unless_given(section, spec, **own)


PASSAGE = Specification(
    "main_valve_orifices.passage", "kappa", "-", "(A_sa_max / A_p)^2, A_p: passages in series with an edge",
    0.0, 100.0, "-", entry=_passage,
)  # fmt: skip

FORM_SPECIFICATIONS = (
    *(
        Specification(
            f"main_valve_orifices.dn_{e}", f"dn_{e}", "-", f"how much larger the exponent is, {EDGES[e]}", -2.0, 2.0, "5.17",
            entry=_form,
        )
        for e in EDGES if e != "sa"
    ),
    *(
        Specification(
            f"main_valve_orifices.b_{e}", f"b_{e}", "-", f"logarithm of what the area is more half open, {way}", -1.0, 0.3, "5.17",
            entry=_form,
        )
        for e, way in EDGES.items()
    ),
)  # fmt: skip

SPECIFICATIONS = (
    Specification("main_valve_orifices.x0", "x_0", "-", "overlap (dead zone) over full stroke", 0.0, 0.9, "5.17"),
    Specification("main_valve_orifices.n", "n", "-", "exponent of the opening", 0.8, 4.0, "5.17"),
    Specification("main_valve_orifices.A_sa_max", "A_sa", "m^2", "largest area supply to a", 1e-8, 1e-2, "3.23"),
    Specification("main_valve_orifices.A_tb_max", "A_tb", "m^2", "largest area b to tank", 1e-8, 1e-2, "3.23"),
    Specification("main_valve_orifices.A_sb_max", "A_sb", "m^2", "largest area supply to b", 1e-8, 1e-2, "3.23"),
    Specification(
        "main_valve_orifices.A_ta_law.c0", "c_0", "-", "A_ta: constant", 0.05, 100.0, "3.23", entry=_meter_out
    ),
    Specification(
        "main_valve_orifices.A_ta_law.c1", "c_1", "-", "A_ta: factor of u^2", -10.0, 10.0, "3.23", entry=_meter_out
    ),
    PASSAGE,
    *FORM_SPECIFICATIONS,
)


def check_forms(p: Any, _: Mapping[str, Any]) -> None:
    """An edge with the exponent zero or less would be open at once, and shut again."""
    for edge in EDGES:
        more = getattr(p.main_valve_orifices, f"dn_{edge}", 0.0)
        if p.main_valve_orifices.n + more < LEAST_EXPONENT:
            raise MachineError(
                f"main_valve_orifices.dn_{edge}: {more:g} makes the exponent of this edge {p.main_valve_orifices.n + more:g}; "
                f"{LEAST_EXPONENT:g} is the least"
            )


def overlap(position: Expression, p: Any, e: Any, edge: str = "supply") -> Expression:
    """x_0 [-] of the ``supply`` or the ``tank`` edge that is open at the spool position s_s [m], over full stroke."""
    return e.through("overlap", p.main_valve_orifices.x0, position=position, edge=edge)


def of_side(position: Expression, p: Any, name: str) -> tuple[Expression, Expression]:
    """A number of the supply and of the tank edge that are open at s_s [m]; ``name`` with ``{}`` for the edge."""
    extend = position < 0
    sa, tb, sb, ta = (getattr(p.main_valve_orifices, name.format(edge)) for edge in EDGES)
    return ca.if_else(extend, sa, sb), ca.if_else(extend, tb, ta)


def openings(position: Expression, overlaps: tuple[Expression, Expression], p: Any) -> tuple[Expression, Expression]:
    """u [-] of the supply and of the tank edge that are open at s_s [m], with their overlaps x_0 [-]."""
    o, extend = p.main_valve_orifices, position < 0
    x = ca.fmin(ca.fabs(position) / p.main_valve_spool.s_max, LARGEST_OPENING)
    steeper = ca.if_else(extend, 0.0, o.dn_sb), ca.if_else(extend, o.dn_tb, o.dn_ta)
    supply, tank = (
        _opening((x - x0) / (1 - x0), o.n + dn, b)
        for x0, dn, b in zip(overlaps, steeper, of_side(position, p, "b_{}"), strict=True)
    )
    return supply, tank


def _opening(u: Expression, exponent: Expression, fuller: Expression) -> Expression:
    w = ca.fmax(u, SMALLEST_OPENING)
    return ca.if_else(u > 0, power(w, exponent) * ca.exp(4 * fuller * w * (1 - ca.fmin(w, 1.0))), 0.0)


def behind_throttle(area: Expression, whole: Expression, throttle: Expression) -> Expression:
    """Area [m^2] of two orifices in series: ``area`` and a throttle A_c, (``whole`` / A_c)^2 = ``throttle``, ``whole`` [m^2]."""
    return area / ca.sqrt(1 + throttle * (area / whole) ** 2)


def in_series(area: Expression, p: Any) -> Expression:
    """Area [m^2] of an edge with the passages that its flow goes through."""
    o = p.main_valve_orifices
    return behind_throttle(area, o.A_sa_max, o.passage)


def areas(position: Expression, p: Any, e: Any) -> tuple[Expression, Expression]:
    """(A_sa, A_tb) [m^2] at s_s < 0, (A_sb, A_ta) at s_s >= 0 [m]: from the supply to one port, from the other to the tank."""
    o = p.main_valve_orifices
    extend = position < 0
    supply, tank = openings(position, (overlap(position, p, e), overlap(position, p, e, "tank")), p)
    a_ta = o.A_sb_max * tank / (o.A_ta_law.c0 - o.A_ta_law.c1 * ca.fmin(tank, LARGEST_METER_OUT) ** 2)
    metered = ca.if_else(extend, o.A_sa_max, o.A_sb_max) * supply, ca.if_else(extend, o.A_tb_max * tank, a_ta)
    return in_series(metered[0], p), in_series(metered[1], p)


def flows(
    position: Expression,
    hose_pressure: Expression,
    rod_pressure: Expression,
    p: Any,
    e: Any,
    supply_drop: Supply,
    cushions: tuple[Expression, Expression] = NO_CUSHIONS,
    edges: Areas = areas,
) -> ValveFlows:
    """Flows and closing force at the spool position s_s [m], p_h and p_b [Pa].

    supply_drop: over the edge from the supply. cushions: (A_tb / A_c)^2 of throttles in series with the return edges, of the rod
    side and of the hose. edges: areas of the edges that are open, as :func:`areas`.
    """
    f = p.fluid
    gain = f.C_d * ca.sqrt(2 / f.rho)
    extend = position < 0
    supply_area, tank_area = edges(position, p, e)
    port_pressure = ca.if_else(extend, hose_pressure, rod_pressure)
    supply_root = supply_drop.root(port_pressure + e.through("supply_fall", 0.0), p)
    conducted = gain * supply_area
    pump = port_pressure + supply_drop.drop(port_pressure, p)
    supply = e.through("supply_flow", conducted * supply_root, conductance=conducted, pressure=port_pressure, pump=pump)
    tank_drop = ca.if_else(extend, rod_pressure, hose_pressure) - f.p_t
    whole = edges(-p.main_valve_spool.s_max, p, e)[1]
    conductance = gain * behind_throttle(tank_area, whole, ca.if_else(extend, *cushions))
    tank = e.through("tank_flow", conductance * signed_sqrt(tank_drop), conductance=conductance)
    size = ca.fabs(supply * supply_root) + ca.fabs(tank * signed_sqrt(tank_drop))
    return ValveFlows(
        head=ca.if_else(extend, supply, -tank),
        rod=ca.if_else(extend, -tank, supply),
        force=e.through("flow_force", 0.0, size=size, extend=extend),
    )


register(Metering(
    name="common_overlap", meaning="four edges with one overlap and one exponent",
    term="q = C_d A(s_s) sqrt(2 / rho) sqrt(dp), A = A_max ((x - x_0) / (1 - x_0))^n", equation="5.39l,m",
    specifications=SPECIFICATIONS, information=frozenset({"A_0", "A_ta_law_soft", "A_ta_max"}), flows=flows, areas=areas,
    overlap=overlap, largest_opening=LARGEST_OPENING, overlaps=("main_valve_orifices.x0",), law=True, check=check_forms,
))  # fmt: skip
