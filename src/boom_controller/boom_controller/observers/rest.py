"""Whether the boom rests, so that the spool need not move for noise.

It rests once the reference does and the feedback asks, on average, for less than ``closed``, below which nothing flows anyway, and
until the reference moves, or the feedback asks for twice that on average or for ``START`` times that at once.
"""

from __future__ import annotations

from typing import NamedTuple

import casadi as ca

from boom_model.regularisation import Expression

AVERAGING = 0.3
"""s."""
STILL = 1.0e-5
"""m/s. Below this the reference rests."""
START = 10.0


class RestState(NamedTuple):
    """Speed that the feedback asks for on average [m/s]; 1 while the boom rests."""

    asked: Expression = 0.0
    resting: Expression = 0.0


def watch_rest(
    x: RestState, asked: Expression, moving: Expression, closed: Expression, sample_time: float
) -> RestState:
    """One sample time: speeds [m/s] that the feedback asks for and that the reference has soon; ``closed`` [m/s]."""
    mean = x.asked + (1.0 - ca.exp(-sample_time / AVERAGING)) * (asked - x.asked)
    limit = closed * (1.0 + x.resting)
    quiet = ca.logic_and(ca.fabs(mean) < limit, ca.fabs(asked) < START * closed)
    return RestState(mean, ca.logic_and(quiet, ca.fabs(moving) < STILL))
