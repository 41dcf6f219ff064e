"""Flow past the piston seal: laminar in the gap of a sound one, towards an orifice's root law in a nick or a scored barrel."""

from typing import Any

from boom_model.catalogue.effect import Effect, parameter
from boom_model.regularisation import PRESSURE_EPSILON, Expression, power

LPM = 1.0 / 60_000.0
USUAL = 1e7
"""p_r [Pa]: 100 bar, where the leakage is c p_r whatever its law."""


def _leak(flow: Expression, own: Any, at: Any) -> Expression:
    dp = at.head_pressure - at.rod_pressure
    return flow + own.c * dp * power((dp * dp + PRESSURE_EPSILON**2) / USUAL**2, (own.n - 1) / 2)


EFFECT = Effect(
    "piston_leakage", "cylinder", "5.39c,d", "q_l = c (p_a - p_b) (|p_a - p_b| / p_r)^(n - 1)",
    ("the piston seal", "leaks"), "sinks at standstill, p_b rises, slower both ways",
    (
        parameter("c", "m^3/s/Pa", 0.0, (0.1 * LPM / USUAL, 5 * LPM / USUAL), (0.0, 1e-9), "leakage of the piston, at 100 bar"),
        parameter("n", "-", 1.0, (0.5, 1.0), (0.4, 1.2), "exponent of its law: 1 laminar, 0.5 turbulent", positive=True),
    ),
    {"leakage": _leak},
    place=1,
)  # fmt: skip
