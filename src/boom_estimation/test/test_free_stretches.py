"""Where free runs begin and end, on a recording of the shipped loader crane by hand."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from boom_estimation.currents import held_currents
from boom_estimation.runs import at_an_end, free_stretches
from boom_model.machine_file import load_machine
from boom_recording.recording import Configuration, Recording
from boom_recording.writing import from_columns

LOADER = load_machine("loader_crane")
LOW, HIGH = LOADER.angle_limits


def recorded(angles: list[float], extend: float, retract: float = 0.0) -> Recording:
    """Of 40 s: straight ways between angles [rad] at 0, 8, 12, 20, 28, 32 and 40 s; currents [A]: extend to 20 s, then retract."""
    time = np.arange(4000) * 0.01
    rest = np.zeros_like(time)
    columns = {
        "angle": np.interp(time, [0.0, 8.0, 12.0, 20.0, 28.0, 32.0, 40.0], angles), "rate": rest,
        "hose_pressure": rest + 5e6, "rod_pressure": rest + 1e6,
        "extend_current": np.where(time < 20.0, extend, 0.0), "retract_current": np.where(time < 20.0, 0.0, retract),
    }  # fmt: skip
    return from_columns("made", time, columns, Configuration("loader_crane", 4.5, 0.0, 0.0))


def test_a_boom_that_is_driven_against_an_end_is_left_out_until_it_has_left_it() -> None:
    top, bottom = HIGH - 0.012, LOW + 0.02
    made = recorded([0.9, top, top, top, bottom, bottom, bottom], 0.55, 0.55)
    (first, last), (later, end) = at_an_end(made, LOADER)[::-1]
    assert first == pytest.approx(8.0 - 0.02 / (top - 0.9) * 8.0, abs=0.05)
    assert last == pytest.approx(20.0 + 0.005 / (top - bottom) * 8.0, abs=0.05)
    assert (later, end) == (pytest.approx(28.0 - 0.02 / (top - bottom) * 8.0, abs=0.05), pytest.approx(40.0, abs=0.02))
    runs = free_stretches(made, held_currents(made), LOADER, holds=True)
    assert runs == [(0.0, pytest.approx(first)), (pytest.approx(last), pytest.approx(later))]


@pytest.mark.parametrize("kept", [0, 1, 2])
def test_a_recording_of_hardly_a_sample_has_no_end_that_it_stands_at(kept: int) -> None:
    made = recorded([1.44] * 7, 0.55)
    angle = made.signals["angle"]
    few = replace(angle, values=angle.values[:kept], time=angle.time[:kept], valid=angle.valid[:kept])
    assert at_an_end(replace(made, signals={**made.signals, "angle": few}), LOADER) == []


def test_stamps_that_come_in_pairs_end_in_no_traceback() -> None:
    made = recorded([0.9, HIGH - 0.012, HIGH - 0.012, HIGH - 0.012, 0.5, 0.5, 0.5], 0.55)
    angle = made.signals["angle"]
    paired = replace(angle, time=np.repeat(angle.time[::3], 3)[: len(angle.time)])
    assert len(at_an_end(replace(made, signals={**made.signals, "angle": paired}), LOADER)) == 1


@pytest.mark.parametrize(
    ("angle", "current"),
    [(HIGH - 0.012, 0.0), (HIGH - 0.012, 0.15), (HIGH - 0.2, 0.55)],
    ids=["off", "overlap", "free"],
)
def test_a_boom_that_rests_near_an_end_or_is_blocked_elsewhere_is_not_left_out(angle: float, current: float) -> None:
    made = recorded([0.9, angle, angle, angle, 0.5, 0.5, 0.5], current)
    assert at_an_end(made, LOADER) == []
    assert len(free_stretches(made, held_currents(made), LOADER, holds=True)) == 1
