"""Enables motion once, as soon as the bridge accepts, and ends: ``ros2 run boom_can_bridge enable``.

It calls ``/boom_can_bridge/enable`` until the bridge agrees. Exit status 0, or 2 with the bridge's reason after ``wait_timeout``.

With ``after_controller`` it waits until the controller is ready, and stays until the first motion begins: what late frames of a
busy computer take away until then, it gives back. What an operator or an emergency stop takes away, or anything from the first
motion on, is the operator's to give back.
"""

# ruff: noqa: I001
from __future__ import annotations

from boom_node import early  # noqa: F401  (first: signals and environment)

import time
from typing import Any

from boom_interfaces.msg import ControllerState
from boom_node import parameters, qos, shell
from boom_node.node import Node
from boom_node.parameters import ParameterSpec
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from std_srvs.srv import SetBool

BRIDGE = "boom_can_bridge"
SERVICE = f"/{BRIDGE}/enable"
PARAMETERS = (
    ParameterSpec("wait_timeout", 20.0, "how long to try", "s", 0.1, 3600.0, read_only=True),
    ParameterSpec(
        "after_controller", False,
        "wait until a controller is ready, and enable again what late frames stop before the first motion",
        read_only=True,
    ),
)  # fmt: skip
LOOK_S = 0.05
ANSWER_S = 2.0
"""Longest wait for one answer: the answer of a service can be lost while both ends are still being discovered."""
SILENT_S = 0.5
"""A controller that has said nothing for so long may have stopped meanwhile."""
DISABLED, STOP = "motion was disabled: ", "emergency stop"
"""Beginnings of what the bridge says of motion that was lost."""
LATE = ("no good ", "the bridge itself stood still ", "no current command ")
"""Beginnings of the bridge's reasons to disable motion that a busy computer gives; all others are somebody's will, or a fault."""


class EnableNode(Node):
    """Requests motion until it is enabled, with a controller until it moves."""

    def __init__(self) -> None:
        super().__init__("boom_enable")
        given = parameters.declare(self, PARAMETERS)
        self._patience, self._waiting = given.wait_timeout, given.after_controller
        self._stays, self._wanted, self._given = given.after_controller, True, False
        self._begin = self._heard = time.monotonic()
        self._reason = "no bridge is running: start it with python -m boom_can_bridge.bridge_node"
        self._future: Any = None
        self._asked = 0.0
        self._client = self.create_client(SetBool, SERVICE)
        if self._stays:
            self._reason = "no controller is running: start it with python -m boom_controller.controller_node"
            self.create_subscription(ControllerState, "/boom/controller_state", self._on_controller, qos.SENSOR_DATA)
            self.create_subscription(
                DiagnosticArray, "/diagnostics", self._on_diagnostics, qos.requested("/diagnostics")
            )
        self.create_timer(LOOK_S, self._look, clock=Clock(clock_type=ClockType.STEADY_TIME))

    def _on_controller(self, message: ControllerState) -> None:
        self._heard = time.monotonic()
        if self._given and message.mode != "idle":
            shell.finish(0)  # it moves, or was stopped
        self._waiting = message.status == "stopped" or message.reason.startswith("not ready")
        if self._waiting:
            self._reason = f"the controller says: {message.reason}"

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        """Where motion that was enabled is lost: whether it is to be enabled again."""
        motion = next((v.value for s in message.status if s.name == BRIDGE for v in s.values if v.key == "motion"), "")
        if not self._given or not motion.startswith((DISABLED, STOP)):
            return
        if not motion.removeprefix(DISABLED).startswith(LATE):
            shell.finish(0)
            return
        if self._wanted:
            return
        self.get_logger().info(f"{motion.partition(';')[0]}: enabling again, nothing has moved yet")
        self._wanted, self._begin = True, time.monotonic()

    def _look(self) -> None:
        now = time.monotonic()
        if self._future is not None and self._future.done():
            self._take(self._future.result())
        if not self._wanted:
            return
        if now - self._begin > self._patience:
            shell.finish(2, f"motion could not be enabled within {self._patience:g} s: {self._reason}")
            return
        if self._future is not None and now - self._asked > ANSWER_S:
            self._client.remove_pending_request(self._future)
            self._future = None
            self._reason = f"{SERVICE} does not answer"
        waiting = self._waiting or (self._stays and now - self._heard > SILENT_S)
        if self._future is None and not waiting and self._client.service_is_ready():
            self._asked = now
            self._future = self._client.call_async(SetBool.Request(data=True))

    def _take(self, answer: SetBool.Response) -> None:
        self._future = None
        self._reason = answer.message
        if not answer.success:
            if self._given and answer.message.startswith(STOP):
                shell.finish(0)
            return
        self._wanted, self._given = False, True
        self.get_logger().info(answer.message)
        if not self._stays:
            shell.finish(0)


def main() -> int:
    """Run until motion is enabled, the time is over, or SIGINT or SIGTERM; returns the exit status."""
    return shell.run(EnableNode)


if __name__ == "__main__":
    raise SystemExit(main())
