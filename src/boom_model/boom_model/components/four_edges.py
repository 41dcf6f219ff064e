"""Metering edges of the main valve, each with its own overlap and area, of a spool whose neutral may be off-centre.

    A_e = A_e_max u_e,   w = max(0, (x - x0_e) / (1 - x0_e)),   x = min(|s_s + x_n s_max| / s_max, 1.2),   e = sa, tb, sb, ta

Letters: from s(upply) or to t(ank), port a or b. Not in the thesis: overlaps of real spools are .05 to .18 and unequal, so that one
edge opens before its partner, and the neutral is off by 2 to 6 % of full command. u_e(w)
and flows as in ``main_valve_orifices``.
"""

from __future__ import annotations

from functools import partial
from typing import Any

import casadi as ca

from boom_model.components import main_valve_orifices
from boom_model.regularisation import Expression
from boom_model.slots import Metering, register
from boom_model.specification import Specification

SPECIFICATIONS = (
    *(
        Specification(f"main_valve_orifices.x0_{e}", f"x_0,{e}", "-", f"overlap over full stroke, {way}", 0.0, 0.9, "5.17")
        for e, way in main_valve_orifices.EDGES.items()
    ),
    *(
        Specification(f"main_valve_orifices.A_{e}_max", f"A_{e}", "m^2", f"largest area {way}", 1e-8, 1e-2, "3.23")
        for e, way in main_valve_orifices.EDGES.items()
    ),
    Specification("main_valve_orifices.n", "n", "-", "exponent of the opening", 0.8, 4.0, "5.17"),
    *main_valve_orifices.FORM_SPECIFICATIONS,
    main_valve_orifices.PASSAGE,
    Specification("main_valve_orifices.x_n", "x_n", "-", "neutral off-centre, over full stroke, > 0: lowers", -0.3, 0.3, "-"),
)  # fmt: skip


def overlaps(position: Expression, p: Any, e: Any) -> tuple[Expression, Expression]:
    """x_0 [-] of the supply and of the tank edge that are open at s_s [m], over full stroke."""
    supply, tank = main_valve_orifices.of_side(position, p, "x0_{}")
    return (
        e.through("overlap", supply, position=position, edge="supply"),
        e.through("overlap", tank, position=position, edge="tank"),
    )


def areas(position: Expression, p: Any, e: Any) -> tuple[Expression, Expression]:
    """(A_sa, A_tb) [m^2] at s_s < 0, (A_sb, A_ta) at s_s >= 0 [m]."""
    supply, tank = main_valve_orifices.openings(position, overlaps(position, p, e), p)
    largest_supply, largest_tank = main_valve_orifices.of_side(position, p, "A_{}_max")
    return tuple(main_valve_orifices.in_series(a, p) for a in (largest_supply * supply, largest_tank * tank))


register(Metering(
    name="four_edges", meaning="four edges, each with its own overlap and area",
    term="q = C_d A_e(s_s) sqrt(2 / rho) sqrt(dp), A_e = A_e_max u_e(s_s), e = sa, tb, sb, ta",
    equation="5.39l,m", specifications=SPECIFICATIONS, flows=partial(main_valve_orifices.flows, edges=areas), areas=areas,
    overlap=lambda position, p, e: ca.fmin(*overlaps(position, p, e)), largest_opening=main_valve_orifices.LARGEST_OPENING,
    neutral=lambda p: p.main_valve_orifices.x_n * p.main_valve_spool.s_max,
    overlaps=tuple(f"main_valve_orifices.x0_{edge}" for edge in main_valve_orifices.EDGES), check=main_valve_orifices.check_forms,
))  # fmt: skip
