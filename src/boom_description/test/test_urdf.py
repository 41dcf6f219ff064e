"""The shipped URDF is what the machine file says: poses of the tip, gravity, limits, and the file itself."""

from __future__ import annotations

import copy
import math
import xml.etree.ElementTree as ET
from collections.abc import Mapping
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio
import pytest

from boom_description import make_urdf
from boom_description.tip_pose import TipKinematics
from boom_model.errors import MachineError
from boom_model.rigid_body import locked_inertia

POSES = ["T1_T2_folded", "T3_extended", "T4_log"]


@pytest.fixture(scope="module")
def machine() -> Mapping[str, Any]:
    return make_urdf.load_machine()


@pytest.fixture(scope="module")
def urdf() -> str:
    return make_urdf.shipped_urdf()


@pytest.fixture(scope="module")
def crane(urdf: str) -> Any:
    return pinocchio.buildModelFromXML(urdf)


def positions(crane: Any, q2: float, q3: float, q4: float) -> np.ndarray:
    values = {"inner_boom_joint": q2, "outer_boom_joint": q3, "telescope_joint": q4, "telescope_stage_joint": q4 / 2}
    result = pinocchio.neutral(crane)
    for name, value in values.items():
        result[crane.joints[crane.getJointId(name)].idx_q] = value
    return result


def gravity_torque(crane: Any, q: np.ndarray) -> float:
    joint = crane.joints[crane.getJointId("inner_boom_joint")]
    return float(pinocchio.computeGeneralizedGravity(crane, crane.createData(), q)[joint.idx_v])


def test_shipped_file_is_what_the_machine_file_makes(machine: Mapping[str, Any], urdf: str) -> None:
    assert urdf == make_urdf.make_urdf(machine), "run python -m boom_description.make_urdf"


@pytest.mark.parametrize("name", POSES)
def test_tip_agrees_with_the_tabulated_pose(machine: Mapping[str, Any], urdf: str, name: str) -> None:
    pose = machine["rigid_body"]["configs"][name]
    kinematics = TipKinematics(urdf)
    joints = {"slewing_joint": 0.0, "outer_boom_joint": pose["q3"], "telescope_joint": pose["q4"]}
    boom_joint = np.array(machine["rigid_body"]["planar"]["boom_joint"]["value"])
    for q2 in (0.0, 0.7):
        tip = kinematics.pose({**joints, "inner_boom_joint": q2}).position
        turn = np.array([[math.cos(q2), -math.sin(q2)], [math.sin(q2), math.cos(q2)]])
        expected = boom_joint + turn @ np.array(pose["tip"])
        assert tip == pytest.approx([expected[0], 0.0, expected[1]], abs=1e-3)


@pytest.mark.parametrize("name", POSES)
@pytest.mark.parametrize("q2", [-0.5, 0.0, 0.4, 1.0])
def test_gravity_agrees_with_the_locked_body(machine: Mapping[str, Any], crane: Any, name: str, q2: float) -> None:
    pose = machine["rigid_body"]["configs"][name]
    body = locked_inertia(machine["rigid_body"], pose["q3"], pose["q4"])
    expected = 9.81 * (body.Sx * math.cos(q2) - body.Sy * math.sin(q2))
    largest = 9.81 * math.hypot(body.Sx, body.Sy)
    found = gravity_torque(crane, positions(crane, q2, pose["q3"], pose["q4"]))
    assert found == pytest.approx(expected, abs=0.01 * largest)


def test_gravity_agrees_in_every_pose(machine: Mapping[str, Any], crane: Any) -> None:
    # The arm cylinder is shared out between two links, which holds exactly in one pose only.
    for q3 in np.linspace(-0.9, 4.6, 12):
        for q4 in (0.0, 2.0, 4.4):
            body = locked_inertia(machine["rigid_body"], float(q3), q4)
            along = gravity_torque(crane, positions(crane, 0.0, q3, q4)) / 9.81
            across = -gravity_torque(crane, positions(crane, math.pi / 2, q3, q4)) / 9.81
            assert math.hypot(along - body.Sx, across - body.Sy) <= 0.01 * math.hypot(body.Sx, body.Sy)


@pytest.mark.parametrize("name", POSES)
def test_inertia_agrees_with_the_locked_body(machine: Mapping[str, Any], crane: Any, name: str) -> None:
    pose = machine["rigid_body"]["configs"][name]
    joint = crane.joints[crane.getJointId("inner_boom_joint")].idx_v
    matrix = pinocchio.crba(crane, crane.createData(), positions(crane, 0.0, pose["q3"], pose["q4"]))
    # Sharing out the arm cylinder keeps first moments, not inertias.
    assert matrix[joint, joint] == pytest.approx(pose["D0"], rel=0.02)


def test_moving_mass_is_that_of_the_machine_file(machine: Mapping[str, Any], crane: Any) -> None:
    boom = crane.getJointId("inner_boom_joint")
    mass = sum(crane.inertias[i].mass for i in range(boom, crane.njoints))
    assert mass == pytest.approx(machine["rigid_body"]["m_total_moving"]["value"], abs=1.0)


