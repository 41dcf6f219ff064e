"""Below an angle something carries the boom: the ground, a log, the cab. It is no part of the crane."""

from typing import Any

from boom_model.catalogue.effect import Effect, EffectParameter, parameter
from boom_model.regularisation import Expression, ramp

ROUNDED = 2e-3
"""rad over which a contact sets in."""


def numbers(*shares: float) -> tuple[EffectParameter, ...]:
    """Stiffness and place of a contact; ``shares`` of the angles visited at which it is looked for."""
    return (
        parameter("c", "N m/rad", 0.0, (5e3, 3e6), (0.0, 1e9), "stiffness of what is touched", positive=True),
        parameter("q_0", "rad", 0.5, (0.0, 1.0), (-3.2, 3.2), "where it is touched", starts=shares, visited=True),
    )  # fmt: skip


def _carried(gravity: Expression, own: Any, at: Any) -> Expression:
    return gravity - own.c * ramp(own.q_0 - at.angle, ROUNDED)


EFFECT = Effect(
    "ground_contact", "structure", "5.39a", "torque + c max(0, q_0 - q_2)",
    ("something", "carries the boom below an angle, as the ground does"), "below an angle: the cylinder carries less",
    numbers(0.15, 0.3, 0.45), {"gravity_torque": _carried}, place=2, watched=False, foreign=True,
)  # fmt: skip
