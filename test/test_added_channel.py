"""A measured channel is added in two files: its row in the table of channels, and the message of its topic."""

from __future__ import annotations

import dataclasses
import filecmp
import json
import os
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from boom_identification.validation import validate
from boom_input.channels import PREDICTED
from boom_model.machine_file import load_machine
from boom_recording import recorder
from boom_recording.loading import load

ROOT = Path(__file__).parents[1]
BAG = ROOT / "bags" / "healthy" / "folded_fast"
EDITED = ("boom_model", "boom_recording")  # what the two files are in; all else is imported from where it is
TOUCHED = {
    "boom_model/boom_input/channels.py": (
        '    _pressure("rod_pressure", "p_b"),\n',
        '    _pressure("brake_pressure", "p_z", predicted=False, required=False),\n',
    ),
    "boom_recording/boom_recording/channels.py": (
        '    "/boom/rod_pressure": "sensor_msgs/msg/FluidPressure",\n',
        '    "/boom/brake_pressure": "sensor_msgs/msg/FluidPressure",\n',
    ),
}
USE = """
import json, sys
from pathlib import Path
import numpy as np
from boom_can_bridge.mapping import OPTIONAL_FIELDS
from boom_diagnosis import proof
from boom_diagnosis.document import STAGES, BagResult
from boom_identification.validation import validate
from boom_input.channels import PREDICTED
from boom_model.machine_file import load_machine
from boom_recording import loading, recorder, writing
from boom_report.diagnosis import figure as diagnosis
from boom_report.validation.figure import figure

bag, folder = Path(sys.argv[1]), Path(sys.argv[2])
machine, plain = load_machine("tz17"), loading.load(bag)
values = 200e5 + 1e5 * np.sin(np.arange(6000) * 0.3)
values[1000:1010] = 900e5
configuration = plain.configuration
made = writing.from_columns("made", np.arange(6000) * 0.01, {"brake_pressure": values}, configuration, start_ns=plain.start_ns)
both = loading.load(bag)
both.signals |= made.signals
writing.write(folder / "both", both)
loaded = loading.load(folder / "both")
brake = loaded.signals["brake_pressure"]
seen = validate(loaded, machine)
channels = proof._channels(loaded, machine, 0, {stage: proof.Driven([seen.full], []) for stage in STAGES})
diagnosed = BagResult("both", False, None, loaded.duration, (), channels, (), np.zeros(0), {}, np.zeros(0, np.int64))

def lines(chart):
    return [trace["name"] for trace in chart["data"] if trace.get("yaxis") == "y9"]

print(json.dumps({
    "topics": [t for t in recorder.DEFAULT_TOPICS if "brake" in t],
    "type": recorder.offered("/boom/brake_pressure", [recorder.Publisher("std_msgs/msg/Float64", "", None)])[1],
    "can": [name for name in OPTIONAL_FIELDS if "brake" in name], "unit": brake.unit,
    "median": float(np.median(brake.values)), "masked": int((~brake.valid).sum()),
    "events": [(e.kind, e.count, e.detail) for e in loaded.events if e.topic == "/boom/brake_pressure"],
    "with": seen.document(), "without": validate(plain, machine).document(),
    "panels": [a["text"] for a in figure(seen)["layout"]["annotations"] if a["text"].startswith("<b>")],
    "lines": [lines(figure(seen)), lines(diagnosis.figure(diagnosed))],
}))
"""


@pytest.fixture(scope="module")
def used(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """What the copy of the tree with the added channel makes of a recording with it, and of one without."""
    folder = tmp_path_factory.mktemp("tree")
    for package in EDITED:
        shutil.copytree(ROOT / "src" / package, folder / package, ignore=shutil.ignore_patterns("test", "__pycache__"))
    for name, (anchor, row) in TOUCHED.items():
        text = (folder / name).read_text("utf-8")
        assert text.count(anchor) == 1
        (folder / name).write_text(text.replace(anchor, anchor + row), "utf-8")
    changed = {
        str(p.relative_to(folder))
        for p in folder.rglob("*.py")
        if not filecmp.cmp(p, ROOT / "src" / p.relative_to(folder), False)
    }
    assert changed == set(TOUCHED)
    path = os.pathsep.join(str(folder / package) for package in EDITED)
    command = [sys.executable, "-c", USE, str(BAG), str(folder)]
    environment = os.environ | {"PYTHONPATH": path}
    result = subprocess.run(command, env=environment, capture_output=True, text=True, check=False, timeout=60)
    assert result.returncode == 0, result.stderr
    found: dict[str, Any] = json.loads(result.stdout)
    return found


def test_it_is_recorded_where_it_is_published_and_may_come_over_can(used: dict[str, Any]) -> None:
    assert used["topics"] == ["/boom/brake_pressure"]
    assert used["type"].endswith("has to be sensor_msgs/msg/FluidPressure")
    assert used["can"][0] == "brake_pressure"


def test_it_is_written_and_loaded_with_its_unit_and_its_range(used: dict[str, Any]) -> None:
    assert used["unit"] == "Pa"
    assert used["median"] == pytest.approx(200e5, rel=0.01)  # gauge, as it was before the way through the absolute one
    assert used["masked"] == 10
    assert [event[:2] for event in used["events"]] == [["out_of_range", 10]]
    assert "brake_pressure reads 9e+07 Pa" in used["events"][0][2]


def test_it_is_drawn_beside_the_others_and_compared_with_nothing(used: dict[str, Any]) -> None:
    assert "<b>Brake pressure</b> p<sub>z</sub> [bar]" in used["panels"]
    assert used["lines"] == [["measured"], ["measured"]]  # in a validation's report, and in a diagnosis'
    assert used["with"]["full"] == used["without"]["full"]
    assert used["with"]["agrees"]


def test_recordings_without_it_are_as_good_as_before(used: dict[str, Any]) -> None:
    assert "/boom/brake_pressure" not in recorder.DEFAULT_TOPICS  # here, where the table does not have it
    before = validate(load(BAG), load_machine("tz17")).document()
    assert used["without"] == json.loads(json.dumps(before))


def test_what_the_model_predicts_cannot_be_optional() -> None:
    with pytest.raises(ValueError, match="rod_pressure: what the model predicts"):
        dataclasses.replace(PREDICTED[-1], required=False)
