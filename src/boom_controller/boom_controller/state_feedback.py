"""Feedback for a mass on an oil spring that is driven by a speed v: gains by pole placement, prediction over the remaining lag.

    e'' = f~ / m,  f~' = K (v~ - e'),  v~ = -k_p e - k_v e' - k_d f~,   e = s_p - s_p*,  f~ = f_p - f_ff
    s^3 + K k_d s^2 + (K / m) (1 + k_v) s + (K / m) k_p = (s + a) (s^2 + 2 zeta w s + w^2)

w is the spring's own frequency sqrt(K / m), or w_least where that is lower. K k_d is limited, since what is left of the valve's lag
forbids more; zeta then is what the limit leaves.
"""

from __future__ import annotations

from math import cos, sin, sqrt
from typing import NamedTuple

from boom_controller.settings import Settings


class Gains(NamedTuple):
    """k_p [1/s], k_v [-], k_d [m/s/N], natural frequency sqrt(K/m) [rad/s]."""

    position: float
    velocity: float
    force: float
    frequency: float


def gains(stiffness: float, mass: float, s: Settings) -> Gains:
    """For K [N/m] and m = D / J^2 [kg]."""
    natural = sqrt(stiffness / mass)
    frequency = max(natural, s.slowest_frequency)
    a = -s.feedback_pole
    damping = min(a + 2.0 * s.feedback_damping * frequency, max(s.largest_damping, a))
    zeta = (damping - a) / (2.0 * frequency)
    ratio = (frequency / natural) ** 2
    velocity = ratio * (1.0 + 2.0 * zeta * a / frequency) - 1.0
    return Gains(a * ratio, velocity, damping / stiffness, natural)


def predicted_force(force: float, missing_speed: float, stiffness: float, frequency: float, lag: float) -> float:
    """F~ [N] after ``lag`` [s]: f~ cos(w t) + (K / w) (v~ - e') sin(w t), for f~ [N] and v~ - e' [m/s] now."""
    angle = frequency * lag
    return force * cos(angle) + stiffness / frequency * missing_speed * sin(angle)
