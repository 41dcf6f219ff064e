"""Noise of the sensors, as recordings show it, where a machine file tells less of it."""

from __future__ import annotations

from collections.abc import Sequence
from math import isfinite, sqrt

from boom_input.channels import BY_NAME, PREDICTED, Sensor
from boom_model.machine import Machine
from boom_recording.measurement import ChannelMeasurement, measurements
from boom_recording.recording import Recording

KNOWN_TO = 1.05
"""Factor to which the noise of a channel can be told from a recording of a minute: three times the scatter of the estimate."""


def with_measured_noise(machine: Machine, recordings: Sequence[Recording]) -> Machine:
    """The machine with the noise of the sensors that its recordings show, where that is more than its file tells.

    A rate that is the angle's derivative has no noise of its own to be told.
    """
    told = machine.sensor_noise()
    numbers: dict[str, float] = {}
    for recording in recordings:
        for name, found in measurements(recording).items():
            sensor = BY_NAME[name]
            if sensor in PREDICTED and isinstance(sensor, Sensor) and _noisier(found, told.deviation(sensor)):
                sigma = sqrt(found.deviation**2 - told.quantum(sensor) ** 2 / 12.0)
                if sensor.is_pressure:
                    power = sigma**2 * machine.sample_time
                    numbers["p_noise_psd"] = max(power, numbers.get("p_noise_psd", 0.0))
                else:
                    key = {"angle": "q2_noise", "rate": "rate_noise"}[name]
                    numbers[key] = max(sigma, numbers.get(key, 0.0))
    return machine.with_sensors(numbers) if numbers else machine


def _noisier(found: ChannelMeasurement, told: float) -> bool:
    return found.independent and isfinite(found.deviation) and found.deviation > KNOWN_TO * told
