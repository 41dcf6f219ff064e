"""The sensors of the machine (ch. 4.2 and 6.4): angle, angular velocity, p_h and p_b.

:class:`SensorNoise` holds the quantisation and
noise of ch. 6.4; PSD_p is read as 3e6 Pa^2/Hz (machine notes): sigma = sqrt(PSD / T_s), 0.17 bar at 100 Hz.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import hypot, pi, sqrt
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from boom_input.channels import PREDICTED, Sensor
from boom_model.regularisation import Expression
from boom_model.specification import Specification

SPECIFICATIONS = (
    Specification("control.Ts", "T_s", "s", "sample time", 1e-4, 1.0, "ch. 6.4"),
    Specification("control.q2_quant", "", "rad", "resolution of the angle", 0.0, 0.1, "ch. 6.4"),
    Specification("control.q2_noise", "", "rad", "noise of the angle, standard deviation", 0.0, 0.1, "ch. 6.4"),
    Specification(
        "control.rate_noise", "", "rad/s", "noise of the angular velocity, standard deviation", 0.0, 1.0, "ch. 6.4"
    ),
    Specification("control.p_quant", "", "Pa", "resolution of the pressures", 0.0, 1e6, "ch. 6.4"),
    Specification("control.p_noise_psd", "PSD_p", "Pa^2/Hz", "noise of the pressures", 0.0, 1e12, "ch. 6.4"),
)
"""Keys of a machine file for its sensors; the default numbers are those of :class:`SensorNoise`."""

OUTPUTS = tuple(sensor.name for sensor in PREDICTED)
"""y: the channels of ``boom_input.channels`` that the model predicts, NY of them."""
PRESSURES = np.array([sensor.is_pressure for sensor in PREDICTED])
"""(NY,) which of them are pressures: these may arrive late."""


def measured(angle: Expression, rate: Expression, hose_pressure: Expression, rod_pressure: Expression, e: Any) -> Any:
    """y in the order of ``OUTPUTS`` [SI, pressures gauge], without noise."""
    y = {"angle": angle, "rate": rate, "hose_pressure": hose_pressure, "rod_pressure": rod_pressure}
    return ca.vertcat(*(e.through(f"measured_{name}", y[name]) for name in OUTPUTS))


@dataclass(frozen=True)
class SensorNoise:
    """Noise and quantisation; a zero switches a term off.

    Attributes:
        angle_sigma, angle_quantum: [rad]. rate_sigma: [rad/s]. pressure_sigma, pressure_quantum: [Pa].
        current_sigma, current_quantum: [A]. length_quantum: of the telescope's length [m] (assumed: a draw wire).
    """

    angle_quantum: float = 2 * pi / 2**14
    rate_sigma: float = 1.5e-3
    pressure_sigma: float = sqrt(3.0e6 / 0.01)
    pressure_quantum: float = 1.0e4
    current_sigma: float = 0.8e-3
    current_quantum: float = 1.0e-3
    length_quantum: float = 1.0e-3
    angle_sigma: float = 0.0

    def sigma(self, sensor: Sensor) -> float:
        """Standard deviation of a sensor's white noise [its unit]."""
        return float(getattr(self, sensor.sigma)) if sensor.sigma else 0.0

    def quantum(self, sensor: Sensor) -> float:
        """Resolution of a sensor [its unit]."""
        return float(getattr(self, sensor.quantum)) if sensor.quantum else 0.0

    def deviation(self, sensor: Sensor) -> float:
        """Standard deviation of noise and rounding together [its unit]."""
        return hypot(self.sigma(sensor), self.quantum(sensor) / sqrt(12.0))

    def variance(self, sensor: Sensor) -> float:
        """The square of that."""
        return self.sigma(sensor) ** 2 + self.quantum(sensor) ** 2 / 12

    def outputs(self, y: NDArray[np.float64], rng: np.random.Generator) -> NDArray[np.float64]:
        """Measured y, shape (..., NY), of the true y; as many draws of ``rng`` per sample."""
        noisy = y + rng.standard_normal(y.shape) * np.array([self.sigma(sensor) for sensor in PREDICTED])
        return np.stack([_quantise(noisy[..., i], self.quantum(sensor)) for i, sensor in enumerate(PREDICTED)], axis=-1)

    def currents(self, u: NDArray[np.float64], rng: np.random.Generator) -> NDArray[np.float64]:
        """Measured currents, shape (..., 2), of the true ones; clipped at zero as in the recordings."""
        noisy = u + self.current_sigma * rng.standard_normal(u.shape)
        return np.maximum(_quantise(noisy, self.current_quantum), 0.0)


IDEAL = SensorNoise(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
"""Sensors without noise and quantisation."""


def _quantise(values: NDArray[np.float64], quantum: float) -> NDArray[np.float64]:
    return np.round(values / quantum) * quantum if quantum > 0 else values
