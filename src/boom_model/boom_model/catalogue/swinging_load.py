"""A load that hangs from the tip as a pendulum instead of sticking to it. Not in the thesis.

Lagrange's equations for a point mass m on a rope of length l at the tip (x_t, y_t), the rope's angle theta to the vertical
small, the tip's position that of the boom angle q_2, w = q_2':

    x_t = t_x cos q_2 - t_y sin q_2,   y_t = t_x sin q_2 + t_y cos q_2
    (D + m |tip|^2) w' - m y_t l theta'' = J f_p - tau_f - g(q_2) - m g_0 x_t
    l theta'' = y_t w' + x_t w^2 - g_0 theta - 2 zeta sqrt(g_0 l) theta'

solved for both accelerations. m is added to the load of the configuration; neutral m = 0: no states.
"""

from typing import Any

import casadi as ca

from boom_model.catalogue.effect import Effect, parameter
from boom_model.regularisation import Expression
from boom_model.state import State


def _acceleration(_: Expression, own: Any, at: Any) -> Expression:
    swing, swing_rate = own.state("swing_angle"), own.state("swing_rate")
    m, g, tip = own.mass, at.p.constants.g, at.p.pose.tip
    x = tip[0] * ca.cos(at.angle) - tip[1] * ca.sin(at.angle)
    y = tip[0] * ca.sin(at.angle) + tip[1] * ca.cos(at.angle)
    pull = x * at.rate * at.rate - g * swing - 2 * own.zeta * ca.sqrt(g * own.length) * swing_rate
    acceleration = (at.torque - m * g * x + m * y * pull) / (at.inertia + m * x * x)  # |tip|^2 - y_t^2 = x_t^2
    own.rates["swing_angle"] = swing_rate
    own.rates["swing_rate"] = (y * acceleration + pull) / own.length
    return acceleration


EFFECT = Effect(
    "swinging_load", "load", "5.39a", "pendulum of mass m and length l at the tip",
    ("the load", "swings as a pendulum"), "0.3 to 0.55 Hz ringing in both pressures after stops",
    (
        parameter("mass", "kg", 0.0, (100.0, 1500.0), (0.0, 5000.0), "mass that hangs, beside the load told", almost_nothing=1.0),
        parameter("length", "m", 1.5, (0.8, 3.0), (0.1, 20.0), "length of the pendulum", positive=True,
                  starts=(0.8, 1.3, 2.0, 3.0)),
        parameter("zeta", "-", 0.02, (0.005, 0.1), (0.0, 2.0), "damping ratio of the pendulum", positive=True),
    ),
    {"angular_acceleration": _acceleration},
    place=3, states=(State("swing_angle", "theta", "rad", 0.1, -1.5, 1.5), State("swing_rate", "theta'", "rad/s", 0.3)),
)  # fmt: skip
