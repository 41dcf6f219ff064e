"""Tracking numbers (6.29) from columns and from recordings."""

from __future__ import annotations

import numpy as np
import pytest

from boom_model.machine_file import load_machine
from boom_recording import writing
from boom_recording.loading import load
from boom_recording.recording import Configuration
from boom_report.tracking import position_error

CONFIGURATION = Configuration("tz17", 0.28, 2.2, 0.0)
TIME = np.arange(500) * 0.01


def recorded(reference: np.ndarray, angle: np.ndarray, lost: np.ndarray | None = None) -> dict[str, np.ndarray]:
    shown = angle.copy()
    if lost is not None:
        shown[lost] = np.nan
    return {
        "angle": shown, "rate": np.gradient(angle, TIME), "hose_pressure": np.full(500, 8e6) + TIME * 1e4,
        "rod_pressure": np.full(500, 1e6) + TIME * 1e4, "retract_current": 0.1 + 0 * TIME, "extend_current": 0.1 + 0 * TIME,
        "smooth_reference_angle": reference, "smooth_reference_rate": np.gradient(reference, TIME),
        "smooth_reference_acceleration": 0 * TIME, "smooth_reference_jerk": 0 * TIME,
    }  # fmt: skip


def test_the_three_measures_are_those_of_the_thesis() -> None:
    found = position_error.errors(np.array([0.001, -0.003, 0.002, 0.0]))
    assert (found.mae, found.maxe) == (0.0015, 0.003)
    assert found.rmse == pytest.approx(np.sqrt(14e-6 / 4))
    assert found.document()["maxe_mm"] == 3.0


def test_piston_positions_of_many_angles_are_those_of_the_linkage() -> None:
    machine = load_machine("tz17")
    angles = np.linspace(0.013, 0.91, 37)
    exact = np.array([machine.piston_position(a) for a in angles])
    assert np.max(np.abs(position_error.piston_positions(machine, angles) - exact)) < 1e-7


def test_an_angle_error_counts_with_the_lever_of_the_linkage() -> None:
    machine = load_machine("tz17")
    reference = np.full(100, 0.4)
    found = position_error.track(machine, TIME[:100], reference, reference - 1e-3)
    lever = (machine.piston_position(0.401) - machine.piston_position(0.399)) / 2e-3
    assert found.errors.mae == pytest.approx(1e-3 * lever, rel=1e-2)


def test_a_bag_with_the_reference_state_tells_its_tracking(tmp_path) -> None:
    machine = load_machine("tz17")
    reference = 0.4 + 0.05 * np.sin(np.maximum(TIME - 1.0, 0.0))
    columns = recorded(reference, reference - 1e-3, np.array([200, 201]))
    writing.write(tmp_path / "bag", writing.from_columns("bag", TIME, columns, CONFIGURATION))
    found = position_error.of_recording(load(tmp_path / "bag"), machine)
    assert found.time[0] == pytest.approx(1.0, abs=0.02)  # the rest before the first motion does not count
    assert not np.isin(np.round(found.time, 2), [2.0, 2.01]).any()
    wanted = position_error.track(machine, TIME[100:], reference[100:], reference[100:] - 1e-3)
    assert found.errors.mae == pytest.approx(wanted.errors.mae, rel=1e-2)


def test_a_bag_without_a_reference_says_what_to_record(tmp_path) -> None:
    columns = {k: v for k, v in recorded(0.4 + 0 * TIME, 0.4 + 0 * TIME).items() if not k.startswith("smooth")}
    recording = writing.from_columns("bag", TIME, columns, CONFIGURATION)
    with pytest.raises(position_error.TrackingError, match="/boom/reference_state"):
        position_error.of_recording(recording, load_machine("tz17"))
