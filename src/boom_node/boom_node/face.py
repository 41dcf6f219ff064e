"""What the simulation and the bridge show to any ROS program: all joints of the robot description, and the description itself."""

from __future__ import annotations

from collections.abc import Sequence
from types import SimpleNamespace
from typing import Any

from std_msgs.msg import String

from boom_input.files import InputError, read_text
from boom_node import qos
from boom_node.errors import StartError
from boom_node.joint_set import JointSet
from boom_node.parameters import ParameterSpec
from boom_node.urdf import UrdfError

PARAMETERS = (
    ParameterSpec("joint_name", "inner_boom_joint", "name of the boom's joint in /joint_states", read_only=True),
    ParameterSpec(
        "fixed_joints", ["outer_boom_joint", "telescope_joint"],
        "names under which q3 and q4 are published too; empty: they are not", read_only=True,
    ),
    ParameterSpec(
        "hanging_joint", "gripper_hinge_joint", "joint of the robot description whose link hangs plumb", read_only=True
    ),
    ParameterSpec(
        "robot_description", "", "URDF text, or the path of a .urdf file: /joint_states brings all its joints", read_only=True
    ),
    ParameterSpec(
        "publish_description", True, "publish it on /robot_description; false beside a robot_state_publisher, which does",
        read_only=True,
    ),
)  # fmt: skip


class Face:
    """Joints and robot description of a node that stands for the machine.

    Args:
        node: publishes.
        values: of `PARAMETERS`.
        pose: q3 [rad] and q4 [m].

    Attributes:
        joints: all joints for ``/joint_states``.

    Raises:
        StartError: the robot description cannot be used.
    """

    def __init__(self, node: Any, values: SimpleNamespace, pose: Sequence[float]) -> None:
        try:
            text = described(values.robot_description)
            fixed = {name: float(value) for name, value in zip(values.fixed_joints, pose, strict=False)}
            self.joints = JointSet(text, values.joint_name, fixed, values.hanging_joint)
        except (InputError, UrdfError) as error:
            raise StartError(f"robot_description: {error}") from None
        if self.joints.note:
            node.get_logger().warning(self.joints.note)
        if text.strip() and values.publish_description:
            topic = "/robot_description"
            self._publisher = node.create_publisher(
                String, topic, qos.BY_TOPIC[topic]
            )  # latched: lives as long as this
            self._publisher.publish(String(data=text))


def described(text: str) -> str:
    """The URDF text; a path ending in .urdf is read. Raises InputError."""
    return read_text(text.strip()) if text.strip().endswith(".urdf") else text
