"""A control law is added by one file: it is chosen by its name, tuned by parameters of the node, and listed in the help."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]

LAW = '''
"""Current in proportion to the angle error, beyond what opens the valve."""

from dataclasses import dataclass

from boom_controller.settings import LawSettings, tunable
from boom_controller.types import ControlOutput

LAWS = {"proportional": "the current in proportion to the angle error"}


@dataclass(frozen=True)
class ProportionalSettings(LawSettings):
    """One gain."""

    proportional_gain: float = tunable(4.0, "A/rad", 0.1, 20.0, "current over angle error, proportional")
    opening_current: float = tunable(0.24, "A", 0.0, 0.5, "current from which the valve opens, proportional")


SETTINGS = ProportionalSettings


class Proportional:
    """u = gain (q* - q) + opening, on the solenoid that reduces the error."""

    mode = "proportional"

    def __init__(self, settings):
        self.change(settings)

    def reset(self, measurement):
        """Nothing is remembered."""

    def change(self, settings):
        """Other settings."""
        self._settings = settings

    def step(self, reference, measurement):
        """One sample time."""
        s, error = self._settings, reference.angle - measurement.angle
        current = min(s.opening_current + s.proportional_gain * abs(error), s.largest_current)
        return ControlOutput(0.0, current, error) if error > 0 else ControlOutput(current, 0.0, error)


def make(name, machine, pose, settings):
    """See boom_controller.laws."""
    return Proportional(settings)
'''

PROGRAM = """
import contextlib, io, json, sys

from boom_bringup import cli

out, bag = sys.argv[1:]

def said(*words):
    with contextlib.redirect_stdout(io.StringIO()) as text, contextlib.suppress(SystemExit):
        cli.main(list(words))
    return text.getvalue()

helps = {name: said(name, "--help") for name in ("simulate", "sim", "demo", "robustness")}
tracked = said("simulate", bag, "--reference", "--mode", "proportional", "--duration", "12", "--output", out)

import rclpy
from boom_controller import laws
from boom_controller.controller_node import ControllerNode

rclpy.init(args=["--ros-args", "-p", "mode:=proportional", "-p", "opening_current:=0.3"])
node = ControllerNode()
try:
    gain = node.describe_parameter("proportional_gain")
    limits = gain.floating_point_range[0]
    values = {name: node.get_parameter(name).value for name in ("mode", "proportional_gain", "opening_current")}
    told = {"description": gain.description, "range": [limits.from_value, limits.to_value], "values": values}
    refused = node.set_parameters([rclpy.parameter.Parameter("proportional_gain", value=21.0)])[0]
    told["refused"] = "" if refused.successful else refused.reason
finally:
    node.close()
    node.destroy_node()
    rclpy.try_shutdown()
json.dump({"helps": helps, "tracked": tracked, "parameter": told, "laws": laws.described()}, sys.stdout)
"""


def test_one_new_file_is_a_control_law_that_follows_is_tuned_and_is_listed(tmp_path: Path) -> None:
    copy = tmp_path / "src" / "boom_controller"
    shutil.copytree(ROOT / "src/boom_controller/boom_controller", copy, ignore=shutil.ignore_patterns("__pycache__"))
    (copy / "laws" / "proportional.py").write_text(LAW, encoding="utf-8")
    bag = ROOT / "bags" / "healthy" / "extended"
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM, str(tmp_path / "followed"), str(bag)],
        env=os.environ | {"PYTHONPATH": str(copy.parent)}, capture_output=True, text=True, check=False, timeout=60,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout.splitlines()[-1])

    assert list(found["laws"]) == ["thesis", "baseline", "improved", "proportional", "simple"]
    assert all("proportional" in text for text in found["helps"].values())
    mean_mm = float(found["tracked"].split("error: mean ")[1].split(" mm")[0])
    assert mean_mm < 15.0  # a boom that stands still is 90 mm away
    parameter = found["parameter"]
    assert parameter["description"] == "current over angle error, proportional [A/rad], 0.1 to 20 A/rad"
    assert parameter["range"] == [0.1, 20.0]
    assert parameter["values"] == {"mode": "proportional", "proportional_gain": 4.0, "opening_current": 0.3}
    assert "out of range" in parameter["refused"]
