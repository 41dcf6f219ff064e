"""Feedback for a mass on an oil spring that is driven by a speed v: gains by pole placement, prediction over the remaining lag.

    e'' = f~ / m,  f~' = K (v~ - e'),  v~ = -k_p e - k_v e' - k_d f~,   e = s_p - s_p*,  f~ = f_p - f_ff
    s^3 + K k_d s^2 + (K / m) (1 + k_v) s + (K / m) k_p = (s + a) (s^2 + 2 zeta w s + w^2)

w is the spring's own frequency sqrt(K / m), or w_least where that is lower. K k_d is limited because of the remaining lag of the
valve, and to ``QUICKEST`` / T_s; zeta then follows from the limit. A dead time T is predicted over (``dead_time``), but the
prediction of a spring that turns by w T is wrong by the part by which w is: the limit of K k_d falls with (w T)^4, and the pole a
stays below ``LARGEST_TURN`` / T.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import casadi as ca

from boom_controller.settings import QUICKEST
from boom_model.regularisation import Expression

LARGEST_TURN = 0.5
"""rad: real pole of the position times the dead time."""


SAFE_POLE, SAFE_DAMPING = 1.0, 5.0
"""1/s. Position pole and K k_d once an oscillation was recognised; the speed is not fed back."""


class FeedbackGains(NamedTuple):
    """k_p [1/s], k_v [-], k_d [m/s/N], natural frequency sqrt(K/m) [rad/s]."""

    position: Expression
    velocity: Expression
    force: Expression
    frequency: Expression


def gains(stiffness: Expression, mass: Expression, dead_time: Expression, safe: Expression, s: Any) -> FeedbackGains:
    """For K [N/m], m = D / J^2 [kg], a dead time [s] that is predicted over; ``safe``: 1 for the safe set; settings ``s``."""
    natural = ca.sqrt(stiffness / mass)
    frequency = ca.fmax(natural, s.slowest_frequency)
    largest = ca.fmin(s.largest_damping, QUICKEST / s.sample_time) / (
        1.0 + (natural * dead_time / s.predicted_phase) ** 4
    )
    largest = ca.if_else(safe, ca.fmin(largest, SAFE_DAMPING), largest)
    a = ca.fmin(
        ca.if_else(safe, ca.fmin(-s.feedback_pole, SAFE_POLE), -s.feedback_pole),
        LARGEST_TURN / ca.fmax(dead_time, 1e-3),
    )
    damping = ca.fmin(a + 2.0 * s.feedback_damping * frequency, ca.fmax(largest, a))
    zeta = (damping - a) / (2.0 * frequency)
    ratio = (frequency / natural) ** 2
    velocity = ratio * (1.0 + 2.0 * zeta * a / frequency) - 1.0
    velocity = ca.if_else(safe, 0.0, velocity)
    factor = ca.if_else(safe, 1.0, s.feedback_gain)
    return FeedbackGains(
        factor * a * ca.if_else(safe, 1.0, ratio), factor * velocity, factor * damping / stiffness, natural
    )


def predicted_force(
    force: Expression, missing_speed: Expression, stiffness: Expression, frequency: Expression, lag: Expression
) -> Expression:
    """F~ [N] after ``lag`` [s]: f~ cos(w t) + (K / w) (v~ - e') sin(w t), for f~ [N] and v~ - e' [m/s] now."""
    angle = frequency * lag
    return force * ca.cos(angle) + stiffness / frequency * missing_speed * ca.sin(angle)
