"""What the page of the moving crane is made of: packed numbers, marks, the drawing of a machine."""

import numpy as np
import pytest

from boom_model.machine_file import shipped_machine
from boom_report.packing import STEPS, compressed, inflated, steps
from boom_report.view.page import recording_page
from boom_report.view.scene import scene
from boom_report.view.series import Series, limits, on_grid


def unpacked(packed):
    values = packed["low"] + packed["step"] * np.cumsum(packed["d"])
    for a, b in packed["gaps"]:
        values[a:b] = np.nan
    return values


def test_packed_values_come_back_within_half_a_step_and_gaps_stay_gaps():
    values = np.cumsum(np.random.default_rng(0).normal(size=3000))
    values[100:120] = values[0] = np.nan
    back = unpacked(steps(values))
    assert (np.isnan(back) == np.isnan(values)).all()
    assert np.nanmax(np.abs(back - values)) <= 0.5001 * np.ptp(values[np.isfinite(values)]) / STEPS
    assert steps(np.full(3, np.nan))["d"] is None


def test_a_mark_begins_where_machine_and_model_part_and_noise_makes_none():
    machine, n = shipped_machine("tz17"), 1000
    limit = limits(machine)["hose_pressure"]
    noise = machine.sensor_noise().pressure_sigma * np.random.default_rng(1).normal(size=n)
    apart = noise + np.where((np.arange(n) > 400) & (np.arange(n) < 600), 5 * limit, 0.0)
    found = {
        name: Series("x", 0.01, {"hose_pressure": values}, {"model": {"hose_pressure": np.zeros(n)}}, limits(machine))
        for name, values in (("noise", noise), ("apart", apart))
    }
    assert found["noise"].marks("model") == []
    (mark,) = found["apart"].marks("model")
    assert mark["channel"] == "hose_pressure"
    assert (mark["start"], mark["end"]) == pytest.approx((4.01, 6.0), abs=0.02)


@pytest.mark.parametrize("name", ["tz17", "triangle_direct", "loader_crane"])
def test_the_drawn_cylinder_is_as_long_as_the_model_says(name):
    machine = shipped_machine(name)
    drawn = scene(machine, machine.tabulated[0])
    cylinder, piston = np.array(drawn["bars"][0]), np.array(drawn["piston"])
    length = np.hypot(cylinder[:, 2] - cylinder[:, 0], cylinder[:, 3] - cylinder[:, 1])
    assert length == pytest.approx(piston + machine.numbers.cylinder.l_min, abs=1e-4)
    assert np.array(drawn["boom"][2]) == pytest.approx(machine.tabulated[0].tip, abs=1e-4)


def test_a_hostile_name_stays_text():
    machine, evil = shipped_machine("tz17"), "</script><script>alert(1)</script>"
    values = {"angle": np.zeros(5)}
    text = recording_page(scene(machine, machine.tabulated[0]), Series(evil, 0.01, values, {}, {}), evil)
    assert "alert(1)</script>" not in text and "default-src 'none'" in text
    assert evil in inflated(compressed(evil))


def test_slow_sensors_are_known_between_their_samples_and_not_where_some_are_lost():
    """At 20 Hz two of three frames had no angle, and the marks where machine and model part were a barcode."""
    time = np.delete(np.arange(200) * 0.05, np.arange(100, 110))
    shown = on_grid({"angle": time}, {"angle": np.sin(time)}, 0.02, 499)["angle"]
    unknown = np.flatnonzero(np.isnan(shown)) * 0.02
    assert unknown.min() > 4.95 and unknown.max() < 5.5 and len(unknown) > 20
