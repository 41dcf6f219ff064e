"""The accumulators have another pre-charge pressure: both, or as a rule one of them, have lost gas."""

from boom_model.catalogue.effect import Effect, parameter

EFFECT = Effect(
    "accumulator_precharge", "accumulators", "5.39g,h", "p_g0 r, p_g0,2 r r_2",
    ("the accumulators", "have another pre-charge pressure"), "the corner in p_h' moves",
    (
        parameter("r", "-", 1.0, (0.2, 1.1), (0.02, 2.0), "factor of both pre-charge pressures", positive=True),
        parameter("r_2", "-", 1.0, (0.4, 2.5), (0.01, 100.0), "further factor of the second's", positive=True, acts=True),
    ),
    {"precharge": lambda pressure, own, at: pressure * own.r * (own.r_2 if at.number == 2 else 1.0)},
    place=1, needs="accumulators", changes=("accumulators.p_g0_1", "accumulators.p_g0_2"),
    alike=("accumulators.V_g0",),  # above the pre-charge all that acts is p_g0 V_g0^kappa
    # both alike, the first alone, the second alone
    points=((0.35, 1.0), (0.7, 1.0), (1.08, 1.0), (0.35, 1.0 / 0.35), (0.7, 1.0 / 0.7), (1.0, 0.35), (1.0, 0.7)),
)  # fmt: skip
