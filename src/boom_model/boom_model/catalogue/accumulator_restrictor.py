"""The orifices in the accumulators' ports have another size, both by the same factor."""

from boom_model.catalogue.effect import Effect, parameter

EFFECT = Effect(
    "accumulator_restrictor", "accumulators", "5.39j,k", "d r",
    ("the orifices of the accumulators", "have another size"), "time constant of p_h",
    (
        parameter("r", "-", 1.0, (0.3, 1.2), (0.0, 5.0), "factor of both orifice diameters", positive=True,
                  starts=(0.45, 0.75, 1.15)),
    ),
    {"throat": lambda diameter, own, at: diameter * own.r},
    place=3, needs="accumulators", changes=("accumulators.d_1", "accumulators.d_2"),
)  # fmt: skip
