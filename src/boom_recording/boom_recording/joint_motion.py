"""Motion of the other joints in a recording: position, velocity and acceleration from measured angles and rates.

The positions q on an even grid are those that explain the samples best if the jerk is white noise (not causal; an integrated
random walk, whose posterior mean is that of a Kalman smoother with constant acceleration):

    minimise  sum ((y - q)/s_y)^2 + sum ((v - q')/s_v)^2 + sum (q'''/s_j)^2

s_y and s_v are the noise of the samples themselves (``measurement``), s_j the intensity of the jerk under which they are most
likely: nothing is left to choose. Velocity and acceleration are the differences of q. A gap is bridged by the smoothest way.
Source: Kimeldorf and Wahba 1970 (smoothing splines are Bayes estimates); the likelihood is that of the banded normal equations.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from boom_input.channels import JOINT_NAMES
from boom_recording.measurement import channel_measurement
from boom_recording.recording import Configuration, Floats, Recording, Signal

STANDS = 1e-3
"""rad or m: a joint that moves by no more stands still; poses are told apart by as much."""
MEASURED = 0.9
"""Share of valid samples from which a joint drives the model, as for a pressure."""
PERIOD = 0.01
"""s of the grid; the joints of a crane change their acceleration within 0.1 s."""
SHORTEST = 0.5
"""s. Less tells no acceleration."""
SMALLEST = 1e-6
"""rad, m and their rates: no sensor is better."""
_CHANNELS = {
    "outer_boom": ("outer_boom_angle", "outer_boom_rate"),
    "telescope": ("telescope_length", "telescope_rate"),
    "slewing": ("slewing_angle", "slewing_rate"),
}


@dataclass(frozen=True)
class JointMotion:
    """Time (n,) [s]; position, velocity, acceleration (n, 3) [rad or m, per s, per s^2] in the order of ``JOINT_NAMES``."""

    time: Floats
    position: Floats
    velocity: Floats
    acceleration: Floats

    def at(self, time: Floats) -> tuple[Floats, Floats, Floats]:
        """Position, velocity and acceleration (m, 3) at times (m,) [s], between the grid's by lines."""
        position, velocity, acceleration = (
            np.column_stack([np.interp(time, self.time, column) for column in part.T])
            for part in (self.position, self.velocity, self.acceleration)
        )
        return position, velocity, acceleration


def joint_motion(recording: Recording) -> JointMotion | None:
    """How the other joints move in a recording; None where all of them stand still, as configured."""
    moving = {name: found for name in JOINT_NAMES if (found := _moving(recording, name)) is not None}
    if not moving or recording.duration < SHORTEST:
        return None
    time = np.asarray(np.arange(np.ceil(recording.duration / PERIOD) + 1) * PERIOD, np.float64)
    at = _configured(recording.configuration)
    parts = np.zeros((3, len(JOINT_NAMES), len(time)))
    for k, name in enumerate(JOINT_NAMES):
        parts[0, k] = at[name]
        if name in moving:
            parts[:, k] = smoothed(time, *moving[name])
    return JointMotion(time, *(np.ascontiguousarray(part.T) for part in parts))


def moving_joints(recording: Recording) -> str:
    """Which of them move and how far, in words; empty where none does."""
    words = []
    for name in JOINT_NAMES:
        found = _moving(recording, name)
        if found is not None:
            values = found[0].values[found[0].valid]
            words.append(f"{name.replace('_', ' ')} {values.min():.2f} to {values.max():.2f} {found[0].unit}")
    return ", ".join(words)


def _configured(configuration: Configuration) -> dict[str, float]:
    return {
        "outer_boom": configuration.outer_boom_angle,
        "telescope": configuration.telescope_length,
        "slewing": 0.0,
    }


def _moving(recording: Recording, name: str) -> tuple[Signal, Signal | None] | None:
    """Position and rate of a joint that moves, else None."""
    position, rate = (recording.signals.get(channel) for channel in _CHANNELS[name])
    if position is None or len(position.valid) == 0 or position.valid.mean() < MEASURED:
        return None
    values = position.values[position.valid]
    if np.ptp(values) <= STANDS:
        return None
    low, high = np.quantile(values, (0.005, 0.995))  # a spike or the sensor's noise is no motion
    if high - low <= STANDS + 6.0 * np.nan_to_num(channel_measurement(position).deviation):
        return None
    return position, rate if rate is not None and rate.valid.any() else None


