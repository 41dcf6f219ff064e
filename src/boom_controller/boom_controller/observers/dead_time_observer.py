"""Dead time that nobody told, from the running system: the modelled flow is compared with the motion that follows it.

y is the displacement of the oil as measured, u as the valve's model gives it for the estimated dead time theta^:

    y' = v + f_p' / K,   u' = Q(t - theta^),   both behind the same high pass twice
    y - u = -(theta - theta^) u'   ->   theta^' = -(y - u) u' / S,   S' = u'^2 (1 - S / (u'^2 + u_0^2) / T)

That is least squares with a memory of T seconds of motion. Nothing is learnt while the rod side may draw oil through its
anti-cavitation valve. A wrong gain of the valve makes y - u go with u, a quarter of a wave from u', so it does not pass for dead
time. A lag does, and is as good as dead time to a law that predicts over it.
"""

from __future__ import annotations

from math import exp
from typing import Any, NamedTuple

import casadi as ca

from boom_controller.blocks.limits import limited
from boom_model.regularisation import Expression

FORGETTING = 2.0
"""1/s, of the high passes."""
LEAST_SPEED = 0.03
"""m/s, u_0."""
REMEMBERED = 6.0
"""s of motion, T."""
PRIOR = 0.5 * LEAST_SPEED**2
"""m^2/s, S at the start."""
LONGEST = 0.1
"""s."""


class DeadTimeState(NamedTuple):
    """theta^ [s]; y and u [m] behind one high pass and behind both; f_p [N] of the sample before; S [m^2/s]."""

    delay: Expression = 0.0
    moved: Expression = 0.0
    given: Expression = 0.0
    y: Expression = 0.0
    u: Expression = 0.0
    force: Expression = 0.0
    known: Expression = PRIOR


def observe_dead_time(
    x: DeadTimeState, velocity: Expression, modelled: Expression, force: Expression, stiffness: Expression,
    shortest: Expression, trusted: Expression, s: Any,
) -> DeadTimeState:  # fmt: skip
    """One sample time: v and Q [m/s], f_p [N], K [N/m], the least theta^ [s], settings ``s``; not ``trusted``: it waits."""
    t = s.sample_time
    keep = exp(-FORGETTING * t)
    moved = keep * x.moved + t * velocity + (force - x.force) / stiffness
    given = keep * x.given + t * modelled
    y, u = keep * x.y + moved - x.moved, keep * x.u + given - x.given
    slope = (u - x.u) / t
    size = ca.if_else(trusted, slope * slope, 0.0)
    known = x.known + t * size * (1.0 - x.known / (size + LEAST_SPEED * LEAST_SPEED) / REMEMBERED)
    delay = limited(x.delay - ca.if_else(trusted, t * (y - u) * slope / known, 0.0), shortest, LONGEST)
    return DeadTimeState(delay, moved, given, y, u, force, known)
