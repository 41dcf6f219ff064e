"""Smooth stand-ins for functions with a corner or an infinite slope, all harmless below sensor resolution.

Measured (shared notes on performance): an epsilon of 100 to 1000 Pa costs no accuracy; 1 Pa is as slow as none.
"""

from __future__ import annotations

from typing import Any

import casadi as ca

Expression = Any
"""A casadi.SX, casadi.DM or float: every equation of this package takes and gives any of them."""

PRESSURE_EPSILON = 1.0e3
"""Pa. Width of the regularised square root of a pressure drop."""
LEAST_SHARE = 1e-6
"""Of a limit: below it nothing of the limit is seen, and a logarithm has a derivative."""


def signed_sqrt(x: Expression, epsilon: float = PRESSURE_EPSILON) -> Expression:
    """sgn(x) sqrt(|x|), as x / (x^2 + eps^2)^(1/4); x and eps in Pa, the result in Pa^0.5."""
    return x / ca.sqrt(ca.sqrt(x * x + epsilon * epsilon))


def positive(x: Expression) -> Expression:
    """max(0, x)."""
    return ca.fmax(x, 0.0)


def ramp(x: Expression, width: float) -> Expression:
    """max(0, x), with the corner rounded over ``width`` above zero: x^2 / (2 width) there, x - width / 2 beyond."""
    held = ca.fmin(ca.fmax(x, 0.0), width)
    return held * held / (2 * width) + ca.fmax(x - width, 0.0)


def power(base: Expression, exponent: Expression) -> Expression:
    """base^exponent for base > 0, as exp(exponent ln base): its derivative uses the same exponential again."""
    return ca.exp(exponent * ca.log(base))


def under_limit(share: Expression, w: Expression) -> Expression:
    """(1 + |x|^(1/w))^-w [-]: factor that keeps x within a limit of 1, the more sharply the smaller w."""
    return power(1 + power(ca.fmax(ca.fabs(share), LEAST_SHARE), 1 / w), -w)
