"""The controller's simulation of a spool that the currents command directly, and its inverse for a position.

    T s_s' = K_i (i_+ - i_-) - s_s

T is the component's settling time: the lag of a first-order spool, 2 zeta / omega_n of a second-order one. Exact for held currents.
The set point goes through the same filter as that of a piloted spool (``valve_follower``), and one solenoid acts at a time.
"""

from __future__ import annotations

from math import exp
from typing import Any

import casadi as ca

from boom_controller.blocks.hysteresis import Play
from boom_controller.blocks.limits import limited
from boom_controller.blocks.pilot_stage import PilotState, StaticPilot, require_pilot_stage
from boom_controller.blocks.valve_follower import ClosingForce, ValveFollower, ValveState
from boom_model.machine import Machine
from boom_model.regularisation import Expression


class DirectFollower:
    """The spool of a machine without pilot stage."""

    def __init__(self, machine: Machine, p: Any, e: Any, dead_zone: float, sample_time: float, play: Play) -> None:
        spool, pilot = machine.structure.spool, machine.structure.pilot_valves
        stroke = float(p.main_valve_spool.s_max)
        self._gain = stroke / float(spool.current(stroke, p, pilot))
        self._share = 1.0 - exp(-sample_time / float(spool.settling(p, e, pilot)))
        self._dead_zone, self._play, self._step = dead_zone, play, sample_time

    def step(
        self, x: ValveState, wanted: Expression, _closing: ClosingForce, s: Any
    ) -> tuple[ValveState, Expression, Expression]:
        """As :meth:`ValveFollower.step`; there are no pilot pressures."""
        resting = ca.logic_and(ca.fabs(wanted) <= self._dead_zone, ca.fabs(self.edges(x)) <= self._dead_zone)
        response = ca.if_else(resting, s.rest_response, s.spool_response)
        target = x.target + (self._play.spool(x.play, wanted) - x.target) * (1.0 - ca.exp(-self._step / response))
        current = (x.position + (target - x.position) / self._share) / self._gain
        current = limited(current, -s.largest_current, s.largest_current)
        moved = self._share * (self._gain * current - x.position)
        position = x.position + moved
        retract, extend = (PilotState(0.0, ca.fmax(sign * current, 0.0)) for sign in (1.0, -1.0))
        state = ValveState(position, moved / self._step, target, self._play.after(x.play, position), retract, extend)
        return state, 0.0, 0.0

    def edges(self, x: ValveState) -> Expression:
        """Where the metering edges stand [m]: s_s but for play."""
        return self._play.edges(x.play, x.position)

    def settled(self, edges: float, _closing: float, _s: Any) -> ValveState:
        """As :meth:`ValveFollower.settled`."""
        position = float(self._play.spool(0.0, edges))
        retract, extend = (PilotState(0.0, max(sign * position / self._gain, 0.0)) for sign in (1.0, -1.0))
        return ValveState(position, 0.0, position, float(self._play.after(0.0, position)), retract, extend)

    def reach(self, current: Expression) -> Expression:
        """How far a current [A] for long deflects the spool [m]."""
        return self._gain * current


def follower_of(
    machine: Machine, mode: str, p: Any, e: Any, dead_zone: float, sample_time: float, play: Play
) -> ValveFollower | DirectFollower:
    """The valve of a machine for a control law.

    Raises:
        ControlError: pilot valves or a spool without an inverse here.
    """
    if not machine.structure.spool.piloted:
        return DirectFollower(machine, p, e, dead_zone, sample_time, play)
    require_pilot_stage(machine, mode)
    return ValveFollower(p, e, StaticPilot(p, e), dead_zone, sample_time, play)
