"""Node log_scene: the sensor and the gripper of the example, simulated. A log lies within reach of the simulated crane.

Out: /perception/points, sensor_msgs/PointCloud2 in ``base_link``, 5 Hz. Service /gripper/grasp, std_srvs/SetBool: true closes
the gripper, false opens it. A log between the jaws then hangs at the tip: its mass is told to the simulated crane.
"""

from __future__ import annotations

from boom_node import early  # noqa: F401  isort: skip  (signals and environment, before rclpy is imported)

import sys

import numpy as np
from geometry_msgs.msg import PoseStamped
from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from sensor_msgs.msg import PointCloud2
from std_srvs.srv import SetBool

from boom_description.perception.log_cloud import LogOnGround, seen
from boom_description.perception.point_cloud import FRAME, POINTS_TOPIC, packed
from boom_description.perception.reach import Gripper, grasp_point
from boom_interfaces.srv import SetPayload
from boom_node import parameters, qos, shell
from boom_node.node import Node
from boom_node.parameters import ParameterSpec

PERIOD_S = 0.2
PARAMETERS = (
    ParameterSpec("x", 6.7, "log: middle, forward of the slewing axis", "m", -20.0, 20.0, read_only=True),
    ParameterSpec("y", 0.1, "log: middle, to the left", "m", -20.0, 20.0, read_only=True),
    ParameterSpec("yaw", 1.4, "log: direction of its axis, 0 = forward", "rad", -3.2, 3.2, read_only=True),
    ParameterSpec("length", 3.0, "log: length", "m", 0.5, 10.0, read_only=True),
    ParameterSpec("radius", 0.16, "log: radius", "m", 0.05, 0.5, read_only=True),
    ParameterSpec("density", 850.0, "log: density", "kg/m^3", 100.0, 1500.0, read_only=True),
    ParameterSpec("seed", 0, "seed of the sensor's noise", "", 0, 2**31 - 1, read_only=True),
)


class LogSceneNode(Node):
    """The log, the sensor that sees it, and the gripper."""

    def __init__(self) -> None:
        super().__init__("log_scene")
        v = parameters.declare(self, PARAMETERS)
        self._log = LogOnGround((v.x, v.y, v.radius), v.yaw, v.length, v.radius)
        self._mass = v.density * np.pi * v.radius**2 * v.length
        self._rng = np.random.default_rng(v.seed)
        self._gripper = Gripper()
        self._tip: PoseStamped | None = None
        self._holds = False
        self._points = self.create_publisher(PointCloud2, POINTS_TOPIC, qos.SENSOR_DATA)
        self._payload = self.create_client(SetPayload, "/boom_simulation/set_payload")
        self.create_subscription(PoseStamped, "/boom/tip_pose", self._on_tip, qos.SENSOR_DATA)
        self.create_service(SetBool, "/gripper/grasp", self._on_grasp)
        self.create_timer(PERIOD_S, self._look, clock=Clock(clock_type=ClockType.STEADY_TIME))
        self.get_logger().info(f"a log of {self._mass:.0f} kg at x = {v.x:g} m, y = {v.y:g} m")

    def _on_tip(self, message: PoseStamped) -> None:
        self._tip = message

    def _look(self) -> None:
        cloud = seen(None if self._holds else self._log, self._rng)
        self._points.publish(packed(cloud, FRAME, self.get_clock().now().to_msg()))

    def _on_grasp(self, request: SetBool.Request, response: SetBool.Response) -> SetBool.Response:
        response.success = True
        if not request.data:
            response.message = "the gripper is open"
            self._hold(False)
        elif self._tip is None or not self._payload.service_is_ready():
            response.success, response.message = False, "no simulated crane: start ./boom sim --control"
        else:
            p = self._tip.pose.position
            off = grasp_point(np.array([p.x, p.y, p.z]), self._gripper) - np.array(self._log.center)
            response.success = bool(np.linalg.norm(off) < self._gripper.opening)
            response.message = "the gripper is closed" + ("" if response.success else ": nothing between the jaws")
            self._hold(response.success)
        self.get_logger().info(response.message)
        return response

    def _hold(self, holds: bool) -> None:
        if holds != self._holds:
            self._holds = holds
            self._payload.call_async(SetPayload.Request(mass=self._mass if holds else 0.0))


def main() -> int:
    """Run the node until a signal ends it. Returns the exit status."""
    return shell.run(LogSceneNode)


if __name__ == "__main__":
    sys.exit(main())
