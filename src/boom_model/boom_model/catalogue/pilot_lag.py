"""The pilot valves are slower or faster: their first order by the factor r, so that the stationary gain stays."""

from boom_model.catalogue.effect import Effect, parameter

EFFECT = Effect(
    "pilot_lag", "pilot_valves", "5.39p,s", "a_1 / r, b_0 / r",
    ("the pilot valves", "are slower or faster"), "slower at every edge",
    (
        parameter("r", "-", 1.0, (0.6, 3.0), (0.05, 50.0), "factor of the pilot valves' time constant", positive=True,
                  starts=(0.75, 1.6), form=0.06),  # the pilot's rise is no first-order lag
    ),
    {"pilot_rate": lambda rate, own, at: rate / own.r},
    place=1, needs="pilot_valves", changes=("pilot_valves.a1_s",),
)  # fmt: skip
