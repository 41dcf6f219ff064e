"""The spool of a valve without pilot stage is slower or faster than told."""

from boom_model.catalogue.effect import Effect, parameter

EFFECT = Effect(
    "spool_lag", "main_valve", "5.39n", "T_s r, or omega_n / r",
    ("the spool of the main valve", "is slower or faster"), "slower at every edge",
    (
        parameter("r", "-", 1.0, (0.6, 3.0), (0.05, 50.0), "factor of the spool's time constant, 1 / omega_n of a second-order one",
                  positive=True, starts=(0.75, 1.6), form=0.06),  # a spool that slews at most so fast is no linear lag
    ),
    {"spool_rate": lambda rate, own, at: rate / own.r},
    place=9, needs="no_pilot_valves", changes=("main_valve_spool.T_s", "main_valve_spool.omega_n"),
)  # fmt: skip
