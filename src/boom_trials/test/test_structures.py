"""Cranes of random structure run through simulate and validate; the numbers that made a recording reproduce it."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import yaml

from boom_bringup.cli import main
from boom_model.machine_file import load_machine, machine_from
from boom_recording.writing import write
from boom_trials.structures import DrawnCrane, complete, draw

SEEDS = (0, 3, 6)
"""Chosen so that every slot differs among them."""


@pytest.fixture(scope="module")
def drawn() -> dict[int, DrawnCrane]:
    return {seed: draw(np.random.default_rng(seed), 10.0) for seed in SEEDS}


def test_draws_reach_every_component_and_every_missing_sensor() -> None:
    from boom_trials.structures import _document

    seen: dict[str, set[str]] = {}
    for seed in range(60):
        for slot, name in _document(np.random.default_rng(seed))[1].items():
            seen.setdefault(slot, set()).add(name)
    assert seen["hose_burst_valve"] == {"flow_limiting", "pilot_opened", "none"}
    assert seen["spool"] == {"pilot_operated", "direct", "second_order"}
    assert {
        len(seen[slot])
        for slot in ("linkage", "friction", "metering", "supply", "accumulators", "port_valves", "neutral", "steps")
    } == {2}


@pytest.mark.parametrize("seed", SEEDS)
def test_crane_of_random_structure_runs_through_simulate_and_validate(
    drawn: dict[int, DrawnCrane], seed: int, tmp_path: Path
) -> None:
    crane, file, bag = drawn[seed], tmp_path / "machine.yaml", tmp_path / "drawn"
    file.write_text(yaml.safe_dump(crane.document))
    write(bag, crane.recording)
    assert main(["simulate", str(bag), "--machine", str(file), "--output", str(tmp_path / "again")]) in (0, 2)
    assert (
        main(
            [
                "validate",
                str(bag),
                "--machine",
                str(file),
                "--json",
                str(tmp_path / "v.json"),
                "--report",
                str(tmp_path / "v.html"),
            ]
        )
        == 0
    )
    full = json.loads((tmp_path / "v.json").read_text())["bags"][0]["full"]
    for name in crane.missing:
        assert [value for key, value in full.items() if key.startswith(name)] == [None]
    if complete(crane):
        assert full["angle_mae_rad"] < 3e-3 and full["rod_pressure_rmse_pa"] < 1.5e5


def test_file_of_a_drawn_crane_holds_the_numbers_that_made_its_recording(drawn: dict[int, DrawnCrane]) -> None:
    machines = [machine_from(crane.document) for crane in drawn.values()]
    shipped = {name: load_machine(name) for name in ("tz17", "loader_crane")}
    for machine in machines:
        assert all(
            machine.parameters["fluid.beta"].value != other.parameters["fluid.beta"].value for other in shipped.values()
        )