def smoothed(time: Floats, position: Signal, rate: Signal | None = None) -> Floats:
    """Position, velocity, acceleration (3, n) of a joint at an even ``time`` (n,) [s]."""
    from scipy.optimize import minimize_scalar

    step = float(time[1] - time[0])
    matrix, right, square = _normal_equations(time, step, position, rate)
    prior = _jerk_band(len(time)) / step**6

    def unlikely(log_jerk: float) -> float:
        try:
            return _solve(matrix, right, square, prior, log_jerk)[1]
        except np.linalg.LinAlgError:  # so stiff that a long gap is not determined in doubles
            return 1e300

    best = minimize_scalar(unlikely, bounds=(-6.0, 12.0), method="bounded", options={"xatol": 0.05})
    q = _solve(matrix, right, square, prior, float(best.x))[0]
    velocity = np.gradient(q, step)
    acceleration = np.zeros_like(q)
    acceleration[1:-1] = np.diff(q, 2) / step**2
    return np.stack([q, velocity, acceleration])


def _normal_equations(time: Floats, step: float, position: Signal, rate: Signal | None) -> tuple[Floats, Floats, float]:
    """A^T A as an upper band (4, n), A^T y (n,), y^T y: rows that interpolate q and its differences, over their noise."""
    n = len(time)
    matrix, right, square = np.zeros((4, n)), np.zeros(n), 0.0
    where, values = _inside(position, time)
    s = np.clip((where - time[0]) / step, 0.0, n - 1.0)
    cell = np.minimum(s.astype(np.int64), n - 2)
    share = s - cell
    square += _add(matrix, right, cell, np.stack([1 - share, share]), values, _sigma(position))
    if rate is not None and n > 3:
        where, values = _inside(rate, time)
        s = np.clip((where - time[0]) / step - 0.5, 0.0, n - 2.0)
        cell = np.minimum(s.astype(np.int64), n - 3)
        share = s - cell
        weights = np.stack([-(1 - share), 1 - 2 * share, share]) / step
        square += _add(matrix, right, cell, weights, values, _sigma(rate))
    return matrix, right, square


def _inside(signal: Signal, time: Floats) -> tuple[Floats, Floats]:
    valid = signal.valid & (signal.time >= time[0]) & (signal.time <= time[-1])
    return signal.time[valid], signal.values[valid]


def _sigma(signal: Signal) -> float:
    """Standard deviation of a signal's noise and rounding; of few samples their third differences tell it."""
    deviation = channel_measurement(signal).deviation
    if not np.isfinite(deviation):
        deviation = float(np.sqrt(np.mean(np.diff(signal.values[signal.valid], 3) ** 2) / 20.0))
    return max(float(np.nan_to_num(deviation)), SMALLEST)


def _add(
    matrix: Floats, right: Floats, first: NDArray[np.int64], weights: Floats, values: Floats, sigma: float
) -> float:
    """Add rows with ``weights`` (k, m) from the columns ``first`` (m,) on; returns the sum of the squared values."""
    weights, values = weights / sigma, values / sigma
    for i, one in enumerate(weights):
        np.add.at(right, first + i, one * values)
        for j, other in enumerate(weights[i:], i):
            np.add.at(matrix[3 - (j - i)], first + j, one * other)
    return float(values @ values)


def _jerk_band(n: int) -> Floats:
    """D^T D of the third differences D as an upper band (4, n)."""
    band = np.zeros((4, n))
    weights = (-1.0, 3.0, -3.0, 1.0)
    for i in range(4):
        for j in range(i, 4):
            band[3 - (j - i), j : n - 3 + j] += weights[i] * weights[j]
    return band


def _solve(matrix: Floats, right: Floats, square: float, prior: Floats, log_jerk: float) -> tuple[Floats, float]:
    """The most likely q (n,), and twice the negative log-likelihood of the samples at this intensity of the jerk."""
    from scipy.linalg import cho_solve_banded, cholesky_banded

    precision = np.exp(-2.0 * log_jerk)
    factor = cholesky_banded(matrix + precision * prior)
    q = cho_solve_banded((factor, False), right)
    log_determinant = 2.0 * float(np.sum(np.log(factor[-1])))
    count = matrix.shape[1] - 3
    return q, square - float(right @ q) + log_determinant + 2.0 * count * log_jerk
