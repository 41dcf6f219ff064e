"""Goals, feedback and results in the two actions that a planned motion can be asked for with."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from builtin_interfaces.msg import Duration
from trajectory_msgs.msg import JointTrajectoryPoint

from boom_controller.references.joint_trajectory import Code, TrajectoryError
from boom_controller.supervision.supervision_settings import SupervisionSettings
from boom_controller.supervision.tracking_goal import Ending, Tolerances
from boom_input.shown import quoted
from boom_node.motion_action import NAME, MotionAction
from boom_node.stamps import seconds_to_ns, set_ns

Progress = tuple[float, float, float, float]
"""Wanted and measured angle [rad], time since the start of the trajectory [s], and its pace [-], 1 where it is not slowed."""


class OwnFormat:
    """boom_interfaces/TrackTrajectory."""

    def __init__(self, kind: Any) -> None:
        self.kind = kind

    def tolerances(self, goal: Any, _joint: str, settings: SupervisionSettings) -> Tolerances:
        """What the goal asks for."""
        return Tolerances.asked(goal.path_tolerance, goal.goal_tolerance, goal.goal_time_tolerance, settings)

    def result(self, ending: Ending) -> Any:
        """How the motion ended."""
        return self.kind.Result(
            error_code=int(ending.code), error_string=ending.text, max_error=float(ending.largest_error)
        )

    def feedback(self, _joint: str, stamp_ns: int, progress: Progress) -> Any:
        """How far it has come."""
        wanted, actual, elapsed, pace = progress
        message = self.kind.Feedback(desired_angle=wanted, actual_angle=actual, error_angle=wanted - actual, pace=pace)
        set_ns(message.header.stamp, stamp_ns)
        set_ns(message.time_from_start, _ns(elapsed))
        return message


class StandardFormat:
    """control_msgs/FollowJointTrajectory for the one joint; what is asked for and not watched is refused."""

    def __init__(self, kind: Any) -> None:
        self.kind = kind

    def tolerances(self, goal: Any, joint: str, settings: SupervisionSettings) -> Tolerances:
        """What the goal asks for. Raises TrajectoryError."""
        if goal.multi_dof_trajectory.points or goal.component_path_tolerance or goal.component_goal_tolerance:
            raise TrajectoryError("the goal is for joints of several degrees of freedom: the boom has none")
        time = goal.goal_time_tolerance
        return Tolerances.asked(
            _angle(goal.path_tolerance, joint, "path_tolerance"),
            _angle(goal.goal_tolerance, joint, "goal_tolerance"),
            time.sec + 1e-9 * time.nanosec,
            settings,
        )

    def result(self, ending: Ending) -> Any:
        """How the motion ended."""
        return self.kind.Result(error_code=int(ending.code), error_string=ending.text)

    def feedback(self, joint: str, stamp_ns: int, progress: Progress) -> Any:
        """How far it has come; there is no place for the pace, which the state and the diagnostics tell."""
        wanted, actual, elapsed, _ = progress
        since = set_ns(Duration(), _ns(elapsed))
        desired, measured, error = (
            JointTrajectoryPoint(positions=[value], time_from_start=since)
            for value in (wanted, actual, wanted - actual)
        )
        message = self.kind.Feedback(joint_names=[joint], desired=desired, actual=measured, error=error)
        set_ns(message.header.stamp, stamp_ns)
        return message


GoalFormat = OwnFormat | StandardFormat


def installed() -> GoalFormat:
    """The format of the action that this installation has."""
    return (StandardFormat if NAME == "follow_joint_trajectory" else OwnFormat)(MotionAction)


def _angle(tolerances: Sequence[Any], joint: str, name: str) -> float:
    """The tolerance of the angle [rad]; 0 where none is asked for. Raises TrajectoryError."""
    foreign = next((each.name for each in tolerances if each.name != joint), None)
    if foreign is not None:
        raise TrajectoryError(
            f"{name} is for {quoted(foreign) or 'no joint'}: this controller moves {joint} alone", Code.INVALID_JOINTS
        )
    if not all(math.isfinite(each.position) for each in tolerances):
        raise TrajectoryError(f"{name} is not finite: give rad, 0 for the default, or a negative number for none")
    if any(each.velocity > 0.0 or each.acceleration > 0.0 for each in tolerances):
        raise TrajectoryError(f"{name} limits a velocity or an acceleration: this controller watches positions alone")
    return float(tolerances[-1].position) if tolerances else 0.0


def _ns(elapsed: float) -> int:
    return int(seconds_to_ns(max(elapsed, 0.0)))
