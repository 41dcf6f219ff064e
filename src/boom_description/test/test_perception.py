"""The perception example without ROS processes: the log in the cloud, the angle that reaches it, the motion there."""

from __future__ import annotations

import numpy as np
import pytest
from builtin_interfaces.msg import Time
from sensor_msgs.msg import PointCloud2

from boom_description.make_urdf import shipped_urdf
from boom_description.perception.log_cloud import LogOnGround, seen
from boom_description.perception.log_fit import PerceptionError, find_log
from boom_description.perception.point_cloud import packed, unpacked
from boom_description.perception.reach import Gripper, angle_at, grasp_point, motion
from boom_description.tip_pose import TipKinematics

JOINT = "inner_boom_joint"
JOINTS = {"slewing_joint": 0.0, JOINT: 1.0, "outer_boom_joint": 0.28, "telescope_joint": 2.2}


@pytest.mark.parametrize("seed", range(4))
def test_the_log_is_found_from_one_side(seed: int) -> None:
    rng = np.random.default_rng(seed)
    true = LogOnGround(
        (6.5, rng.uniform(-0.5, 0.5), 0.2), rng.uniform(-3.0, 3.0), rng.uniform(2.0, 4.0), rng.uniform(0.12, 0.2)
    )
    found = find_log(unpacked(packed(seen(true, rng), "base_link", Time())))
    assert found.center == pytest.approx(true.center, abs=0.03)
    assert abs(found.axis @ [np.cos(true.yaw), np.sin(true.yaw), 0.0]) > 0.999
    assert found.length == pytest.approx(true.length, rel=0.06)
    assert found.radius == pytest.approx(true.radius, abs=0.02)


def test_a_cloud_without_a_log_is_one_line() -> None:
    rng = np.random.default_rng(1)
    ball = rng.normal(size=(500, 3))
    ball *= 0.5 / np.linalg.norm(ball, axis=1)[:, None]
    for cloud in (
        seen(None, rng),
        np.zeros((3, 3)),
        np.full((500, 3), np.nan),
        np.random.default_rng(0).normal(size=(500, 3)) * 1e38,
        np.vstack([seen(None, rng), ball + np.array([6.0, 0.0, 1.0])]),
    ):
        with pytest.raises(PerceptionError, match=r"^[^\n]+$"):
            find_log(cloud)


def test_a_cloud_that_is_shorter_than_it_says_or_has_no_points_is_refused() -> None:
    cloud = packed(seen(None, np.random.default_rng(0)), "base_link", Time())
    cloud.data = bytes(cloud.data)[:-20]
    with pytest.raises(PerceptionError, match="shorter"):
        unpacked(cloud)
    with pytest.raises(PerceptionError, match="no x, y and z"):
        unpacked(PointCloud2())


def test_the_gripper_is_at_the_log_at_the_planned_angle() -> None:
    kinematics, gripper = TipKinematics(shipped_urdf()), Gripper()
    target = grasp_point(kinematics.pose({**JOINTS, JOINT: 0.7123}).position, gripper)
    angle, left = angle_at(kinematics, JOINTS, JOINT, target, gripper)
    assert angle == pytest.approx(0.7123, abs=1e-4)
    assert left < 1e-3
    with pytest.raises(PerceptionError, match="comes no closer than 2"):
        angle_at(kinematics, JOINTS, JOINT, target + np.array([2.5, 0.0, 0.0]), gripper)


@pytest.mark.parametrize(("end", "rate", "acceleration"), [(0.2, 0.1, 0.5), (1.4, 0.3, 0.05), (1.0, 0.3, 0.3)])
def test_a_motion_stays_below_its_limits_and_ends_at_rest(end: float, rate: float, acceleration: float) -> None:
    planned = motion(1.0, end, rate, acceleration)
    assert (planned.angles[0], planned.angles[-1]) == pytest.approx((1.0, end))
    assert planned.rates[[0, -1]] == pytest.approx([0.0, 0.0])
    assert abs(planned.rates).max() <= rate * (1 + 1e-9)
    assert abs(planned.accelerations).max() <= acceleration * (1 + 1e-4)
    assert (np.diff(planned.times) > 0.0).all()
    assert np.gradient(planned.angles, planned.times)[1:-1] == pytest.approx(planned.rates[1:-1], abs=0.01)
