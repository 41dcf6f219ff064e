"""Constants of the main valve's spool from data sheet values, (5.8)-(5.12), its friction (5.13) and step response, Figs. 5.5, 5.6.

    k = p_max A_s / s_s^max (5.10),   d_v = 2 xi_s sqrt(k m_s) (5.12c),   T_s = sqrt(m_s / k) (5.11b)

No sensor measures the spool, so these numbers are not identified. They are computed from the data sheet values in the machine
file and compared with those that the file states, which reveals errors.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import pi, sqrt

import numpy as np
from numpy.typing import NDArray

from boom_model.component_numbers import component_parameters
from boom_model.components import main_valve_spool
from boom_model.components.pilot_valve import BAR
from boom_model.machine import Machine, Pose
from boom_model.specification import number

Array = NDArray[np.float64]

STEP_PRESSURE = 1.0 * BAR
"""Pa. Pilot pressure of the step in Fig. 5.6."""
STEP_DURATION = 1.5
STEEL = 7850.0
"""kg/m^3."""


@dataclass(frozen=True)
class SpoolConstant:
    """One number: symbol, unit, value in the file (NaN: none), value from the data sheet, equation."""

    symbol: str
    unit: str
    stated: float
    computed: float
    equation: str


@dataclass(frozen=True)
class SpoolNumbers:
    """Constants and pictures: speed (n,) [m/s], friction (n,) [N]; time (m,) [s], position (m,) [m] after a step."""

    constants: tuple[SpoolConstant, ...]
    speed: Array
    friction: Array
    time: Array
    position: Array


def spool_of(machine: Machine, pose: Pose) -> SpoolNumbers:
    """The spool of a pilot-operated machine; any pose."""
    p, e = component_parameters(machine, pose)
    s, section = p.main_valve_spool, machine.document["main_valve_spool"]

    def information(key: str) -> float:
        return number(section[key]) if key in section else float("nan")

    diameter, p_max, damping = (information(key) for key in ("d_spool", "p_max", "xi_s"))
    spring = p_max * s.A_s / s.s_max
    constants = (
        SpoolConstant("A_s", "m^2", s.A_s, pi / 4 * diameter**2, "area of d_spool"),
        SpoolConstant("V_s", "m^3", float("nan"), s.m_s / STEEL, "(5.8), steel"),
        SpoolConstant("k", "N/m", s.k, spring, "(5.10)"),
        SpoolConstant("T_s", "s", float("nan"), sqrt(s.m_s / s.k), "(5.11b)"),
        SpoolConstant("xi_s", "-", damping, s.d_v / (2 * sqrt(s.k * s.m_s)), "(5.11b)"),
        SpoolConstant("d_v", "N s/m", s.d_v, 2 * damping * sqrt(s.k * s.m_s), "(5.12c)"),
    )

    def acceleration(position: float, speed: float, pressure: float) -> float:
        return float(main_valve_spool.acceleration(position, speed, pressure, 0.0, p, e))

    speeds = np.linspace(-0.1, 0.1, 201)
    friction = np.array([-s.m_s * acceleration(0.0, float(v), 0.0) for v in speeds])

    def rates(_: float, x: Array) -> list[float]:
        return [float(x[1]), acceleration(float(x[0]), float(x[1]), STEP_PRESSURE)]

    from scipy.integrate import solve_ivp  # takes a while to load, and only a report costs it

    time = np.linspace(0.0, STEP_DURATION, 301)
    answer = solve_ivp(rates, (0.0, STEP_DURATION), [0.0, 0.0], method="LSODA", t_eval=time, rtol=1e-6, atol=1e-10)
    return SpoolNumbers(constants, speeds, friction, time, np.asarray(answer.y[0], float))
