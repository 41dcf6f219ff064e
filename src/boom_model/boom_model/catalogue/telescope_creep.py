"""The boom's moment of mass changes during the recording, as of a telescope that creeps under its weight.

The mass that slides moves along the line from joint to tip, by its moment d f(t), f = 1 - exp(-t / T) from the beginning on:

    S' = S + d f tip / |tip|,   D' = D + 2 r |tip| d f

r: where on that line the sliding mass is. Its own d^2 and the tip's way, which a load at the tip goes along, are left out.
"""

from typing import Any

import casadi as ca

from boom_model.catalogue.effect import Effect, parameter
from boom_model.regularisation import Expression
from boom_model.state import ELAPSED_TIME


def _moment(own: Any) -> Expression:
    """d f(t) [kg m]."""
    return own.d * (1 - ca.exp(-own.time() / own.T))


def _gravity(torque: Expression, own: Any, at: Any) -> Expression:
    tip = at.p.pose.tip
    lever = (tip[0] * ca.cos(at.angle) - tip[1] * ca.sin(at.angle)) / ca.sqrt(tip[0] ** 2 + tip[1] ** 2)
    return torque + at.p.constants.g * _moment(own) * lever


def _acceleration(acceleration: Expression, own: Any, at: Any) -> Expression:
    tip = at.p.pose.tip
    further = 2 * own.r * ca.sqrt(tip[0] ** 2 + tip[1] ** 2) * _moment(own)
    return acceleration * at.inertia / (at.inertia + further)


EFFECT = Effect(
    "telescope_creep", "structure", "5.39a", "S + d (1 - exp(-t / T)) along the tip's direction, D with it",
    ("the boom's moment of mass", "changes during the recording, as of a telescope that creeps"),
    "grows with time, at rest, too",
    (
        parameter("d", "kg m", 0.0, (-1000.0, 1000.0), (-5e4, 5e4), "first moment gained in the end (sliding in: negative)"),
        parameter("T", "s", 30.0, (8.0, 120.0), (0.1, 1e5), "time constant of the change", positive=True, starts=(10.0, 40.0)),
        parameter("r", "-", 0.7, (0.5, 1.0), (0.1, 1.5), "where the mass that slides is, of the way to the tip", positive=True),
    ),
    {"gravity_torque": _gravity, "angular_acceleration": _acceleration},
    place=5, states=(ELAPSED_TIME,), watched=False, foreign=True,
)  # fmt: skip
