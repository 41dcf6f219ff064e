"""Currents that make the spool follow a wanted position: pilot stage and spool dynamics inverted in discrete time.

Spool (3.21) without its mass, whose time constant is below 2 ms:  A_s (p_+ - p_-) = k s_s + d_v s_s' + f_c tanh(s_s' / sigma_s).
The set point goes through a first-order filter of time constant ``spool_response``, which gives s_s'. Pilot stage (5.7c): the
current of the next interval is the one under which nu has come by its share 1 - exp(-T_s / pilot_response) nearer to h^-1(p).
The valve's own state is followed from the commanded currents; nothing of it is measured.
"""

from __future__ import annotations

from math import exp, tanh
from typing import Any

from boom_controller.pilot_stage import PilotValve, StaticPilot
from boom_controller.settings import Settings
from boom_model import main_valve_spool


class ValveInverse:
    """Two pilot valves and the spool of a machine; ``spool``: False inverts the pilot stage only."""

    def __init__(self, p: Any, e: Any, pilot: StaticPilot, settings: Settings, *, spool: bool = True) -> None:
        self._with_spool = spool
        self._p, self._area = p, float(p.main_valve_spool.A_s)
        self._pilot = pilot
        self._retract = PilotValve(p, e, settings.sample_time)
        self._extend = PilotValve(p, e, settings.sample_time)
        self._filtered = 0.0
        self._set(settings)

    def reset(self) -> None:
        """No current for long: the spool is centred."""
        self._filtered = 0.0
        self._retract.settle(0.0)
        self._extend.settle(0.0)

    def change(self, settings: Settings) -> None:
        """Other limits and responses; the followed states stay."""
        self._set(settings)

    def step(self, position: float) -> tuple[float, float, float, float]:
        """(i_+, i_-) [A] for the wanted s_s [m], and the pilot pressures (p_+, p_-) [Pa] that are wanted for it."""
        if not self._with_spool:
            plus, minus = self._pilot.split(self._pilot.stiffness * position)
            return self._drive(self._retract, plus), self._drive(self._extend, minus), plus, minus
        velocity = (position - self._filtered) * self._rate
        self._filtered += (position - self._filtered) * self._share
        friction = main_valve_spool.friction(velocity, self._p, tanh)
        plus, minus = self._pilot.split(self._pilot.stiffness * self._filtered + friction / self._area)
        return self._drive(self._retract, plus), self._drive(self._extend, minus), plus, minus

    def _drive(self, valve: PilotValve, pressure: float) -> float:
        wanted = self._pilot.current(pressure)
        now = valve.output_held()
        current = valve.current_for(now + self._pilot_share * (wanted - now))
        current = min(max(current, 0.0), self._largest)
        valve.advance(current)
        return current

    def _set(self, settings: Settings) -> None:
        self._share = 1.0 - exp(-settings.sample_time / settings.spool_response)
        self._rate = 1.0 / settings.spool_response
        self._pilot_share = 1.0 - exp(-settings.sample_time / settings.pilot_response)
        self._largest = settings.largest_current
