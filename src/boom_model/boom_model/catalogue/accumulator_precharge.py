"""The accumulators have another pre-charge pressure, both by the same factor."""

from boom_model.catalogue.effect import Effect, parameter

EFFECT = Effect(
    "accumulator_precharge", "accumulators", "5.39g,h", "p_g0 r",
    ("the accumulators", "have another pre-charge pressure"), "the corner in p_h' moves",
    (
        parameter("r", "-", 1.0, (0.2, 1.1), (0.02, 2.0), "factor of both pre-charge pressures", positive=True,
                  starts=(0.35, 0.7, 1.08)),
    ),
    {"precharge": lambda pressure, own, at: pressure * own.r},
    place=1, needs="accumulators", changes=("accumulators.p_g0_1", "accumulators.p_g0_2"),
)  # fmt: skip
