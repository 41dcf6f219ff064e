"""Anti-cavitation valves at both ports of the main valve.

Not in the thesis (machine notes), whose equations let p_b fall to -147 bar on a fast stop with a log; ``enabled: false`` in the
machine file is the thesis as printed.

    q = C_d A_ac sqrt(2 / rho) sqrt(max(0, p_open - p))
"""

from __future__ import annotations

from typing import Any

import casadi as ca

from boom_model.regularisation import Expression, positive, signed_sqrt
from boom_model.specification import Specification

SPECIFICATIONS = (
    Specification(
        "main_valve_orifices.anti_cavitation.A_ac", "A_ac", "m^2", "area of an anti-cavitation valve", 0.0, 1e-2, "-"
    ),
    Specification(
        "main_valve_orifices.anti_cavitation.p_open", "p_open", "Pa", "pressure below which it opens", -1e5, 1e6, "-"
    ),
)


def flow(pressure: Expression, p: Any) -> Expression:
    """q [m^3/s] into the port with the gauge pressure [Pa]."""
    a = p.main_valve_orifices.anti_cavitation
    return p.fluid.C_d * a.A_ac * ca.sqrt(2 / p.fluid.rho) * signed_sqrt(positive(a.p_open - pressure))
