"""A component more is one file more: a linkage, a spool and a metering valve, each dropped into a copy of the model."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from importlib import resources
from pathlib import Path
from typing import Any

import pytest
import yaml

ROOT = Path(__file__).parents[1]

RACK = '''"""A straight rod with a rack that turns a pinion on the boom's axis."""

from boom_model.slots import Linkage, register
from boom_model.specification import Specification

register(
    Linkage(
        name="rack",
        meaning="rack and pinion",
        term="s_p = r (q_2 - q_0)",
        specifications=(
            Specification("kinematics.r", "r", "m", "radius of the pinion", 1e-2, 10.0, "-"),
            Specification("kinematics.q_0", "q_0", "rad", "angle at s_p = 0", -3.2, 3.2, "-"),
        ),
        piston_position=lambda angle, p: p.kinematics.r * (angle - p.kinematics.q_0),
    )
)
'''
SERVO = '''"""A spool with position control of its own, of second order."""

from boom_model.slots import Spool, register
from boom_model.specification import Specification


def motion(w, position, force):
    s = w.p.main_valve_spool
    speed = w.add("servo_speed", "v_s", "m/s", 0.1, -10.0, 10.0)
    w.rates["spool_position"] = speed
    wanted = s.K_i * (w.u[0] - w.u[1])
    w.rates["servo_speed"] = s.omega**2 * (wanted - position) - 2 * s.omega * speed


register(
    Spool(
        name="servo",
        meaning="position control in the valve",
        term="s_s'' = omega^2 (K_i (i_+ - i_-) - s_s) - 2 omega s_s'",
        specifications=(
            Specification("main_valve_spool.s_max", "s_s^max", "m", "full stroke to either side", 1e-4, 0.1, "-"),
            Specification("main_valve_spool.K_i", "K_i", "m/A", "spool position per current", 1e-5, 1.0, "-"),
            Specification("main_valve_spool.omega", "omega", "rad/s", "bandwidth", 1.0, 1e4, "-"),
        ),
        motion=motion,
        position=lambda retract, extend, p, pilot: p.main_valve_spool.K_i * (retract - extend),
        current=lambda position, p, pilot: position / p.main_valve_spool.K_i,
        settling=lambda p, e, pilot: 2.0 / p.main_valve_spool.omega,
    )
)
'''
EDGES = '''"""Four edges that open in proportion to the spool, those of port a earlier or later than those of port b."""

import casadi as ca

from boom_model.components.main_valve_orifices import behind_throttle
from boom_model.regularisation import signed_sqrt
from boom_model.slots import Metering, ValveFlows, register
from boom_model.specification import Specification

NAMES = ("x_a", "x_b", "A_a", "A_b")


def overlap(position, p, e):
    return ca.fmin(p.main_valve_orifices.x_a, p.main_valve_orifices.x_b)


def edges(position, p):
    o, x = p.main_valve_orifices, ca.fabs(position) / p.main_valve_spool.s_max
    return tuple(area * ca.fmin(ca.fmax((x - x_0) / (1 - x_0), 0.0), 1.0) for area, x_0 in ((o.A_a, o.x_a), (o.A_b, o.x_b)))


def areas(position, p, e):
    a, b = edges(position, p)
    return ca.if_else(position < 0, a, b), ca.if_else(position < 0, b, a)


def flows(position, hose, rod, p, e, supply, cushions):
    gain, extend = p.fluid.C_d * ca.sqrt(2 / p.fluid.rho), position < 0
    inlet, outlet = areas(position, p, e)
    outlet = behind_throttle(outlet, p.main_valve_orifices.A_b, ca.if_else(extend, *cushions))
    into = gain * inlet * supply.root(ca.if_else(extend, hose, rod), p)
    out = gain * outlet * signed_sqrt(ca.if_else(extend, rod, hose) - p.fluid.p_t)
    return ValveFlows(head=ca.if_else(extend, into, -out), rod=ca.if_else(extend, -out, into), force=0.0)


