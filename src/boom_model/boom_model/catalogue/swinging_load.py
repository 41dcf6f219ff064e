"""A load that hangs from the tip as a pendulum instead of sticking to it. Not in the thesis.

Lagrange's equations for a point mass m on a rope of length l at the tip (x_t, y_t), at the angle theta to the vertical, the tip's
position that of the boom angle q_2, w = q_2':

    x_t = t_x cos q_2 - t_y sin q_2,   y_t = t_x sin q_2 + t_y cos q_2
    c = x_t cos theta + y_t sin theta,   s = x_t sin theta - y_t cos theta
    (D - m_k |tip|^2 + m c^2) w' = J f_p - tau_f - g(q_2) + m_k g_0 x_t - m c (s w^2 + g_0 cos theta + l theta'^2)
    l theta'' = -s w' + c w^2 - g_0 sin theta - 2 zeta sqrt(g_0 l) theta'

m comes beside the load of the configuration (k = 0), or is that load (k = 1): m_k = min(k m, load) no longer sticks, and with
another load than the ``load`` with which m was found another mass hangs, (1 + k (load / load_0 - 1)) m. Neutral m = 0: no states.
"""

from typing import Any

import casadi as ca

from boom_model.catalogue.effect import Effect, parameter
from boom_model.regularisation import Expression
from boom_model.state import State


def _acceleration(_: Expression, own: Any, at: Any) -> Expression:
    swing, swing_rate = own.state("swing_angle"), own.state("swing_rate")
    length, g, tip = own.length, at.p.constants.g, at.p.pose.tip
    heavier = ca.if_else(own.load > 0.0, at.p.pose.load / ca.if_else(own.load > 0.0, own.load, 1.0), 1.0)
    m = own.mass * (1 + own.told * (heavier - 1))
    x = tip[0] * ca.cos(at.angle) - tip[1] * ca.sin(at.angle)
    y = tip[0] * ca.sin(at.angle) + tip[1] * ca.cos(at.angle)
    c, s = x * ca.cos(swing) + y * ca.sin(swing), x * ca.sin(swing) - y * ca.cos(swing)
    told = ca.fmin(own.told * m, at.p.pose.load)
    pull = s * at.rate * at.rate + g * ca.cos(swing) + length * swing_rate * swing_rate
    inertia = at.inertia - told * (x * x + y * y) + m * c * c
    acceleration = (at.torque + told * g * x - m * c * pull) / inertia
    drag = 2 * own.zeta * ca.sqrt(g * length) * swing_rate
    own.rates["swing_angle"] = swing_rate
    own.rates["swing_rate"] = (c * at.rate * at.rate - s * acceleration - g * ca.sin(swing) - drag) / length
    return acceleration


EFFECT = Effect(
    "swinging_load", "load", "5.39a", "pendulum of mass m and length l at the tip",
    ("the load", "swings as a pendulum"), "0.3 to 0.55 Hz ringing in both pressures after stops",
    (
        parameter("mass", "kg", 0.0, (100.0, 1500.0), (0.0, 5000.0), "mass that hangs", almost_nothing=1.0),
        parameter("length", "m", 1.5, (0.8, 3.0), (0.1, 20.0), "length of the pendulum", positive=True,
                  starts=(0.6, 0.8, 1.05, 1.4, 1.8, 2.4, 3.2)),
        parameter("zeta", "-", 0.02, (0.005, 0.1), (0.0, 2.0), "damping ratio of the pendulum", positive=True),
        parameter("told", "-", 0.0, (0.0, 1.0), (0.0, 1.0), "share of it that is the load told: 1 all of it, 0 another one",
                  starts=(0.0, 1.0)),
        parameter("load", "kg", 0.0, (0.0, 1500.0), (0.0, 1e5), "load told where mass was found; 0: mass is the same with any",
                  fixed=True),
    ),
    {"angular_acceleration": _acceleration},
    place=3, states=(State("swing_angle", "theta", "rad", 0.1, -1.5, 1.5), State("swing_rate", "theta'", "rad/s", 0.3)),
    told="told",
)  # fmt: skip
