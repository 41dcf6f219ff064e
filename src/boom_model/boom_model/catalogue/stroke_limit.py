"""The main valve opens no further than part of its stroke: a stop screw, or a pilot supply that does not give the pressure."""

from typing import Any

import casadi as ca

from boom_model.catalogue.effect import Effect, parameter
from boom_model.regularisation import Expression

NO_LIMIT = 2.0
"""Of full stroke: no spool comes so far."""


def _limited(spool: Expression, own: Any, at: Any) -> Expression:
    stroke = at.p.main_valve_spool.s_max
    return ca.fmax(ca.fmin(spool, own.x_retract * stroke), -own.x_extend * stroke)


# It does nothing up to some size, hence starts and shares as of a pump's limit.
_SEARCH: dict[str, Any] = {"starts": (0.9, 0.8, 0.7, 0.6, 0.5, 0.4, 0.3)}

EFFECT = Effect(
    "stroke_limit", "main_valve", "5.39l,m", "metering edges within -x_extend s_max .. x_retract s_max",
    ("the main valve", "opens no further than part of its stroke"), "speed saturates as the current rises",
    (
        parameter("x_extend", "-", NO_LIMIT, (0.25, 0.95), (0.02, NO_LIMIT), "largest opening over full stroke, lifting", **_SEARCH),
        parameter("x_retract", "-", NO_LIMIT, (0.25, 0.95), (0.02, NO_LIMIT), "largest opening over full stroke, lowering", **_SEARCH),
    ),
    {"metering_position": _limited},
    place=2, independent=True, sets_in=(1.0, 0.96, 0.92), reach=2.0,
)  # fmt: skip
