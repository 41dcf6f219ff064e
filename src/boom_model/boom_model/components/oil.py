"""The oil, and its bulk modulus beta in (3.8): a number, as the thesis has it."""

from __future__ import annotations

from typing import Any

from boom_model.regularisation import Expression
from boom_model.specification import Specification

AMBIENT_PRESSURE = 101_325.0
"""Pa, absolute. Pressures in the model are gauge."""

SPECIFICATIONS = (
    Specification("fluid.rho", "rho", "kg/m^3", "density of the oil", 600.0, 1200.0, "3.20"),
    Specification("fluid.beta", "beta", "Pa", "bulk modulus of the oil without air", 1e7, 5e9, "3.8"),
    Specification("fluid.C_d", "C_d", "-", "discharge coefficient of sharp-edged orifices", 0.1, 1.0, "3.20"),
    Specification("fluid.p_t", "p_t", "Pa", "pressure in the return line", 0.0, 5e6, "3.23"),
)


def bulk_modulus(pressure: Expression, p: Any, e: Any) -> Expression:
    """beta [Pa] at the gauge pressure [Pa], which only effects look at."""
    return e.through("bulk_modulus", p.fluid.beta, pressure=pressure)
