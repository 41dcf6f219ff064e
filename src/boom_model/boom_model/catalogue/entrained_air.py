"""Free air in the oil: the bulk modulus depends on the pressure.

    beta(p) = beta (1 + a r^(1/n)) / (1 + a r^(1/n) beta / (n p_abs)),   r = p_0 / p_abs,   p_abs = p + p_0

a is the volume fraction of free air at ambient pressure p_0, n the polytropic exponent of its compression (1.4).
The air stays free (no dissolution).
Source: the usual mixture law, e.g. Jelali and Kroll, Hydraulic Servo-systems, ch. 2 (reference [19] of the thesis).
"""

from typing import Any

import casadi as ca

from boom_model.catalogue.effect import Effect, parameter
from boom_model.components.oil import AMBIENT_PRESSURE
from boom_model.regularisation import Expression, power

POLYTROPIC_EXPONENT = 1.4
LOWEST_ABSOLUTE_PRESSURE = 5.0e3
"""Pa. Below it the air law is frozen; the run itself ends at -1 bar gauge."""


def _bulk_modulus(beta: Expression, own: Any, at: Any) -> Expression:
    absolute = ca.fmax(at.pressure + AMBIENT_PRESSURE, LOWEST_ABSOLUTE_PRESSURE)
    free_air = own.a * power(AMBIENT_PRESSURE / absolute, 1 / POLYTROPIC_EXPONENT)
    return beta * (1 + free_air) / (1 + free_air * beta / (POLYTROPIC_EXPONENT * absolute))


EFFECT = Effect(
    "entrained_air", "oil", "5.39c,d,i", "beta(p) = beta (1 + a r^(1/n)) / (1 + a r^(1/n) beta / (n p_abs))",
    ("the oil", "contains air"), "soft below 15 bar, stiff above",
    (
        parameter("a", "-", 0.0, (0.002, 0.06), (0.0, 0.3), "free air over oil volume at ambient pressure",
                  starts=(0.006, 0.03), accuracy=0.002),  # any oil that is pumped around carries some
    ),
    {"bulk_modulus": _bulk_modulus},
    place=1, reach=1.0,
)  # fmt: skip
