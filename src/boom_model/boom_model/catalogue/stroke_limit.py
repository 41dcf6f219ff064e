"""The main valve opens no further than part of its stroke: a stop screw, or a pilot supply that does not give the pressure."""

from typing import Any

import casadi as ca

from boom_model.catalogue.effect import Effect, EffectParameter, parameter
from boom_model.regularisation import Expression

NO_LIMIT = 2.0
"""Of full stroke: no spool comes so far."""


def _limited(spool: Expression, own: Any, at: Any) -> Expression:
    stroke = at.p.main_valve_spool.s_max
    return ca.fmax(ca.fmin(spool, own.x_retract * stroke), -own.x_extend * stroke)


def _opening(name: str, way: str, **more: bool) -> EffectParameter:
    return parameter(
        name, "-", NO_LIMIT, (0.25, 0.95), (0.02, NO_LIMIT), f"largest opening over full stroke, {way}", **more
    )


# It does nothing up to some size, hence many points to start from.
EFFECT = Effect(
    "stroke_limit", "main_valve", "5.39l,m", "metering edges within -x_extend s_max .. x_retract s_max",
    ("the main valve", "opens no further than part of its stroke"), "speed saturates as the current rises",
    (_opening("x_extend", "lifting"), _opening("x_retract", "lowering", leads=True)),
    {"metering_position": _limited},
    points=tuple(
        point for x in (0.85, 0.7, 0.58, 0.47, 0.37, 0.28) for point in ((x, x), (x, NO_LIMIT), (NO_LIMIT, x))
    ),
    place=0, sets_in=(1.0, 0.96, 0.92), watched=False,  # the watch looks upwards from nothing
)  # fmt: skip
