"""An effect without state is two files: its own in the catalogue, its concealed form. Nothing above names effects."""

import ast
import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from boom_model.catalogue import EFFECTS

SOURCES = Path(__file__).resolve().parents[1] / "src"

EFFECT = '''
"""The hoses that cross the boom joint pull it back to where they were laid: a torsion spring."""

from boom_model.catalogue.effect import Effect, parameter

EFFECT = Effect(
    "hose_bundle", "structure", "5.39a", "g += k (q_2 - q_0)",
    ("the hose bundle across the joint", "pulls the boom back"), "the same angle, in both directions",
    (
        parameter("k", "N m/rad", 0.0, (500.0, 8000.0), (0.0, 1e5), "stiffness"),
        parameter("q_0", "rad", 0.5, (0.0, 1.0), (-2.0, 2.0), "angle at which it was laid", starts=(0.2, 0.8)),
    ),
    {"gravity_torque": lambda torque, own, at: torque + own.k * (at.angle - own.q_0)},
)
'''

CONCEALED = '''
"""The hose bundle: the concealed form."""

from concealed_plant.hidden import Array, Hidden, Scene, conceals, within


@conceals("hose_bundle", "structure", "N m/rad", (50.0, 2e4), "pulls up only, and damps")
def hose_bundle(size: float, r: Array, scene: Scene) -> Hidden:
    """A stiff bundle that was laid with the boom up."""
    return Hidden({"rest_angle": within(r[0], 1.6, 2.0), "rest_stiffness": size})
'''

ASKED = """
import json, sys
from types import SimpleNamespace
import numpy as np
import yaml
from boom_diagnosis.coordinates import all_coordinates, starts
from boom_diagnosis.document import Estimate, Finding
from boom_diagnosis.search import possible_effects
from boom_model import theory
from boom_model.catalogue import EFFECTS
from boom_model.equations import full_model
from boom_model.machine_file import load_machine
from boom_model.plant import Plant
from boom_monitor.model import switched_on
from boom_report.diagnosis.words import statement
from concealed_plant.concealments import CONCEALMENTS, KNOWN
from concealed_plant.quantities import Quantities

machine = load_machine(sys.argv[1])
pose = machine.pose(0.28, 2.2)
nominal = machine.with_effects({})
time, start = np.arange(0.0, 2.0, 0.01), Plant(nominal, pose).equilibrium(0.3)
angles = [Plant(m, pose).run(time, np.zeros((200, 2)), time, start).output("angle")[-1] for m in (machine, nominal)]
estimate = Estimate(4000.0, "N m/rad", (3000.0, 5000.0))
finding = Finding("hose_bundle", "structure", "5.39a", 0.97, {"k": estimate}, "", (), (), "")
concealment = CONCEALMENTS["hose_bundle"]
hidden = concealment.build(4000.0, [0.5] * 5, None)
print(json.dumps({
    "effects": {name: dict(values) for name, values in machine.effects.items()},
    "moved": angles[0] - angles[1],
    "candidate": "hose_bundle" in possible_effects(nominal.structure.has),
    "coordinates": [c.name for c in all_coordinates(["hose_bundle"])],
    "starts": starts(EFFECTS["hose_bundle"], 60.0),
    "watched": "hose_bundle" in switched_on(nominal),
    "statement": statement(finding),
    "documented": "| `hose_bundle` | `structure` |" in theory.effects_table(),
    "concealed": "hose_bundle" in KNOWN and set(hidden.changes) <= set(Quantities._fields),
    "place": list(EFFECTS).index("hose_bundle") - list(EFFECTS).index("telescope_creep"),
}))
"""


@pytest.fixture(scope="module")
def grown(tmp_path_factory):
    """What the tree says with two more files in it, and nothing else changed."""
    tree = tmp_path_factory.mktemp("tree")
    for package in sorted(SOURCES.iterdir()):
        shutil.copytree(package, tree / package.name, ignore=shutil.ignore_patterns("test", "__pycache__"))
    (tree / "boom_model" / "boom_model" / "catalogue" / "hose_bundle.py").write_text(EFFECT)
    (tree / "concealed_plant" / "concealed_plant" / "conceal_hose_bundle.py").write_text(CONCEALED)
    machine = tree / "machine.yaml"
    nominal = (SOURCES / "boom_model" / "boom_model" / "machines" / "tz17.yaml").read_text(encoding="utf-8")
    machine.write_text(nominal + "\neffects: {hose_bundle: {k: 4000.0, q_0: 0.8}}\n", encoding="utf-8")
    path = os.pathsep.join(str(tree / package.name) for package in sorted(SOURCES.iterdir()))
    done = subprocess.run(
        [sys.executable, "-c", ASKED, str(machine)],
        env={**os.environ, "PYTHONPATH": path},
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def test_a_machine_file_takes_the_new_effect(grown):
    assert grown["effects"] == {"hose_bundle": {"k": 4000.0, "q_0": 0.8}}


def test_a_simulation_shows_the_new_effect(grown):
    assert grown["moved"] > 1e-4  # towards where it was laid


def test_the_diagnosis_tries_the_new_effect_from_its_starts(grown):
    assert grown["candidate"]
    assert grown["coordinates"] == ["effects.hose_bundle.k", "effects.hose_bundle.q_0"]
    assert [start["effects.hose_bundle.q_0"] for start in grown["starts"]] == [0.2, 0.8]
    assert {start["effects.hose_bundle.k"] for start in grown["starts"]} == {0.35 * 8000.0}


def test_the_watch_suspects_the_new_effect(grown):
    assert grown["watched"]


def test_the_report_has_words_for_the_new_effect(grown):
    assert grown["statement"] == (
        "Almost certainly the hose bundle across the joint pulls the boom back: k = 4.0 kN m/rad "
        "(90 % interval 3.0 to 5.0 kN m/rad) (confidence 0.97)."
    )


def test_documentation_and_concealed_plant_have_the_new_effect_last_of_its_subsystem(grown):
    assert grown["documented"] and grown["concealed"]
    assert grown["place"] == 1


def named(text):
    """Whether a text is the id of an effect, alone or with what stands before and behind it in a dotted name."""
    return bool(re.fullmatch(rf"(effects\.)?({'|'.join(EFFECTS)})(\..*)?", text))


def knows_the_model(path):
    return any(word in path.read_text(encoding="utf-8") for word in ("boom_model", "boom_diagnosis", "boom_estimation"))


def test_no_package_above_the_model_names_an_effect():
    own = ("boom_model", "concealed_plant")
    files = [
        f for f in SOURCES.glob("*/*/**/*.py") if f.relative_to(SOURCES).parts[0] not in own and "test" not in f.parts
    ]
    assert len(files) > 200
    found = [
        f"{path.relative_to(SOURCES)}:{node.lineno}: {node.value}"
        for path in filter(knows_the_model, files)
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and named(node.value)
    ]
    assert found == []
