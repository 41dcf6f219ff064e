"""A family of curves through (0, 0) and (1, 1), the bricks of most random forms, and the few roots and steps beside them."""

from __future__ import annotations

import math

from concealed_plant.compiling import compiled

CURVES = ("power", "saturating exponential", "hyperbola", "Hill curve", "threshold", "parabola with a straight start")
"""Names of the curves, in the order of their numbers from 1."""


@compiled
def curve(kind: float, x: float, a: float) -> float:
    """The curve ``kind`` (1 to 6) at x >= 0 with the shape a in 0..1."""
    x = max(x, 0.0)
    if kind < 1.5:
        return math.pow(x, 0.6 + 1.8 * a)
    if kind < 2.5:
        k = 0.5 + 3.0 * a
        return (1.0 - math.exp(-k * x)) / (1.0 - math.exp(-k))
    if kind < 3.5:
        return x * (1.2 + a) / (1.0 + (0.2 + a) * x)
    if kind < 4.5:
        n, h = 1.5 + 2.0 * a, 0.35 + 0.3 * a
        rise = math.pow(x / h, n)
        return (1.0 + math.pow(h, n)) * rise / (1.0 + rise)
    if kind < 5.5:
        start = 0.15 + 0.4 * a
        rise = (x - start) / (1.0 - start)
        return 0.5 * (rise + math.sqrt(rise * rise + 1e-3))
    return a * x + (1.0 - a) * x * x


@compiled
def odd(kind: float, x: float, a: float) -> float:
    """The curve continued to negative x by symmetry about the origin."""
    return curve(kind, x, a) if x >= 0.0 else -curve(kind, -x, a)


@compiled
def root(x: float) -> float:
    """sign(x) sqrt(|x|) for a pressure [Pa], straight within some 0.5 kPa of zero."""
    return x / math.sqrt(abs(x) + 500.0)


@compiled
def step(x: float) -> float:
    """0 for x <= 0, 1 for x >= 1, smooth in between."""
    if x <= 0.0:
        return 0.0
    if x >= 1.0:
        return 1.0
    return x * x * (3.0 - 2.0 * x)


@compiled
def beyond(x: float, half: float) -> float:
    """How far x lies outside the play -half..half."""
    return x - min(max(x, -half), half)
