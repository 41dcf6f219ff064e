"""The noise that a prediction has to expect, and the resulting gains.

Even with the right parameters a free run differs by more than the sensors' noise: the measured currents that drive it are
noisy, and the angle integrates their errors. To first order the error of the state obeys

    dx_{k+1} = A_k dx_k + G_k w_k + v_k,  e_k = H dx_k + n_k,  dx_0 ~ (0, P_0)

with A_k, G_k from the Jacobians of the model along the run, w the currents' noise, v a little noise on rate and pressures (errors
that every model has), n the sensors' noise. A Kalman filter along the run gives the gains K_k of an observer
(``boom_model.observer``) and the covariance S_k = L_k L_k^T of its innovations: L_k^-1 e_k is white and of unit variance if the
model is right, so that its plain least squares are efficient. Initial states need not be estimated: they are part of dx_0.

``level`` multiplies the standard deviations of w and v: the error of a wrong model counts as more of this noise.
"""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from boom_estimation.experiment import PreparedRecording, Segment
from boom_input.channels import PREDICTED
from boom_model.cores import usable_cores
from boom_model.observer import riccati
from boom_model.plant import Plant
from boom_model.sensors import OUTPUTS, SensorNoise

Array = NDArray[np.float64]

MODEL_NOISE = {"rate": 3e-5, "head_pressure": 2e3, "hose_pressure": 2e3, "rod_pressure": 2e3}
"""rad/s, Pa per root of a period: v. Far below the effect of the currents' noise while the boom moves."""
_SUBSTEPS = 2  # doublings: a period is integrated in 2^_SUBSTEPS steps
_MISSING = 1e30
_LONGEST_STILL = 200.0


@dataclass(frozen=True)
class PredictorGains:
    """Gains of the observer of one segment, and the size of its innovations; n intervals between the nodes.

    Attributes:
        gain: (n, NX, NY). root: (n, NY, NY), L_k^-1.
        used: (n, NY) samples that count.
    """

    gain: Array
    root: Array
    used: NDArray[np.bool_]

    def whiten(self, innovations: Array) -> Array:
        """(n, NY, m) of unit variance, of innovations (n, NY, m) [SI]; zero where there is no sample."""
        e = np.where(self.used[:, :, None] & np.isfinite(innovations), innovations, 0.0)
        return np.asarray(np.matmul(self.root, e), dtype=float)


@dataclass(frozen=True)
class _Line:
    """The linearised model along one run, in scaled states: A (k, n, n), G G' w + v (k, n, n), H, R (n, NY), P_0."""

    a: Array
    q: Array
    h: Array
    r: Array
    p0: Array
    used: NDArray[np.bool_]
    scale: Array


def first_gains(experiment: PreparedRecording, segment: Segment) -> PredictorGains:
    """Initial gains, before any run is known: measured states are corrected by a third of their innovation."""
    plant, n = experiment.plant, len(segment.nodes) - 1
    gain = np.linalg.pinv(plant.output_matrix() * plant.scale) * plant.scale[:, None] / 3
    names = plant.state_names
    if "hose_pressure" in names:
        gain[names.index("head_pressure")] += gain[names.index("hose_pressure")]
    used = segment.valid[1:]
    return PredictorGains(np.repeat(gain[None], n, axis=0), np.zeros((n, len(OUTPUTS), len(OUTPUTS))), used)


def gains(
    runs: Sequence[tuple[PreparedRecording, Segment, Array, Array]], *, level: float = 1.0
) -> list[PredictorGains]:
    """The gains along runs: experiment, segment, parameters (NP,), states (n, NX) at the intervals' beginnings each.

    level: factor of the standard deviations of w and v.
    """

    def one(run: tuple[PreparedRecording, Segment, Array, Array]) -> PredictorGains:
        experiment, segment, parameters, states = run
        return _filtered(experiment.plant, _line(experiment, segment, parameters, states, level))

    with ThreadPoolExecutor(usable_cores()) as pool:
        return list(pool.map(one, runs))


