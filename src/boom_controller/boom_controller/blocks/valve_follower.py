"""The controller's simulation of the valve (pilot stage, spool) from the commanded currents, and its inverse for a position.

Nothing of the valve is measured. Pilot stage (5.7c) exactly; spool (3.21) without its mass, whose time constant is below 2 ms:

    A_s (p_+ - p_-) = k s_s + d_v s_s' + f_c tanh(s_s' / sigma_s)

Inverse: the set point goes through a first-order filter of time constant ``spool_response``, which gives a position and a velocity
and so a pressure; the current brings nu nearer to what that pressure needs by the share 1 - exp(-T_s / pilot_response). Where the
current reached its limit, the filter goes on from the simulated position. Inside
the dead zone, where nothing flows and noise would only make the solenoids hum, the slower ``rest_response`` applies.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import casadi as ca

from boom_controller.blocks.hysteresis import Play
from boom_controller.blocks.pilot_stage import PilotState, PilotValve, StaticPilot
from boom_model.components import main_valve_spool
from boom_model.regularisation import Expression

ClosingForce = Callable[[Expression], Expression]

SUBSTEPS = 4
_NEWTON = 3
_LEAST_SLOPE = 0.02
"""Least slope of tanh in the Newton iteration: keeps its step finite where the friction is saturated."""


class ValveState(NamedTuple):
    """s_s [m] and s_s' [m/s] as simulated, filtered set point [m], state of the play [m]; both pilot valves.

    Initially: no current for long.
    """

    position: Expression = 0.0
    velocity: Expression = 0.0
    target: Expression = 0.0
    play: Expression = 0.0
    retract: PilotState = PilotState()
    extend: PilotState = PilotState()


class ValveFollower:
    """Two pilot valves and the spool."""

    def __init__(self, p: Any, e: Any, pilot: StaticPilot, dead_zone: float, sample_time: float, play: Play) -> None:
        self._p, self._pilot, self._dead_zone, self._play = p, pilot, dead_zone, play
        self._area = float(p.main_valve_spool.A_s)
        self._spring = self._area * pilot.stiffness
        self._valve = PilotValve(p, e, sample_time)
        self._step = sample_time

    def step(
        self, x: ValveState, wanted: Expression, closing: ClosingForce, s: Any
    ) -> tuple[ValveState, Expression, Expression]:
        """For wanted edges at s_s [m], one sample time: the state, whose currents are (i_+, i_-), and (p_+*, p_-*) [Pa] for it.

        closing: F_q [N] at a position of the edges [m].
        """
        t = self._step
        edges = self.edges(x)
        resting = ca.logic_and(ca.fabs(wanted) <= self._dead_zone, ca.fabs(edges) <= self._dead_zone)
        response = ca.if_else(resting, s.rest_response, s.spool_response)
        # a solenoid at its limit: the set point goes on from where the spool is, not from where it should have been
        limited = ca.fmax(x.retract.current, x.extend.current) >= s.largest_current
        before = ca.if_else(limited, x.position, x.target)
        velocity = (self._play.spool(x.play, wanted) - before) * ((1.0 - ca.exp(-t / response)) / t)
        target = before + velocity * t
        needed = self._spring * target + main_valve_spool.friction(velocity, self._p) + closing(wanted)
        plus, minus = self._pilot.split(needed / self._area, s.neutral_pressure)
        retract = self._valve.drive(x.retract, self._pilot.current(plus), s)
        extend = self._valve.drive(x.extend, self._pilot.current(minus), s)
        thrust = closing(edges) / self._area
        position, moving = self._moved(
            x.position,
            x.velocity,
            self._valve.pressure(x.retract) - self._valve.pressure(x.extend) - thrust,
            self._valve.pressure(retract) - self._valve.pressure(extend) - thrust,
        )
        return ValveState(position, moving, target, self._play.after(x.play, position), retract, extend), plus, minus

    def settled(self, edges: float, closing: float, s: Any) -> ValveState:
        """With the edges at s_s [m] for long, against F_q [N]."""
        position = float(self._play.spool(0.0, edges))
        plus, minus = self._pilot.split((self._spring * position + closing) / self._area, s.neutral_pressure)
        retract, extend = (self._valve.settled(float(self._pilot.current(side))) for side in (plus, minus))
        return ValveState(position, 0.0, position, float(self._play.after(0.0, position)), retract, extend)

    def reach(self, current: Expression) -> Expression:
        """How far a current [A] for long deflects the spool [m]."""
        return self._pilot.pressure(current) / self._pilot.stiffness

    def edges(self, x: ValveState) -> Expression:
        """Where the metering edges stand [m]: s_s but for play."""
        return self._play.edges(x.play, x.position)

    def _moved(
        self, position: Expression, v: Expression, before: Expression, after: Expression
    ) -> tuple[Expression, Expression]:
        """(s_s [m], s_s' [m/s]) one sample time later, while p_+ - p_- goes from ``before`` to ``after`` [Pa].

        Implicit Euler steps, Newton's iteration written out.
        """
        s = self._p.main_valve_spool
        h = self._step / SUBSTEPS
        stiff, steepness = s.d_v + self._spring * h, s.f_c / s.sigma_s
        for k in range(SUBSTEPS):
            driving = (before + (after - before) * (k + 0.5) / SUBSTEPS) * s.A_s - self._spring * position
            for _ in range(_NEWTON):
                residual = self._spring * h * v + main_valve_spool.friction(v, self._p) - driving
                slope = ca.fmax(1.0 - ca.tanh(v / s.sigma_s) ** 2, _LEAST_SLOPE)
                v = v - residual / (stiff + steepness * slope)
            position = position + h * v
        return position, v
