"""One pilot valve on the bench of the first measurement campaign (ch. 4.1): PWM driver, solenoid, valve, oscilloscope.

    L i' = u - R i,  u = PWM_VOLTAGE or 0 at 100 Hz      (solenoid; the driver chooses the duty cycle so that the mean
                                                           current follows the wanted one)
    lambda' = a_1 lambda + i,  p = h(nu)                  (boom_model.components.pilot_valve)

The oscilloscope samples u, i and p at 6.25 kHz and adds white noise to each.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from boom_model.component_numbers import component_parameters
from boom_model.components import pilot_valve
from boom_model.machine import Machine, Pose
from boom_recording.oscilloscope import OscilloscopeTrace, Stretch

Array = NDArray[np.float64]

SAMPLE_PERIOD = 0.16e-3
"""s. Ch. 4.1."""
PWM_PERIOD = 10e-3
"""s. Ch. 3.2.4: 100 Hz, that is 62.5 samples."""
PWM_VOLTAGE = 24.0
RESISTANCE, INDUCTANCE = 27.0, 0.45
"""Ohm, H: give the ripple of 0.12 A that the recorded traces show."""
_STEP = SAMPLE_PERIOD / 8


@dataclass(frozen=True)
class BenchNoise:
    """White noise of the oscilloscope: [V], [A], [Pa] standard deviations."""

    voltage: float = 0.1
    current: float = 4e-3
    pressure: float = 1.2e4


SILENT = BenchNoise(0.0, 0.0, 0.0)
"""An oscilloscope without noise."""


def measure(
    machine: Machine, pose: Pose, valve: str, wanted: Array, *, name: str, noise: BenchNoise, seed: int
) -> OscilloscopeTrace:
    """The trace of one run.

    Args:
        machine: the machine with the pilot valves, including effects.
        pose: any; it does not affect the valves.
        valve: ``retract`` or ``extend``.
        wanted: (n,) [A], current requested by the joystick in each PWM period; the run lasts n periods.
        name: of the trace.
        noise: of the oscilloscope.
        seed: of the noise.
    """
    time = np.arange(0.0, len(wanted) * PWM_PERIOD - 0.5 * _STEP, _STEP)
    voltage = _pwm(wanted, time)
    decay = np.exp(-RESISTANCE / INDUCTANCE * _STEP)
    # exact for a voltage that is held over a step
    current = _from_rest(voltage / RESISTANCE, float(wanted[0]), decay)
    p, e = component_parameters(machine, pose)
    pole = float(pilot_valve.state_rate(1.0, 0.0, p, e))
    delay = round(e.delay("command") / _STEP)
    acting = np.concatenate((np.full(delay, current[0]), current[: len(current) - delay]))
    state = _from_rest(-acting / pole, -float(wanted[0]) / pole, np.exp(pole * _STEP))
    pressure = np.asarray(pilot_valve.pressure(state, acting, p, e), float)
    rng = np.random.default_rng(seed)
    kept = slice(0, None, 8)
    columns = [
        column[kept] + sigma * rng.standard_normal(len(column[kept]))
        for column, sigma in ((voltage, noise.voltage), (current, noise.current), (pressure, noise.pressure))
    ]
    return OscilloscopeTrace(name, Path(name), valve, SAMPLE_PERIOD, (Stretch(0.0, *columns),))


def _pwm(wanted: Array, time: Array) -> Array:
    """U (len(time),) [V]: high at the beginning of each period, as long as the mean current needs."""
    following = np.append(wanted[1:], wanted[-1])
    mean = RESISTANCE * wanted + INDUCTANCE * (following - wanted) / PWM_PERIOD
    duty = np.clip(mean / PWM_VOLTAGE, 0.0, 1.0)
    period = np.minimum((time / PWM_PERIOD + 1e-9).astype(int), len(wanted) - 1)
    return np.asarray(np.where(time / PWM_PERIOD - period < duty[period], PWM_VOLTAGE, 0.0), np.float64)


def _from_rest(target: Array, start: float, decay: float) -> Array:
    """X (n,) with x[0] = start and x[k+1] = decay x[k] + (1 - decay) target[k]."""
    return np.asarray(lfilter([0.0, 1.0 - decay], [1.0, -decay], target, zi=[start])[0], np.float64)
