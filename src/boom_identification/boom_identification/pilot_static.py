"""Static curve of the pilot valves, h(i), from stationary points of oscilloscope traces: (5.1), (5.2), Figs. 5.2, 5.3."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from boom_identification import estimate, signals
from boom_model.components import pilot_valve
from boom_model.components.pilot_valve import BAR
from boom_recording.oscilloscope import OscilloscopeTrace

Array = NDArray[np.float64]

PRESSURE_RATE = 1.0e5
"""Pa/s. p_th of (5.1)."""
CURRENT_RATE = 0.5
"""A/s. i_th of (5.1)."""
DERIVATIVE_WINDOW = 0.1
"""s. Savitzky-Golay window: the derivative's noise stays far below both thresholds."""
PWM_PERIOD = 0.01
"""s. Used if the trace shows no PWM edges (ch. 3.2.4: 100 Hz)."""
SMALLEST_RANGE = 0.05
"""A. A parabola through a shorter range of stationary currents does not determine the rest."""


@dataclass(frozen=True)
class Averaged:
    """One stretch of a trace, averaged over the PWM period: arrays (n,) without the ends that the window cuts.

    Attributes:
        start: time of the first sample [s]. period: [s].
        current: [A]. pressure: [Pa].
        raw_current, raw_pressure: the same samples as measured.
        stationary: (n,) where (5.1) holds.
    """

    start: float
    period: float
    current: Array
    pressure: Array
    raw_current: Array
    raw_pressure: Array
    stationary: NDArray[np.bool_]

    @property
    def time(self) -> Array:
        """(n,) [s] since the start of the trace."""
        return np.asarray(self.start + np.arange(len(self.current)) * self.period, np.float64)


@dataclass(frozen=True)
class AveragedTrace:
    """A trace and its averaged stretches. ``window``: [samples] of the moving average."""

    trace: OscilloscopeTrace
    window: float
    stretches: tuple[Averaged, ...]

    @property
    def stationary_points(self) -> tuple[Array, Array]:
        """(current [A], pressure [Pa]) of all stationary points."""
        return (
            np.concatenate([s.current[s.stationary] for s in self.stretches]),
            np.concatenate([s.pressure[s.stationary] for s in self.stretches]),
        )


@dataclass(frozen=True)
class StaticCurve:
    """h(i) = h_0 i^2 + h_1 i + h_2.

    Attributes:
        h: (h_0, h_1, h_2) [bar/A^2, bar/A, bar]. covariance: (3, 3) of them.
        current_range: (low, high) [A] of the stationary points.
        residual: rms [Pa]. points, groups: number of points and of stretches.
    """

    h: tuple[float, float, float]
    covariance: Array
    current_range: tuple[float, float]
    residual: float
    points: int
    groups: int

    def pressure(self, nu: Array) -> Array:
        """h(nu) [Pa] for nu (n,) [A]."""
        return np.asarray(pilot_valve.static_pressure(nu, self.h), float)

    def inverse(self, pressure: Array) -> Array:
        """nu (n,) [A] for pressures (n,) [Pa], (5.6)."""
        return np.asarray(pilot_valve.static_inverse(pressure, self.h), float).ravel()

    def half_width(self, nu: Array) -> Array:
        """Half of the 90 % interval [Pa] of h(nu), nu (n,) [A]."""
        basis = np.column_stack((nu**2, nu, np.ones_like(nu)))
        variance = np.einsum("ij,jk,ik->i", basis, self.covariance, basis)
        return np.asarray(BAR * estimate.NORMAL_90 * np.sqrt(np.maximum(variance, 0.0)))


def averaged(trace: OscilloscopeTrace) -> AveragedTrace | None:
    """Average a trace over its true PWM period and find its stationary points (5.1).

    None if every stretch is shorter than the windows.
    """
    found = signals.pwm_period(np.concatenate([s.voltage for s in trace.stretches]))
    window = found or PWM_PERIOD / trace.period
    half = int(np.ceil(window / 2))
    margin = signals.window_samples(trace.period, DERIVATIVE_WINDOW) // 2
    parts = []
    for stretch in trace.stretches:
        inside = slice(half, len(stretch.current) - half)
        current = signals.moving_average(stretch.current, window)[inside]
        pressure = signals.moving_average(stretch.pressure, window)[inside]
        if len(current) < 4 * margin:
            continue
        slow = np.abs(signals.smoothed(current, trace.period, DERIVATIVE_WINDOW, 1)) < CURRENT_RATE
        slow &= np.abs(signals.smoothed(pressure, trace.period, DERIVATIVE_WINDOW, 1)) < PRESSURE_RATE
        slow[:margin] = slow[-margin:] = False
        parts.append(
            Averaged(
                stretch.start + half * trace.period, trace.period, current, pressure,
                stretch.current[inside], stretch.pressure[inside], slow,
            )
        )  # fmt: skip
    return AveragedTrace(trace, window, tuple(parts)) if parts else None


def fit_curve(traces: Sequence[AveragedTrace]) -> StaticCurve:
    """h by least squares (5.2) from the stationary points of all traces.

    Raises:
        ValueError: too few stationary points, or over too small a range; the message says which.
    """
    current, pressure, groups = [], [], []
    count = 0
    for trace in traces:
        for part in trace.stretches:
            for first, end in signals.stretches(part.stationary):
                current.append(part.current[first:end])
                pressure.append(part.pressure[first:end])
                groups.append(np.full(end - first, count))
                count += 1
    if not current:
        raise ValueError("no stationary points")
    i, p, g = np.concatenate(current), np.concatenate(pressure) / BAR, np.concatenate(groups)
    low, high = float(i.min()), float(i.max())
    if high - low < SMALLEST_RANGE or count < 4:
        raise ValueError(f"stationary points only between {low:.3f} A and {high:.3f} A, in {count} stretches")
    design = np.column_stack((i**2, i, np.ones_like(i)))
    h, covariance = estimate.least_squares(design, p, g)
    if not h[0] > 0.0 or 2 * h[0] * low + h[1] <= 0.0:
        raise ValueError("the pressure does not rise with the current over the stationary points")
    residual = BAR * float(np.sqrt(np.mean((p - design @ h) ** 2)))
    return StaticCurve((float(h[0]), float(h[1]), float(h[2])), covariance, (low, high), residual, len(i), count)
