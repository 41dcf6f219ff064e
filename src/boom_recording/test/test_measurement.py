"""What the channels of a recording can tell: noise, resolution, repeats, and a rate that is the angle's derivative."""

from __future__ import annotations

import numpy as np
import pytest
from recording_samples import CONFIGURATION

from boom_recording.measurement import ChannelMeasurement, measurements
from boom_recording.recording import Floats, Recording
from boom_recording.writing import from_columns

COUNT = 4000
TIME = np.arange(COUNT) * 0.01
ANGLE = 0.4 + 0.2 * np.sin(0.7 * TIME)


def made(seed: int = 0, **columns: Floats) -> Recording:
    rng = np.random.default_rng(seed)
    rate = 0.14 * np.cos(0.7 * TIME) + 1.5e-3 * rng.standard_normal(COUNT)
    angle = np.round((ANGLE + 1e-4 * rng.standard_normal(COUNT)) / 1e-4) * 1e-4
    return from_columns("made", TIME, {"angle": angle, "rate": rate} | columns, CONFIGURATION)


def pressure(sigma: float, quantum: float, seed: int = 1) -> Floats:
    noisy = 8e6 + 2e6 * np.sin(0.9 * TIME) + sigma * np.random.default_rng(seed).standard_normal(COUNT)
    return np.asarray(np.round(noisy / quantum) * quantum if quantum else noisy, float)


@pytest.mark.parametrize(("sigma", "quantum"), [(2e4, 1e4), (4e3, 0.0), (1.7e4, 1.2e3)])
def test_noise_and_resolution_of_a_pressure_are_told(sigma: float, quantum: float) -> None:
    found = measurements(made(hose_pressure=pressure(sigma, quantum)))["hose_pressure"]
    assert found.sigma == pytest.approx(sigma, rel=0.1)
    assert found.quantum == pytest.approx(quantum)
    assert (found.repeats, found.independent, found.samples) == (1.0, True, COUNT)
    assert found.period == pytest.approx(0.01)


def test_pressure_of_a_coarse_bus_has_the_noise_of_its_steps() -> None:
    found = measurements(made(rod_pressure=pressure(2e3, 2e5)))["rod_pressure"]  # 0.2 MPa a bit
    assert found.quantum == pytest.approx(2e5)
    assert found.deviation == pytest.approx(2e5 / np.sqrt(12), rel=0.3)


@pytest.mark.parametrize("times", [2, 5])
def test_samples_that_a_bus_repeats_are_counted_and_make_no_noise(times: int) -> None:
    held = np.repeat(pressure(2e4, 1e3)[::times], times)[:COUNT]
    found = measurements(made(hose_pressure=held))["hose_pressure"]
    assert found.repeats == pytest.approx(times, rel=0.1)
    assert found.sigma == pytest.approx(2e4, rel=0.25)


def test_gyro_is_a_measurement_of_its_own() -> None:
    rate = measurements(made())["rate"]
    assert (rate.derived_from, rate.independent) == ("", True)
    assert rate.sigma == pytest.approx(1.5e-3, rel=0.1)


@pytest.mark.parametrize("lag", [0.0, 3.0, 10.0])
def test_rate_that_is_the_filtered_derivative_of_the_angle_is_recognised(lag: float) -> None:
    angle = made().signals["angle"].values
    rate, keep = np.gradient(angle, 0.01), np.exp(-1 / lag) if lag else 0.0
    for _ in range(2):
        for k in range(1, COUNT):
            rate[k] = keep * rate[k - 1] + (1 - keep) * rate[k]
    found = measurements(made(rate=rate))["rate"]
    assert (found.derived_from, found.independent) == ("angle", False)


def test_channel_that_was_not_recorded_has_no_samples() -> None:
    found = measurements(made())
    assert found["rod_pressure"].samples == 0
    assert not found["rod_pressure"].independent
    assert "supply_pressure" not in found
    assert isinstance(found["angle"], ChannelMeasurement)


def test_few_samples_tell_no_noise() -> None:
    recording = from_columns("short", TIME[:50], {"angle": ANGLE[:50]}, CONFIGURATION)
    assert np.isnan(measurements(recording)["angle"].sigma)