register(
    Metering(
        name="overlap_of_each_side",
        meaning="ports with overlaps of their own",
        term="A = A_max (x - x_0) / (1 - x_0)",
        specifications=(
            Specification("main_valve_orifices.x_a", "x_a", "-", "overlap, port a", 0.0, 0.9, "-"),
            Specification("main_valve_orifices.x_b", "x_b", "-", "overlap, port b", 0.0, 0.9, "-"),
            Specification("main_valve_orifices.A_a", "A_a", "m^2", "largest area, port a", 1e-8, 1e-2, "-"),
            Specification("main_valve_orifices.A_b", "A_b", "m^2", "largest area, port b", 1e-8, 1e-2, "-"),
        ),
        flows=flows,
        areas=areas,
        overlap=overlap,
        largest_opening=1.0,
    )
)
'''
SCRIPT = """
import json, sys
from pathlib import Path
from boom_bringup import cli
from boom_model import theory
from boom_model.components import __path__ as folder
assert cli.main(["simulate", "steps.csv", "--machine", "machine.yaml", "--output", "bag", "--duration", "3"]) == 0
assert cli.main(["validate", "bag", "--machine", "machine.yaml", "--json", "validated.json", "--no-report"]) == 0
assert cli.main(["validate", "bag", "--machine", "tz17", "--json", "tz17.json", "--no-report"]) == 0
tables = {name: make() for name, make in theory.TABLES.items()}
Path("told.json").write_text(json.dumps({"folder": list(folder), "tables": tables}))
sys.exit(cli.main(["check-machine", "lacking.yaml"]))
"""


def number(value: float, unit: str) -> dict[str, Any]:
    return {"value": value, "unit": unit, "prov": "assumed"}


def tz17(section: str, new: dict[str, Any], kept: tuple[str, ...] = ()) -> dict[str, Any]:
    """The machine file of tz17 with one section anew; ``kept``: keys of it that stay."""
    text = (resources.files("boom_model") / "machines" / "tz17.yaml").read_text(encoding="utf-8")
    document: dict[str, Any] = yaml.safe_load(text)
    document[section] = {key: document[section][key] for key in kept} | new
    return document


LINKAGE = tz17(
    "kinematics", {"type": "rack", "r": number(0.36, "m"), "q_0": number(-1.06, "rad")}, ("q2_stroke_min", "q2_max")
)
del LINKAGE["cylinder"]["l_min"]
SPOOL = tz17(
    "main_valve_spool",
    {"type": "servo", "s_max": number(9e-3, "m"), "K_i": number(0.018, "m/A"), "omega": number(60.0, "rad/s")},
) | {"pilot_valves": {"type": "none"}}
METERING = tz17(
    "main_valve_orifices",
    {
        "type": "overlap_of_each_side", "x_a": number(0.25, "-"), "x_b": number(0.3, "-"), "A_a": number(6e-5, "m^2"),
        "A_b": number(4e-5, "m^2"),
    },
    ("dp_c", "anti_cavitation"),
)  # fmt: skip


@pytest.mark.parametrize(
    ("name", "source", "document", "lacking", "row"),
    [
        ("rack_linkage", RACK, LINKAGE, "kinematics.r", "| `kinematics.type: rack` | - | `s_p = r (q_2 - q_0)` |"),
        ("servo_spool", SERVO, SPOOL, "main_valve_spool.omega", "| v_s | state `servo_speed` | m/s |"),
        ("edges", EDGES, METERING, "main_valve_orifices.x_b", "`A = A_max (x - x_0) / (1 - x_0)`"),
    ],
    ids=["linkage", "spool", "metering"],
)
def test_a_component_in_one_new_file_is_checked_simulated_validated_and_documented(
    tmp_path: Path, name: str, source: str, document: dict[str, Any], lacking: str, row: str
) -> None:
    package = tmp_path / "boom_model"
    for part in ("boom_model", "boom_input"):
        folder = ROOT / "src" / "boom_model" / part
        shutil.copytree(folder, package / part, ignore=shutil.ignore_patterns("__pycache__"))
    (package / "boom_model" / "components" / f"{name}.py").write_text(source)
    (tmp_path / "machine.yaml").write_text(yaml.safe_dump(document))
    section, key = lacking.split(".")
    poor = document | {section: {k: v for k, v in document[section].items() if k != key}}
    (tmp_path / "lacking.yaml").write_text(yaml.safe_dump(poor))
    (tmp_path / "steps.csv").write_text("time_s,retract_a,extend_a\n0,0,0\n0.5,0,0.42\n1.5,0,0\n2.0,0.42,0\n2.6,0,0\n")
    path = os.pathsep.join(filter(None, (str(package), os.environ.get("PYTHONPATH"))))
    ended = subprocess.run(
        [sys.executable, "-c", SCRIPT], cwd=tmp_path, env=os.environ | {"PYTHONPATH": path}, capture_output=True,
        text=True, check=False, timeout=60,
    )  # fmt: skip
    assert ended.returncode == 2, ended.stderr
    assert f"{lacking}: missing" in ended.stderr
    told = json.loads((tmp_path / "told.json").read_text())
    assert told["folder"] == [str(package / "boom_model" / "components")]
    assert row in "\n".join(told["tables"].values())
    assert f"| `{lacking}` |" in told["tables"]["symbols"]
    own, other = (
        json.loads((tmp_path / f"{name}.json").read_text())["bags"][0]["full"] for name in ("validated", "tz17")
    )
    assert own["angle_mae_rad"] < 5e-4 < 2e-3 < other["angle_mae_rad"]
    assert own["hose_pressure_rmse_pa"] < 5e4
