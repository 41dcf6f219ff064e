"""Within ``length`` of an end of stroke the chamber that shrinks empties through a throttle, in series with what follows it.

    A_e = A / sqrt(1 + (A / A_c)^2),   A_c = A_tb / (kappa ramp(distance / length)^shape)

A: of the passage that follows, A_tb: return edge of the rod side, fully open. An edge that is hardly open is hardly narrowed. The
piston comes back through check valves. On the head side the throttle is the cylinder's, ahead of the valve at it (kappa_a), or the
main valve narrows the way back of the hose (kappa_h), as where a crane brakes before its stops. On the rod side both are kappa_b;
where the pressure is measured behind the cylinder's throttle, at the valve, that is a force on the piston (kappa_r):

    f_p - A_b dp,   dp = rho / 2 (A_b s_p' / (C_d A_c))^2 while it extends
"""

from typing import Any

import casadi as ca

from boom_model.catalogue.effect import Effect, parameter
from boom_model.regularisation import Expression, power

_TIP = 1e-6
"""Depth of a spear that is outside; a power needs one."""


def _narrowing(cushion: Expression, own: Any, at: Any) -> Expression:
    """(A_tb / A_c)^2 [-]."""
    kappa = {"a": own.kappa_a, "b": own.kappa_b, "h": own.kappa_h, "r": own.kappa_r}[at.way]
    depth = ca.fmin(ca.fmax(1 - at.distance / own.length, _TIP), 1.0)
    return cushion + kappa**2 * power(depth, 2 * own.shape)


_OVER = "A_tb over the throttle's area at the end of stroke, "

_TOGETHER = ((1, 1, 0, 0), (1, 0, 1, 0), (0, 0, 0, 1))
"""Which throttles a search tries together: b, a, h, r."""

EFFECT = Effect(
    "end_cushioning", "cylinder", "5.39b,f,l,m", "throttle in the way out, A_tb / A_c = kappa ramp(distance / length)^shape",
    ("the cylinder", "is cushioned near the end of its stroke"), "near the ends of stroke: p_b rises, the boom slows",
    (
        parameter("kappa_b", "-", 0.0, (1.0, 41.0), (0.0, 100.0), _OVER + "rod side"),
        parameter("kappa_a", "-", 0.0, (1.0, 41.0), (0.0, 100.0), _OVER + "head side, in the cylinder", leads=True),
        parameter("kappa_h", "-", 0.0, (1.0, 41.0), (0.0, 100.0), _OVER + "head side, at the main valve", leads=True),
        parameter("kappa_r", "-", 0.0, (1.0, 41.0), (0.0, 100.0), _OVER + "rod side, ahead of the transducer", leads=True),
        parameter("length", "m", 0.05, (0.02, 0.1), (1e-3, 1.0), "stroke over which the cushion acts", positive=True),
        parameter("shape", "-", 1.0, (0.5, 2.0), (0.2, 5.0), "of the spear: exponent of its depth", positive=True),
    ),
    {"cushion": _narrowing},
    points=tuple(
        (*(k * one for one in which), length, 1.0) for k in (3.0, 12.0) for which in _TOGETHER for length in (0.03, 0.08)
    ),
    place=2, reach=0.25, not_in_laws=("kappa_r",),
)  # fmt: skip
