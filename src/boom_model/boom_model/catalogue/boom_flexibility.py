"""An elastic mode of the boom between cylinder and IMU, which acts back on the cylinder. Not in the thesis.

One mode on top of the rigid rotation q_2 at the cylinder, x the angle that it adds where the IMU sits (Lagrange):

    x'' + 2 zeta omega x' + omega^2 x = -Gamma q_2'',   omega = 2 pi f
    D q_2'' + mu Gamma D x'' = J f_p - tau_f - g(q_2)
    measured angle q_2 + x, measured rate q_2' + x'

Gamma is how much of the boom's angular acceleration excites the mode where it is measured, mu the modal mass there over D. Two
masses on a joint spring are Gamma = 1, mu = D_2 / D: the boom's outer part D_2 behind a stiffness omega^2 D_2, in cranes 1.5e6 to
2.2e6 N m/rad; f is the frequency with the cylinder held, there 1.5 to 5 Hz with zeta .014 to .02. Solved for q_2'':

    (1 - mu Gamma^2) D q_2'' = J f_p - tau_f - g(q_2) + mu Gamma D (2 zeta omega x' + omega^2 x)

The sag under the own weight is part of the angle's zero. Neutral Gamma = 0: no states.
"""

from math import inf, pi
from typing import Any

import casadi as ca

from boom_model.catalogue.effect import Effect, parameter
from boom_model.regularisation import Expression
from boom_model.state import State

LEAST_RIGID = 0.05
"""Share of the inertia that stays at the cylinder at least."""


def _restoring(own: Any) -> Expression:
    """2 zeta omega x' + omega^2 x [rad/s^2]."""
    omega = 2 * pi * own.f
    return 2 * own.zeta * omega * own.state("bend_rate") + omega * omega * own.state("bend")


def _acceleration(acceleration: Expression, own: Any, _at: Any) -> Expression:
    back = own.mu * own.gain
    return (acceleration + back * _restoring(own)) / ca.fmax(1 - back * own.gain, LEAST_RIGID)


def _seen_angle(angle: Expression, own: Any, at: Any) -> Expression:
    own.rates["bend"] = own.state("bend_rate")
    own.rates["bend_rate"] = -own.gain * at.acceleration - _restoring(own)
    return angle + own.state("bend")


# What is slower or more damped than the modes of a steel boom, as far as its intervals tell, is the mode of another body.
EFFECT = Effect(
    "boom_flexibility", "structure", "5.39a",
    "y = q_2 + x, x'' + 2 zeta omega x' + omega^2 x = -Gamma q_2'', D (q_2'' + mu Gamma x'') = torque",
    ("the boom", "bends between cylinder and angle sensor"), "rings in angle and pressures after stops",
    (
        parameter("gain", "-", 0.0, (0.1, 1.0), (0.0, 5.0), "Gamma, share of the acceleration that excites the mode",
                  almost_nothing=1e-3),
        parameter("f", "Hz", 2.5, (1.5, 5.0), (0.1, 50.0), "frequency of the mode", positive=True,
                  starts=(1.0, 1.25, 1.5, 1.8, 2.2, 2.7, 3.3, 4.0, 5.0), possible=(1.0, inf), surely=True),
        parameter("zeta", "-", 0.02, (0.01, 0.05), (0.0, 2.0), "damping ratio of the mode", positive=True,
                  possible=(-inf, 0.05), surely=True),
        parameter("mu", "-", 0.3, (0.1, 0.7), (0.0, 0.95), "modal mass where the angle is measured, over D", positive=True),
    ),
    {
        "angular_acceleration": _acceleration,
        "seen_angle": _seen_angle, "seen_rate": lambda rate, own, at: rate + own.state("bend_rate"),
    },
    place=1, states=(State("bend", "x", "rad", 1e-2, -1.0, 1.0), State("bend_rate", "x'", "rad/s", 0.1)),
)  # fmt: skip
