"""The action TrackTrajectory: goals in, feedback and a result that says why. A goal that is refused is answered by its result.

rclpy tells a client of a rejected goal nothing but that it was rejected; so every goal is accepted, and one that cannot be tracked
is aborted at once with code and sentence.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from rclpy.action import ActionServer, CancelResponse, GoalResponse
from rclpy.task import Future

from boom_controller.joint_trajectory import Code, TrajectoryError
from boom_controller.tracking_goal import Ending
from boom_interfaces.action import TrackTrajectory
from boom_node.stamps import seconds_to_ns, set_ns


class TrajectoryAction:
    """The server of one node.

    Args:
        node: the node.
        start: starts a goal and returns its number; raises TrajectoryError.
        cancel: ends the trajectory of a number; False where it does not run.
    """

    def __init__(self, node: Any, start: Callable[[Any], int], cancel: Callable[[int], bool]) -> None:
        self._start, self._cancel = start, cancel
        self._running: dict[int, tuple[Any, Future]] = {}
        self._numbers: dict[bytes, int] = {}
        self._server = ActionServer(
            node,
            TrackTrajectory,
            "~/track_trajectory",
            execute_callback=self._execute,
            goal_callback=lambda _: GoalResponse.ACCEPT,
            cancel_callback=self._on_cancel,
            result_timeout=60,
        )

    @property
    def running(self) -> list[int]:
        """Numbers of the goals on their way."""
        return list(self._running)

    def end(self, number: int, ending: Ending) -> None:
        """A trajectory has ended."""
        entry = self._running.get(number)
        if entry is not None and not entry[1].done():
            entry[1].set_result(ending)

    def feed_back(self, number: int, stamp_ns: int, progress: tuple[float, float, float]) -> None:
        """Wanted and measured angle [rad] and time since the start [s] of a trajectory."""
        entry = self._running.get(number)
        if entry is None:
            return
        wanted, actual, elapsed = progress
        message = TrackTrajectory.Feedback(desired_angle=wanted, actual_angle=actual, error_angle=wanted - actual)
        set_ns(message.header.stamp, stamp_ns)
        set_ns(message.time_from_start, seconds_to_ns(max(elapsed, 0.0)))
        entry[0].publish_feedback(message)

    async def _execute(self, handle: Any) -> Any:
        try:
            number = self._start(handle.request)
        except TrajectoryError as error:
            handle.abort()
            return _result(Ending(error.code, str(error), 0.0))
        future: Future = Future()
        self._running[number] = (handle, future)
        self._numbers[bytes(handle.goal_id.uuid)] = number
        try:
            ending = await future
        finally:
            del self._running[number], self._numbers[bytes(handle.goal_id.uuid)]
        if handle.is_cancel_requested:
            handle.canceled()
        elif ending.code is Code.SUCCESSFUL and not ending.text:
            handle.succeed()
        else:
            handle.abort()
        return _result(ending)

    def _on_cancel(self, handle: Any) -> CancelResponse:
        number = self._numbers.get(bytes(handle.goal_id.uuid))
        if number is None or not self._cancel(number):
            return CancelResponse.REJECT
        return CancelResponse.ACCEPT

    def destroy(self) -> None:
        """Take the server away."""
        self._server.destroy()


def _result(ending: Ending) -> Any:
    return TrackTrajectory.Result(
        error_code=int(ending.code), error_string=ending.text, max_error=float(ending.largest_error)
    )