def _line(experiment: PreparedRecording, segment: Segment, parameters: Array, states: Array, level: float) -> _Line:
    plant = experiment.plant
    known: NDArray[np.bool_] = np.asarray(np.isfinite(states).all(axis=1))
    reached = len(states) if known.all() else max(1, int(np.argmin(known)))
    states = states[:reached]
    scale, names = plant.scale, plant.state_names
    middle = states.copy()
    middle[:-1] = 0.5 * (states[:-1] + states[1:])
    currents = experiment.currents.values[
        np.clip(np.searchsorted(experiment.currents.time, segment.nodes[:reached], side="right") - 1, 0, None)
    ]
    a, g = _transition(*plant.linearise(middle, currents, parameters), np.diff(segment.nodes)[:reached], scale)
    noise = plant.machine.sensor_noise()
    used = (segment.valid & segment.training[:, None])[1:]
    used[reached:] = False
    rate = np.full(len(used), np.nan)
    rate[:reached] = states[:, names.index("rate")]
    r = sensor_variance(noise, rate, experiment.period)
    v = np.array([MODEL_NOISE.get(name, 0.0) for name in names]) / scale
    w = noise.current_sigma**2 + noise.current_quantum**2 / 12
    q = level**2 * (w * np.matmul(g, g.transpose(0, 2, 1)) + np.diag(v**2))
    p0 = np.diag((experiment.initial_spread(segment) / scale) ** 2)
    return _Line(a, q, plant.output_matrix(parameters) * scale, np.where(used, r, _MISSING), p0, used, scale)


def sensor_variance(noise: SensorNoise, rate: Array, period: float) -> Array:
    """Variances (n, NY) of the channels' noise [SI^2] along a run with the angular velocity ``rate`` (n,) [rad/s].

    The angle's rounding error stays the same while the boom moves less than a quantum, for a time of q / |w|. The samples in
    this time count as one.
    """
    quantum = noise.angle_quantum
    still = quantum / np.maximum(np.abs(np.nan_to_num(rate)) * period, quantum / _LONGEST_STILL)
    result = np.empty((len(rate), len(PREDICTED)))
    for i, sensor in enumerate(PREDICTED):
        result[:, i] = noise.variance(sensor) + (1.0 if sensor.is_pressure else 1e-12)
    angle = OUTPUTS.index("angle")
    result[:, angle] = noise.angle_sigma**2 + quantum**2 / 12 * np.maximum(1.0, still) + 1e-12
    return result


def _transition(by_state: Array, by_input: Array, step: Array, scale: Array) -> tuple[Array, Array]:
    """A (n, NX, NX) and G (n, NX, 2) over intervals of ``step`` (n,) [s] with held input, in scaled states.

    exp of the augmented matrix by the L-stable Pade approximant (1 + z/3) / (1 - 2z/3 + z^2/6), squared.
    """
    k, n, inputs = by_input.shape
    z = np.zeros((k, n + inputs, n + inputs))
    z[:, :n, :n] = by_state * scale[None, None, :] / scale[None, :, None]
    z[:, :n, n:] = by_input / scale[None, :, None]
    z *= step[:, None, None] / 2**_SUBSTEPS
    identity = np.eye(n + inputs)
    result = np.linalg.solve(identity - (2 / 3) * z + np.matmul(z, z) / 6, identity + z / 3)
    for _ in range(_SUBSTEPS):
        result = np.matmul(result, result)
    return result[:, :n, :n], result[:, :n, n:]


def _filtered(plant: Plant, line: _Line) -> PredictorGains:
    """The filter along a line; after the end of a failed run nothing is corrected or counted."""
    n, count = len(line.used), len(line.a)
    gain, root = np.zeros((n, len(plant.state_names), len(OUTPUTS))), np.zeros((n, len(OUTPUTS), len(OUTPUTS)))
    made, innovation = riccati(plant, line.a, line.q, line.h, line.used[:count], line.r[:count], line.p0)
    gain[:count] = made * line.scale[None, :, None]
    root[:count] = np.linalg.inv(np.linalg.cholesky(innovation))
    root[~line.used.any(axis=1)] = 0.0
    return PredictorGains(gain, root, line.used)
