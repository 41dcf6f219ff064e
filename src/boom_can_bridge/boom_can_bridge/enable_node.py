"""Enables motion once, as soon as the bridge accepts, and ends: ``ros2 run boom_can_bridge enable``.

It calls ``/boom_can_bridge/enable`` until the bridge agrees. Exit status 0, or 2 with the bridge's reason after ``wait_timeout``.
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
from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from std_srvs.srv import SetBool

SERVICE = "/boom_can_bridge/enable"
PARAMETERS = (
    ParameterSpec("wait_timeout", 20.0, "how long to try", "s", 0.1, 3600.0, read_only=True),
    ParameterSpec(
        "after_controller", False, "wait until a controller runs: while it loads, frames may be late and stop what is enabled",
        read_only=True,
    ),
)  # fmt: skip
LOOK_S = 0.05
ANSWER_S = 2.0
"""Longest wait for one answer: the answer of a service can be lost while both ends are still being discovered."""


class EnableNode(Node):
    """Requests motion until it is enabled."""

    def __init__(self) -> None:
        super().__init__("boom_enable")
        given = parameters.declare(self, PARAMETERS)
        self._patience, self._waiting = given.wait_timeout, given.after_controller
        self._begin = time.monotonic()
        self._reason = "no bridge is running: start it with python -m boom_can_bridge.bridge_node"
        self._future: Any = None
        self._asked = 0.0
        self._client = self.create_client(SetBool, SERVICE)
        if self._waiting:
            self._reason = "no controller is running: start it with python -m boom_controller.controller_node"
            self.create_subscription(ControllerState, "/boom/controller_state", self._runs, qos.SENSOR_DATA)
        self.create_timer(LOOK_S, self._look, clock=Clock(clock_type=ClockType.STEADY_TIME))

    def _runs(self, _: ControllerState) -> None:
        self._waiting = False

    def _look(self) -> None:
        now = time.monotonic()
        if self._future is not None and self._future.done():
            answer = self._future.result()
            self._future = None
            if answer.success:
                self.get_logger().info(answer.message)
                shell.finish(0)
                return
            self._reason = answer.message
        if now - self._begin > self._patience:
            shell.finish(2, f"motion could not be enabled within {self._patience:g} s: {self._reason}")
            return
        if self._future is not None and now - self._asked > ANSWER_S:
            self._client.remove_pending_request(self._future)
            self._future = None
            self._reason = f"{SERVICE} does not answer"
        if self._future is None and not self._waiting and self._client.service_is_ready():
            self._asked = now
            self._future = self._client.call_async(SetBool.Request(data=True))


def main() -> int:
    """Run until motion is enabled, the time is over, or SIGINT or SIGTERM; returns the exit status."""
    return shell.run(EnableNode)


if __name__ == "__main__":
    raise SystemExit(main())
