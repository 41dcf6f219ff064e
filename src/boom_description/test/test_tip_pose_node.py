"""The perception example as a process of its own: knows topics only, waits, warns, and ends when told."""

from __future__ import annotations

import math
import os
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator, Mapping
from typing import Any

import pytest
import rclpy
from geometry_msgs.msg import PoseStamped
from rclpy.executors import SingleThreadedExecutor
from sensor_msgs.msg import JointState
from std_msgs.msg import String

from boom_description.make_urdf import shipped_urdf
from boom_description.tip_pose import TipKinematics
from boom_interfaces.msg import MachineConfiguration
from boom_node import qos, stamps

LIMIT_S = 20.0
STAMP_NS = 1_700_000_000_123_456_789


class Crane:
    """Publishes what a crane publishes, and hears the tip pose."""

    def __init__(self) -> None:
        self.context = rclpy.Context()
        rclpy.init(context=self.context)
        self.node = rclpy.create_node("crane", context=self.context)
        self.executor = SingleThreadedExecutor(context=self.context)
        self.executor.add_node(self.node)
        self.poses: list[PoseStamped] = []
        self.node.create_subscription(PoseStamped, "/boom/tip_pose", self.poses.append, qos.SENSOR_DATA)
        self.joint_states = self.node.create_publisher(JointState, "/joint_states", qos.BY_TOPIC["/joint_states"])
        self.description = self.node.create_publisher(String, "/robot_description", qos.BY_TOPIC["/robot_description"])
        self.configuration = self.node.create_publisher(
            MachineConfiguration, "/boom/machine_configuration", qos.BY_TOPIC["/boom/machine_configuration"]
        )

    def publish(self, joints: Mapping[str, float], stamp_ns: int = STAMP_NS) -> None:
        message = JointState(name=list(joints), position=list(joints.values()))
        stamps.set_ns(message.header.stamp, stamp_ns)
        self.joint_states.publish(message)

    def publish_angle(self, angle: float) -> None:
        self.publish({"inner_boom_joint": angle})

    def until(self, done: Callable[[], bool], action: Callable[[], Any] = lambda: None) -> bool:
        """Repeat `action` and spin until `done`, or until the time is up."""
        clock = self.node.get_clock()
        end = clock.now().nanoseconds + int(LIMIT_S * 1e9)
        while not done() and clock.now().nanoseconds < end:
            action()
            self.executor.spin_once(timeout_sec=0.02)
        return done()

    def close(self) -> None:
        self.executor.shutdown()
        self.node.destroy_node()
        rclpy.shutdown(context=self.context)


@pytest.fixture
def crane() -> Iterator[Crane]:
    crane = Crane()
    yield crane
    crane.close()


@pytest.fixture
def start() -> Iterator[Callable[..., subprocess.Popen[str]]]:
    running: list[subprocess.Popen[str]] = []

    def start(*parameters: str) -> subprocess.Popen[str]:
        ros = ["--ros-args", *(word for parameter in parameters for word in ("-p", parameter))]
        command = [sys.executable, "-m", "boom_description.tip_pose_node", *(ros if parameters else [])]
        process = subprocess.Popen(
            command, stderr=subprocess.PIPE, stdout=subprocess.DEVNULL, text=True, env=os.environ
        )
        running.append(process)
        return process

    yield start
    for process in running:
        if process.poll() is None:
            process.kill()
        process.communicate()


def ended(process: subprocess.Popen[str], number: int | None = None) -> tuple[int, list[str]]:
    """Exit status and what was written on stderr, after `number` was sent."""
    if number is not None:
        process.send_signal(number)
    error = process.communicate(timeout=LIMIT_S)[1]
    return process.returncode, error.splitlines()


