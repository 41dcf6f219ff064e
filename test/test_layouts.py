"""The layouts for Foxglove, PlotJuggler, RViz and rerun show what the topics hold; rerun's is opened where rerun is installed."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from pathlib import Path
from xml.etree import ElementTree

import pytest
import yaml

from boom_input.channels import CHANNELS
from boom_recording.channels import TYPES

ROOT = Path(__file__).resolve().parents[1]
LAYOUTS = ROOT / "layouts"
FIELDS = {f"{channel.topic}/{channel.field}" for channel in CHANNELS}
SHOWN_IN_3D = {"/robot_description", "/boom/tip_pose", "/perception/points"}


def test_foxglove_plots_channels_and_moves_the_crane_by_its_joints():
    layout = json.loads((LAYOUTS / "foxglove.json").read_text())
    placed = re.findall(r"[A-Z0-9]\w*![a-z0-9]+", json.dumps(layout["layout"]))
    assert sorted(placed) == sorted(layout["configById"])
    panels = layout["configById"].values()
    paths = [series["value"] for panel in panels for series in panel.get("paths", ())]
    assert {path.replace("[:]", "").replace(".", "/") for path in paths} <= FIELDS and len(paths) > 8
    (crane,) = (panel for panel in panels if "topics" in panel)
    assert set(crane["topics"]) == SHOWN_IN_3D
    assert crane["topics"]["/robot_description"]["jointStatesTopic"] in TYPES


def test_plotjuggler_plots_channels():
    curves = [e.get("name", "") for e in ElementTree.parse(LAYOUTS / "plotjuggler.xml").iter("curve")]
    joined = {curve.replace("/inner_boom_joint/", "/") for curve in curves}  # it writes the joint before the list
    assert joined <= FIELDS and len(curves) > 8


def test_rviz_asks_for_no_stronger_qos_than_is_offered():
    displays = yaml.safe_load((LAYOUTS / "boom.rviz").read_text())["Visualization Manager"]["Displays"]
    topics = {t["Value"]: t for d in displays for t in (d.get("Topic"), d.get("Description Topic")) if t}
    assert set(topics) == SHOWN_IN_3D
    for name, topic in topics.items():
        latched = name == "/robot_description"
        assert topic["Durability Policy"] == ("Transient Local" if latched else "Volatile")
        assert topic["Reliability Policy"] == ("Reliable" if latched else "Best Effort")


def test_rerun_gets_the_crane_moving_and_every_signal(tmp_path):
    pytest.importorskip("rerun")
    made = tmp_path / "bag.rrd"
    words = [sys.executable, LAYOUTS / "rerun_bag.py", ROOT / "bags/healthy/extended_log", "--output", made]
    subprocess.run(words, check=True, timeout=300)
    rerun = Path(sys.executable).with_name("rerun")
    said = subprocess.run([rerun, "rrd", "print", made], capture_output=True, text=True, check=True).stdout
    for path in (
        "angle/angle",
        "rate/rate",
        "pressure/hose_pressure",
        "pressure/rod_pressure",
        "current/extend_current",
    ):
        assert re.search(rf"6000 rows .* - /{path} ", said), path
    assert re.search(r"6000 rows .* - /joints/inner_boom_joint .*Transform3D", said)
