"""A perception stack in one program: finds the log in the point cloud, moves the boom to it, grasps it, lifts it, weighs it.

./boom sim --control --angle 1.0                                     # first terminal
./boom python -m boom_description.perception.log_scene_node          # second: sensor and gripper, simulated
./boom python -m boom_description.perception.reach_log_node          # third

It uses standard messages only. In: /perception/points, /boom/tip_pose, /joint_states, /robot_description, /boom/estimated_load.
Out: the action /boom_controller/follow_joint_trajectory, the service /gripper/grasp.
"""

from __future__ import annotations

from boom_node import early  # noqa: F401  isort: skip  (signals and environment, before rclpy is imported)

import argparse
import sys
import time
from typing import Any

import numpy as np
from geometry_msgs.msg import PoseStamped
from rclpy.action import ActionClient
from rclpy.qos import DurabilityPolicy, QoSProfile, qos_profile_sensor_data
from sensor_msgs.msg import JointState, PointCloud2
from std_msgs.msg import Float64, String
from std_srvs.srv import SetBool
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from boom_description.perception.log_fit import PerceptionError, SeenLog, find_log
from boom_description.perception.point_cloud import POINTS_TOPIC, unpacked
from boom_description.perception.reach import Gripper, PlannedMotion, angle_at, grasp_point, motion
from boom_description.tip_pose import TipKinematics, UrdfError
from boom_node.motion_action import NAME, MotionAction
from boom_node.move_node import NotMovedError, follow, program, until
from boom_node.stamps import seconds_to_ns, set_ns

JOINT = "inner_boom_joint"
ACTION = f"/boom_controller/{NAME}"
PATIENCE_S = 30.0
SAME_M = 0.05
"""How far the tip pose may be from that of the joint states [m]."""
WEIGHING_S = 1.0
LIGHTEST_KG = 20.0


class ReachLog:
    """The stack: what it hears, and its steps."""

    def __init__(self, node: Any, gripper: Gripper, rate: float, acceleration: float) -> None:
        self.node, self.gripper, self.rate, self.acceleration = node, gripper, rate, acceleration
        self.heard: dict[str, Any] = {}
        self.loads: list[float] = []
        latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        for kind, topic, profile in (
            (String, "/robot_description", latched),
            (JointState, "/joint_states", QoSProfile(depth=10)),
            (PoseStamped, "/boom/tip_pose", qos_profile_sensor_data),
            (PointCloud2, POINTS_TOPIC, qos_profile_sensor_data),
        ):
            node.create_subscription(kind, topic, lambda m, topic=topic: self.heard.update({topic: m}), profile)
        node.create_subscription(Float64, "/boom/estimated_load", self._on_load, qos_profile_sensor_data)
        self.action = ActionClient(node, MotionAction, ACTION)
        self.grasping = node.create_client(SetBool, "/gripper/grasp")

    def _on_load(self, message: Float64) -> None:
        self.loads.append(message.data)

    def hear(self, topic: str, advice: str) -> Any:
        """The next message of a topic. Raises NotMovedError where none comes."""
        if topic != "/robot_description":
            self.heard.pop(topic, None)
        until(self.node, lambda: topic in self.heard, PATIENCE_S, f"nothing on {topic}: {advice}")
        return self.heard[topic]

    def joints(self) -> dict[str, float]:
        """All joints [rad or m] by name."""
        message = self.hear("/joint_states", "start ./boom sim --control")
        return dict(zip(message.name, message.position, strict=False))

    def look(self) -> tuple[SeenLog, TipKinematics]:
        """The log in ``base_link``, and the crane's kinematics. Raises PerceptionError, NotMovedError."""
        description = self.hear("/robot_description", "start ./boom sim --control")
        kinematics = TipKinematics(description.data)
        cloud = self.hear(POINTS_TOPIC, "start boom_description.perception.log_scene_node, or your sensor")
        if cloud.header.frame_id != kinematics.root_frame:
            raise PerceptionError(
                f"the cloud is in frame '{cloud.header.frame_id}': transform it to '{kinematics.root_frame}' first (tf2)"
            )
        return find_log(unpacked(cloud)), kinematics

    def tip(self) -> Any:
        """Position (3,) [m] of the tip."""
        p = self.hear("/boom/tip_pose", "start boom_description.tip_pose_node; ./boom sim does").pose.position
        return np.array([p.x, p.y, p.z])

    def move(self, begin: float, end: float) -> None:
        """A motion of the boom. Raises NotMovedError."""
        planned = motion(begin, end, self.rate, self.acceleration)
        duration = float(planned.times[-1])
        until(self.node, self.action.server_is_ready, PATIENCE_S, f"no server of {ACTION}: start ./boom sim --control")
        follow(self.node, self.action, as_message(planned), duration + PATIENCE_S)

    def grasp(self, close: bool) -> str:
        """Close or open the gripper. Raises NotMovedError."""
        until(self.node, self.grasping.service_is_ready, PATIENCE_S, "no gripper: nobody serves /gripper/grasp")
        future = self.grasping.call_async(SetBool.Request(data=close))
        until(self.node, future.done, PATIENCE_S, "the gripper does not answer")
        if not future.result().success:
            raise NotMovedError(future.result().message)
        return str(future.result().message)

    def weigh(self) -> float:
        """Mean of the controller's estimate of the load [kg] over a second at rest. Raises NotMovedError."""
        self.loads.clear()
        end = time.monotonic() + WEIGHING_S
        silent = "the controller estimates no load: its control law has to be one that does"
        until(self.node, lambda: time.monotonic() > end and self.loads, PATIENCE_S, silent)
        return float(np.mean(self.loads))


