"""Friction changes during the recording, as a bearing does that warms.

Which of the two is the file's, that of the cold crane or that of the warm one, the file does not say.
"""

from typing import Any

import casadi as ca

from boom_model.catalogue.effect import Effect, parameter
from boom_model.regularisation import Expression
from boom_model.state import ELAPSED_TIME


def _torque(torque: Expression, own: Any, _at: Any) -> Expression:
    return own.r_0 * (1 + (own.r - 1) * (1 - ca.exp(-own.time() / own.T))) * torque


EFFECT = Effect(
    "friction_drift", "friction", "5.39b", "tau_f r_0 (1 + (r - 1) (1 - exp(-t / T)))",
    ("the friction", "changes during the recording"), "grows with time, with speed",
    (
        parameter("r", "-", 1.0, (0.3, 5.0), (0.0, 20.0), "factor by which the friction torque changes in the end", positive=True),
        parameter("T", "s", 30.0, (5.0, 120.0), (0.1, 1e5), "time constant of the change", positive=True,
                  possible=(3.0, 1e5)),  # nothing warms faster
        parameter("r_0", "-", 1.0, (0.5, 4.0), (0.02, 50.0), "factor of the friction torque in the beginning", positive=True,
                  acts=True),
    ),
    {"friction_torque": _torque},
    # a file of the cold crane, and one of the warm crane that is cold in the beginning
    points=((2.0, 8.0, 1.0), (2.0, 30.0, 1.0), (0.33, 8.0, 3.0), (0.33, 30.0, 3.0)),
    place=4, states=(ELAPSED_TIME,), watched=False,
)  # fmt: skip
