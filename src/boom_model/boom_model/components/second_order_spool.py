"""Spool of a valve that the currents command directly, with on-board position control: second order.

    s_s'' = omega_n^2 (s_c - s_s) - 2 zeta omega_n s_s',   s_c = K_i (i_+ - i_-), at most s_max, as in ``direct_spool``

i_+ retracts (s_s > 0), i_- extends (s_s < 0). Not in the thesis; makers of proportional valves state natural frequency and damping.
"""

from __future__ import annotations

from typing import Any

from boom_model.components.direct_spool import at_rest, commanded
from boom_model.regularisation import Expression
from boom_model.slots import Spool, Wiring, register
from boom_model.specification import Specification

SPECIFICATIONS = (
    Specification("main_valve_spool.s_max", "s_s^max", "m", "full stroke to either side", 1e-4, 0.1, "5.9"),
    Specification("main_valve_spool.K_i", "K_i", "m/A", "spool position per current", 1e-5, 1.0, "-"),
    Specification("main_valve_spool.omega_n", "omega_n", "rad/s", "natural frequency of the spool", 1.0, 1e4, "-"),
    Specification("main_valve_spool.zeta", "zeta", "-", "damping ratio of the spool", 0.05, 10.0, "-"),
)


def acceleration(
    position: Expression, velocity: Expression, retract: Expression, extend: Expression, p: Any, e: Any
) -> Expression:
    """s_s'' [m/s^2] for s_s [m], s_s' [m/s] and the two currents [A]."""
    frequency = natural_frequency(p, e)
    return (
        frequency**2 * (commanded(retract, extend, p) - position) - 2 * p.main_valve_spool.zeta * frequency * velocity
    )


def natural_frequency(p: Any, e: Any) -> Expression:
    """omega_n [rad/s]."""
    return e.through("spool_rate", p.main_valve_spool.omega_n)


def _motion(w: Wiring, position: Expression, _force: Expression) -> None:
    velocity = w.add("spool_velocity", "w_s", "m/s", 0.1, -10.0, 10.0)
    w.rates["spool_position"] = velocity
    w.rates["spool_velocity"] = acceleration(position, velocity, w.u[0], w.u[1], w.p, w.e)


register(Spool(
    name="second_order", meaning="follows its current as a second-order system",
    term="s_s'' = omega_n^2 (s_c - s_s) - 2 zeta omega_n s_s', s_c = K_i (i_+ - i_-), at most s_max",
    specifications=SPECIFICATIONS, motion=_motion,
    position=at_rest,
    current=lambda position, p, pilot: position / p.main_valve_spool.K_i,
    settling=lambda p, e, pilot: 2 * p.main_valve_spool.zeta / natural_frequency(p, e),
))  # fmt: skip
