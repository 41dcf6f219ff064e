"""Moves the boom to an angle, by topic or by action: a minimal program that sends trajectories.

./boom python -m boom_node.move_node 0.35 --seconds 2
./boom python -m boom_node.move_node 0.30 --seconds 2 --by action
"""

from __future__ import annotations

import argparse
import math
import sys
import time
from collections.abc import Callable
from typing import Any

from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from boom_interfaces.msg import ControllerState
from boom_node import motion_action, qos
from boom_node.stamps import seconds_to_ns, set_ns

PATIENCE_S = 10.0
JOINT = "inner_boom_joint"
TOPIC, ACTION = "/boom/joint_trajectory", f"/boom_controller/{motion_action.NAME}"


class NotMovedError(RuntimeError):
    """The boom was not moved; one line that says why."""


def trajectory(angle: float, seconds: float) -> JointTrajectory:
    """A motion that comes to rest at this angle [rad] after so many seconds."""
    point = JointTrajectoryPoint(positions=[angle], velocities=[0.0], accelerations=[0.0])
    set_ns(point.time_from_start, seconds_to_ns(seconds))
    return JointTrajectory(joint_names=[JOINT], points=[point])


def until(node: Any, done: Callable[[], Any], patience: float, otherwise: str) -> None:
    """Spin until the condition holds.

    Raises:
        NotMovedError: the condition did not hold within so many seconds.
    """
    import rclpy

    end = time.monotonic() + patience
    while not done():
        if time.monotonic() > end:
            raise NotMovedError(otherwise)
        rclpy.spin_once(node, timeout_sec=0.05)


def by_topic(node: Any, wanted: JointTrajectory, patience: float) -> None:
    """Publish it and wait until the controller holds its end. Raises NotMovedError."""
    states: list[ControllerState] = []
    node.create_subscription(ControllerState, "/boom/controller_state", states.append, qos.SENSOR_DATA)
    publisher = node.create_publisher(JointTrajectory, TOPIC, qos.BY_TOPIC[TOPIC])
    nobody = f"no subscriber on {TOPIC}: is the controller running, and does it receive all sensors? Try ./boom sim --control"
    until(node, lambda: publisher.get_subscription_count() and states, PATIENCE_S, nobody)
    if states[-1].mode == "stopped":
        raise NotMovedError(f"the boom is stopped: {states[-1].reason}; call /boom_controller/resume first")
    states.clear()
    publisher.publish(wanted)
    until(
        node,
        lambda: any(s.mode == "track" for s in states),
        PATIENCE_S,
        "the motion was refused: see the controller's log",
    )
    until(node, lambda: states[-1].mode != "track", patience, "the motion does not finish")
    if states[-1].mode != "hold" or states[-1].reason:
        raise NotMovedError(f"{states[-1].mode}: {states[-1].reason}")


def by_action(node: Any, wanted: JointTrajectory, patience: float) -> None:
    """Send it as a goal and wait for its result. Raises NotMovedError."""
    from rclpy.action import ActionClient

    client = ActionClient(node, motion_action.MotionAction, ACTION)
    nobody = (
        f"no server of {ACTION}: is the controller running, and does it receive all sensors? Try ./boom sim --control"
    )
    until(node, client.server_is_ready, PATIENCE_S, nobody)
    sent = client.send_goal_async(motion_action.MotionAction.Goal(trajectory=wanted))
    until(node, sent.done, PATIENCE_S, "the controller does not answer")
    answer = sent.result().get_result_async()
    until(node, answer.done, patience, "the motion does not finish")
    result = answer.result().result
    if result.error_code != result.SUCCESSFUL or result.error_string:
        raise NotMovedError(result.error_string)


def main() -> int:
    """Move it; returns the exit status."""
    parser = argparse.ArgumentParser(
        prog="move", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("angle", type=float, help="target angle [rad], 0 = horizontal, positive = up")
    parser.add_argument("--seconds", type=float, default=4.0, help="duration of the motion [s] (default: 4)")
    parser.add_argument("--by", choices=("topic", "action"), default="topic", help="interface to use (default: topic)")
    args = parser.parse_args()
    if not (math.isfinite(args.angle) and 0.0 < args.seconds <= 600.0):
        parser.error("give an angle in rad and a time of at most 600 s")
    import rclpy

    rclpy.init(args=[])
    node = rclpy.create_node("boom_move")
    try:
        move = by_topic if args.by == "topic" else by_action
        move(node, trajectory(args.angle, args.seconds), args.seconds + PATIENCE_S)
    except NotMovedError as error:
        print(f"move: {' '.join(str(error).split())}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        return 130
    finally:
        node.destroy_node()
        rclpy.try_shutdown()
    print(f"the boom is at {args.angle:g} rad and held there")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
