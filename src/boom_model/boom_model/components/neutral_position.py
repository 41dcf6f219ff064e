"""What the main valve's spool does with its ports about neutral: shut, or vented to the tank. Not in the thesis.

    q = -C_d A_v max(0, 1 - x / x_v) sqrt(2 / rho) sqrt(p - p_t),   x = |s_s| / s_max, of either port

Loader cranes with a load-holding valve at the cylinder have vented spools: in neutral both ports fall to the tank's pressure, so
that the valve shuts. Without a valve that holds the load such a boom sinks.
"""

from __future__ import annotations

from typing import Any

import casadi as ca

from boom_model.regularisation import Expression, signed_sqrt
from boom_model.slots import NeutralPosition, register
from boom_model.specification import Specification

SPECIFICATIONS = (
    Specification(
        "main_valve_orifices.A_v", "A_v", "m^2", "area from each port to the tank in neutral", 1e-8, 1e-3, "-"
    ),
    Specification(
        "main_valve_orifices.x_v", "x_v", "-", "spool position over full stroke that shuts it", 1e-3, 0.9, "-"
    ),
)


def remaining(position: Expression, x_v: Expression, p: Any) -> Expression:
    """Share [-] of A_v that is open at the spool position s_s [m]."""
    return ca.fmax(0.0, 1.0 - ca.fabs(position) / (p.main_valve_spool.s_max * x_v))


def flow(area: Expression, pressure: Expression, p: Any) -> Expression:
    """q [m^3/s] into a port with the gauge pressure [Pa] through an area [m^2] to the tank."""
    return -p.fluid.C_d * area * ca.sqrt(2 / p.fluid.rho) * signed_sqrt(pressure - p.fluid.p_t)


def _vented(position: Expression, p: Any) -> Expression:
    o = p.main_valve_orifices
    return o.A_v * remaining(position, o.x_v, p)


register(
    NeutralPosition(name="shut", meaning="ports shut in neutral", term="q = 0", offers=frozenset({"shut_neutral"}))
)
register(NeutralPosition(
    name="vented", meaning="ports vented to the tank in neutral",
    term="q = -C_d A_v max(0, 1 - x / x_v) sqrt(2 / rho) sqrt(p - p_t)", specifications=SPECIFICATIONS, area=_vented, vents=True,
))  # fmt: skip
