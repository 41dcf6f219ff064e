"""The valve as the controller follows it: pilot stage and spool, from the commanded currents. Inverted for a wanted position.

Nothing of the valve is measured. Pilot stage (5.7c) exactly; spool (3.21) without its mass, whose time constant is below 2 ms:

    A_s (p_+ - p_-) = k s_s + d_v s_s' + f_c tanh(s_s' / sigma_s)

Inverse: the set point goes through a first-order filter of time constant ``spool_response``, which gives a position and a velocity
and so a pressure; the current brings nu nearer to what that pressure needs by the share 1 - exp(-T_s / pilot_response). Inside
the dead zone, where nothing flows and noise would only make the solenoids hum, the slower ``rest_response`` counts.
"""

from __future__ import annotations

from array import array
from math import exp, tanh
from typing import Any

import casadi as ca

from boom_controller.buffers import on_buffers
from boom_controller.pilot_stage import PilotValve, StaticPilot
from boom_controller.settings import Settings
from boom_model import main_valve_spool, pilot_valve

SUBSTEPS = 4
_NEWTON = 3
_LEAST_SLOPE = 0.02
"""Of tanh in the Newton iteration: keeps its step finite where the friction is saturated."""


class ValveFollower:
    """Two pilot valves and the spool; ``position`` is s_s [m] as followed."""

    def __init__(self, p: Any, e: Any, pilot: StaticPilot, dead_zone: float, settings: Settings) -> None:
        self._p, self._e, self._pilot, self._dead_zone = p, e, pilot, dead_zone
        s = p.main_valve_spool
        self._area = float(s.A_s)
        self._spring = self._area * pilot.stiffness
        self._retract = PilotValve(p, e, settings.sample_time)
        self._extend = PilotValve(p, e, settings.sample_time)
        self.position = self._velocity = self._target = 0.0
        self._moved = array("d", [0.0, 0.0])
        self._motion = array("d", [0.0, 0.0, 0.0, 0.0])
        self._move = on_buffers(_spool_motion(p, self._spring, settings.sample_time), self._motion, self._moved)
        self._set(settings)

    def reset(self) -> None:
        """No current for long: the spool is centred."""
        self.position = self._velocity = self._target = 0.0
        self._retract.settle(0.0)
        self._extend.settle(0.0)

    def change(self, settings: Settings) -> None:
        """Other responses and limits; the followed states stay."""
        self._set(settings)

    def step(self, wanted: float) -> tuple[float, float, float, float]:
        """(i_+, i_-) [A] for the wanted s_s [m], and the pilot pressures (p_+*, p_-*) [Pa]; follows the valve one sample time."""
        resting = abs(wanted) <= self._dead_zone and abs(self.position) <= self._dead_zone
        velocity = (wanted - self._target) * (self._rest_rate if resting else self._rate)
        self._target += velocity * self._step
        needed = self._spring * self._target + main_valve_spool.friction(velocity, self._p, tanh)
        plus, minus = self._pilot.split(needed / self._area)
        before = self._difference()
        retract, extend = self._drive(self._retract, plus), self._drive(self._extend, minus)
        self._follow(before, self._difference())
        return retract, extend, plus, minus

    def _difference(self) -> float:
        """p_+ - p_- [Pa] now."""
        return float(
            pilot_valve.pressure(self._retract.state, self._retract.current, self._p, self._e)
            - pilot_valve.pressure(self._extend.state, self._extend.current, self._p, self._e)
        )

    def _drive(self, valve: PilotValve, pressure: float) -> float:
        wanted, now = self._pilot.current(pressure), valve.output_held()
        current = valve.current_for(now + self._pilot_share * (wanted - now))
        current = min(max(current, 0.0), self._largest)
        valve.advance(current)
        return current

    def _follow(self, before: float, after: float) -> None:
        """One sample time of the spool while the pressure difference goes from ``before`` to ``after`` [Pa]."""
        self._motion[:] = array("d", (self.position, self._velocity, before, after))
        self._move()
        self.position, self._velocity = self._moved

    def _set(self, settings: Settings) -> None:
        t = self._step = settings.sample_time
        self._rate = (1.0 - exp(-t / settings.spool_response)) / t
        self._rest_rate = (1.0 - exp(-t / settings.rest_response)) / t
        self._pilot_share = 1.0 - exp(-t / settings.pilot_response)
        self._largest = settings.largest_current


def _spool_motion(p: Any, spring: float, sample_time: float) -> Any:
    """Function of (s_s, s_s', p_+ - p_- before, after) to (s_s, s_s') one sample time later; ``spring``: k [N/m], its effect in it.

    Implicit Euler steps, Newton's iteration written out.
    """
    s = p.main_valve_spool
    x = ca.SX.sym("x", 4)
    position, v, before, after = ca.vertsplit(x)
    h = sample_time / SUBSTEPS
    stiff, steepness = s.d_v + spring * h, s.f_c / s.sigma_s
    for k in range(SUBSTEPS):
        driving = (before + (after - before) * (k + 0.5) / SUBSTEPS) * s.A_s - spring * position
        for _ in range(_NEWTON):
            residual = spring * h * v + main_valve_spool.friction(v, p) - driving
            slope = ca.fmax(1.0 - ca.tanh(v / s.sigma_s) ** 2, _LEAST_SLOPE)
            v = v - residual / (stiff + steepness * slope)
        position = position + h * v
    return ca.Function("spool_motion", [x], [ca.cse(ca.vertcat(position, v))])