def test_limits_are_those_of_the_machine_file(machine: Mapping[str, Any], urdf: str) -> None:
    limits = TipKinematics(urdf).limits
    table = machine["rigid_body"]["joint_limits"]
    assert limits["slewing_joint"] == tuple(table["q1"])
    assert limits["inner_boom_joint"] == tuple(table["q2"])
    assert limits["outer_boom_joint"] == tuple(table["q3"])
    assert limits["telescope_joint"] == tuple(2 * value for value in table["q4_per_stage"])


def test_positive_angle_lifts_and_telescope_moves_outward(urdf: str) -> None:
    kinematics = TipKinematics(urdf)
    level = {"slewing_joint": 0.0, "inner_boom_joint": 0.0, "outer_boom_joint": math.pi / 2, "telescope_joint": 0.0}
    start = kinematics.pose(level)
    assert start.quaternion == pytest.approx([0.0, 0.0, 0.0, 1.0], abs=1e-6), "x outward, z up where the arm is in line"
    for name in ("inner_boom_joint", "outer_boom_joint"):
        assert kinematics.pose({**level, name: level[name] + 0.1}).position[2] > start.position[2]
    assert kinematics.pose({**level, "telescope_joint": 1.5}).position - start.position == pytest.approx(
        [1.5, 0, 0], abs=1e-6
    )
    assert kinematics.pose({**level, "slewing_joint": 0.1}).position[1] > 0.0


def test_stages_extend_by_half_each(urdf: str) -> None:
    joints = {joint.get("name"): joint for joint in ET.fromstring(urdf).findall("joint")}
    mimic = joints["telescope_stage_joint"].find("mimic")
    assert mimic is not None
    assert (mimic.get("joint"), mimic.get("multiplier")) == ("telescope_joint", "0.5")


def test_inertias_are_physical(urdf: str) -> None:
    for element in ET.fromstring(urdf).iter("inertia"):
        xx, xy, xz, yy, yz, zz = (float(element.attrib[key]) for key in ("ixx", "ixy", "ixz", "iyy", "iyz", "izz"))
        low, middle, high = np.linalg.eigvalsh([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        assert low > 0.0
        assert low + middle >= high * 0.999


def test_comment_says_that_the_identity_is_inferred(urdf: str) -> None:
    assert "inferred" in urdf
    assert "not stated" in urdf


def test_machine_without_planar_data_is_refused(machine: Mapping[str, Any]) -> None:
    other = copy.deepcopy(dict(machine))
    del other["rigid_body"]["planar"]
    with pytest.raises(MachineError, match=r"rigid_body\.planar"):
        make_urdf.make_urdf(other)


def test_command_writes_the_file_and_refuses_a_bad_machine(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], urdf: str
) -> None:
    out = tmp_path / "crane.urdf"
    assert make_urdf.main(["--output", str(out)]) == 0
    assert out.read_text(encoding="utf-8") == urdf
    capsys.readouterr()
    bad = tmp_path / "machine.yaml"
    bad.write_text("rigid_body: [unclosed", encoding="utf-8")
    assert make_urdf.main(["--machine", str(bad), "--output", str(out)]) == 2
    assert len(capsys.readouterr().err.splitlines()) == 1


def test_collision_shapes_touch_their_neighbours_alone_in_a_level_pose(urdf: str) -> None:
    model = pinocchio.buildModelFromXML(urdf)
    shapes = pinocchio.buildGeomFromUrdfString(model, urdf, pinocchio.GeometryType.COLLISION)
    assert {shape.name.rsplit("_", 1)[0] for shape in shapes.geometryObjects} == {
        "base_link", "column", "inner_boom", "outer_boom", "telescope_1", "telescope_2", "gripper"
    }  # fmt: skip
    shapes.addAllCollisionPairs()
    values = {
        "inner_boom_joint": 0.3,
        "outer_boom_joint": math.pi / 2,
        "telescope_joint": 2.0,
        "telescope_stage_joint": 1.0,
    }
    at = np.array([values.get(name, 0.0 if name != "gripper_hinge_joint" else -0.3) for name in list(model.names)[1:]])
    data, found = model.createData(), shapes.createData()
    pinocchio.computeCollisions(model, data, shapes, found, at, False)
    names = [shape.name.rsplit("_", 1)[0] for shape in shapes.geometryObjects]
    touching = {
        frozenset((names[pair.first], names[pair.second]))
        for pair, result in zip(shapes.collisionPairs, found.collisionResults, strict=True)
        if result.isCollision()
    }
    order = ["base_link", "column", "inner_boom", "outer_boom", "telescope_1", "telescope_2", "gripper"]
    assert {pair for pair in touching if len(pair) == 2} <= {
        *(frozenset(pair) for pair in pairwise(order)), frozenset(("outer_boom", "telescope_2"))
    }  # fmt: skip
