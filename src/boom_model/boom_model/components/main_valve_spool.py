"""Spool of the main valve, moved by two pilot pressures, (3.21)-(3.22) = (5.39n,o).

    m_s s_s'' + k s_s = (p_+ - p_-) A_s - d_v s_s' - f_c tanh(s_s' / sigma_s) - F_q

s_s > 0 retracts (lowers), s_s < 0 extends (lifts). Effects: ``spring_rate`` multiplies k by r (neutral 1); ``flow_force``
is the axial force F_q with which the flow closes the spool (neutral 0); see ``main_valve_orifices.flow_force``.
"""

from __future__ import annotations

from typing import Any

import casadi as ca

from boom_model.regularisation import Expression
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


def acceleration(
    position: Expression, velocity: Expression, pilot_difference: Expression, flow_force: Expression, p: Any, e: Any
) -> Expression:
    """s_s'' [m/s^2] for s_s [m], s_s' [m/s], p_+ - p_- [Pa] and the closing force F_q [N]."""
    s = p.main_valve_spool
    held = s.k * e.spring_rate.r * position + friction(velocity, p) + flow_force
    return (pilot_difference * s.A_s - held) / s.m_s


def friction(velocity: Expression, p: Any) -> Expression:
    """(3.22) [N] at s_s' [m/s]."""
    s = p.main_valve_spool
    return s.d_v * velocity + s.f_c * ca.tanh(velocity / s.sigma_s)
