"""Cranes of another make, through the front door: what `./boom diagnose` says of recordings that nobody prepared."""

import json
from pathlib import Path
from typing import Any

import pytest

from boom_bringup import cli
from boom_model.machine_file import load_machine

STRANGERS = Path(__file__).resolve().parents[2] / "shared" / "recordings" / "strangers"
pytestmark = pytest.mark.skipif(not STRANGERS.exists(), reason="no shared/recordings/strangers beside the project")


def answer(number: int, first: str, second: str, output: Path) -> Any:
    """What the command says of a stranger."""
    bags = [str(STRANGERS / f"stranger_{number}_{part}") for part in (first, second)]
    options = ["--machine", str(STRANGERS / "stranger.yaml"), "--output", str(output)]
    assert cli.main(["diagnose", bags[0], "--hold-out", bags[1], *options]) == 0
    return json.loads((output / "diagnosis.json").read_text())


@pytest.mark.parametrize(("first", "second"), [("a", "b"), ("b", "a")])
def test_numbers_alone_explain_a_crane_of_another_make_whose_physics_is_the_model_s(
    first: str, second: str, tmp_path: Path
) -> None:
    document = answer(5, first, second, tmp_path / "answer")
    assert (document["verdict"], document["findings"]) == ("parameters_only", [])
    held_out = document["fit"]["held_out"]
    for channel in (2, 3):  # hose and rod pressure
        assert held_out["parameters_only"][channel] < held_out["noise_floor"][channel]


@pytest.mark.parametrize(("first", "second"), [("a", "b"), ("b", "a")])
def test_a_dead_time_is_found_beside_numbers_that_are_far_off(first: str, second: str, tmp_path: Path) -> None:
    document = answer(2, first, second, tmp_path / "answer")
    finding = document["findings"][0]
    assert (document["verdict"], finding["effect"]) == ("identified", "command_delay")
    assert finding["parameters"]["T"]["value"] == pytest.approx(0.05, abs=1e-3)


def test_identify_finds_the_numbers_of_a_crane_that_is_far_from_its_file(tmp_path: Path) -> None:
    """Overlaps .108, .092, .101, .095, beta 1.12e9 Pa and the pole 38 1/s are true; .09, 1.4e9 Pa and 45 1/s are believed."""
    found, words = tmp_path / "found.yaml", ["--machine", str(STRANGERS / "stranger.yaml"), "--no-report"]
    assert cli.main(["identify", str(STRANGERS / "stranger_5_a"), *words, "--output", str(found)]) == 0
    machine = load_machine(found)
    overlap = machine.parameters["main_valve_orifices.x0"].value[0]
    edges, between = machine.effects["edge_overlap"], machine.effects["valve_dead_zone"]["d_retract"]
    lowering = overlap + between
    # what is seen of an overlap is the current that it takes
    stroke = machine.parameters["main_valve_spool.K_i"].value[0]
    stroke /= load_machine(STRANGERS / "stranger.yaml").parameters["main_valve_spool.K_i"].value[0]
    told = [x / stroke for x in (overlap, overlap + edges["d_extend"], lowering, lowering + edges["d_retract"])]
    assert told == pytest.approx([0.108, 0.092, 0.101, 0.095], abs=1e-3)
    assert machine.parameters["fluid.beta"].value[0] == pytest.approx(1.12e9, rel=0.03)
    assert 1 / machine.parameters["main_valve_spool.T_s"].value[0] == pytest.approx(38.0, rel=0.02)
    words = ["--machine", str(found), "--no-report", "--json", str(tmp_path / "seen.json")]
    assert cli.main(["validate", str(STRANGERS / "stranger_5_b"), *words]) == 0
    assert json.loads((tmp_path / "seen.json").read_text())["bags"][0]["agrees"]


def test_identify_fits_no_numbers_to_a_command_of_the_wrong_sign(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["--machine", str(STRANGERS / "stranger.yaml"), "--no-report", "--json", str(tmp_path / "found.json")]
    assert cli.main(["identify", str(STRANGERS / "stranger_4_a"), *words]) == 0
    assert (
        "repair the recording first: stranger_4_a, /boom/solenoid_currents: the command has" in capsys.readouterr().out
    )
    assert not any("in tolerance" in str(row) for row in json.loads((tmp_path / "found.json").read_text()).values())
