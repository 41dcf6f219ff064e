"""The two actions: the same tolerances, feedback and results, and what the standard one asks for in vain is refused."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import pytest
from builtin_interfaces.msg import Duration
from control_msgs.action import FollowJointTrajectory
from control_msgs.msg import JointComponentTolerance, JointTolerance

from boom_controller.node import goal_formats
from boom_controller.node.goal_formats import OwnFormat, StandardFormat
from boom_controller.references.joint_trajectory import Code, TrajectoryError
from boom_controller.supervision.tracking_goal import Ending, Tolerances
from boom_interfaces.action import TrackTrajectory

JOINT = "inner_boom_joint"
DEFAULTS: Any = SimpleNamespace(path_tolerance=0.1, goal_tolerance=0.005, goal_time_tolerance=1.0)
OWN, STANDARD = OwnFormat(TrackTrajectory), StandardFormat(FollowJointTrajectory)


def standard(**fields: Any) -> Any:
    return FollowJointTrajectory.Goal(**fields)


def limit(position: float, name: str = JOINT, **others: float) -> Any:
    return JointTolerance(name=name, position=position, **others)


def test_both_actions_ask_for_the_same() -> None:
    own = TrackTrajectory.Goal(path_tolerance=0.02, goal_tolerance=-1.0, goal_time_tolerance=2.5)
    other = standard(
        path_tolerance=[limit(0.02)],
        goal_tolerance=[limit(-1.0)],
        goal_time_tolerance=Duration(sec=2, nanosec=500_000_000),
    )
    asked = Tolerances(0.02, None, 2.5)
    assert OWN.tolerances(own, JOINT, DEFAULTS) == STANDARD.tolerances(other, JOINT, DEFAULTS) == asked


def test_what_is_not_asked_for_is_the_controllers_default() -> None:
    assert STANDARD.tolerances(standard(), JOINT, DEFAULTS) == Tolerances(0.1, 0.005, 1.0)


@pytest.mark.parametrize(
    ("goal", "code", "words"),
    [
        (standard(path_tolerance=[limit(0.1, "elbow")]), Code.INVALID_JOINTS, "for elbow"),
        (standard(goal_tolerance=[limit(0.1, velocity=0.2)]), Code.INVALID_GOAL, "watches positions alone"),
        (standard(goal_tolerance=[limit(math.nan)]), Code.INVALID_GOAL, "not finite"),
        (standard(component_path_tolerance=[JointComponentTolerance()]), Code.INVALID_GOAL, "several degrees"),
    ],
)
def test_a_tolerance_that_nobody_watches_is_refused(goal: Any, code: Code, words: str) -> None:
    with pytest.raises(TrajectoryError, match=words) as caught:
        STANDARD.tolerances(goal, JOINT, DEFAULTS)
    assert caught.value.code is code


def test_feedback_and_result_tell_the_same() -> None:
    own, other = (each.feedback(JOINT, 3 * 10**9, (0.4, 0.3, 1.5, 0.6)) for each in (OWN, STANDARD))
    assert own.header == other.header
    assert [own.desired_angle, own.actual_angle] == [other.desired.positions[0], other.actual.positions[0]]
    assert other.error.positions[0] == pytest.approx(own.error_angle)
    assert own.time_from_start == other.actual.time_from_start
    ending = Ending(Code.PATH_TOLERANCE_VIOLATED, "away", 0.2)
    assert OWN.result(ending).error_string == STANDARD.result(ending).error_string == "away"
    assert OWN.result(ending).error_code == STANDARD.result(ending).error_code == -4


def test_the_standard_action_is_used_where_it_is_installed() -> None:
    assert isinstance(goal_formats.installed(), StandardFormat)
