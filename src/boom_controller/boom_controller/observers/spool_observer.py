"""How far the spool goes for a current, over what the machine file says, learnt from the flow that comes.

    s_s = s_s^file / rho:   ln rho' = phi^2 w / S  ln(|s_s^| / |s_s(Q+)|),   S' = phi^2 w - S / T
    Q+ = v + f_p' / K + leakage,   phi = |s_s| dQ/d|s_s| = |s_s| |Q| / (|s_s| - s_0),   w = 1 / (1 + (f_p' / (K Q_0))^2)

s_s^ = s_s^file / rho^ is where the spool is by the law's model, s_s(Q+) where it must be for the flow that came, s_0 the edge of
the dead zone; one rho for either side, by least squares with a memory of T seconds of motion. Compared are positions, not flows:
the flow is off by a multiple where the spool goes a third further. What compresses oil counts less, because how soft
the oil is has to be learnt, too. What rho explains is known at once after a reversal, while the missed flow (``flow_observer``)
has to be learnt anew.

How far rho may be from 1, and how soon it is believed, is the tolerance of the machine file (``deflection_sigma``).
"""

from __future__ import annotations

from math import exp, log
from typing import Any, NamedTuple

import casadi as ca
import numpy as np

from boom_controller.blocks.limits import limited
from boom_model.component_numbers import component_parameters
from boom_model.errors import MachineError
from boom_model.machine import Machine, Pose
from boom_model.prior import prior_of
from boom_model.regularisation import Expression

REMEMBERED = 10.0
"""s of motion, T."""
MISSED = 5.0e-3**2 * 0.5
"""(m/s)^2 s: flow that the model misses for other reasons comes and goes by 5 mm/s within half a second."""
LEAST_SPEED = 5.0e-3
"""m/s. Below this nothing is learnt."""
COMPRESSED = 0.01
"""m/s, Q_0."""
WIDEST = 3.0
"""Standard deviations that ln rho may be from 0."""
LEAST_SIGMA = 0.03
"""Standard deviation of ln rho at least: friction holds a spool back."""
OF_THE_SPOOL = ("main_valve_spool.", "pilot_valves.")


class SideState(NamedTuple):
    """rho^ [-] and S [(m/s)^2 s] of one side."""

    share: Expression = 1.0
    known: Expression = MISSED / LEAST_SIGMA**2


class SpoolState(NamedTuple):
    """Of lifting and of lowering."""

    lift: SideState = SideState()
    lower: SideState = SideState()

    @classmethod
    def uncertain(cls, sigma: float) -> SpoolState:
        """Nothing learnt yet; ``sigma``: standard deviation of ln rho."""
        return cls(*(SideState(known=MISSED / sigma**2) for _ in cls._fields))

    def of(self, position: Expression) -> Expression:
        """rho^ for a position [m] of this sign."""
        return ca.if_else(position < 0, self.lift.share, self.lower.share)


class SpoolSeen(NamedTuple):
    """What the running system shows of the spool, at one time.

    s_s^ [m], |s_s(Q+)| [m]; Q, Q+ through the valve, f_p' / K [m/s], positive lifts; whether the flow is known (``trusted``).
    """

    position: Expression
    needed: Expression
    modelled: Expression
    came: Expression
    compressing: Expression
    trusted: Expression


def observe_spool(x: SpoolState, seen: SpoolSeen, edge: Expression, sigma: float, s: Any) -> SpoolState:
    """One sample time: s_0 [m], standard deviation of ln rho, settings ``s``."""
    t, size = s.sample_time, ca.fabs(seen.position)
    trust = seen.trusted / (1.0 + (seen.compressing / COMPRESSED) ** 2)
    nearest, furthest = exp(-WIDEST * sigma), exp(WIDEST * sigma)
    sides = []
    for side, sign in ((x.lift, 1.0), (x.lower, -1.0)):
        far = ca.fmax(size, seen.needed)
        speed = ca.fmax(sign * seen.modelled, sign * seen.came)
        phi = far * speed / ca.fmax(far - edge, 0.05 * edge)
        off = limited(ca.log(ca.fmax(size, 1e-6) / ca.fmax(seen.needed, edge)), -0.5, 0.5)
        weight = t * trust * phi * phi
        known = side.known + weight - t * side.known / REMEMBERED
        share = limited(side.share * ca.exp(weight * off / known), nearest, furthest)
        may_be_open = ca.logic_and(sign * seen.position < 0, size * side.share > nearest * edge)
        learns = ca.logic_and(may_be_open, ca.logic_and(trust > 0, speed > LEAST_SPEED))
        sides.append(SideState(ca.if_else(learns, share, side.share), ca.if_else(learns, known, side.known)))
    return SpoolState(*sides)


def deflection_sigma(machine: Machine, pose: Pose) -> float:
    """Standard deviation of ln(s_s / s_max) [-] under the current that opens half the stroke, to first order in the tolerances."""
    spool, pilot = machine.structure.spool, machine.structure.pilot_valves
    p, _ = component_parameters(machine, pose)
    current = spool.current(0.5 * p.main_valve_spool.s_max, p, pilot)

    def opening(key: str, value: tuple[float, ...]) -> float:
        p, _ = component_parameters(machine.with_values({key: value}), pose)
        return log(float(spool.position(np.array([current]), np.zeros(1), p, pilot)[0]) / p.main_valve_spool.s_max)

    variance = LEAST_SIGMA**2
    for key, parameter in machine.parameters.items():
        for k, name in enumerate(parameter.specification.components if key.startswith(OF_THE_SPOOL) else ()):
            off = list(parameter.value)
            off[k] = prior_of(machine, name).away(off[k], 0.1)
            try:
                variance += ((opening(key, tuple(off)) - opening(key, parameter.value)) / 0.1) ** 2
            except MachineError:  # a number at the end of its range
                continue
    return float(variance**0.5)
