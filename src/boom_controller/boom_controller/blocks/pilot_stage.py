"""From a wanted difference of the pilot pressures to two currents, (6.24)-(6.26), and the response of the pilot stage.

    p_+* - p_-* = k s_s* / A_s   (6.24);   i = h^-1(p)   (6.25), (6.26)

Split (Fig. 6.4, read as a straight line): both valves stay active. From ``neutral`` on both sides the one rises to p_max and
the other sinks to zero while the difference goes from 0 to p_max = k s_max / A_s.
"""

from __future__ import annotations

from math import exp
from typing import Any, NamedTuple

import casadi as ca

from boom_controller.blocks.limits import limited
from boom_controller.errors import ControlError
from boom_model.components import main_valve_spool, pilot_valve
from boom_model.components.pilot_valve import BAR
from boom_model.machine import Machine
from boom_model.regularisation import Expression


def require_pilot_stage(machine: Machine, mode: str) -> None:
    """Raises ControlError if the machine has no pilot valves, or valves without an inverse here."""
    stage, spool = machine.structure.pilot_valves, machine.structure.spool
    if not stage.present:
        raise ControlError(
            f"mode {mode} commands pilot valves, machine {machine.name} has none: use a machine file with pilot_valves"
        )
    if not (stage.invertible and spool.invertible):
        raise ControlError(
            f"mode {mode} inverts the valve, but there is no inverse of {spool.meaning}, pushed by {stage.meaning}"
        )


class StaticPilot:
    """h^-1 and the split of the pressures.

    Attributes:
        stiffness: p_+ - p_- per spool position [Pa/m]; largest: p_max [Pa].
    """

    def __init__(self, p: Any, e: Any) -> None:
        self._h: tuple[float, float, float] = p.pilot_valves.h
        s = p.main_valve_spool
        self.stiffness = float(main_valve_spool.spring(p, e) / s.A_s)
        self.largest = self.stiffness * float(s.s_max)

    def current(self, pressure: Expression) -> Expression:
        """h^-1: the stationary current [A] for a pilot pressure [Pa]; 0 at and below the least pressure of the valve."""
        h0, h1, h2 = self._h
        root = h1 * h1 - 4.0 * h0 * (h2 - pressure / BAR)
        return ca.fmax(0.0, (ca.sqrt(ca.fmax(root, 0.0)) - h1) / (2.0 * h0))

    def pressure(self, current: Expression) -> Expression:
        """h: the stationary pilot pressure [Pa] of a current [A]."""
        return pilot_valve.static_pressure(current, self._h)

    def split(self, difference: Expression, neutral: Expression) -> tuple[Expression, Expression]:
        """(p_+, p_-) [Pa] for the wanted difference p_+ - p_- [Pa] and the pressure of both in the middle [Pa]."""
        size = ca.fabs(difference)
        low = neutral * ca.fmax(0.0, 1.0 - size / self.largest)
        high = low + size
        return ca.if_else(difference >= 0, high, low), ca.if_else(difference >= 0, low, high)


class PilotState(NamedTuple):
    """lambda [A s] of a pilot valve, and the current [A] of the last interval. Zero: no current for long."""

    state: Expression = 0.0
    current: Expression = 0.0


class PilotValve:
    """One pilot valve, simulated from the commanded currents: exact for held currents, (5.7c)."""

    def __init__(self, p: Any, e: Any, sample_time: float) -> None:
        a1 = pilot_valve.pole(p, e)
        self._p, self._e = p, e
        self.phi = exp(a1 * sample_time)
        self.gamma = (self.phi - 1.0) / a1
        self.b0, self.b1 = pilot_valve.gain(p, e), p.pilot_valves.b1_s

    def output(self, x: PilotState) -> Expression:
        """nu [A] now, under the current of the last interval."""
        return self.b0 * x.state + self.b1 * x.current

    def pressure(self, x: PilotState) -> Expression:
        """p [Pa] now."""
        return pilot_valve.pressure(x.state, x.current, self._p, self._e)

    def current_for(self, x: PilotState, wanted: Expression) -> Expression:
        """The current [A] under which nu reaches ``wanted`` [A] at the end of the sample time."""
        return (wanted - self.b0 * self.phi * x.state) / (self.b0 * self.gamma + self.b1)

    def after(self, x: PilotState, current: Expression) -> PilotState:
        """One sample time under the current [A]."""
        return PilotState(self.phi * x.state + self.gamma * current, current)

    def settled(self, current: float) -> PilotState:
        """Under this current [A] for long."""
        return PilotState(self.gamma / (1.0 - self.phi) * current, current)

    def drive(self, x: PilotState, output: Expression, s: Any) -> PilotState:
        """One sample time in which nu comes by its share 1 - exp(-T_s / pilot_response) nearer to ``output`` [A]."""
        now = self.output(x)
        share = 1.0 - ca.exp(-s.sample_time / s.pilot_response)
        current = self.current_for(x, now + share * (output - now))
        return self.after(x, limited(current, 0.0, s.largest_current))
