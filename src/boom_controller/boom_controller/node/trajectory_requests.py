"""Planned motions that are asked for, by topic and by action."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from trajectory_msgs.msg import JointTrajectory

from boom_controller.loop.control_loop import ControlLoop
from boom_controller.loop.cycle import Cycle
from boom_controller.node import goal_formats, messages
from boom_controller.node.node_parameters import supervision_of
from boom_controller.node.sample_times import SampleTimes
from boom_controller.node.trajectory_action import TrajectoryAction
from boom_controller.references.joint_trajectory import TrajectoryError
from boom_controller.supervision.tracking_goal import Tolerances
from boom_node import qos
from boom_node.stamps import ns_to_seconds, to_ns

_TOPIC = "/boom/joint_trajectory"


class TrajectoryRequests:
    """The topic ``/boom/joint_trajectory`` and the action.

    Args:
        node: the node.
        values: its parameters.
        times: of its samples.
        active_loop: the control loop while it commands, else None.
    """

    def __init__(
        self, node: Any, values: Mapping[str, Any], times: SampleTimes, active_loop: Callable[[], ControlLoop | None]
    ) -> None:
        self._node, self._values, self._times, self._active_loop = node, values, times, active_loop
        self._format = goal_formats.installed()
        self._action = TrajectoryAction(node, self._format, values["joint_name"], self._start_goal, self._cancel)
        self._feedback_at = 0

    def answer(self, cycle: Cycle, loop: ControlLoop, stamp_ns: int) -> None:
        """What a cycle means for them: ends, feedback; from the first cycle on that could track one they are offered.

        Who finds topic and action there can use them.
        """
        if not self._action.offered and not loop.interlock.missing(self._times.now()):
            self._node.create_subscription(JointTrajectory, _TOPIC, self._on_message, qos.BY_TOPIC[_TOPIC])
            self._action.offer()
        for number, ending in cycle.endings:
            if not self._action.end(number, ending) and ending.text:
                self._node.get_logger().warning(f"trajectory: {ending.text}")
        running = self._action.running
        since = stamp_ns - self._feedback_at  # below 0: a simulation's clock began again
        if running and not 0 <= since < 1e9 / self._values["feedback_rate"]:
            self._feedback_at = stamp_ns
            for number in running:
                progress = loop.goal_progress(number)
                if progress is not None:
                    self._action.feed_back(number, stamp_ns, progress)

    def finish(self, loop: ControlLoop) -> None:
        """Results of what ended outside of a cycle."""
        for number, ending in loop.pop_endings():
            self._action.end(number, ending)

    def destroy(self) -> None:
        """Take the action away."""
        self._action.destroy()

    def _on_message(self, message: JointTrajectory) -> None:
        loop = self._active_loop()
        if loop is None:
            return
        if not message.points:
            loop.cancel()
            return
        try:
            self._start(message, None)
        except TrajectoryError as error:
            self._node.get_logger().warning(f"trajectory refused: {error}")

    def _start(self, message: JointTrajectory, tolerances: Tolerances | None) -> int:
        loop = self._active_loop()
        if loop is None:
            raise TrajectoryError("the controller is not active: activate it first")
        points = messages.points_of(message, self._values["joint_name"])
        stamp_ns = to_ns(message.header.stamp)
        begin = ns_to_seconds(stamp_ns - (self._times.origin_ns or 0)) if stamp_ns else None
        return loop.start(points, self._times.now(), begin=begin, tolerances=tolerances)

    def _start_goal(self, request: Any) -> int:
        tolerances = self._format.tolerances(request, self._values["joint_name"], supervision_of(self._values))
        return self._start(request.trajectory, tolerances)

    def _cancel(self, number: int) -> bool:
        loop = self._active_loop()
        return loop is not None and loop.cancel(number)
