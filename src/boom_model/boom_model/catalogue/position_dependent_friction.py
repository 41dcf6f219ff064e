"""A tight spot in the joint."""

import casadi as ca

from boom_model.catalogue.effect import Effect, parameter

EFFECT = Effect(
    "position_dependent_friction", "friction", "5.39b", "tau_C (1 + b exp(-((q_2 - q_c) / width)^2))",
    ("the joint", "has a tight spot"), "the same angle, flips with the direction",
    (
        parameter("b", "-", 0.0, (0.2, 2.0), (-0.9, 20.0), "height of the tight spot over the Coulomb friction"),
        parameter("q_c", "rad", 0.5, (0.0, 1.0), (-2.0, 2.0), "where it is", starts=(0.1, 0.3, 0.5, 0.7, 0.9),
                  visited=True, form=0.02),  # the outline of a spot is not known
        parameter("width", "rad", 0.1, (0.03, 0.3), (1e-3, 2.0), "how wide it is", positive=True, starts=(0.06, 0.2)),
    ),
    {"coulomb_friction": lambda size, own, at: size * (1 + own.b * ca.exp(-(((at.angle - own.q_c) / own.width) ** 2)))},
    place=3,
)  # fmt: skip
