"""The orifices in the accumulators' ports have another size, both by the same factor."""

from boom_model.catalogue.effect import Effect, parameter

EFFECT = Effect(
    "accumulator_restrictor", "accumulators", "5.39j,k", "d r, d_2 r r_2",
    ("the orifices of the accumulators", "have another size"), "time constant of p_h",
    (
        parameter("r", "-", 1.0, (0.3, 1.2), (0.0, 5.0), "factor of both orifice diameters", positive=True),
        parameter("r_2", "-", 1.0, (0.4, 2.5), (0.0, 100.0), "further factor of the second's", positive=True, acts=True),
    ),
    {"throat": lambda diameter, own, at: diameter * own.r * (own.r_2 if at.number == 2 else 1.0)},
    place=3, needs="accumulators", changes=("accumulators.d_1", "accumulators.d_2"),
    # both alike, the first alone, the second alone
    points=((0.45, 1.0), (0.75, 1.0), (1.15, 1.0), (0.6, 1.0 / 0.6), (1.0, 0.6)),
)  # fmt: skip
