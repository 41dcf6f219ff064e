"""Cranes of another make, through the front door: what `./boom diagnose` says of recordings that nobody prepared."""

import json
from pathlib import Path

import pytest

from boom_bringup import cli

STRANGERS = Path(__file__).resolve().parents[2] / "shared" / "recordings" / "strangers"
pytestmark = pytest.mark.skipif(not STRANGERS.exists(), reason="no shared/recordings/strangers beside the project")


def test_nothing_is_named_surely_in_a_crane_of_another_make_whose_numbers_explain_its_pressures(tmp_path: Path) -> None:
    bags = [str(STRANGERS / f"stranger_5_{part}") for part in "ab"]
    options = ["--machine", str(STRANGERS / "stranger.yaml"), "--output", str(tmp_path / "answer")]
    assert cli.main(["diagnose", bags[0], "--hold-out", bags[1], *options]) == 0
    document = json.loads((tmp_path / "answer" / "diagnosis.json").read_text())
    assert document["verdict"] in ("parameters_only", "ambiguous")
    assert all(finding["confidence"] < 0.9 for finding in document["findings"][:1])
    held_out = document["fit"]["held_out"]
    for channel in (2, 3):  # hose and rod pressure: nearly what the sensors' noise leaves
        assert held_out["parameters_only"][channel] < 1.5 * held_out["noise_floor"][channel]
