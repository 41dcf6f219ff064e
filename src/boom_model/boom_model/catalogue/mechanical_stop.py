"""Above an angle something is in the way of the boom: a stop, the column, a tree. It is no part of the crane."""

from typing import Any

from boom_model.catalogue.effect import Effect
from boom_model.catalogue.ground_contact import ROUNDED, numbers
from boom_model.regularisation import Expression, ramp


def _held(gravity: Expression, own: Any, at: Any) -> Expression:
    return gravity + own.c * ramp(at.angle - own.q_0, ROUNDED)


EFFECT = Effect(
    "mechanical_stop", "structure", "5.39a", "torque - c max(0, q_2 - q_0)",
    ("something", "is in the way of the boom above an angle"), "above an angle: the cylinder pushes against it",
    numbers(0.55, 0.7, 0.85), {"gravity_torque": _held}, place=3, watched=False, foreign=True,
)  # fmt: skip
