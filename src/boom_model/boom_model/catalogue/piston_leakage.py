"""Laminar flow past the piston seal."""

from boom_model.catalogue.effect import Effect, parameter

LPM = 1.0 / 60_000.0

EFFECT = Effect(
    "piston_leakage", "cylinder", "5.39c,d", "q_l = c (p_a - p_b)",
    ("the piston seal", "leaks"), "sinks at standstill, p_b rises, slower both ways",
    (
        parameter("c", "m^3/s/Pa", 0.0, (0.1 * LPM / 1e7, 5 * LPM / 1e7), (0.0, 1e-9),
                  "laminar leakage past the piston seal"),
    ),
    {"leakage": lambda flow, own, at: flow + own.c * (at.head_pressure - at.rod_pressure)},
    place=1,
)  # fmt: skip
