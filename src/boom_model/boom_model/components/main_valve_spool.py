"""Spool of the main valve, moved by two pilot pressures, (3.21)-(3.22) = (5.39n,o).

    m_s s_s'' + k s_s = (p_+ - p_-) A_s - d_v s_s' - f_c tanh(s_s' / sigma_s) - F_q

s_s > 0 retracts (lowers), s_s < 0 extends (lifts). F_q is the axial force with which the flow closes the spool, see
``main_valve_orifices``.
"""

from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np

from boom_model.regularisation import Expression
from boom_model.slots import PilotStage, Spool, Wiring, register
from boom_model.specification import Specification

SPECIFICATIONS = (
    Specification("main_valve_spool.A_s", "A_s", "m^2", "cross-section of the spool", 1e-6, 0.1, "3.21"),
    Specification("main_valve_spool.s_max", "s_s^max", "m", "full stroke to either side", 1e-4, 0.1, "5.9"),
    Specification("main_valve_spool.k", "k", "N/m", "return spring", 1e2, 1e8, "3.21"),
    Specification("main_valve_spool.m_s", "m_s", "kg", "mass of the spool", 1e-3, 100.0, "3.21"),
    Specification("main_valve_spool.d_v", "d_v", "N s/m", "viscous friction of the spool", 0.0, 1e5, "3.22"),
    Specification("main_valve_spool.f_c", "f_c", "N", "Coulomb friction of the spool", 0.0, 1e4, "3.22"),
    Specification("main_valve_spool.sigma_s", "sigma_s", "m/s", "width of the tanh", 1e-5, 1.0, "3.22"),
)


def spring(p: Any, e: Any) -> Expression:
    """k [N/m]."""
    return e.through("return_spring", p.main_valve_spool.k)


def acceleration(
    position: Expression, velocity: Expression, pilot_difference: Expression, flow_force: Expression, p: Any, e: Any
) -> Expression:
    """s_s'' [m/s^2] for s_s [m], s_s' [m/s], p_+ - p_- [Pa] and the closing force F_q [N]."""
    s = p.main_valve_spool
    held = spring(p, e) * position + friction(velocity, p) + flow_force
    return (pilot_difference * s.A_s - held) / s.m_s


def friction(velocity: Expression, p: Any) -> Expression:
    """(3.22) [N] at s_s' [m/s]."""
    s = p.main_valve_spool
    return s.d_v * velocity + s.f_c * ca.tanh(velocity / s.sigma_s)


def _motion(w: Wiring, position: Expression, force: Expression) -> None:
    velocity = w.add("spool_velocity", "w_s", "m/s", 0.1, -10.0, 10.0)
    difference = w.pilot_difference()
    w.rates["spool_position"] = velocity
    w.rates["spool_velocity"] = acceleration(position, velocity, difference, force, w.p, w.e)


def stationary_position(retract: Any, extend: Any, p: Any, pilot: PilotStage) -> Any:
    """s_s (n,) [m] of the currents i_+, i_- (n,) [A], (5.18); no pilot pressure is below zero."""
    s = p.main_valve_spool
    plus, minus = (np.maximum(pilot.pressure(current, p), 0.0) for current in (retract, extend))
    return (plus - minus) * s.A_s / s.k


def holding_current(position: float, p: Any, pilot: PilotStage) -> float:
    """Current [A] of one pilot valve that holds the spool at |s_s| [m], (6.24), (6.25)."""
    s = p.main_valve_spool
    return float(pilot.current(position * s.k / s.A_s, p))


def settling(p: Any, e: Any, pilot: PilotStage) -> float:
    """Time [s] of pilot stage and creep, (d_v + f_c / sigma_s) / k."""
    s = p.main_valve_spool
    return float(pilot.settling(p, e) + (s.d_v + s.f_c / s.sigma_s) / s.k)


register(Spool(
    name="pilot_operated", meaning="moved by two pilot pressures against a spring",
    term="m_s s_s'' + k s_s = (p_+ - p_-) A_s - d_v s_s' - f_c tanh(s_s' / sigma_s)", equation="5.39n,o",
    specifications=SPECIFICATIONS, piloted=True, invertible=True, motion=_motion, position=stationary_position,
    current=holding_current, settling=settling,
))  # fmt: skip
