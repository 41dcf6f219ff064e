"""From a wanted difference of the pilot pressures to two currents, (6.24)-(6.26), and what the pilot stage does with them.

    p_+* - p_-* = k s_s* / A_s   (6.24);   i = h^-1(p)   (6.25), (6.26)

Split (Fig. 6.4, read as a straight line): both valves stay active. From ``neutral`` on both sides the one rises to p_max and
the other sinks to zero while the difference goes from 0 to p_max = k s_max / A_s.
"""

from __future__ import annotations

from math import exp, sqrt
from typing import Any

from boom_controller.errors import ControlError
from boom_model.machine import Machine
from boom_model.pilot_valve import BAR


def require_pilot_stage(machine: Machine, mode: str) -> None:
    """Raises ControlError where the machine has no pilot valves."""
    if not machine.structure.pilot_valves:
        raise ControlError(
            f"mode {mode} commands pilot valves, machine {machine.name} has none: use a machine file with pilot_valves"
        )


class StaticPilot:
    """h^-1 and the split of the pressures."""

    def __init__(self, p: Any, e: Any, neutral: float) -> None:
        self._h: tuple[float, float, float] = p.pilot_valves.h
        s = p.main_valve_spool
        self.stiffness = float(s.k * e.spring_rate.r / s.A_s)  # Pa/m
        self.largest = self.stiffness * float(s.s_max)
        self.neutral = neutral

    def current(self, pressure: float) -> float:
        """h^-1: the stationary current [A] for a pilot pressure [Pa]; 0 at and below the least pressure of the valve."""
        h0, h1, h2 = self._h
        root = h1 * h1 - 4.0 * h0 * (h2 - pressure / BAR)
        if root <= 0.0:
            return max(0.0, -h1 / (2.0 * h0))
        return max(0.0, (sqrt(root) - h1) / (2.0 * h0))

    def split(self, difference: float) -> tuple[float, float]:
        """(p_+, p_-) [Pa] for the wanted difference p_+ - p_- [Pa]."""
        size = abs(difference)
        low = self.neutral * max(0.0, 1.0 - size / self.largest)
        high = low + size
        return (high, low) if difference >= 0 else (low, high)


class PilotValve:
    """State lambda of one pilot valve, followed from the commanded currents: exact for held currents, (5.7c)."""

    def __init__(self, p: Any, e: Any, sample_time: float) -> None:
        v = p.pilot_valves
        a1 = v.a1_s / e.pilot_lag.r
        self.phi = exp(a1 * sample_time)
        self.gamma = (self.phi - 1.0) / a1
        self.b0, self.b1 = v.b0_s / e.pilot_lag.r, v.b1_s
        self.state = self.current = 0.0

    def settle(self, current: float) -> None:
        """Stationary under the current [A]."""
        self.current = current
        self.state = self.gamma * current / (1.0 - self.phi)

    def output_held(self) -> float:
        """nu [A] now, under the current of the last interval."""
        return float(self.b0 * self.state + self.b1 * self.current)

    def current_for(self, wanted: float) -> float:
        """The current [A] under which nu reaches ``wanted`` [A] at the end of the sample time."""
        return float((wanted - self.b0 * self.phi * self.state) / (self.b0 * self.gamma + self.b1))

    def advance(self, current: float) -> None:
        """One sample time under the current [A]."""
        self.current = current
        self.state = self.phi * self.state + self.gamma * current
