"""Sensors, bus and recorder: turns a run on the grid into a recording of the contract."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from boom_input.channels import BY_NAME, REQUIRED, SENSOR_TOPICS
from boom_recording.recording import Configuration, Recording, Signal
from boom_recording.writing import START_NS
from unseen_plant.layout import STEP

Array = NDArray[np.float64]

SEEN = ("angle", "rate", "hose_pressure", "rod_pressure")
CURRENTS = ("retract_current", "extend_current")
_TOPICS = tuple(tuple(c.name for c in REQUIRED if c.topic == topic) for topic in SENSOR_TOPICS)


@dataclass(frozen=True)
class Fitting:
    """The sensors of a crane and its bus [SI].

    Attributes:
        period: between two samples, a multiple of the grid's step.
        angle_quantum, angle_sigma: of the angle.
        rate_sigma: noise of the gyro; without one (``gyro`` false) the rate is a filtered derivative of the measured angle.
        rate_lag: of that filter.
        pressure_quantum, pressure_sigma: of both transducers.
        current_quantum, current_sigma: of the measured currents.
        jitter: of the stamps. phase: largest phase of a topic. loss: share of samples that are lost.
    """

    period: float = 0.01
    angle_quantum: float = 2.0 * np.pi / 2**14
    angle_sigma: float = 0.0
    rate_sigma: float = 1.5e-3
    gyro: bool = True
    rate_lag: float = 0.03
    pressure_quantum: float = 1.0e4
    pressure_sigma: float = 1.7e4
    current_quantum: float = 1.0e-3
    current_sigma: float = 0.8e-3
    jitter: float = 1.0e-4
    phase: float = 2.0e-4
    loss: float = 0.0

    @property
    def noise(self) -> Array:
        """Standard deviations of what the sensors add to angle, rate, hose and rod pressure."""
        angle = np.hypot(self.angle_sigma, self.angle_quantum / np.sqrt(12.0))
        derived = angle * np.sqrt(self.period / self.rate_lag) / self.rate_lag
        pressure = np.hypot(self.pressure_sigma, self.pressure_quantum / np.sqrt(12.0))
        return np.array([angle, self.rate_sigma if self.gyro else derived, pressure, pressure])


def fitted(rng: np.random.Generator, anything: bool) -> Fitting:
    """Sensors of a crane; ``anything``: also coarse ones and none for the rate, which the owner's machine file then tells."""
    period = float(rng.choice([0.005, 0.01, 0.01, 0.01, 0.015, 0.02]))
    worse = float(rng.uniform(0.7, 1.4))
    if not anything:
        angle, pressure, gyro = Fitting.angle_quantum, Fitting.pressure_quantum, True
    else:
        angle = 2.0 * np.pi / 2 ** float(rng.integers(13, 18))
        pressure = float(rng.choice([1.0e3, 1.0e4, 2.0e4, 5.0e4]))
        gyro, worse = bool(rng.uniform() < 0.6), worse * float(rng.uniform(0.5, 2.0))
    return Fitting(
        period, angle, float(rng.choice([0.0, 1e-4])), 1.5e-3 * worse, gyro, float(rng.uniform(0.02, 0.05)),
        pressure, 1.7e4 * worse, jitter=float(rng.uniform(0.5e-4, 3e-4)), phase=float(rng.uniform(1e-4, 6e-4)),
        loss=float(rng.choice([0.0, 0.002, 0.01])),
    )  # fmt: skip


def recorded(
    name: str, outputs: Array, currents: Array, configuration: Configuration, fitting: Fitting, rng: np.random.Generator
) -> Recording:
    """A recording of ``outputs`` (n, 4) at the ends of the grid's steps, and of the currents (n, 2) held in them."""
    count = len(outputs)
    duration, every = count * STEP, round(fitting.period / STEP)
    grid: Array = np.arange(count + 1, dtype=np.float64) * STEP
    splines = {
        signal: CubicSpline(grid, np.concatenate([outputs[:1, k], outputs[:, k]])) for k, signal in enumerate(SEEN)
    }
    signals = {}
    for topic in _TOPICS:
        times = grid[:count:every] + fitting.jitter + rng.uniform(0.0, fitting.phase)
        times = times + rng.uniform(-fitting.jitter, fitting.jitter, len(times))
        times = times[(rng.uniform(size=len(times)) >= fitting.loss) & (times < duration - 1e-3)]
        stamps = START_NS + np.rint(times * 1e9).astype(np.int64)
        told: dict[str, Array] = {}
        for signal in topic:
            if signal in CURRENTS:
                held = currents[(times / STEP).astype(np.int64), CURRENTS.index(signal)]
                told[signal] = _measured(held, fitting.current_sigma, fitting.current_quantum, rng)
            elif signal == "rate" and not fitting.gyro:
                told[signal] = _derived(told["angle"], times, fitting.rate_lag)
            else:
                told[signal] = _measured(splines[signal](times), *_quality(signal, fitting), rng)
            values = np.maximum(told[signal], 0.0) if signal in CURRENTS else told[signal]
            channel = BY_NAME[signal]
            signals[signal] = Signal(
                signal, channel.unit, channel.topic, stamps, times, values, np.ones(len(times), np.bool_)
            )
    return Recording(name, Path(name), START_NS, duration, signals, stored_configuration=configuration)


def _quality(signal: str, fitting: Fitting) -> tuple[float, float]:
    """Noise and quantum of a sensor."""
    if signal == "angle":
        return fitting.angle_sigma, fitting.angle_quantum
    if signal == "rate":
        return fitting.rate_sigma, 0.0
    return fitting.pressure_sigma, fitting.pressure_quantum


def _measured(values: Array, sigma: float, quantum: float, rng: np.random.Generator) -> Array:
    noisy = values + sigma * rng.standard_normal(len(values))
    return np.asarray(np.round(noisy / quantum) * quantum if quantum else noisy, dtype=np.float64)


def _derived(angle: Array, times: Array, lag: float) -> Array:
    """The owner's rate: difference of the measured angle, filtered with the time constant ``lag``."""
    slope = np.diff(angle, prepend=angle[0]) / np.diff(times, prepend=times[0] - 1.0)
    weight = 1.0 - np.exp(-np.diff(times, prepend=times[0]) / lag)
    rate, value = np.empty_like(slope), 0.0
    for k in range(len(slope)):
        value += weight[k] * (slope[k] - value)
        rate[k] = value
    return rate


def held(recording: Recording, count: int) -> Array:
    """The measured currents (count, 2) on the grid: each holds from its stamp to the next."""
    columns = []
    for name in CURRENTS:
        signal = recording.signals[name]
        # a step takes what was measured within its first millisecond or before
        last = np.searchsorted(signal.time, np.arange(count) * STEP + 0.9 * STEP) - 1
        columns.append(signal.values[np.maximum(last, 0)])
    return np.stack(columns, axis=-1)
