"""Node boom_tip_pose: an example of what a crane perception stack does. It uses topics only.

In: /robot_description, /joint_states, /boom/machine_configuration (for joints that are not measured). Out:
/boom/tip_pose, geometry_msgs/PoseStamped in the URDF's root frame, with the stamp of the joint state it was computed
from; /diagnostics. With publish_tf also /tf and /tf_static, as a robot_state_publisher publishes them.
"""

from __future__ import annotations

from boom_node import early  # noqa: F401  isort: skip  (signals and environment, before rclpy is imported)

import sys
import time
from typing import Any

from geometry_msgs.msg import PoseStamped, TransformStamped
from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from sensor_msgs.msg import JointState
from std_msgs.msg import String
from tf2_msgs.msg import TFMessage

from boom_description.tip_pose import JointTable, LinkPose, TipKinematics, TipPose, UrdfError
from boom_interfaces.msg import MachineConfiguration
from boom_node import parameters, qos, shell
from boom_node.diagnostics import DiagnosticsPublisher, Health, Level
from boom_node.input_watch import InputWatch
from boom_node.node import Node
from boom_node.parameters import ParameterSpec

WATCH_PERIOD = 0.5  # s
MOST_JOINTS = 200

PARAMETERS = (
    ParameterSpec("tip_frame", "boom_tip", "link of the robot description whose pose is published", read_only=True),
    ParameterSpec(
        "required_joints", ("inner_boom_joint",), "joints without which no pose is published", read_only=True
    ),
    ParameterSpec(
        "outer_boom_joint", "outer_boom_joint", "joint that has the configuration's outer boom angle", read_only=True
    ),
    ParameterSpec(
        "telescope_joint", "telescope_joint", "joint that has the configuration's telescope length", read_only=True
    ),
    ParameterSpec(
        "publish_tf", False, "true: publish /tf and /tf_static, where no robot_state_publisher does", read_only=True
    ),
    ParameterSpec(
        "input_timeout", 2.0, "silence of an input after which the node warns", "s", 0.1, 60.0, read_only=True
    ),
    ParameterSpec(
        "warning_period", 10.0, "time between two warnings about the same input", "s", 0.1, 3600.0, read_only=True
    ),
)


