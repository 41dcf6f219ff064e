"""The measurement campaign of ch. 4.1, simulated with random valves, is found again by ch. 5.1."""

from __future__ import annotations

import numpy as np
import pytest

from boom_identification.pilot_valve import PilotValves, identify_pilot_valves
from boom_model.components.pilot_valve import BAR, static_pressure
from boom_model.machine import Machine
from boom_model.machine_file import load_machine
from boom_sim.campaigns import pilot_current
from boom_sim.pilot_bench import BenchNoise, measure

SHAPES = ("chirp", "static", "general")


def random_valve(seed: int) -> Machine:
    rng = np.random.default_rng(seed)
    pole, through = rng.uniform(10.0, 35.0), rng.uniform(-0.05, 0.02)
    h = (rng.uniform(60.0, 95.0), rng.uniform(-3.0, 3.0), rng.uniform(0.1, 1.0))
    return load_machine("tz17").with_values(
        {
            "pilot_valves.a1_s": -pole,
            "pilot_valves.b1_s": through,
            "pilot_valves.b0_s": pole * (1.0 - through),
            "pilot_valves.h": h,
        }
    )


def identified(machine: Machine, seed: int, shapes: tuple[str, ...] = SHAPES) -> PilotValves:
    pose = machine.pose(4.59, 0.0)
    rng = np.random.default_rng([seed, 7])
    traces = [
        measure(machine, pose, "retract", pilot_current(s, rng), name=s, noise=BenchNoise(), seed=seed + 10 * k)
        for k, s in enumerate(shapes)
    ]
    return identify_pilot_valves(traces)


@pytest.mark.parametrize("seed", [11, 12, 13])
def test_three_traces_of_a_random_valve_give_its_numbers(seed: int) -> None:
    machine = random_valve(seed)
    found = identified(machine, seed)
    truth = {key: machine.parameters[f"pilot_valves.{key}"].value for key in ("a1_s", "h")}
    estimates = {e.key: e.value for e in found.estimates()}
    assert estimates["pilot_valves.a1_s"] == pytest.approx(truth["a1_s"][0], rel=0.02)
    current = np.linspace(0.30, 0.55, 51)
    h = [estimates[f"pilot_valves.h.{k}"] for k in range(3)]
    error = np.asarray(static_pressure(current, h), float) - np.asarray(static_pressure(current, truth["h"]), float)
    assert np.abs(error).max() < 0.15 * BAR
    unseen = [check for check in found.checks if check.held_out]
    assert unseen
    assert all(check.rms_raw < 0.25 * BAR for check in unseen)


def test_without_a_fast_trace_the_pole_is_not_told_and_the_curve_is() -> None:
    found = identified(random_valve(11), 11, ("ramp",))
    assert {e.key for e in found.estimates()} == {f"pilot_valves.h.{k}" for k in range(3)}
    missing = {n.parameter: n.why for n in found.not_determined}
    assert "A/s are needed" in missing["pilot_valves.a1_s"]
