"""The action for planned motions: goals, feedback and a result with the reason. The result also answers a refused goal.

A rejected goal in rclpy carries no reason; so every goal is accepted, and one that cannot be tracked is aborted at once with code
and sentence.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from rclpy.action import ActionServer, CancelResponse, GoalResponse
from rclpy.qos import QoSProfile

from boom_controller.node.goal_formats import GoalFormat, Progress
from boom_controller.references.joint_trajectory import Code, TrajectoryError
from boom_controller.supervision.tracking_goal import Ending
from boom_node.motion_action import NAME

_MANY = QoSProfile(depth=200)
"""As many clients may ask in the same instant; of a service's usual ten the others would wait for ever."""


class _Server(ActionServer):
    """rclpy's action server, except that a running goal is not a task.

    rclpy executes a goal as a coroutine that waits until it is over. The EventsExecutor polls a waiting task without end, at the
    cost of a whole core, and samples compete with it for the queue: they came up to 100 ms late. Here the task begins when the
    goal has ended, and ends at once.
    """

    begin: Callable[[Any], None]
    format: GoalFormat

    def notify_execute(self, goal_handle: Any, _execute_callback: Any) -> None:
        """Note an accepted goal."""
        self.begin(goal_handle)

    def end(self, goal_handle: Any, ending: Ending) -> None:
        """Tell the client that the goal has ended."""

        def result(_: Any) -> Any:
            if goal_handle.is_cancel_requested:
                goal_handle.canceled()
            elif ending.code is Code.SUCCESSFUL and not ending.text:
                goal_handle.succeed()
            else:
                goal_handle.abort()
            return self.format.result(ending)

        super().notify_execute(goal_handle, result)


class TrajectoryAction:
    """The server of one node, once it is offered.

    Args:
        node: the node.
        goals: format of goals, feedback and results.
        joint: name of the boom's joint.
        start: starts a goal and returns its number; raises TrajectoryError.
        cancel: ends the trajectory of a number; False if it does not run.
    """

    def __init__(
        self, node: Any, goals: GoalFormat, joint: str, start: Callable[[Any], int], cancel: Callable[[int], bool]
    ) -> None:
        self._node, self._format, self._joint, self._start, self._cancel = node, goals, joint, start, cancel
        self._running: dict[int, Any] = {}
        self._server: _Server | None = None

    @property
    def offered(self) -> bool:
        """Whether there is a server."""
        return self._server is not None

    def offer(self) -> None:
        """Create the server."""
        self._server = _Server(
            self._node,
            self._format.kind,
            f"~/{NAME}",
            execute_callback=self._begin,
            goal_callback=lambda _: GoalResponse.ACCEPT,
            cancel_callback=self._on_cancel,
            result_timeout=60,
            goal_service_qos_profile=_MANY,
            result_service_qos_profile=_MANY,
            cancel_service_qos_profile=_MANY,
        )
        self._server.begin, self._server.format = self._begin, self._format

    @property
    def running(self) -> list[int]:
        """Numbers of the running goals."""
        return list(self._running)

    def end(self, number: int, ending: Ending) -> bool:
        """Note an ended trajectory. False if it was not a goal of the action."""
        handle = self._running.pop(number, None)
        if handle is None or self._server is None:
            return False
        self._server.end(handle, ending)
        return True

    def feed_back(self, number: int, stamp_ns: int, progress: Progress) -> None:
        """Tell the client how far a trajectory has come."""
        handle = self._running.get(number)
        if handle is not None:
            handle.publish_feedback(self._format.feedback(self._joint, stamp_ns, progress))

    def _begin(self, handle: Any) -> None:
        assert self._server is not None  # who calls
        try:
            self._running[self._start(handle.request)] = handle
        except TrajectoryError as error:
            self._server.end(handle, Ending(error.code, str(error), 0.0))
        except Exception:
            self._server.end(handle, Ending(Code.INVALID_GOAL, "internal error: see the log of the controller", 0.0))
            raise

    def _on_cancel(self, handle: Any) -> CancelResponse:
        number = next((number for number, running in self._running.items() if running is handle), None)
        if number is None or not self._cancel(number):
            return CancelResponse.REJECT
        return CancelResponse.ACCEPT

    def destroy(self) -> None:
        """Destroy the server."""
        if self._server is not None:
            self._server.destroy()
