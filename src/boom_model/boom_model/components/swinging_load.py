"""A load that hangs from the tip as a pendulum instead of sticking to it: effect ``swinging_load``. Not in the thesis.

Lagrange's equations for a point mass m on a rope of length l at the tip (x_t, y_t), the rope's angle theta to the vertical
small, the tip's position that of the boom angle q_2, w = q_2':

    x_t = t_x cos q_2 - t_y sin q_2,   y_t = t_x sin q_2 + t_y cos q_2
    (D + m |tip|^2) w' - m y_t l theta'' = J f_p - tau_f - g(q_2) - m g_0 x_t
    l theta'' = y_t w' + x_t w^2 - g_0 theta - 2 zeta sqrt(g_0 l) theta'

solved for both accelerations. m is added to the load of the configuration; neutral m = 0: no states.
"""

from __future__ import annotations

from typing import Any

import casadi as ca

from boom_model.regularisation import Expression


def accelerations(
    angle: Expression, rate: Expression, swing: Expression, swing_rate: Expression,
    inertia: Expression, torque: Expression, p: Any, e: Any,
) -> tuple[Expression, Expression]:  # fmt: skip
    """(w' [rad/s^2], theta'' [rad/s^2]).

    angle, rate: of the boom [rad, rad/s]. swing, swing_rate: theta, theta' [rad, rad/s]. inertia: D without m [kg m^2].
    torque: J f_p - tau_f - g(q_2) without m [N m].
    """
    m, length, zeta = e.swinging_load.mass, e.swinging_load.length, e.swinging_load.zeta
    g, tip = p.constants.g, p.pose.tip
    x = tip[0] * ca.cos(angle) - tip[1] * ca.sin(angle)
    y = tip[0] * ca.sin(angle) + tip[1] * ca.cos(angle)
    own = x * rate * rate - g * swing - 2 * zeta * ca.sqrt(g * length) * swing_rate
    acceleration = (torque - m * g * x + m * y * own) / (inertia + m * x * x)  # |tip|^2 - y_t^2 = x_t^2
    return acceleration, (y * acceleration + own) / length
