"""Position feedback with an integral state, (6.6)-(6.13b): gains by Ackermann's formula, anti-windup.

x_e = (q_2 - q_2*, q_2' - q_2*'),  x_eI,k+1 = x_eI,k + T_s (q_2 - q_2*),  u = k~^T (x_e, x_eI)   [N m]
"""

from __future__ import annotations

from math import exp

import numpy as np


def ackermann(phi: np.ndarray, gamma: np.ndarray, poles: list[float]) -> np.ndarray:
    """k (n,) that places the eigenvalues of phi + gamma k^T at ``poles`` (n,); phi (n, n), gamma (n,).

    k^T = -(0 .. 0 1) R^-1 prod(phi - pole I), R = (gamma, phi gamma, ..) of (6.12).

    Raises:
        numpy.linalg.LinAlgError: the pair is not controllable.
    """
    n = len(gamma)
    reachable = np.column_stack([np.linalg.matrix_power(phi, k) @ gamma for k in range(n)])
    polynomial = np.eye(n)
    for pole in poles:
        polynomial = polynomial @ (phi - pole * np.eye(n))
    last = np.zeros(n)
    last[-1] = 1.0
    return -np.linalg.solve(reachable.T, last) @ polynomial


class PositionFeedback:
    """(6.10) for the inertia D; the gains are proportional to D, so that it may be given at every step."""

    def __init__(self, pole: float, sample_time: float) -> None:
        self._sample_time = sample_time
        self.integral = 0.0
        self._set(pole)

    def torque(self, angle_error: float, rate_error: float, inertia: float) -> float:
        """U [N m] for q_2 - q_2* [rad], q_2' - q_2*' [rad/s] and D [kg m^2]."""
        k = self._gains
        return inertia * (k[0] * angle_error + k[1] * rate_error + k[2] * self.integral)

    def integrate(self, angle_error: float) -> None:
        """(6.8a), one sample time."""
        self.integral += self._sample_time * angle_error

    def hold(self, torque: float, inertia: float) -> None:
        """Sets the integral such that u is ``torque`` [N m] without an error."""
        self.integral = torque / (inertia * self._gains[2])

    def change(self, pole: float, angle_error: float, rate_error: float) -> None:
        """Another pole; u stays what it is at these errors."""
        before = self.torque(angle_error, rate_error, 1.0)
        self._set(pole)
        k = self._gains
        self.integral = (before - k[0] * angle_error - k[1] * rate_error) / k[2]

    def _set(self, pole: float) -> None:
        t = self._sample_time
        phi = np.array([[1.0, t, 0.0], [0.0, 1.0, 0.0], [t, 0.0, 1.0]])
        gamma = np.array([t * t / 2, t, 0.0])  # for D = 1
        self._gains = [float(v) for v in ackermann(phi, gamma, [exp(pole * t)] * 3)]
