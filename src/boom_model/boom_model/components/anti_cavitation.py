"""Anti-cavitation valves at both ports of the main valve.

Not in the thesis (machine notes), whose equations let p_b fall to -147 bar on a fast stop with a log; ``enabled: false`` in the
machine file is the thesis as printed.

    q = C_d A_ac sqrt(2 / rho) sqrt(max(0, p_open - p))
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import casadi as ca

from boom_model.errors import MachineError
from boom_model.regularisation import Expression, positive, signed_sqrt
from boom_model.slots import PortValves, register
from boom_model.specification import Specification


def _entry(section: Mapping[str, Any], spec: Specification) -> dict[str, Any]:
    """The group stands in the file as plain numbers with one source; its ``tol`` is that of the area."""
    group, name = section["anti_cavitation"], spec.key.rpartition(".")[2]
    if name not in group:
        raise MachineError(f"{spec.key}: missing ({spec.meaning}, {spec.unit})")
    own = {"tol": group["tol"]} if "tol" in group and name == "A_ac" else {}
    return {"value": group[name], "unit": spec.unit, "prov": group.get("prov", ""), **own}


SPECIFICATIONS = (
    Specification(
        "main_valve_orifices.anti_cavitation.A_ac", "A_ac", "m^2", "area of an anti-cavitation valve", 0.0, 1e-2, "-",
        entry=_entry,
    ),
    Specification(
        "main_valve_orifices.anti_cavitation.p_open", "p_open", "Pa", "pressure below which it opens", -1e5, 1e6, "-",
        entry=_entry,
    ),
)  # fmt: skip


def flow(pressure: Expression, p: Any) -> Expression:
    """q [m^3/s] into the port with the gauge pressure [Pa]."""
    a = p.main_valve_orifices.anti_cavitation
    return p.fluid.C_d * a.A_ac * ca.sqrt(2 / p.fluid.rho) * signed_sqrt(positive(a.p_open - pressure))


register(PortValves(
    name=True, meaning="anti-cavitation valves at both ports of the main valve",
    term="q = C_d A_ac sqrt(2 / rho) sqrt(max(0, p_open - p))", specifications=SPECIFICATIONS, flow=flow,
))  # fmt: skip
register(PortValves(name=False, meaning="no anti-cavitation valves", term="q = 0"))
