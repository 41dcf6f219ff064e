"""The spool of the main valve is off-centre in neutral: its edges stand at s_s + (x_n + d (1 - exp(-t / T))) s_max.

A neutral that wanders, as of a solenoid or of pilot oil that warms, is off by another amount in the end.
"""

from typing import Any

import casadi as ca

from boom_model.catalogue.effect import Effect, parameter
from boom_model.regularisation import Expression
from boom_model.state import ELAPSED_TIME


def _edges(spool: Expression, own: Any, at: Any) -> Expression:
    gone = 1 - ca.exp(-own.time() / own.T) if own.stateful else 0.0
    return spool + (own.x_n + own.d * gone) * at.p.main_valve_spool.s_max


EFFECT = Effect(
    "neutral_offset", "main_valve", "5.39l,m", "metering edges at s_s + (x_n + d (1 - exp(-t / T))) s_max",
    ("the spool of the main valve", "is off-centre in neutral"), "opens early to one side and late to the other",
    (
        parameter("x_n", "-", 0.0, (-0.06, 0.06), (-0.3, 0.3), "over full stroke, positive: towards lowering"),
        parameter("d", "-", 0.0, (-0.03, 0.03), (-0.3, 0.3), "what it changes by during a recording, in the end", leads=True,
                  almost_nothing=1e-9),
        parameter("T", "s", 20.0, (5.0, 120.0), (0.1, 1e5), "time constant of the change", positive=True, of="d"),
    ),
    {"metering_position": _edges},
    place=7, states=(ELAPSED_TIME,), moving=("d",), stateless=("metering_position",), not_in_laws=("d", "T"),
)  # fmt: skip
