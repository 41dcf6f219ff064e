"""The action that takes planned motions: control_msgs/FollowJointTrajectory, or where that is not installed TrackTrajectory.

Goals hold a ``trajectory``, results ``error_code`` and ``error_string`` in both.
"""

try:
    from control_msgs.action import FollowJointTrajectory as MotionAction

    NAME = "follow_joint_trajectory"
except ImportError:
    from boom_interfaces.action import TrackTrajectory as MotionAction

    NAME = "track_trajectory"

__all__ = ["NAME", "MotionAction"]
