"""Learns the oil's behaviour while running: the compliance of each chamber, and the flow that the valve's model misses.

Compliance of a chamber, against the nominal one:  int k (q - A v) dt = kappa (p - p_0), k the nominal dp/dV. Both
sides pass the same high-pass filter twice: once would leave a flow that the model misses steadily as an offset, which is taken for
compliance. kappa follows by a normalised gradient, only while the pressure
moves. The regression is on the pressure, which is measured, so that an error of the modelled flow does not bias kappa.

Flow that the model misses, as a piston speed:  d^' = w (v + f_p' / K - Q - d^), Q the speed that the modelled flows would give.
"""

from __future__ import annotations

from math import exp
from typing import Any, NamedTuple

import casadi as ca

from boom_controller.blocks.limits import limited
from boom_model.regularisation import Expression

SOFTEST, STIFFEST = 8.0, 0.7
"""Limits of kappa: air in the oil (beta x 0.2, Table 6.1) with a margin."""
FORGETTING = 4.0
"""1/s, of the high-pass filters."""
SAFE_POLE = -1.0
"""1/s. Once an oscillation was recognised."""
LARGEST_MISSED = 0.05
"""m/s."""


class ChamberState(NamedTuple):
    """kappa [-]; both sides of the regression behind one high pass [Pa] and behind both; p [Pa] of the sample before."""

    ratio: Expression = 1.0
    volume: Expression = 0.0
    moved: Expression = 0.0
    steady_free: Expression = 0.0
    change: Expression = 0.0
    pressure: Expression = 0.0


class MissedState(NamedTuple):
    """d^ [m/s], and f_p [N] of the sample before."""

    speed: Expression = 0.0
    force: Expression = 0.0


def observe_chamber(
    x: ChamberState, pressure: Expression, expected_rate: Expression, s: Any, trusted: Expression = 1.0
) -> ChamberState:
    """One sample time: p [Pa], k (q - A v) [Pa/s] of the nominal chamber; ``trusted``: 0 only filters. ``s``: settings."""
    t = s.sample_time
    keep = exp(-FORGETTING * t)
    volume = keep * x.volume + t * expected_rate
    moved = keep * x.moved + pressure - x.pressure
    steady_free = keep * x.steady_free + volume - x.volume
    y, size = keep * x.change + moved - x.moved, s.compliance_pressure
    change = s.compliance_gain * t * y * (steady_free - x.ratio * y) / (size * size + y * y)
    learnt = limited(x.ratio + change, STIFFEST, SOFTEST)
    return ChamberState(ca.if_else(trusted, learnt, x.ratio), volume, moved, steady_free, y, pressure)


def observe_missed_flow(
    x: MissedState, velocity: Expression, modelled: Expression, force: Expression, stiffness: Expression,
    safe: Expression, s: Any,
) -> MissedState:  # fmt: skip
    """One sample time: v and Q [m/s], f_p [N], K [N/m], settings ``s``; ``safe``: not faster than ``SAFE_POLE``."""
    gained = s.sample_time * (velocity - modelled - x.speed) + (force - x.force) / stiffness
    speed = x.speed - ca.if_else(safe, ca.fmax(s.flow_pole, SAFE_POLE), s.flow_pole) * gained
    return MissedState(limited(speed, -LARGEST_MISSED, LARGEST_MISSED), force)
