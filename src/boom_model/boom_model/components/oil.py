"""Bulk modulus of the oil, beta in (3.8); with entrained air it depends on the pressure.

    beta(p) = beta (1 + a r^(1/n)) / (1 + a r^(1/n) beta / (n p_abs)),   r = p_0 / p_abs,   p_abs = p + p_0

a is the volume fraction of free air at ambient pressure p_0, n the polytropic exponent of its compression (1.4).
The air stays free (no dissolution). Effect ``entrained_air``, neutral a = 0: beta, as the thesis has it.
Source: the usual mixture law, e.g. Jelali and Kroll, Hydraulic Servo-systems, ch. 2 (reference [19] of the thesis).
"""

from __future__ import annotations

from typing import Any

import casadi as ca

from boom_model.regularisation import Expression, power
from boom_model.specification import Specification

AMBIENT_PRESSURE = 101_325.0
"""Pa, absolute. Pressures in the model are gauge."""

POLYTROPIC_EXPONENT = 1.4
LOWEST_ABSOLUTE_PRESSURE = 5.0e3
"""Pa. Below it the air law is frozen; the run itself ends at -1 bar gauge."""

SPECIFICATIONS = (
    Specification("fluid.rho", "rho", "kg/m^3", "density of the oil", 600.0, 1200.0, "3.20"),
    Specification("fluid.beta", "beta", "Pa", "bulk modulus of the oil without air", 1e7, 5e9, "3.8"),
    Specification("fluid.C_d", "C_d", "-", "discharge coefficient of sharp-edged orifices", 0.1, 1.0, "3.20"),
    Specification("fluid.p_t", "p_t", "Pa", "pressure in the return line", 0.0, 5e6, "3.23"),
)


def bulk_modulus(pressure: Expression, p: Any, e: Any) -> Expression:
    """beta(p) [Pa] at the gauge pressure p [Pa]."""
    air, n = e.entrained_air.a, POLYTROPIC_EXPONENT
    absolute = ca.fmax(pressure + AMBIENT_PRESSURE, LOWEST_ABSOLUTE_PRESSURE)
    free_air = air * power(AMBIENT_PRESSURE / absolute, 1 / n)
    return p.fluid.beta * (1 + free_air) / (1 + free_air * p.fluid.beta / (n * absolute))
