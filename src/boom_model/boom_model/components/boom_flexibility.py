"""An elastic mode of the boom between cylinder and IMU: effect ``boom_flexibility``. Not in the thesis.

    x'' + 2 zeta omega x' + omega^2 x = -Gamma q_2'',   omega = 2 pi f
    measured angle q_2 + x, measured rate q_2' + x'

Gamma is how much of the boom's angular acceleration excites the mode; neutral Gamma = 0: no states.
"""

from __future__ import annotations

from math import pi
from typing import Any

from boom_model.regularisation import Expression


def acceleration(bend: Expression, bend_rate: Expression, boom_acceleration: Expression, e: Any) -> Expression:
    """x'' [rad/s^2] for x [rad], x' [rad/s] and q_2'' [rad/s^2]."""
    mode = e.boom_flexibility
    omega = 2 * pi * mode.f
    return -mode.gain * boom_acceleration - 2 * mode.zeta * omega * bend_rate - omega * omega * bend
