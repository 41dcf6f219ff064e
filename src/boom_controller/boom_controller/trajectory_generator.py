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

from boom_controller.controller import Reference

ORDER = 4


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

    def reset(self, angle: float) -> Reference:
        """Rests at the angle [rad]."""
        self._x = [angle / self._f0, 0.0, 0.0, 0.0]
        return Reference(angle)

    def step(self, angle: float) -> Reference:
        """One sample time with the wanted angle [rad] held; the reference at its end."""
        x = self._x
        self._x = [
            row[0] * x[0] + row[1] * x[1] + row[2] * x[2] + row[3] * x[3] + gain * angle
            for row, gain in zip(self._phi, self._gamma, strict=True)
        ]
        f0, x = self._f0, self._x
        return Reference(f0 * x[0], f0 * x[1], f0 * x[2], f0 * x[3])

    def change(self, pole: float) -> None:
        """Another pole [1/s] from the next step on; angle and derivatives go on without a jump."""
        reached = [self._f0 * x for x in self._x]
        self._set(pole)
        self._x = [y / self._f0 for y in reached]

    def _set(self, pole: float) -> None:
        phi, gamma = discretised(pole, self._sample_time)
        self._phi, self._gamma, self._f0 = phi.tolist(), gamma.tolist(), coefficients(pole)[0]