class TipPoseNode(Node):
    """Turns joint states into the pose of the tip."""

    def __init__(self) -> None:
        super().__init__("boom_tip_pose")
        self._values = parameters.declare(self, PARAMETERS)
        self._kinematics: TipKinematics | None = None
        self._joints = JointTable(self._values.input_timeout)
        self._sources: dict[str, str] = {}
        self._published = 0
        self._failure = ""
        self._watches = self._make_watches(time.monotonic())
        self._frames = self._values.publish_tf
        if self._frames:
            self._tf = self.create_publisher(TFMessage, "/tf", qos.BY_TOPIC["/tf"])
            self._tf_static = self.create_publisher(TFMessage, "/tf_static", qos.BY_TOPIC["/tf_static"])
        self._publisher = self.create_publisher(PoseStamped, "/boom/tip_pose", qos.SENSOR_DATA)
        latched, sensor_data = qos.BY_TOPIC["/robot_description"], qos.requested("/joint_states")
        self.create_subscription(String, "/robot_description", self._on_description, latched)
        self.create_subscription(
            MachineConfiguration,
            "/boom/machine_configuration",
            self._on_configuration,
            qos.BY_TOPIC["/boom/machine_configuration"],
        )
        self.create_subscription(JointState, "/joint_states", self._on_joint_state, sensor_data)
        self._diagnostics = DiagnosticsPublisher(self, self._health)
        # Steady, because a simulation that stops takes its clock with it.
        self.create_timer(WATCH_PERIOD, self._watch, clock=Clock(clock_type=ClockType.STEADY_TIME))

    def _make_watches(self, now: float) -> dict[str, InputWatch]:
        timeout, repeat = self._values.input_timeout, self._values.warning_period
        required = ", ".join(self._values.required_joints)
        return {
            "description": InputWatch(
                "no robot description for {age} s: nobody publishes /robot_description; "
                "start the simulation or a robot state publisher",
                now, timeout, repeat, once=True,
            ),
            "joints": InputWatch(
                f"no joint states for {{age}} s: /joint_states brings no position of {required}; "
                "start the simulation or the sensors",
                now, timeout, repeat,
            ),
        }  # fmt: skip

    def _on_description(self, message: String) -> None:
        try:
            self._kinematics = TipKinematics(message.data, self._values.tip_frame)
        except UrdfError as error:
            self._failure = f"/robot_description: {error}"
            self.guard.refuse("/robot_description", "cannot be used", str(error))
            self._diagnostics.update()
            return
        self._failure = ""
        if self._frames:
            stamp = self.get_clock().now().to_msg()
            fixed = [_transform(frame, stamp) for frame in self._kinematics.fixed_frames()]
            self._tf_static.publish(TFMessage(transforms=fixed))
        self._watches["description"].seen(time.monotonic())
        self.get_logger().info(
            f"{self._kinematics.tip_frame} in {self._kinematics.root_frame}: {', '.join(self._kinematics.joint_names)}"
        )

    def _on_configuration(self, message: MachineConfiguration) -> None:
        names = self._values.outer_boom_joint, self._values.telescope_joint
        self._joints.configure(dict(zip(names, (message.outer_boom_angle, message.telescope_length), strict=True)))

    def _on_joint_state(self, message: JointState) -> None:
        now = time.monotonic()
        if len(message.name) > MOST_JOINTS:
            self.guard.refuse("/joint_states", f"more than {MOST_JOINTS} joints", str(len(message.name)))
            return
        measured = self._joints.measure(message.name, message.position, now)
        if not set(self._values.required_joints) <= set(measured):
            return
        self._watches["joints"].seen(now)
        if self._kinematics is None:
            return
        limits = self._kinematics.all_limits if self._frames else self._kinematics.limits
        joints = self._joints.values(limits, now)
        self._tell_sources(dict(joints.sources))
        pose = self._kinematics.pose(joints.values)
        out = PoseStamped()
        out.header.stamp = message.header.stamp
        out.header.frame_id = self._kinematics.root_frame
        _fill(out.pose.position, out.pose.orientation, pose)
        self._publisher.publish(out)
        if self._frames:
            frames = self._kinematics.frames(joints.values)
            self._tf.publish(TFMessage(transforms=[_transform(frame, message.header.stamp) for frame in frames]))
        self._published += 1

    def _tell_sources(self, sources: dict[str, str]) -> None:
        for name, source in sources.items():
            if self._sources.get(name) != source:
                self.get_logger().info(f"{name}: {source}")
        self._sources = sources

    def _watch(self) -> None:
        now = time.monotonic()
        for watch in self._watches.values():
            warning = watch.warning(now)
            if warning is not None:
                self.get_logger().warning(warning)
        self._diagnostics.update()

    def _health(self) -> Health:
        now = time.monotonic()
        missing = [name for name, watch in self._watches.items() if watch.missing(now)]
        if self._failure:
            return Health(Level.ERROR, self._failure, {"poses published": self._published})
        level = Level.WARN if missing else Level.OK
        message = f"missing: {', '.join(missing)}" if missing else "publishing the tip pose"
        return Health(level, message, {"poses published": self._published})


def _fill(position: Any, orientation: Any, pose: TipPose) -> None:
    position.x, position.y, position.z = map(float, pose.position)
    orientation.x, orientation.y, orientation.z, orientation.w = map(float, pose.quaternion)


def _transform(frame: LinkPose, stamp: Any) -> TransformStamped:
    out = TransformStamped(child_frame_id=frame.child)
    out.header.stamp, out.header.frame_id = stamp, frame.parent
    _fill(out.transform.translation, out.transform.rotation, frame.pose)
    return out


def main() -> int:
    """Run the node until a signal ends it. Returns the exit status."""
    return shell.run(TipPoseNode)


if __name__ == "__main__":
    sys.exit(main())
