"""Position feedback with an integral state, (6.6)-(6.13b): gains by Ackermann's formula, anti-windup.

x_e = (q_2 - q_2*, q_2' - q_2*'),  x_eI,k+1 = x_eI,k + T_s (q_2 - q_2*),  u = k~^T (x_e, x_eI)   [N m]
"""

from __future__ import annotations

from collections.abc import Sequence
from math import exp

import numpy as np

from boom_model.regularisation import Expression


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


def position_gains(pole: float, sample_time: float) -> tuple[float, float, float]:
    """k~ of (6.10) for D = 1 kg m^2: N m per rad, rad/s and rad s. The gains are proportional to D [kg m^2]."""
    t = sample_time
    phi = np.array([[1.0, t, 0.0], [0.0, 1.0, 0.0], [t, 0.0, 1.0]])
    gamma = np.array([t * t / 2, t, 0.0])
    k = ackermann(phi, gamma, [exp(pole * t)] * 3)
    return float(k[0]), float(k[1]), float(k[2])


def feedback_torque(
    gains: Sequence[Expression],
    angle_error: Expression,
    rate_error: Expression,
    integral: Expression,
    inertia: Expression,
) -> Expression:
    """U [N m] for q_2 - q_2* [rad], q_2' - q_2*' [rad/s], x_eI [rad s] and D [kg m^2]."""
    return inertia * (gains[0] * angle_error + gains[1] * rate_error + gains[2] * integral)


def integral_for(torque: float, gains: Sequence[float], angle_error: float, rate_error: float, inertia: float) -> float:
    """x_eI [rad s] with which u is ``torque`` [N m] at these errors: bumpless, whatever the gains were before."""
    return (torque / inertia - gains[0] * angle_error - gains[1] * rate_error) / gains[2]
