"""An elastic mode of the boom between cylinder and IMU, which acts back on the cylinder. Not in the thesis.

One mode on top of the rigid rotation q_2 at the cylinder, x the angle that it adds to the boom's outer part (Lagrange), D_c the
inertia with the load that the configuration tells, D with all loads, r = D / D_c - 1 what is picked up, g_r its torque:

    (mu + r) x'' + mu (2 zeta omega x' + omega^2 x) = -Gamma ((mu + r) q_2'' + (g_r + s g_c) / D_c),   omega = 2 pi f
    D q_2'' + Gamma (mu + r) D_c x'' = J f_p - tau_f - g(q_2)
    measured angle q_2 + eta x, measured rate q_2' + eta x'

Gamma is how much of the boom's angular acceleration excites the mode there, mu the modal mass over D_c, eta the share of x that the
angle's sensor sees: 1 of an IMU on the outer part, 0 of an encoder in the bearing, where the mode shows in the pressures only. Two
masses on a joint spring are Gamma = 1, mu = D_2 / D_c: the boom's outer part D_2 behind a stiffness omega^2 D_2, in cranes 1.5e6 to
2.2e6 N m/rad; f is the frequency with the cylinder held, there 1.5 to 5 Hz with zeta .014 to .02. A load hangs on the outer part:
it lowers the frequency, and what is picked up pulls there first. s is the share of the told weight's torque g_c that bends the boom
against that of its inertia: 1 of a boom that is one joint spring and two masses, 0 where nothing is known of its sag, which is then
part of the angle's zero. Solved for q_2'':

    (1 + r - Gamma^2 (mu + r)) D_c q_2'' = J f_p - tau_f - g(q_2) + Gamma mu D_c (2 zeta omega x' + omega^2 x)
                                       + Gamma^2 (g_r + s g_c)

Neutral Gamma = 0: no states.
"""

from collections.abc import Mapping
from math import inf, pi
from typing import Any

import casadi as ca

from boom_model.catalogue.effect import Effect, parameter
from boom_model.components.equation_of_motion import inertia
from boom_model.regularisation import Expression
from boom_model.state import State

LEAST_RIGID, LEAST_MODAL = 0.05, 0.1
"""Shares of the inertia that stays at the cylinder at least, and of the modal mass that is left when a load is set down."""


def _restoring(own: Any) -> Expression:
    """2 zeta omega x' + omega^2 x [rad/s^2]."""
    omega = 2 * pi * own.f
    return 2 * own.zeta * omega * own.state("bend_rate") + omega * omega * own.state("bend")


def _weight(angle: Expression, picked_up: Expression, own: Any, p: Any) -> Expression:
    """(g_r + s g_c) / D_c [1/s^2], g_r of the share r of D_c that was picked up at the tip."""
    x, y = p.pose.tip[0], p.pose.tip[1]
    told = own.sag / inertia(p.pose.load, p)
    along = told * (p.pose.Sx + p.pose.load * x) + picked_up * x / (x * x + y * y)
    across = told * (p.pose.Sy + p.pose.load * y) + picked_up * y / (x * x + y * y)
    return p.constants.g * (along * ca.cos(angle) - across * ca.sin(angle))


def _acceleration(acceleration: Expression, own: Any, at: Any) -> Expression:
    picked_up = at.inertia / inertia(at.p.pose.load, at.p) - 1.0
    modal = ca.fmax(own.mu + picked_up, LEAST_MODAL * own.mu)
    pulled = own.mu * _restoring(own) + own.gain * _weight(at.angle, picked_up, own, at.p)
    rigid = ca.fmax(1.0 + picked_up - own.gain**2 * modal, LEAST_RIGID)
    result = ((1.0 + picked_up) * acceleration + own.gain * pulled) / rigid
    own.rates["bend"] = own.state("bend_rate")
    own.rates["bend_rate"] = -own.gain * result - pulled / modal
    return result


def _at_rest(states: Mapping[str, Expression], p: Any, e: Any) -> dict[str, Expression]:
    own = e.numbers("boom_flexibility")
    picked_up = inertia(states["load"], p) / inertia(p.pose.load, p) - 1.0
    return {"bend": -own.gain * _weight(states["angle"], picked_up, own, p) / (own.mu * (2 * pi * own.f) ** 2)}


def _seen_angle(angle: Expression, own: Any, _at: Any) -> Expression:
    return angle + own.eta * own.state("bend")


def _seen_rate(rate: Expression, own: Any, _at: Any) -> Expression:
    return rate + own.eta * own.state("bend_rate")


def _of_two_masses(own: Mapping[str, float]) -> dict[str, float]:
    """With Gamma = 1: Gamma^2 mu, Gamma eta and Gamma^2 s are all that shows as long as no load is picked up."""
    gain = own["gain"]
    told = {**own, "gain": 1.0, "mu": gain**2 * own["mu"], "eta": gain * own["eta"], "sag": gain**2 * own["sag"]}
    inside = all(row.minimum <= told[row.name] <= row.maximum for row in EFFECT.parameters)
    return told if inside and told["mu"] > LEAST_MODAL * LEAST_RIGID else {**own}


# What is slower than the modes of a steel boom, or more damped as far as its interval tells, is the mode of another body.
EFFECT = Effect(
    "boom_flexibility", "structure", "5.39a",
    "y = q_2 + eta x, x'' + 2 zeta omega x' + omega^2 x = -Gamma q_2'', D (q_2'' + mu Gamma x'') = torque",
    ("the boom", "bends, or its base rocks"), "rings in angle and pressures after stops",
    (
        parameter("gain", "-", 0.0, (0.1, 1.0), (0.0, 5.0), "Gamma, share of the acceleration that excites the mode",
                  starts=(1.0,), almost_nothing=1e-3),
        parameter("f", "Hz", 2.5, (1.5, 5.0), (0.1, 50.0), "frequency of the mode", positive=True,
                  starts=(1.0, 1.25, 1.5, 1.8, 2.2, 2.7, 3.3, 4.0, 5.0, 6.2), possible=(1.0, inf)),
        parameter("zeta", "-", 0.02, (0.01, 0.05), (0.0, 2.0), "damping ratio of the mode", positive=True,
                  possible=(-inf, 0.05), surely=True),
        parameter("mu", "-", 0.3, (0.1, 0.7), (0.0, 0.95), "modal mass over D", positive=True),
        parameter("eta", "-", 1.0, (0.0, 1.0), (0.0, 2.0), "share of the mode that the angle's sensor sees", starts=(0.5,)),
        parameter("sag", "-", 0.0, (0.0, 1.0), (-1.0, 5.0), "share s of the told weight that bends the boom", starts=(0.5,)),
    ),
    {
        "angular_acceleration": _acceleration,
        "seen_angle": _seen_angle, "seen_rate": _seen_rate,
    },
    place=1, at_rest=_at_rest, plainest=_of_two_masses,
    states=(State("bend", "x", "rad", 1e-2, -1.0, 1.0), State("bend_rate", "x'", "rad/s", 0.1)),
)  # fmt: skip
