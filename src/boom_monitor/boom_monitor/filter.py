"""The filter of the watch: an extended Kalman filter of the nominal model, with the effect of each cause on its innovations.

x' = f(x, u) + w, y = h(x) + v. Of a cause c the state's error follows V' = (df/dx) V + df/dc between the samples and
V -= K G at each, with the innovation's sensitivity G = (dh/dx) V + dh/dc (Friedland 1969). The innovations e with their
covariance S give the information on all causes, with exponential forgetting: A = sum G^T S^-1 G, b = sum G^T S^-1 e.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from boom_estimation.initial_state import UNCERTAINTY
from boom_input.channels import PREDICTED
from boom_model.plant import Stepper
from boom_model.sensors import OUTPUTS, SensorNoise
from boom_monitor.model import ModelPoint, WatchModel

Array = NDArray[np.float64]

TOLERANCE = 1e-5
# White noise on the derivatives, unit/s sqrt(s): what keeps the filter awake; below what the sensors resolve.
_DISTURBANCE = {"rate": 2e-3, "head_pressure": 1e4, "rod_pressure": 1e4, "hose_pressure": 1e4}
_AT_REST = 0.2  # share of the uncertainty of a state in motion
_UNKNOWN_CURRENT = 0.2  # A, where a current is not known
_JITTER = 2e-5  # rad: the angle's quantum divides by its own noise, which is not independent from sample to sample


@dataclass
class Information:
    """Information from the innovations of the recent past.

    Attributes:
        matrix: (c, c) of all causes. vector: (c,). square: sum of e^T S^-1 e. count: number of channels, with the same forgetting.
    """

    matrix: Array
    vector: Array
    square: float = 0.0
    count: float = 0.0


class WatchFilter:
    """The filter from one initial state on.

    Args:
        model: the model with its causes.
        noise: noise of the sensors.
        state: (n,) at ``time`` [s].
        moving: whether it was estimated in motion.
        memory: time constant of the forgetting [s].

    Attributes:
        gain: (n, NY) of the last correction. whitening: (NY, NY) W, W e has unit variance; zero where nothing was measured or
            nothing of it counts.
    """

    def __init__(
        self, model: WatchModel, noise: SensorNoise, state: Array, time: float, *, moving: bool, memory: float
    ) -> None:
        self.time = time
        self._model, self._memory = model, memory
        self._stepper: Stepper = model.plant.stepper(state, tolerance=TOLERANCE)
        names = model.plant.state_names
        share = 1.0 if moving else _AT_REST
        spread = np.array([UNCERTAINTY.get(n, 1e-2 * s) for n, s in zip(names, model.plant.scale, strict=True)])
        self._covariance: Array = np.diag((share * spread) ** 2)
        self._disturbance = np.array([_DISTURBANCE.get(n, 0.0) ** 2 for n in names])
        self._noise = np.array([noise.variance(sensor) for sensor in PREDICTED])
        self._noise[OUTPUTS.index("angle")] += _JITTER**2
        self._current_variance = noise.current_sigma**2 + noise.current_quantum**2 / 12
        self._point: ModelPoint = model.at(self.state, (0.0, 0.0))
        self._output = self._point.y.copy()
        self._causes = len(model.tolerated) + len(model.suspects)
        self._effect = np.zeros((len(names), self._causes))
        self.gain, self.whitening = np.zeros((len(names), len(OUTPUTS))), np.zeros((len(OUTPUTS), len(OUTPUTS)))
        self.forget()

    @property
    def state(self) -> Array:
        """Estimated state (n,)."""
        return self._stepper.state

    def forget(self) -> None:
        """Drop what the innovations so far have told; the state stays."""
        self.information = Information(np.zeros((self._causes, self._causes)), np.zeros(self._causes))

    def advance(
        self,
        end: float,
        currents: list[tuple[float, float, float]],
        measured: Array,
        share: Array,
        *,
        blind: bool = False,
    ) -> None:
        """Predict to ``end`` [s] and correct there.

        Args:
            end: [s].
            currents: (from when [s], retract, extend [A]), ascending; the first acts from the beginning on.
            measured: (NY,) [SI], NaN where nothing was measured.
            share: (NY,) when in the interval each was measured, 0 = beginning .. 1 = end.
            blind: the currents are not known: the state follows the sensors, and what they show counts for nothing.

        Raises:
            SimulationError: the state left its range.
        """
        begin, step = self.time, end - self.time
        self._propagate(step, _UNKNOWN_CURRENT**2 if blind else self._current_variance)
        for k, (_, retract, extend) in enumerate(currents):
            start = begin if k == 0 else currents[k][0]
            until = currents[k + 1][0] if k + 1 < len(currents) else end
            if until > start:
                self._stepper.step(retract, extend, until - start)
        self.time = end
        self._point = self._model.at(self.state, currents[-1][1:])
        before, after = self._output, self._point.y
        self._output = after.copy()
        self._correct(measured - (before + share * (after - before)), step, 0.0 if blind else 1.0)

    def _propagate(self, step: float, current_variance: float) -> None:
        """Covariance and effects of the causes over one step: exp(J h) by its (0, 2) Pade approximant, L-stable."""
        point = self._point
        eye = np.eye(len(point.f_x))
        z = point.f_x * step
        transition = np.linalg.inv(eye - z + 0.5 * (z @ z))
        held = transition @ (eye - 0.5 * z) * step  # integral of exp(J s) over the step
        drive = held @ point.f_u
        self._effect = transition @ self._effect + held @ point.f_c
        covariance = transition @ self._covariance @ transition.T + drive @ drive.T * current_variance
        covariance[np.diag_indices_from(covariance)] += self._disturbance * step
        self._covariance = 0.5 * (covariance + covariance.T)

    def _correct(self, innovation: Array, step: float, counts: float) -> None:
        fade = math.exp(-step / self._memory)
        info = self.information
        info.matrix *= fade
        info.vector *= fade
        info.square *= fade
        info.count *= fade
        known = np.isfinite(innovation)
        self.gain, self.whitening = np.zeros((len(self.state), len(known))), np.zeros((len(known), len(known)))
        if not known.any():
            return
        point = self._point
        e, h = innovation[known], point.y_x[known]
        spread = h @ self._covariance @ h.T + np.diag(self._noise[known])
        inverse = np.linalg.inv(spread)
        gain = self._covariance @ h.T @ inverse
        self.gain[:, known] = gain
        self.whitening[np.ix_(known, known)] = counts * np.linalg.inv(np.linalg.cholesky(spread))
        sensitivity = h @ self._effect + point.y_c[known]
        weighted = counts * (sensitivity.T @ inverse)
        info.matrix += weighted @ sensitivity
        info.vector += weighted @ e
        info.square += counts * float(e @ inverse @ e)
        info.count += counts * len(e)
        self._effect -= gain @ sensitivity
        self._covariance -= gain @ (h @ self._covariance)
        plant = self._model.plant
        corrected = np.clip(self.state + gain @ e, plant.lowest(), plant.maximum)
        self._output += point.y_x @ (corrected - self.state)  # the outputs are linear in the states
        self._stepper.state[:] = corrected
