"""How far the spool has to go for a flow, over what the machine file says: dead zone and spring are known to some per cent only.

    s_s = rho s_s^file:   -sign(Q) d^ = (rho - rho^) phi,   phi = |s_s| dQ/d|s_s| = |s_s| |Q| / (|s_s| - s_0)
    rho^' = -sign(Q) d^ phi / S,   S' = phi^2 - S / T

d^ is the flow that the valve's model misses (``flow_observer``), s_0 the edge of the dead zone; one rho for either side, by least
squares with a memory of T seconds of motion. What rho explains is known at once after a reversal, while d^ has to be learnt anew.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import casadi as ca

from boom_controller.blocks.limits import limited
from boom_model.regularisation import Expression

REMEMBERED = 10.0
"""s of motion, T."""
PRIOR = (5.0e-3 / 0.03) ** 2 * 0.5
"""(m/s)^2 s, S at the start: d^ comes and goes by 5 mm/s within half a second, rho is known to 3 %."""
LEAST_SPEED = 5.0e-3
"""m/s. Below this nothing is learnt."""
SHORTEST, FURTHEST = 0.85, 1.2


class SideState(NamedTuple):
    """rho^ [-] and S [(m/s)^2 s] of one side."""

    share: Expression = 1.0
    known: Expression = PRIOR


class SpoolState(NamedTuple):
    """Of lifting and of lowering."""

    lift: SideState = SideState()
    lower: SideState = SideState()

    def of(self, position: Expression) -> Expression:
        """rho^ for a position [m] of this sign."""
        return ca.if_else(position < 0, self.lift.share, self.lower.share)


def observe_spool(
    x: SpoolState, position: Expression, modelled: Expression, missed: Expression, edge: Expression, trusted: Expression,
    s: Any,
) -> SpoolState:  # fmt: skip
    """One sample time: s_s^file [m], Q and d^ [m/s], s_0 [m], settings ``s``; not ``trusted``: it waits."""
    size, speed, t = ca.fabs(position), ca.fabs(modelled), s.sample_time
    phi = size * speed / ca.fmax(size - edge, 0.01 * edge)
    phi = ca.if_else(ca.logic_and(trusted, speed > LEAST_SPEED), phi, 0.0)
    sides = []
    for side, here, sign in ((x.lift, position < 0, 1.0), (x.lower, position > 0, -1.0)):
        known = side.known + t * (phi * phi - side.known / REMEMBERED)
        share = limited(side.share - t * sign * missed * phi / known, SHORTEST, FURTHEST)
        learns = ca.logic_and(here, phi > 0)
        sides.append(SideState(ca.if_else(learns, share, side.share), ca.if_else(learns, known, side.known)))
    return SpoolState(*sides)
