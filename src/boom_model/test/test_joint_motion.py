"""What the motion of the other joints does to the boom, against pinocchio's recursive Newton-Euler of the whole crane in space."""

from __future__ import annotations

import copy
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from boom_model import joint_motion
from boom_model.component_numbers import component_parameters
from boom_model.components import equation_of_motion
from boom_model.errors import MachineError
from boom_model.machine import Machine
from boom_model.machine_file import load_machine
from boom_model.rigid_body import hanging_mass, link_data, locked_inertia, vector

Vector = NDArray[np.float64]

POSE = (0.28, 2.2)
LOAD = 250.0


@pytest.fixture(scope="module")
def crane() -> Machine:
    return load_machine("tz17")


def _torque(crane: Machine, body: dict[str, Any], q2: float, w: float, joints: tuple[Vector, ...]) -> float:
    """g less the joints' torque [N m]: what the bodies ask for with q_2'' = 0; ``joints``: positions, velocities, accelerations."""
    u = joint_motion.inputs({"rigid_body": body}, POSE, *(part[None, :] for part in joints))[0]
    p, e = component_parameters(crane, crane.pose(*POSE, LOAD))
    locked = locked_inertia(body, *POSE)
    p.pose.D0, p.pose.Sx, p.pose.Sy, p.pose.tip = locked.D0, locked.Sx, locked.Sy, locked.tip
    moved = joint_motion.apply(p, u)
    return float(equation_of_motion.gravity_torque(q2, LOAD, p, e) - joint_motion.torque(moved, q2, w, LOAD, p))


def _in_space(body: dict[str, Any]) -> Any:
    """Slewing, boom, outer boom and two stages of the telescope as a chain in space; x out, z up, tip and load as a point."""
    pin = pytest.importorskip("pinocchio")
    planar, links = body["planar"], body["links"]
    model = pin.Model()

    def at(x: float, z: float) -> Any:
        return pin.SE3(np.eye(3), np.array([x, 0.0, z]))

    boom_joint = vector(planar["boom_joint"]["value"], "boom_joint", 2)
    slewing = model.addJoint(0, pin.JointModelRZ(), pin.SE3.Identity(), "slewing")
    # a rotation about -y lifts
    boom = model.addJoint(slewing, pin.JointModelRevoluteUnaligned(0.0, -1.0, 0.0), at(*boom_joint), "boom")
    elbow = vector(planar["elbow"]["value"], "elbow", 2)
    arm = model.addJoint(boom, pin.JointModelRevoluteUnaligned(0.0, -1.0, 0.0), at(*elbow), "arm")
    first = model.addJoint(arm, pin.JointModelPrismaticUnaligned(0.0, 0.0, -1.0), pin.SE3.Identity(), "stage_1")
    second = model.addJoint(arm, pin.JointModelPrismaticUnaligned(0.0, 0.0, -1.0), pin.SE3.Identity(), "stage_2")
    origin = vector(planar["arm_origin"]["value"], "arm_origin", 2)
    joints = {"inner_boom": boom, "outer_boom": arm, "telescope_1": first, "telescope_2": second}
    for name, joint in joints.items():
        item = planar["bodies"][name]
        mass, center, inertia = link_data(links, name)
        x_axis, y_axis = (
            (-1.0 if word.startswith("-") else 1.0) * np.eye(3)["xyz".index(word.removeprefix("-"))]
            for word in item["axes"]
        )
        # rows: the link's axes along the carrier's x and up; across is what is left
        up = y_axis if item["carrier"] == "boom" else -y_axis
        turn = np.array([x_axis, np.cross(up, x_axis), up])
        place = np.array(item["origin"], dtype=float)
        place = place if item["carrier"] == "boom" else origin + np.array([place[0], -place[1]])
        com = turn @ center
        com[1] = 0.0  # the model's bodies lie in the plane
        own = pin.Inertia(mass, np.zeros(3), turn @ inertia @ turn.T)
        model.appendBodyToJoint(joint, own, pin.SE3(np.eye(3), np.array([place[0], 0.0, place[1]]) + com))
    tip = planar["tip"]["origin"]
    point = pin.Inertia(hanging_mass(body) + LOAD, np.zeros(3), np.zeros((3, 3)))
    model.appendBodyToJoint(second, point, at(origin[0] + tip[0], origin[1] - tip[1]))
    return pin, model


def test_torque_is_that_of_the_whole_crane_in_space(crane: Machine) -> None:
    body = copy.deepcopy(dict(crane.document["rigid_body"]))
    for part in ("barrels", "rods"):  # a closed loop, which a chain of joints does not have
        body["planar"]["arm_cylinder"][part] |= {"m": 0.0, "I": 0.0}
    pin, model = _in_space(body)
    model.gravity.linear = np.array([0.0, 0.0, -9.81])
    data, rng = model.createData(), np.random.default_rng(0)
    for _ in range(20):
        q2, w = rng.uniform(-0.5, 1.2), rng.uniform(-0.5, 0.5)
        q, v, a = (np.array(part) for part in (
            (rng.uniform(0.0, 4.0), rng.uniform(0.0, 4.0), rng.uniform(-3, 3)), rng.uniform(-0.8, 0.8, 3), rng.uniform(-2, 2, 3),
        ))  # fmt: skip
        order = (
            [q[2], q2, q[0], 0.5 * q[1], q[1]],
            [v[2], w, v[0], 0.5 * v[1], v[1]],
            [a[2], 0.0, a[0], 0.5 * a[1], a[1]],
        )
        expected = pin.rnea(model, data, *(np.array(part) for part in order))[1]
        assert _torque(crane, body, q2, w, (q, v, a)) == pytest.approx(expected, rel=1e-9, abs=1e-6)


def test_joints_that_stand_still_as_configured_are_no_inputs(crane: Machine) -> None:
    still = joint_motion.inputs(crane.document, POSE, np.array([[*POSE, 1.3]]), np.zeros((1, 3)), np.zeros((1, 3)))
    assert not still.any()
    assert joint_motion.still(still).all()
    assert crane.structure.inputs == ("retract_current", "extend_current")
    assert crane.with_moving_joints().structure.inputs == (*crane.structure.inputs, *joint_motion.INPUTS)


def test_inertia_moves_as_that_of_the_locked_body(crane: Machine) -> None:
    there = (1.1, 3.0)
    here: Vector = joint_motion.inputs(crane.document, POSE, np.array([[*there, 0.0]]), *(np.zeros((1, 3)),) * 2)[0]
    one, other = (crane.pose(*pose) for pose in (POSE, there))
    # the tabulated pose is rounded
    assert here[:3] == pytest.approx([other.D0 - one.D0, other.Sx - one.Sx, other.Sy - one.Sy], abs=1.0)
    assert here[3:5] == pytest.approx(np.subtract(other.tip, one.tip), abs=1e-4)


def test_without_bodies_it_says_so(crane: Machine) -> None:
    bare = {k: v for k, v in crane.document["rigid_body"].items() if k != "planar"}
    with pytest.raises(MachineError, match=r"rigid_body\.planar is missing"):
        joint_motion.inputs({"rigid_body": bare}, POSE, *(np.zeros((1, 3)),) * 3)
