"""The return spring of the main valve is another one, or the pilot gain: both have the same effect."""

from boom_model.catalogue.effect import Effect, parameter

EFFECT = Effect(
    "spring_rate", "main_valve", "5.39n", "k r",
    ("the return spring of the main valve, or the pilot gain,", "is another one"),
    "speed at all currents, opens earlier or later",
    (
        parameter("r", "-", 1.0, (0.7, 1.3), (0.1, 10.0), "factor of the return spring (or inverse of the pilot gain)",
                  positive=True, starts=(0.88, 1.12)),
    ),
    {"return_spring": lambda stiffness, own, at: stiffness * own.r},
    place=4, needs="pilot_valves", changes=("main_valve_spool.k", "pilot_valves.h.0"),
)  # fmt: skip