def as_message(planned: PlannedMotion) -> JointTrajectory:
    """The motion as trajectory_msgs/JointTrajectory."""
    message = JointTrajectory(joint_names=[JOINT])
    rows = zip(planned.times, planned.angles, planned.rates, planned.accelerations, strict=True)
    for since, angle, rate, acceleration in rows:
        point = JointTrajectoryPoint(
            positions=[float(angle)], velocities=[float(rate)], accelerations=[float(acceleration)]
        )
        set_ns(point.time_from_start, seconds_to_ns(float(since)))
        message.points.append(point)
    return message


def run(stack: ReachLog) -> None:
    """Find, reach, grasp, lift, weigh. Raises PerceptionError, NotMovedError, UrdfError."""
    log, kinematics = stack.look()
    x, y, z = log.center
    say(
        f"log: {log.length:.2f} m long, {2 * log.radius:.2f} m thick, middle at x = {x:.2f}, y = {y:.2f}, z = {z:.2f} m"
    )
    joints = stack.joints()
    if JOINT not in joints:
        raise PerceptionError(f"/joint_states does not bring {JOINT}")
    apart = float(np.linalg.norm(kinematics.pose(joints).position - stack.tip()))
    if apart > SAME_M:
        raise PerceptionError(
            f"tip pose and joint states are {apart:.2f} m apart: is the boom moving, or the URDF another?"
        )
    angle, _ = angle_at(kinematics, joints, JOINT, log.center, stack.gripper)
    begin = joints[JOINT]
    say(f"boom from {begin:.3f} to {angle:.3f} rad")
    stack.move(begin, angle)
    left = float(np.linalg.norm(grasp_point(stack.tip(), stack.gripper) - log.center))
    say(f"the gripper is {left:.2f} m from the middle of the log")
    empty = stack.weigh()  # here, because the controller estimates once it holds the boom
    say(stack.grasp(True))
    say(f"boom from {angle:.3f} to {begin:.3f} rad")
    stack.move(angle, begin)
    grasped = stack.weigh() - empty
    if grasped < LIGHTEST_KG:
        raise PerceptionError(f"the controller estimates {grasped:.0f} kg: the log was not grasped")
    say(f"the controller estimates {grasped:.0f} kg: {grasped / log.volume:.0f} kg/m3 for the {log.volume:.3f} m3 seen")


def say(text: str) -> None:
    """One line, at once."""
    print(text, flush=True)


def main() -> int:
    """One log; returns the exit status."""
    parser = argparse.ArgumentParser(
        prog="reach_log", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "--depth", type=float, default=Gripper.depth, metavar="M", help="gripper below the tip [m] (default: 1.2)"
    )
    parser.add_argument(
        "--opening",
        type=float,
        default=Gripper.opening,
        metavar="M",
        help="how far off a log may lie [m] (default: 0.4)",
    )
    parser.add_argument(
        "--rate", type=float, default=0.2, metavar="RAD/S", help="largest rate of the boom [rad/s] (default: 0.2)"
    )
    parser.add_argument(
        "--acceleration", type=float, default=0.2, metavar="RAD/S2", help="largest acceleration [rad/s2] (default: 0.2)"
    )
    parser.add_argument("--release", action="store_true", help="open the gripper and end, to begin anew")
    args = parser.parse_args()
    if not all(0.0 < value < 100.0 for value in (args.depth, args.opening, args.rate, args.acceleration)):
        parser.error("give numbers above 0")
    try:
        with program("reach_log") as node:
            stack = ReachLog(node, Gripper(args.depth, args.opening), args.rate, args.acceleration)
            if args.release:
                say(stack.grasp(False))
            else:
                run(stack)
    except (PerceptionError, NotMovedError, UrdfError) as error:
        print(f"reach_log: {' '.join(str(error).split())}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print("reach_log: stopped; the boom comes to rest", file=sys.stderr)
        return 130
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
