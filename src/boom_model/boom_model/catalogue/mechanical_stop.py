"""Above an angle something is in the way of the boom: a stop, the column, a tree. It is no part of the crane."""

from boom_model.catalogue.effect import Effect
from boom_model.catalogue.ground_contact import damping, numbers
from boom_model.regularisation import positive

EFFECT = Effect(
    "mechanical_stop", "structure", "5.39a", "torque - c max(0, q_2 - q_0) - d q_2' above q_0",
    ("something", "is in the way of the boom above an angle"), "above an angle: the cylinder pushes against it",
    numbers(0.55, 0.7, 0.85),
    {
        "gravity_torque": lambda gravity, own, at: gravity + own.c * positive(at.angle - own.q_0),
        "friction_torque": lambda friction, own, at: friction + damping(at.angle - own.q_0, own, at.rate),
    },
    place=3, watched=False, foreign=True,
)  # fmt: skip
