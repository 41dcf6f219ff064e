"""Joints that nobody measures: configured, following, hanging, or as near to zero as they can be."""

from __future__ import annotations

import math

import pytest

from boom_node.joint_set import JointSet
from boom_node.urdf import UrdfError

LIMIT = '<limit lower="{}" upper="{}"/>'


def joint(
    name: str, parent: str, child: str, kind: str = "revolute", inside: str = "", low: float = -4, high: float = 4
) -> str:
    limit = LIMIT.format(low, high)
    return f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>{limit}{inside}</joint>'


def urdf(*joints: str) -> str:
    links = "".join(f'<link name="{name}"/>' for name in "abcdef")
    return f'<robot name="r">{links}{"".join(joints)}</robot>'


UP = '<axis xyz="0 -1 0"/>'
CRANE = urdf(
    joint("slew", "a", "b", inside='<axis xyz="0 0 1"/>', low=0.1),
    joint("boom", "b", "c", inside=UP),
    joint("stage", "c", "d", "prismatic", '<mimic joint="slide" multiplier="0.5"/>'),
    joint("slide", "c", "e", "prismatic"),
    joint("hook", "e", "f", inside=UP + f'<origin rpy="0 {math.pi / 2} 0"/>', low=-1.0, high=1.0),
)


def values(joints: JointSet, angle: float) -> dict[str, float]:
    return dict(zip(joints.names, joints.positions(angle), strict=True))


def test_every_joint_of_the_description_has_a_value() -> None:
    joints = JointSet(CRANE, "boom", {"slide": 2.0}, "hook")
    assert values(joints, 1.2) == pytest.approx(
        {"boom": 1.2, "slide": 2.0, "slew": 0.1, "stage": 1.0, "hook": math.pi / 2 - 1.2}
    )
    assert joints.velocities(1.2, 0.3) == pytest.approx([0.3, 0.0, 0.0, 0.0, -0.3])


def test_a_link_that_hangs_stops_at_its_limit() -> None:
    joints = JointSet(CRANE, "boom", {"slide": 2.0}, "hook")
    assert values(joints, 0.3)["hook"] == 1.0
    assert joints.velocities(0.3, 0.5)[joints.names.index("hook")] == 0.0


def test_what_follows_the_measured_joint_can_be_asked_for_alone() -> None:
    joints = JointSet(CRANE, "boom", {"slide": 2.0}, "hook")
    assert [joints.names[k] for k in joints.moving] == ["boom", "hook"]
    assert joints.moved(1.2, 0.3) == pytest.approx([1.2, math.pi / 2 - 1.2, 0.3, -0.3])


def test_without_a_description_there_are_the_joints_that_are_told() -> None:
    assert values(JointSet("", "boom", {"slide": 2.0}, "hook"), 0.4) == {"boom": 0.4, "slide": 2.0}


def test_a_description_of_another_machine_moves_nothing_wrongly() -> None:
    joints = JointSet(CRANE, "other", {"slide": 2.0}, "hook")
    assert values(joints, 0.4) == {"other": 0.4, "slide": 2.0}
    assert "no joint 'other'" in joints.note


def test_a_chain_that_leaves_the_plane_has_no_plumb_link() -> None:
    tilted = CRANE.replace('<axis xyz="0 0 1"/>', '<axis xyz="1 0 0"/>')
    assert values(JointSet(tilted, "boom", {}, "hook"), 1.2)["hook"] == 0.0


@pytest.mark.parametrize(
    "text", ["<robot", urdf(joint("boom", "a", "b"), joint("x", "b", "c", inside='<mimic joint="y"/>'))]
)
def test_a_broken_description_is_one_line(text: str) -> None:
    with pytest.raises(UrdfError, match=r"^the robot description[^\n]*$"):
        JointSet(text, "boom", {})
