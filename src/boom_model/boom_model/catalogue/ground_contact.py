"""Below an angle something carries the boom, like a spring with a damper: the ground, a log, the cab. No part of the crane."""

from typing import Any

import casadi as ca

from boom_model.catalogue.effect import Effect, EffectParameter, parameter
from boom_model.regularisation import Expression, positive

SETS_IN = 1e-3
"""rad over which the damping does."""


def numbers(*shares: float) -> tuple[EffectParameter, ...]:
    """Stiffness, damping and place of a contact; ``shares`` of the angles visited at which it is looked for."""
    return (
        parameter("c", "N m/rad", 0.0, (5e3, 1e7), (0.0, 1e9), "stiffness of what is touched", positive=True),
        parameter("q_0", "rad", 0.5, (0.0, 1.0), (-3.2, 3.2), "where it is touched", starts=shares, visited=True),
        parameter("d", "N m s/rad", 0.0, (0.0, 2e4), (0.0, 1e8), "damping while it is touched"),
    )  # fmt: skip


def damping(depth: Expression, own: Any, rate: Expression) -> Expression:
    """d q_2' [N m] while something is touched, ``depth`` [rad] deep."""
    return own.d * rate * ca.fmin(positive(depth) / SETS_IN, 1.0)


EFFECT = Effect(
    "ground_contact", "load", "5.39a", "torque + c max(0, q_0 - q_2) - d q_2' below q_0",
    ("something", "carries the boom below an angle, as the ground does"), "below an angle: the cylinder carries less",
    numbers(0.15, 0.3, 0.45),
    {
        "gravity_torque": lambda gravity, own, at: gravity - own.c * positive(own.q_0 - at.angle),
        "friction_torque": lambda friction, own, at: friction + damping(own.q_0 - at.angle, own, at.rate),
    },
    place=4, watched=False, foreign=True,
)  # fmt: skip
