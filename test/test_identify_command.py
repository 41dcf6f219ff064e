"""`./boom identify` as a command: what it takes bags for, what it says where nothing can be told."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from boom_bringup import cli
from boom_bringup.commands.identify import _further_off
from boom_model.machine_file import load_machine
from boom_model.plant import Plant
from boom_recording.oscilloscope import write_trace
from boom_recording.recording import Configuration
from boom_recording.writing import from_columns, write
from boom_sim.campaigns import pilot_current
from boom_sim.pilot_bench import BenchNoise, measure

PERIOD, DURATION = 0.01, 6.0


@pytest.fixture
def resting(tmp_path: Path) -> Path:
    """A bag of a boom at rest, with the sensors' noise."""
    machine = load_machine("tz17")
    plant = Plant(machine, machine.pose(4.59, 0.0))
    time = np.arange(round(DURATION / PERIOD)) * PERIOD
    still = np.zeros((len(time), 2))
    outputs = plant.run(time, still, time, plant.equilibrium(0.4), tolerance=1e-6).outputs
    seen = machine.sensor_noise().outputs(outputs, np.random.default_rng(1))
    columns = {name: seen[:, k] for k, name in enumerate(("angle", "rate", "hose_pressure", "rod_pressure"))}
    columns |= {"retract_current": still[:, 0], "extend_current": still[:, 1]}
    write(tmp_path / "resting", from_columns("resting", time, columns, Configuration("tz17", 4.59, 0.0, 0.0)))
    return tmp_path / "resting"


def test_a_boom_at_rest_tells_nothing_and_that_is_no_error(
    resting: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    document, machine = tmp_path / "found.json", tmp_path / "machine.yaml"
    words = ["identify", str(resting), "--no-report", "--json", str(document), "--output", str(machine)]
    assert cli.main(words) == 0
    said = capsys.readouterr().out
    assert "not enough excitation for: friction.tau_C_pos" in said
    found = json.loads(document.read_text())
    assert found["parameters"] == {}
    assert {"friction.tau_C_pos", "accumulators.p_g0_1"} <= {n["parameter"] for n in found["not_determined"]}
    assert (
        load_machine(machine).parameters["friction.tau_C_pos"].value
        == load_machine("tz17").parameters["friction.tau_C_pos"].value
    )


def test_bags_of_the_bench_alone_are_enough(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    machine = load_machine("tz17")
    rng = np.random.default_rng(3)
    bags = []
    for shape in ("ramp",):
        trace = measure(
            machine,
            machine.pose(4.59, 0.0),
            "extend",
            pilot_current(shape, rng),
            name=shape,
            noise=BenchNoise(),
            seed=4,
        )
        write_trace(tmp_path / shape, trace)
        bags.append(str(tmp_path / shape))
    document = tmp_path / "found.json"
    assert cli.main(["identify", *bags, "--no-report", "--json", str(document)]) == 0
    found = json.loads(document.read_text())
    h, current = found["parameters"], np.linspace(0.30, 0.55, 26)
    curve = np.polyval([h[f"pilot_valves.h.{k}"]["value"] for k in range(3)], current)
    assert curve == pytest.approx(np.polyval([76.1, -0.58, 0.247], current), abs=0.15)
    assert "not enough excitation for: pilot_valves.a1_s" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--parameters", "friction.tau_C"], "friction.tau_C: no such parameter; did you mean"),
        (["--parameters", "fluid.beta", "--stationary-only"], "leave one of them out"),
        (["--smoothing", "-1"], "give a number of 0 or more"),
        (["--output", "machine.txt"], "a machine file ends in .yaml"),
    ],
)
def test_wrong_options_end_with_one_line_and_status_2(
    options: list[str], message: str, resting: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert cli.main(["identify", str(resting), "--no-report", *options]) == 2
    line = capsys.readouterr().err.strip().splitlines()[-1]
    assert line.startswith("boom: ")
    assert message in line


def test_without_a_gyro_the_angle_tells_whether_and_how_fast_the_boom_moves() -> None:
    from dataclasses import replace

    from boom_identification.stationary import stationary_points
    from boom_identification.telling import _moves, prepare
    from boom_recording.loading import load

    machine = load_machine("tz17")
    whole = load(Path(__file__).resolve().parents[1] / "bags" / "healthy" / "extended")
    silent = replace(whole.signals["rate"], valid=np.zeros_like(whole.signals["rate"].valid))
    blind = replace(whole, signals={**whole.signals, "rate": silent})
    assert _moves(prepare(blind, machine, name="blind"))
    seen, guessed = (stationary_points([r], machine) for r in (whole, blind))
    assert len(guessed) > 0.8 * len(seen)
    nearest = np.interp(guessed.time, seen.time, seen.rate)
    assert np.median(np.abs(guessed.rate - nearest)) < 0.01


def test_a_fit_that_makes_data_not_used_worse_is_told_by_how_much() -> None:
    rows = [
        {"bag": "a", "before": {"angle": 0.01, "rate": 0.03}, "after": {"angle": 0.02, "rate": 0.24}},
        {"bag": "b", "before": {"angle": 0.01, "rate": None}, "after": {"angle": 0.04, "rate": None}},
    ]
    assert _further_off(rows) == pytest.approx(4.0)
    assert _further_off([{"bag": "a", "before": {"angle": None}, "after": {"angle": 0.1}}]) == 1.0
    for lost in (None, np.nan, np.inf):
        assert _further_off([*rows, {"bag": "c", "before": {"angle": 0.1}, "after": {"angle": lost}}]) == np.inf
