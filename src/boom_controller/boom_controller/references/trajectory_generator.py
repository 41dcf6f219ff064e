"""Smooth reference and its derivatives from an unfiltered wanted angle: state-variable filter, (6.27)-(6.28).

    x' = A_f x + b_f u,  y = C_f x,  A_f the companion form of (s - pole)^4,  C_f = f_0 I
    x_{k+1} = Phi_f x_k + Gamma_f u_k,  Phi_f = exp(A_f T_s),  Gamma_f = int_0^T_s exp(A_f tau) d tau b_f

y is the wanted angle filtered, with its first three derivatives [rad, rad/s, rad/s^2, rad/s^3].
"""

from __future__ import annotations

from math import comb

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

from boom_controller.types import Reference

ORDER = 4
SLOWLY = 0.05
"""s per s: a motion at constant rate is 4 times that slower or faster meanwhile. With 0.5 a filter that gets slower runs past what
is wanted, by 13 mrad after 0.3 rad/s."""


def coefficients(pole: float) -> tuple[float, ...]:
    """(f_0, f_1, f_2, f_3) of (s - pole)^4 = s^4 + f_3 s^3 + f_2 s^2 + f_1 s + f_0; pole [1/s] below zero."""
    return tuple(comb(ORDER, k) * (-pole) ** (ORDER - k) for k in range(ORDER))


def discretised(pole: float, sample_time: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """(Phi_f (4, 4), Gamma_f (4,)) of (6.28c), exact; sample_time [s]."""
    block = np.zeros((ORDER + 1, ORDER + 1))
    block[:3, 1:4] = np.eye(3)
    block[3, :ORDER] = [-f for f in coefficients(pole)]
    block[3, ORDER] = 1.0
    exponential = expm(block * sample_time)  # of [[A, b], [0, 0]]: holds Phi and Gamma
    return exponential[:ORDER, :ORDER], exponential[:ORDER, ORDER]


class TrajectoryGenerator:
    """The filter of (6.28) with all four poles at ``pole`` [1/s], stepped every ``sample_time`` [s]."""

    def __init__(self, pole: float = -10.0, sample_time: float = 0.01) -> None:
        self._sample_time = sample_time
        self._x = [0.0] * ORDER
        self._set(pole)
        self._wanted_pole = pole

    def reset(self, angle: float) -> Reference:
        """Start at rest at the angle [rad]."""
        self._x = [angle / self._f0, 0.0, 0.0, 0.0]
        return Reference(angle)

    def step(self, angle: float) -> Reference:
        """One sample time with the wanted angle [rad] held; the reference at its end."""
        # written out: every cycle of the controller waits for it, and a loop takes three times as long
        if self._pole != self._wanted_pole:
            self._approach()
        x0, x1, x2, x3 = self._x
        (a0, a1, a2, a3), (b0, b1, b2, b3), (c0, c1, c2, c3), (d0, d1, d2, d3) = self._phi
        g0, g1, g2, g3 = self._gamma
        y0 = a0 * x0 + a1 * x1 + a2 * x2 + a3 * x3 + g0 * angle
        y1 = b0 * x0 + b1 * x1 + b2 * x2 + b3 * x3 + g1 * angle
        y2 = c0 * x0 + c1 * x1 + c2 * x2 + c3 * x3 + g2 * angle
        y3 = d0 * x0 + d1 * x1 + d2 * x2 + d3 * x3 + g3 * angle
        self._x = [y0, y1, y2, y3]
        f0 = self._f0
        return Reference(f0 * y0, f0 * y1, f0 * y2, f0 * y3)

    def change(self, pole: float) -> None:
        """Move to another pole [1/s] from the next step on; angle and derivatives continue.

        Its time constant changes by ``SLOWLY`` s per s: at once a slower filter would run far past an angle that stands still,
        and a faster one make up in a moment for what the slow one is behind.
        """
        self._wanted_pole = pole

    def _approach(self) -> None:
        reached = [self._f0 * x for x in self._x]
        step = SLOWLY * self._sample_time
        constant, wanted = -1.0 / self._pole, -1.0 / self._wanted_pole
        near = abs(wanted - constant) <= step
        self._set(self._wanted_pole if near else -1.0 / (constant + (step if wanted > constant else -step)))
        self._x = [y / self._f0 for y in reached]

    def _set(self, pole: float) -> None:
        self._pole = pole
        phi, gamma = discretised(pole, self._sample_time)
        self._phi, self._gamma, self._f0 = phi.tolist(), gamma.tolist(), coefficients(pole)[0]
