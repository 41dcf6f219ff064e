"""Metering edges of the main valve, each with its own overlap and area, of a spool whose neutral may be off-centre.

    A_e = A_e_max w^(n + dn_e) exp(4 b_e w (1 - w)),   w = max(0, (x - x0_e) / (1 - x0_e)),   e = sa, tb, sb, ta
    x = min(|s_s + x_n s_max| / s_max, 1.2)

Letters: from s(upply) or to t(ank), port a or b. Not in the thesis: overlaps of real spools are .05 to .18 and unequal, so that one
edge opens before its partner, and the neutral is off by 2 to 6 % of full command. No two edges have the same notches, and none is a
power of the opening: n is the exponent of sa, the others' are dn_e more, and half open an edge has exp(b_e) times the area.
Flows as in ``main_valve_orifices``.
"""

from __future__ import annotations

from functools import partial
from typing import Any

import casadi as ca

from boom_model.components import main_valve_orifices
from boom_model.regularisation import Expression
from boom_model.slots import Metering, register
from boom_model.specification import Specification

EDGES = {"sa": "supply to a", "tb": "b to tank", "sb": "supply to b", "ta": "a to tank"}
"""Lifting opens sa and tb, lowering sb and ta."""


SPECIFICATIONS = (
    *(
        Specification(f"main_valve_orifices.x0_{e}", f"x_0,{e}", "-", f"overlap over full stroke, {way}", 0.0, 0.9, "5.17")
        for e, way in EDGES.items()
    ),
    *(
        Specification(f"main_valve_orifices.A_{e}_max", f"A_{e}", "m^2", f"largest area {way}", 1e-8, 1e-2, "3.23")
        for e, way in EDGES.items()
    ),
    Specification("main_valve_orifices.n", "n", "-", "exponent of the opening", 0.8, 4.0, "5.17"),
    *(
        Specification(
            f"main_valve_orifices.dn_{e}", f"dn_{e}", "-", f"how much larger the exponent is, {EDGES[e]}", -2.0, 2.0, "5.17",
            entry=main_valve_orifices.none_unless_given,
        )
        for e in EDGES if e != "sa"
    ),
    *(
        Specification(
            f"main_valve_orifices.b_{e}", f"b_{e}", "-", f"logarithm of what the area is more half open, {way}", -1.0, 1.0, "5.17",
            entry=main_valve_orifices.none_unless_given,
        )
        for e, way in EDGES.items()
    ),
    main_valve_orifices.PASSAGE,
    Specification("main_valve_orifices.x_n", "x_n", "-", "neutral off-centre, over full stroke, > 0: lowers", -0.3, 0.3, "-"),
)  # fmt: skip


def _of_side(position: Expression, p: Any, name: str) -> tuple[Expression, Expression]:
    """A number of the supply and of the tank edge that are open at s_s [m]."""
    o, extend = p.main_valve_orifices, position < 0
    sa, tb, sb, ta = (getattr(o, name.format(edge)) for edge in EDGES)
    return ca.if_else(extend, sa, sb), ca.if_else(extend, tb, ta)


def overlaps(position: Expression, p: Any, e: Any) -> tuple[Expression, Expression]:
    """x_0 [-] of the supply and of the tank edge that are open at s_s [m], over full stroke."""
    supply, tank = _of_side(position, p, "x0_{}")
    return (
        e.through("overlap", supply, position=position, edge="supply"),
        e.through("overlap", tank, position=position, edge="tank"),
    )


def areas(position: Expression, p: Any, e: Any) -> tuple[Expression, Expression]:
    """(A_sa, A_tb) [m^2] at s_s < 0, (A_sb, A_ta) at s_s >= 0 [m]."""
    o, extend = p.main_valve_orifices, position < 0
    steeper = ca.if_else(extend, 0.0, o.dn_sb), ca.if_else(extend, o.dn_tb, o.dn_ta)
    fuller = _of_side(position, p, "b_{}")
    supply, tank = (
        main_valve_orifices.opening(position, x0, p, *form)
        for x0, *form in zip(overlaps(position, p, e), steeper, fuller, strict=True)
    )
    largest_supply, largest_tank = _of_side(position, p, "A_{}_max")
    return tuple(main_valve_orifices.in_series(a, p) for a in (largest_supply * supply, largest_tank * tank))


register(Metering(
    name="four_edges", meaning="four edges, each with its own overlap and area",
    term="q = C_d A_e(s_s) sqrt(2 / rho) sqrt(dp), A_e = A_e_max w^(n + dn_e) exp(4 b_e w (1 - w)), e = sa, tb, sb, ta",
    equation="5.39l,m", specifications=SPECIFICATIONS, flows=partial(main_valve_orifices.flows, edges=areas), areas=areas,
    overlap=lambda position, p, e: ca.fmin(*overlaps(position, p, e)), largest_opening=main_valve_orifices.LARGEST_OPENING,
    neutral=lambda p: p.main_valve_orifices.x_n * p.main_valve_spool.s_max,
    overlaps=tuple(f"main_valve_orifices.x0_{edge}" for edge in EDGES),
))  # fmt: skip
