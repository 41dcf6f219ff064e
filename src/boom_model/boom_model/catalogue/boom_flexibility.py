"""An elastic mode of the boom between cylinder and IMU. Not in the thesis.

    x'' + 2 zeta omega x' + omega^2 x = -Gamma q_2'',   omega = 2 pi f
    measured angle q_2 + x, measured rate q_2' + x'

Gamma is how much of the boom's angular acceleration excites the mode; neutral Gamma = 0: no states.
"""

from math import inf, pi
from typing import Any

from boom_model.catalogue.effect import Effect, parameter
from boom_model.regularisation import Expression
from boom_model.state import State


def _seen_angle(angle: Expression, own: Any, at: Any) -> Expression:
    bend, bend_rate, omega = own.state("bend"), own.state("bend_rate"), 2 * pi * own.f
    own.rates["bend"] = bend_rate
    own.rates["bend_rate"] = -own.gain * at.acceleration - 2 * own.zeta * omega * bend_rate - omega * omega * bend
    return angle + bend


# What is slower or more damped than the modes of a steel boom, as far as its intervals tell, is the mode of another body.
EFFECT = Effect(
    "boom_flexibility", "structure", "5.39a", "y = q_2 + x, x'' + 2 zeta omega x' + omega^2 x = -Gamma q_2''",
    ("the boom", "bends between cylinder and angle sensor"), "the gyro shows it far more than the angle",
    (
        parameter("gain", "-", 0.0, (0.1, 1.0), (0.0, 5.0), "Gamma, share of the acceleration that excites the mode",
                  almost_nothing=1e-3),
        parameter("f", "Hz", 2.5, (1.0, 5.0), (0.1, 50.0), "frequency of the mode", positive=True,
                  starts=(1.0, 1.25, 1.5, 1.8, 2.2, 2.7, 3.3, 4.0, 5.0), possible=(1.0, inf), surely=True),
        parameter("zeta", "-", 0.02, (0.01, 0.05), (0.0, 2.0), "damping ratio of the mode", positive=True,
                  possible=(-inf, 0.05), surely=True),
    ),
    {"seen_angle": _seen_angle, "seen_rate": lambda rate, own, at: rate + own.state("bend_rate")},
    place=1, states=(State("bend", "x", "rad", 1e-2, -1.0, 1.0), State("bend_rate", "x'", "rad/s", 0.1)),
)  # fmt: skip
