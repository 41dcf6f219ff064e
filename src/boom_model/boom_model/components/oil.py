"""The oil, and its bulk modulus beta in (3.8): a number, as the thesis has it, where the oil is under pressure.

Oil bears no tension: where a port is closed faster than the boom stops, gas fills the room. Below p_v

    beta(p) = beta / (1 + (p_v / p_abs - 1)^4)

so that no pressure falls to vacuum. Above p_v, which is 0.5 bar below ambient, it is exactly beta.
"""

from __future__ import annotations

from typing import Any

import casadi as ca

from boom_model.regularisation import Expression
from boom_model.specification import Specification

AMBIENT_PRESSURE = 101_325.0
"""Pa, absolute. Pressures in the model are gauge."""

VOID_PRESSURE = 5.0e4
"""p_v [Pa], absolute. Below it dissolved air comes out of mineral oil within milliseconds."""
VACUUM = 500.0
"""Pa, absolute. Nearer to vacuum the law is frozen: beta is 17 Pa there, and no pressure comes back within seconds."""
VOID = VOID_PRESSURE - AMBIENT_PRESSURE
"""Pa, gauge: p_v as the model's pressures count. Oil at rest is at least there; below, one linear step leads nowhere."""
LOWEST_CORRECTED = 1.0e4 - AMBIENT_PRESSURE
"""Pa, gauge, to which observers correct at the lowest: a void that is a thousandth of the volume, and gone within 10 ms."""

SPECIFICATIONS = (
    Specification("fluid.rho", "rho", "kg/m^3", "density of the oil", 600.0, 1200.0, "3.20"),
    Specification("fluid.beta", "beta", "Pa", "bulk modulus of the oil without air", 1e7, 5e9, "3.8"),
    Specification("fluid.C_d", "C_d", "-", "discharge coefficient of sharp-edged orifices", 0.1, 1.0, "3.20"),
    Specification("fluid.p_t", "p_t", "Pa", "pressure in the return line", 0.0, 5e6, "3.23"),
)


def bulk_modulus(pressure: Expression, p: Any, e: Any) -> Expression:
    """beta [Pa] at the gauge pressure [Pa], which effects and the void below p_v look at."""
    void = ca.fmax(VOID_PRESSURE / ca.fmax(pressure + AMBIENT_PRESSURE, VACUUM) - 1, 0) ** 4
    return e.through("bulk_modulus", p.fluid.beta, pressure=pressure) / (1 + void)
