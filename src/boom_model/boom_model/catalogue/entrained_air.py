"""Free air in the oil, and hoses that are softer at low pressure: the bulk modulus depends on the pressure.

    beta(p) = beta_b (1 + a r^(1/n)) / (1 + a r^(1/n) beta_b / (n p_abs)),   r = p_0 / p_abs,   p_abs = p + p_0
    beta_b = beta (1 - b exp(-p / p_b))

a is the volume fraction of free air at ambient pressure p_0, n the polytropic exponent of its compression: 1.4 without exchange of
heat, 1 of bubbles as warm as the oil, less where air dissolves as the pressure rises.
Sources: the usual mixture law, e.g. Jelali and Kroll, Hydraulic Servo-systems, ch. 2 (reference [19] of the thesis); Hoffmann's
measured law E = E_max (1 - exp(-0.4 - 2e-7 p)), p in Pa, is b = 0.67 and p_b = 50 bar.
"""

from typing import Any

import casadi as ca

from boom_model.catalogue.effect import Effect, parameter
from boom_model.components.oil import AMBIENT_PRESSURE
from boom_model.regularisation import Expression, power

LOWEST_ABSOLUTE_PRESSURE = 5.0e3
"""Pa. Below it the air law is frozen; there the oil leaves a void (oil.py)."""
STIFFENED = 5.0e6
"""p_b [Pa]."""


def _bulk_modulus(beta: Expression, own: Any, at: Any) -> Expression:
    absolute = ca.fmax(at.pressure + AMBIENT_PRESSURE, LOWEST_ABSOLUTE_PRESSURE)
    beta = beta * (1 - own.b * ca.exp(-ca.fmax(at.pressure, 0.0) / STIFFENED))
    free_air = own.a * power(AMBIENT_PRESSURE / absolute, 1 / own.n)
    return beta * (1 + free_air) / (1 + free_air * beta / (own.n * absolute))


EFFECT = Effect(
    "entrained_air", "oil", "5.39c,d,i",
    "beta(p) = beta_b (1 + a r^(1/n)) / (1 + a r^(1/n) beta_b / (n p_abs)), beta_b = beta (1 - b e^(-p / 50 bar))",
    ("the oil", "contains air"), "soft below 15 bar, stiff above",
    (
        parameter("a", "-", 0.0, (0.002, 0.06), (0.0, 0.3), "free air over oil volume at ambient pressure",
                  starts=(0.006, 0.03), accuracy=0.002),  # any oil that is pumped around carries some
        parameter("b", "-", 0.0, (0.1, 0.67), (0.0, 0.9), "share of its stiffness that oil in hoses lacks without pressure",
                  acts=True, accuracy=0.67),  # measured on sound circuits
        parameter("n", "-", 1.4, (1.0, 1.4), (0.5, 1.5), "polytropic exponent of the air", positive=True),
    ),
    {"bulk_modulus": _bulk_modulus},
    place=1, reach=1.0,
)  # fmt: skip
