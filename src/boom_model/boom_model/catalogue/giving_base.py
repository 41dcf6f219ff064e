"""The carrier tilts under the cylinder's torque, on tyres, outriggers or soft ground, and the boom with it.

x is the tilt, beside the one under the boom's weight at q_2 = 0, which is part of the angle's zero; q_2 the angle at the cylinder:

    x'' + 2 zeta omega x' + omega^2 x = -omega^2 C (J f_p - g(0)),   omega = 2 pi f
    D (q_2'' + x'') = J f_p - tau_f - g(q_2)
    measured angle q_2 + x, measured rate q_2' + x'
"""

from collections.abc import Mapping
from math import pi
from typing import Any

from boom_model.catalogue.effect import Effect, parameter
from boom_model.components.equation_of_motion import gravity_torque
from boom_model.regularisation import Expression
from boom_model.state import State


def _level(p: Any) -> Expression:
    """g(0) [N m] with the load that was told."""
    return p.constants.g * (p.pose.Sx + p.pose.load * p.pose.tip[0])


def _acceleration(acceleration: Expression, own: Any, at: Any) -> Expression:
    omega, tilt, speed = 2 * pi * own.f, own.state("tilt"), own.state("tilt_rate")
    tilted = -omega * omega * (own.C * (at.drive - _level(at.p)) + tilt) - 2 * own.zeta * omega * speed
    own.rates["tilt"], own.rates["tilt_rate"] = speed, tilted
    return acceleration - tilted


def _at_rest(states: Mapping[str, Expression], p: Any, e: Any) -> dict[str, Expression]:
    weight = gravity_torque(states["angle"], states["load"], p, e)
    return {"tilt": -e.numbers("giving_base").C * (weight - _level(p))}


EFFECT = Effect(
    "giving_base", "structure", "5.39a", "y = q_2 + x, x'' + 2 zeta omega x' + omega^2 x = -omega^2 C (J f_p - g(0))",
    ("the base", "gives way under the cylinder's torque, and the boom tilts with it"), "sways after starts and stops",
    (
        parameter("C", "rad/(N m)", 0.0, (1e-8, 1e-7), (0.0, 1e-4), "compliance of the base", positive=True),
        parameter("f", "Hz", 1.0, (0.5, 2.0), (0.1, 3.0), "frequency at which it sways", positive=True,
                  starts=(0.5, 0.7, 0.9, 1.2, 1.6, 2.2)),
        parameter("zeta", "-", 0.06, (0.02, 0.2), (0.0, 2.0), "damping ratio of that", positive=True),
    ),
    {
        "angular_acceleration": _acceleration,
        "seen_angle": lambda angle, own, at: angle + own.state("tilt"),
        "seen_rate": lambda rate, own, at: rate + own.state("tilt_rate"),
    },
    place=4, at_rest=_at_rest, watched=False, foreign=True,
    states=(State("tilt", "x_b", "rad", 1e-2, -1.0, 1.0), State("tilt_rate", "x_b'", "rad/s", 0.1)),
)  # fmt: skip
