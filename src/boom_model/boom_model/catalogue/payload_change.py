"""A load that is grasped or released during the recording: attached within some 10 ms at t_g, at the tip's speed."""

from typing import Any

import casadi as ca

from boom_model.catalogue.effect import Effect, parameter
from boom_model.regularisation import Expression
from boom_model.state import ELAPSED_TIME

GRASP_TIME = 0.01
"""s. Width of the tanh with which a load is grasped or released."""


def _load(mass: Expression, own: Any, _at: Any) -> Expression:
    grasped = 0.5 * (1 + ca.tanh((own.time() - own.t_g) / GRASP_TIME))
    return mass + own.mass * grasped


EFFECT = Effect(
    "payload_change", "load", "5.39a", "m (1 + tanh((t - t_g) / 0.01 s)) / 2 at the tip",
    ("a load", "was grasped or released during the recording"), "static head pressure steps, with the lever arm",
    (
        parameter("mass", "kg", 0.0, (50.0, 2000.0), (-2000.0, 5000.0), "mass grasped (released: negative)"),
        parameter("t_g", "s", 20.0, (5.0, 50.0), (-1e5, 1e5), "when, since the start of the run"),
    ),
    {"load_mass": _load},
    place=2, states=(ELAPSED_TIME,), load=True, onset="t_g", lasting="payload", watched=False,
)  # fmt: skip
