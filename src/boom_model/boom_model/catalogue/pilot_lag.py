"""The pilot stage is slower or faster: its pilot valves, or the line between them and the spool.

The pilot valves' first order by the factor r, so that the stationary gain stays. The line fills and drains as a first order of its
own behind them (oil that is cold, a damping orifice that is small), of the pressure difference that moves the spool:

    T y' = p_+ - p_- - y,   T = line + T_0,   the spool is moved by p_+ - p_- + (y - (p_+ - p_-)) line / T

which is a lag of ``line`` down to nothing. While pressures fall, valves and line are slower by the factor r_fall: they drain to the
tank through other restrictions than they fill through.
"""

from typing import Any

import casadi as ca

from boom_model.catalogue.effect import Effect, parameter
from boom_model.regularisation import Expression
from boom_model.state import State

SHORTEST = 2e-3
"""s. T_0; far below the pilot stage's 51 ms."""
SMOOTH_CURRENT, SMOOTH_PRESSURE = 0.01, 2e4
"""A, Pa. Between growing and falling; far below the 0.3 A and 5 bar at which a spool leaves its neutral."""


def _sign(x: Expression, smooth: float) -> Expression:
    return x / ca.sqrt(x**2 + smooth**2)


def _share(rising: Expression, own: Any) -> Expression:
    """1 / T over that of a pressure that grows; rising: +1 .. -1."""
    return (1 + rising) / 2 + (1 - rising) / (2 * own.r_fall)


def _pilot_valve(rate: Expression, own: Any, _at: Any) -> Expression:
    return rate * _share(_sign(rate, SMOOTH_CURRENT), own)


def _line(difference: Expression, own: Any, _at: Any) -> Expression:
    y, time = own.state("pilot_line"), own.line + SHORTEST
    missing = difference - y
    rising = _sign(y, SMOOTH_PRESSURE) * _sign(missing, SMOOTH_PRESSURE)
    own.rates["pilot_line"] = missing / time * _share(rising, own)
    return difference - missing * own.line / time


def _settling(time: Expression, own: Any, _at: Any) -> Expression:
    return (time + own.line) * ca.fmax(1.0, own.r_fall)


EFFECT = Effect(
    "pilot_lag", "pilot_valves", "5.39n,p,s", "a_1 / r, b_0 / r, and T y' = p_+ - p_- - y before the spool",
    ("the pilot stage", "is slower or faster"), "slower at every edge",
    (
        parameter("r", "-", 1.0, (0.6, 3.0), (0.05, 50.0), "factor of the pilot valves' time constant", positive=True,
                  starts=(0.75, 1.6), form=0.06),  # the pilot's rise is no first-order lag
        parameter("line", "s", 0.0, (0.005, 0.15), (0.0, 2.0), "time constant of the line to the spool", starts=(0.0, 0.04),
                  leads=True),
        parameter("r_fall", "-", 1.0, (0.5, 2.0), (0.05, 20.0), "factor of both while the pressure falls", positive=True,
                  acts=True),
    ),
    {"pilot_rate": lambda rate, own, at: rate / own.r, "pilot_state_rate": _pilot_valve, "pilot_difference": _line,
     "pilot_settling": _settling},
    place=1, needs="pilot_valves", changes=("pilot_valves.a1_s",), stateless=("pilot_rate", "pilot_state_rate", "pilot_settling"),
    not_in_laws=("line", "r_fall"), states=(State("pilot_line", "y", "Pa", 1e6, -1e8, 1e8, equation="5.39n"),),
)  # fmt: skip
