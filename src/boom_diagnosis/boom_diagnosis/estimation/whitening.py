"""The colour of a free run's error, and how it is taken out.

Even with the right parameters a free run is off by more than the sensors' noise: the measured currents that drive it are
noisy, and what they do wrong adds up in the angle. To first order the error e of the run obeys

    dx_{k+1} = A_k dx_k + G_k w_k + v_k,  e_k = H dx_k + n_k,  dx_0 ~ (0, P_0)

with A_k, G_k from the Jacobians of the model along the run, w the currents' noise, v a little noise on rate and pressures (what no
model has), n the sensors' noise. A Kalman filter along the run turns e into innovations that are white and of unit variance
where the model is right. The filter is linear: applied to the sensitivities, too, it turns generalised least squares into plain
ones. Initial states need not be estimated: they are part of dx_0.

``level`` multiplies the standard deviations of w and v: where a model is not right yet, or never will be, its error counts as more of them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from boom_diagnosis.estimation.experiment import Experiment, Segment
from boom_model.sensors import OUTPUTS, SensorNoise

Array = NDArray[np.float64]

MODEL_NOISE = {"rate": 3e-5, "head_pressure": 2e3, "hose_pressure": 2e3, "rod_pressure": 2e3}
"""rad/s, Pa per root of a period: v. Far below what the currents' noise does while the boom moves."""
_SUBSTEPS = 2  # doublings: a period is integrated in 2^_SUBSTEPS steps
_MISSING = 1e30
_LONGEST_STILL = 200.0


@dataclass(frozen=True)
class Whitener:
    """Turns errors of one segment into innovations.

    Attributes:
        advance: (K, NX, NX), M_k = A_k (I - K_k H). inject: (K, NX, 4), N_k = A_k K_k.
        output: (4, NX), H. root: (K, 4, 4), L_k^-1 with S_k = L_k L_k^T.
        used: (K, 4) samples that count.
    """

    advance: Array
    inject: Array
    output: Array
    root: Array
    used: NDArray[np.bool_]

    def apply(self, errors: Array) -> Array:
        """Innovations (K, 4, m), unit variance, of errors (K, 4, m) [SI]; zero where there is no sample."""
        y = np.where(self.used[:, :, None] & np.isfinite(errors), errors, 0.0)
        k, _, columns = y.shape
        injected = np.matmul(self.inject, y)
        x = np.zeros((k, self.advance.shape[1], columns))
        for i in range(k - 1):
            np.matmul(self.advance[i], x[i], out=x[i + 1])
            x[i + 1] += injected[i]
        return np.asarray(np.matmul(self.root, y - self.output @ x), dtype=float)


def whitener(
    experiment: Experiment, segment: Segment, parameters: Array, *, level: float = 1.0, everything: bool = False
) -> Whitener | None:
    """The whitener along the run with ``parameters`` (NP,); None where that run does not get to its second node.

    level: factor of the standard deviations of w and v. everything: held-out samples count, too.
    """
    plant = experiment.plant
    states, _, _, report = plant.integrate(
        experiment.currents.time, experiment.currents.values, segment.nodes,
        experiment.initial_state(segment, parameters), segment.start, parameters=parameters,
    )  # fmt: skip
    reached = len(states) if report[0] == 0 else int(np.argmax(~np.isfinite(states).all(axis=1)))
    if reached < 2:
        return None
    scale = plant.scale
    currents = experiment.currents.values[
        np.clip(np.searchsorted(experiment.currents.time, segment.nodes, side="right") - 1, 0, None)
    ]
    middle = states[:reached].copy()
    middle[:-1] = 0.5 * (states[: reached - 1] + states[1:reached])
    a, g = _transition(*plant.linearise(middle, currents[:reached], parameters), experiment.period, scale)
    noise = plant.machine.sensor_noise()
    used = segment.valid & (segment.training[:, None] | everything)
    used[reached:] = False
    h = plant.output_matrix(parameters) * scale
    r = sensor_variance(noise, states[:, plant.state_names.index("rate")], experiment.period)
    names = plant.state_names
    v = np.array([MODEL_NOISE.get(name, 0.0) for name in names]) / scale
    w = noise.current_sigma**2 + noise.current_quantum**2 / 12
    return _filter(a, g, h, r, used, level**2 * w, level**2 * v**2, experiment.initial_spread(segment) / scale)


def sensor_variance(noise: SensorNoise, rate: Array, period: float) -> Array:
    """Variances (K, 4) of the channels' noise [SI^2] along a run with the angular velocity ``rate`` (K,) [rad/s].

    The angle's rounding error stays the same as long as the boom moves less than a quantum: q / |w| is how long. So many
    samples count as one.
    """
    quantum = noise.angle_quantum
    still = quantum / np.maximum(np.abs(np.nan_to_num(rate)) * period, quantum / _LONGEST_STILL)
    pressure = noise.pressure_sigma**2 + noise.pressure_quantum**2 / 12
    result = np.empty((len(rate), len(OUTPUTS)))
    result[:, 0] = quantum**2 / 12 * np.maximum(1.0, still) + 1e-12
    result[:, 1] = noise.rate_sigma**2 + 1e-12
    result[:, 2:] = pressure + 1.0
    return result


def _transition(by_state: Array, by_input: Array, period: float, scale: Array) -> tuple[Array, Array]:
    """A (K, NX, NX) and G (K, NX, 2) over one period of held input, in scaled states.

    exp of the augmented matrix by the L-stable Pade approximant (1 + z/3) / (1 - 2z/3 + z^2/6), squared.
    """
    k, n, inputs = by_input.shape
    z = np.zeros((k, n + inputs, n + inputs))
    z[:, :n, :n] = by_state * scale[None, None, :] / scale[None, :, None]
    z[:, :n, n:] = by_input / scale[None, :, None]
    z *= period / 2**_SUBSTEPS
    identity = np.eye(n + inputs)
    result = np.linalg.solve(identity - (2 / 3) * z + np.matmul(z, z) / 6, identity + z / 3)
    for _ in range(_SUBSTEPS):
        result = np.matmul(result, result)
    return result[:, :n, :n], result[:, :n, n:]


def _filter(
    a: Array, g: Array, h: Array, r: Array, used: NDArray[np.bool_], input_variance: float, variance: Array, p0: Array
) -> Whitener:
    """Riccati recursion; a sample that is missing has an infinite variance."""
    count, n = len(used), a.shape[1]
    reached = len(a)
    noise = np.where(used, r, _MISSING)
    q = input_variance * np.matmul(g, g.transpose(0, 2, 1)) + np.diag(variance)
    p = np.diag(p0**2)
    gain, innovation = np.zeros((count, n, len(OUTPUTS))), np.empty((count, len(OUTPUTS), len(OUTPUTS)))
    innovation[:] = np.eye(len(OUTPUTS)) * _MISSING
    transposed = h.T
    for k in range(reached):
        ph = p @ transposed
        s = h @ ph
        s.flat[:: len(OUTPUTS) + 1] += noise[k]
        innovation[k] = s
        gain[k] = ph @ np.linalg.inv(s)
        p = a[k] @ (p - gain[k] @ ph.T) @ a[k].T + q[k]
        p = 0.5 * (p + p.T)
    advance, inject = np.zeros((count, n, n)), np.zeros((count, n, len(OUTPUTS)))
    advance[:reached] = np.matmul(a, np.eye(n) - np.matmul(gain[:reached], h))
    inject[:reached] = np.matmul(a, gain[:reached])
    root = np.linalg.inv(np.linalg.cholesky(innovation))
    root[~used.any(axis=1)] = 0.0
    return Whitener(advance, inject, h, root, used)
