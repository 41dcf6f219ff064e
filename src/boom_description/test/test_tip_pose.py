"""The perception example's core: kinematics of any URDF, values for joints nobody measures, seldom warnings."""

from __future__ import annotations

import math

import numpy as np
import pytest

from boom_description.tip_pose import JointTable, TipKinematics, UrdfError

LINKS = '<link name="ground"/><link name="arm"/><link name="hand"/>'
ARM = (
    '<joint name="shoulder" type="{kind}"><parent link="ground"/><child link="arm"/>'
    '<origin xyz="0 0 1"/><axis xyz="0 0 1"/>'
    '<limit lower="-2" upper="2" effort="1" velocity="1"/></joint>'
)
SLIDE = (
    '<joint name="slide" type="prismatic"><parent link="arm"/><child link="hand"/>'
    '<origin xyz="1 0 0"/><axis xyz="1 0 0"/>'
    '<limit lower="{low}" upper="5" effort="1" velocity="1"/>{more}</joint>'
)


def robot(kind: str = "revolute", low: float = 0.0, more: str = "") -> str:
    return f'<robot name="r">{LINKS}{ARM.format(kind=kind)}{SLIDE.format(low=low, more=more)}</robot>'


@pytest.mark.parametrize("kind", ["revolute", "continuous"])
def test_pose_of_a_small_robot_by_hand(kind: str) -> None:
    kinematics = TipKinematics(robot(kind), "hand")
    assert (kinematics.root_frame, kinematics.joint_names) == ("ground", ("shoulder", "slide"))
    pose = kinematics.pose({"shoulder": math.pi / 2, "slide": 2.0, "elsewhere": 7.0})
    assert pose.position == pytest.approx([0.0, 3.0, 1.0], abs=1e-12)
    assert pose.quaternion == pytest.approx([0.0, 0.0, math.sqrt(0.5), math.sqrt(0.5)], abs=1e-12)


def test_mimicking_joint_follows_its_leader() -> None:
    kinematics = TipKinematics(robot(more='<mimic joint="shoulder" multiplier="2" offset="0.5"/>'), "hand")
    assert kinematics.joint_names == ("shoulder",)
    assert kinematics.pose({"shoulder": 1.0}).position[:2] == pytest.approx([3.5 * math.cos(1.0), 3.5 * math.sin(1.0)])


def test_rotation_beyond_half_a_turn_has_one_sign() -> None:
    kinematics = TipKinematics(robot("continuous"), "hand")
    for angle in np.linspace(-6.0, 6.0, 25):
        assert kinematics.pose({"shoulder": float(angle), "slide": 0.0}).quaternion[3] >= 0.0


def test_missing_and_infinite_joint_values_are_refused() -> None:
    kinematics = TipKinematics(robot(), "hand")
    with pytest.raises(KeyError, match="slide"):
        kinematics.pose({"shoulder": 0.0})
    with pytest.raises(ValueError, match="slide is nan"):
        kinematics.pose({"shoulder": 0.0, "slide": math.nan})


@pytest.mark.parametrize(
    ("urdf", "named"),
    [
        ("", "empty"),
        ("not xml", "no XML"),
        ("<robot><link name='a'></robot>", "no XML"),
        ("<model/>", "begins with <model>"),
        ("<robot name='r'/>", "roots are missing"),
        ("<robot name='r'><link name='a'/><link name='b'/></robot>", "roots are a, b"),
        ("<robot name='r'><link name='a'/><link name='a'/></robot>", "two links named 'a'"),
        ("<robot name='r'><link/></robot>", "a link without 'name'"),
        ("<robot name='r'><link name='a'/></robot>", "no link 'hand'; it has: a"),
        (robot().replace('<parent link="arm"/>', '<parent link="leg"/>'), "names link 'leg'"),
        (robot().replace('<parent link="arm"/>', ""), "has no <parent>"),
        (robot().replace('name="slide"', 'name="shoulder"'), "two joints named 'shoulder'"),
        (robot("spherical"), "of type 'spherical'"),
        (robot(low=9.0), "lower is above the upper"),
        (robot().replace('lower="0.0"', 'lower="low"'), "lower='low'"),
        (robot(more='<mimic joint="nobody"/>'), "mimics 'nobody'"),
        (robot().replace('<limit lower="-2" upper="2" effort="1" velocity="1"/>', ""), "no <limit>"),
        (robot().replace('<origin xyz="0 0 1"/>', '<origin xyz="0 zero 1"/>'), "refused by pinocchio"),
    ],
)
def test_unusable_description_is_refused_in_one_line(urdf: str, named: str) -> None:
    with pytest.raises(UrdfError) as caught:
        TipKinematics(urdf, "hand")
    assert named in str(caught.value)
    assert "\n" not in str(caught.value)


def test_measured_value_comes_first_then_configuration_then_the_value_next_to_zero() -> None:
    kinematics = TipKinematics(robot(low=0.5), "hand")
    table = JointTable(timeout=2.0)
    assert table.values(kinematics.limits, 0.0).values == {"shoulder": 0.0, "slide": 0.5}
    table.configure({"slide": 1.5, "shoulder": math.nan})
    assert table.values(kinematics.limits, 0.0).values == {"shoulder": 0.0, "slide": 1.5}
    assert table.measure(["shoulder", "slide"], [0.3, 2.0], 10.0) == ("shoulder", "slide")
    found = table.values(kinematics.limits, 11.0)
    assert found.values == {"shoulder": 0.3, "slide": 2.0}
    assert set(found.sources.values()) == {"measured"}
    assert table.values(kinematics.limits, 12.5).values == {"shoulder": 0.0, "slide": 1.5}, (
        "a silent sensor does not count for ever"
    )


def test_positions_that_are_missing_or_no_number_do_not_count_as_measured() -> None:
    table = JointTable()
    assert table.measure(["a", "b", "c"], [1.0, math.nan], 0.0) == ("a",)
    assert table.measure(["a"], [], 0.0) == ()