def test_pose_has_the_stamp_of_its_joint_state_and_the_root_frame(
    crane: Crane, start: Callable[..., subprocess.Popen[str]]
) -> None:
    process = start()
    crane.description.publish(String(data=shipped_urdf()))
    crane.configuration.publish(
        MachineConfiguration(machine="tz17", outer_boom_angle=0.28, telescope_length=2.2, load_mass=math.nan)
    )
    expected = TipKinematics(shipped_urdf()).pose(
        {"slewing_joint": 0.0, "inner_boom_joint": 0.4, "outer_boom_joint": 0.28, "telescope_joint": 2.2}
    )

    def here() -> bool:
        # The configuration may arrive after the first joint states.
        return bool(crane.poses) and abs(crane.poses[-1].pose.position.x - expected.position[0]) < 1e-9

    assert crane.until(here, lambda: crane.publish_angle(0.4))
    pose = crane.poses[-1]
    assert stamps.to_ns(pose.header.stamp) == STAMP_NS
    assert pose.header.frame_id == "base_link"
    position, rotation = pose.pose.position, pose.pose.orientation
    assert [position.x, position.y, position.z] == pytest.approx(expected.position)
    assert [rotation.x, rotation.y, rotation.z, rotation.w] == pytest.approx(expected.quaternion)
    status, lines = ended(process, signal.SIGTERM)
    assert status == 0
    assert any("outer_boom_joint: 0.28 from /boom/machine_configuration" in line for line in lines)
    assert sum("slewing_joint: 0, because nobody publishes it" in line for line in lines) == 1
    assert not any("Traceback" in line for line in lines)


def test_missing_inputs_are_named_and_the_node_goes_on(
    crane: Crane, start: Callable[..., subprocess.Popen[str]]
) -> None:
    process = start("input_timeout:=0.3", "warning_period:=600.0")
    assert process.stderr is not None
    first = [process.stderr.readline(), process.stderr.readline()]
    assert "/robot_description" in first[0]
    assert "/joint_states" in first[1]
    crane.description.publish(String(data=shipped_urdf()))
    assert crane.until(lambda: bool(crane.poses), lambda: crane.publish_angle(0.1))
    status, lines = ended(process, signal.SIGINT)
    assert status == 0
    assert not any("nobody publishes /robot_description" in line for line in lines), "told once in the warning period"


def test_joint_states_without_the_required_joint_give_no_pose(
    crane: Crane, start: Callable[..., subprocess.Popen[str]]
) -> None:
    process = start("input_timeout:=0.5", "required_joints:=[inner_boom_joint, outer_boom_joint]")
    assert process.stderr is not None
    crane.description.publish(String(data=shipped_urdf()))
    assert crane.until(lambda: crane.joint_states.get_subscription_count() > 0)
    crane.publish({"inner_boom_joint": 0.1}, stamp_ns=1)
    assert any(
        "/joint_states brings no position of inner_boom_joint, outer_boom_joint" in line for line in process.stderr
    )
    crane.publish({"inner_boom_joint": 0.1}, stamp_ns=2)
    assert crane.until(
        lambda: bool(crane.poses), lambda: crane.publish({"inner_boom_joint": 0.1, "outer_boom_joint": 1.0}, stamp_ns=3)
    )
    assert {stamps.to_ns(pose.header.stamp) for pose in crane.poses} == {3}
    assert ended(process, signal.SIGTERM)[0] == 0


def test_a_malformed_description_is_told_and_a_good_one_later_is_used(
    crane: Crane, start: Callable[..., subprocess.Popen[str]]
) -> None:
    crane.description.publish(String(data="<robot><link"))
    process = start()
    assert process.stderr is not None
    assert any(
        "/robot_description refused: cannot be used: the robot description is no XML" in line for line in process.stderr
    )
    crane.description.publish(String(data=shipped_urdf()))
    assert crane.until(lambda: bool(crane.poses), lambda: crane.publish_angle(0.1))
    assert ended(process, signal.SIGTERM)[0] == 0


def test_misspelt_parameter_ends_with_status_2_and_the_nearest_name(
    start: Callable[..., subprocess.Popen[str]],
) -> None:
    status, lines = ended(start("tip_fram:=boom_tip"))
    assert status == 2
    assert lines == ["boom: boom_tip_pose has no parameter 'tip_fram': did you mean 'tip_frame'?"]
