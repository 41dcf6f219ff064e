"""Currents that make the spool follow a wanted position: pilot stage and spool dynamics inverted in discrete time.

Spool (3.21) without its mass, whose time constant is below 2 ms:  A_s (p_+ - p_-) = k s_s + d_v s_s' + f_c tanh(s_s' / sigma_s).
The set point goes through a first-order filter of time constant ``spool_response``, which gives s_s'. Pilot stage (5.7c): the
current of the next interval is the one under which nu has come by its share 1 - exp(-T_s / pilot_response) nearer to h^-1(p).
The valve's state is simulated from the commanded currents; none of it is measured.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import casadi as ca

from boom_controller.blocks.pilot_stage import PilotState, PilotValve, StaticPilot
from boom_model.components import main_valve_spool
from boom_model.regularisation import Expression


class InverseState(NamedTuple):
    """Filtered set point of the spool [m]; both pilot valves. Initially: no current for long, the spool is centred."""

    filtered: Expression = 0.0
    retract: PilotState = PilotState()
    extend: PilotState = PilotState()


class ValveInverse:
    """Two pilot valves and the spool of a machine; ``spool``: False inverts the pilot stage only."""

    def __init__(self, p: Any, e: Any, pilot: StaticPilot, sample_time: float, *, spool: bool = True) -> None:
        self._with_spool = spool
        self._p, self._area = p, float(p.main_valve_spool.A_s)
        self._pilot = pilot
        self._valve = PilotValve(p, e, sample_time)

    def step(self, x: InverseState, position: Expression, s: Any) -> tuple[InverseState, Expression, Expression]:
        """For the wanted s_s [m], one sample time: the state, whose currents are (i_+, i_-), and (p_+, p_-) [Pa] wanted for it."""
        filtered, difference = x.filtered, self._pilot.stiffness * position
        if self._with_spool:
            velocity = (position - x.filtered) * (1.0 / s.spool_response)
            filtered = x.filtered + (position - x.filtered) * (1.0 - ca.exp(-s.sample_time / s.spool_response))
            difference = self._pilot.stiffness * filtered + main_valve_spool.friction(velocity, self._p) / self._area
        plus, minus = self._pilot.split(difference, s.neutral_pressure)
        retract = self._valve.drive(x.retract, self._pilot.current(plus), s)
        extend = self._valve.drive(x.extend, self._pilot.current(minus), s)
        return InverseState(filtered, retract, extend), plus, minus
