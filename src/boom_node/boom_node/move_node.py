"""Moves the boom to an angle, by topic or by action: a minimal program that sends trajectories.

./boom python -m boom_node.move_node 0.35 --seconds 2
./boom python -m boom_node.move_node 0.30 --seconds 2 --by action
"""

from __future__ import annotations

import argparse
import math
import signal
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from threading import Event
from typing import Any

from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from boom_input.ending import ending_signals
from boom_interfaces.msg import ControllerState
from boom_node import motion_action, qos
from boom_node.stamps import seconds_to_ns, set_ns

PATIENCE_S = 10.0
REST_S = 3.0
"""How long an interrupted program waits until the controller has taken its wish to rest."""
JOINT = "inner_boom_joint"
TOPIC, ACTION = "/boom/joint_trajectory", f"/boom_controller/{motion_action.NAME}"


_interrupted = Event()


class NotMovedError(RuntimeError):
    """The boom was not moved; one line that says why."""


def trajectory(angle: float, seconds: float) -> JointTrajectory:
    """A motion that comes to rest at this angle [rad] after so many seconds."""
    point = JointTrajectoryPoint(positions=[angle], velocities=[0.0], accelerations=[0.0])
    set_ns(point.time_from_start, seconds_to_ns(seconds))
    return JointTrajectory(joint_names=[JOINT], points=[point])


@contextmanager
def program(name: str) -> Iterator[Any]:
    """A node of a program that Ctrl-C and SIGTERM end with KeyboardInterrupt, in :func:`until`: it brings to rest what it moves."""
    import rclpy
    from rclpy.signals import SignalHandlerOptions

    rclpy.init(args=[], signal_handler_options=SignalHandlerOptions.NO)
    for number in ending_signals():
        signal.signal(number, lambda *_: _interrupted.set())
    node = rclpy.create_node(name)
    try:
        yield node
    finally:
        node.destroy_node()
        rclpy.try_shutdown()


def until(node: Any, done: Callable[[], Any], patience: float, otherwise: str) -> None:
    """Spin until the condition holds.

    Raises:
        NotMovedError: the condition did not hold within so many seconds.
        KeyboardInterrupt: the program was asked to end. Raised from within rclpy it would be a RuntimeError of its C++ code.
    """
    import rclpy

    end = time.monotonic() + patience
    while not done():
        if _interrupted.is_set():
            _interrupted.clear()
            raise KeyboardInterrupt
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
    refused = "the motion was refused: see the controller's log"
    try:
        until(node, lambda: any(s.mode == "track" for s in states), PATIENCE_S, refused)
        until(node, lambda: states[-1].mode != "track", patience, "the motion does not finish")
    except BaseException:
        publisher.publish(JointTrajectory(joint_names=[JOINT]))  # without points: come to rest and hold
        with suppress(NotMovedError):
            until(node, lambda: states[-1:] and states[-1].mode != "track", REST_S, "")
        raise
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
    follow(node, client, wanted, patience)


def follow(node: Any, client: Any, wanted: JointTrajectory, patience: float) -> None:
    """Send a goal and wait for its result; whatever ends this early takes the goal back. Raises NotMovedError."""
    sent = client.send_goal_async(motion_action.MotionAction.Goal(trajectory=wanted))
    try:
        until(node, sent.done, PATIENCE_S, "the controller does not answer")
        if not sent.result().accepted:
            raise NotMovedError("the controller does not take the motion")
        answer = sent.result().get_result_async()
        until(node, answer.done, patience, "the motion does not finish")
    except BaseException:
        with suppress(NotMovedError):
            until(node, sent.done, REST_S, "")
            if sent.result().accepted:
                until(node, sent.result().cancel_goal_async().done, REST_S, "")
        raise
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
    try:
        with program("boom_move") as node:
            move = by_topic if args.by == "topic" else by_action
            move(node, trajectory(args.angle, args.seconds), args.seconds + PATIENCE_S)
    except NotMovedError as error:
        print(f"move: {' '.join(str(error).split())}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print("move: stopped; the boom comes to rest", file=sys.stderr)
        return 130
    print(f"the boom is at {args.angle:g} rad and held there")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
