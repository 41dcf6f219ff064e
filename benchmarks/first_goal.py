"""The first goal after a start of `./boom sim --control`, and the first after a stop and ~/resume: does it succeed, and how fast?

    python benchmarks/first_goal.py --starts 50

Each start is one of `./boom sim --control` in a ROS domain of its own, with a partner that is there already. It sends a motion of
0.02 rad in 0.6 s as soon as the graph has the controller's topic or action, in every second start by topic; then an emergency stop
by service, ~/resume, and the next motion at once. A motion has succeeded when it has come to its end: by action with code 0, by
topic where the controller holds the angle that was asked for.

offered      from the start of `./boom` until topic or action is there
answered     from the goal until the first state in which it is tracked
oldest       largest age of an angle in the states of the motion, by its stamp on arrival here; 50 ms old stops the boom
stood still  on each core a process wakes up every 3 ms, before all others where it may: a goal that failed while one of them was
             more than 20 ms late failed with the computer (a virtual machine whose host runs others), and is counted apart

Exit status 1 where a goal has failed while the computer went on.
"""

from __future__ import annotations

import argparse
import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")

import rclpy
from builtin_interfaces.msg import Duration
from control_msgs.action import FollowJointTrajectory
from controller_timing import HIGHEST, metronomes
from rclpy.action import ActionClient
from rclpy.executors import SingleThreadedExecutor
from std_srvs.srv import Trigger
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from boom_bringup import environment
from boom_interfaces.msg import ControllerState
from boom_node import qos
from boom_node.stamps import ns_to_seconds, seconds_to_ns, set_ns, to_ns

ROOT = Path(__file__).resolve().parents[1]
PATIENCE_S = 120.0
ANGLES = (0.32, 0.34)
"""rad. From 0.3 rad, where the crane begins."""
DURATION_S = 0.6
STOOD_STILL_S = 0.02


@dataclass
class Start:
    """What was seen of one start: by action or by topic; of each goal its failure ("" = none) and the times [s]."""

    way: str
    offered: float = 0.0
    failures: list[str] = field(default_factory=list)
    begun: list[float] = field(default_factory=list)
    ended: list[float] = field(default_factory=list)
    answered: list[float] = field(default_factory=list)
    oldest: list[float] = field(default_factory=list)


class Partner:
    """Who gives the goals."""

    def __init__(self, domain: str) -> None:
        self.context = rclpy.Context()
        rclpy.init(context=self.context, domain_id=int(domain))
        self.node = rclpy.create_node("first_goal", context=self.context)
        self.executor = SingleThreadedExecutor(context=self.context)
        self.executor.add_node(self.node)
        self.states: list[ControllerState] = []
        self.ages: list[float] = []
        self.node.create_subscription(ControllerState, "/boom/controller_state", self._on_state, qos.SENSOR_DATA)
        self.action = ActionClient(self.node, FollowJointTrajectory, "/boom_controller/follow_joint_trajectory")
        self.topic = self.node.create_publisher(JointTrajectory, "/boom/joint_trajectory", qos.EVENTS)

    def _on_state(self, message: ControllerState) -> None:
        self.states.append(message)
        self.ages.append(ns_to_seconds(self.node.get_clock().now().nanoseconds - to_ns(message.header.stamp)))

    def until(self, done: Callable[[], Any], patience: float = PATIENCE_S) -> bool:
        """Whether it happened in time."""
        end = time.monotonic() + patience
        while not done():
            if time.monotonic() > end:
                return False
            self.executor.spin_once(timeout_sec=0.02)
        return True

    def call(self, name: str) -> bool:
        """A service of the controller without arguments: did it say yes?"""
        client = self.node.create_client(Trigger, f"/boom_controller/{name}")
        assert self.until(client.service_is_ready), name
        future = client.call_async(Trigger.Request())
        assert self.until(future.done), name
        self.node.destroy_client(client)
        return bool(future.result().success)

    def go(self, start: Start, angle: float) -> None:
        """One motion to this angle [rad], and what came of it."""
        message = JointTrajectory(joint_names=["inner_boom_joint"])
        point = JointTrajectoryPoint(positions=[angle], velocities=[0.0], accelerations=[0.0])
        set_ns(point.time_from_start, seconds_to_ns(DURATION_S))
        message.points.append(point)
        begun, first = time.monotonic(), len(self.states)
        start.begun.append(time.time())

        def tracked() -> bool:
            return any(state.mode == "track" for state in self.states[first:])

        if start.way == "action":
            goal = FollowJointTrajectory.Goal(trajectory=message, goal_time_tolerance=Duration(sec=10))
            future = self.action.send_goal_async(goal)
            assert self.until(future.done)
            answer = future.result().get_result_async()
            self.until(lambda: tracked() or answer.done())
        else:
            self.topic.publish(message)
            self.until(tracked, 10.0)
        start.answered.append(time.monotonic() - begun)
        ended = "not followed" if not tracked() else ""
        if start.way == "action":
            assert self.until(answer.done)
            result = answer.result().result
            ended = (
                ""
                if result.error_code == 0 and not result.error_string
                else f"{result.error_code} {result.error_string}"
            )
        elif not ended:
            self.until(lambda: self.states[-1].mode not in ("track", "stopping"))
            last = self.states[-1]
            ended = (
                "" if last.mode == "hold" and abs(last.reference_angle - angle) < 1e-3 else f"{last.mode} {last.reason}"
            )
        start.failures.append(ended)
        start.ended.append(time.time())
        moving = [
            age for age, state in zip(self.ages[first:], self.states[first:], strict=True) if state.mode == "track"
        ]
        start.oldest.append(max(moving, default=float("nan")))

    def close(self) -> None:
        """End the node."""
        self.executor.shutdown()
        self.node.destroy_node()
        self.context.try_shutdown()


def one(way: str, words: list[str], log: Path | None) -> Start:
    """Starts, two goals, ends."""
    seen = Start(way)
    with environment.private_domain() as domain, open(log or os.devnull, "a", encoding="utf-8") as told:
        partner = Partner(domain)
        begun = time.monotonic()
        boom = subprocess.Popen(
            [str(ROOT / "boom"), "sim", "--control", *words],
            env=dict(os.environ, ROS_DOMAIN_ID=domain), stdout=told, stderr=told,
        )  # fmt: skip
        try:
            there = partner.action.server_is_ready if way == "action" else partner.topic.get_subscription_count
            assert partner.until(lambda: there() or boom.poll() is not None)
            assert boom.poll() is None, "./boom sim --control has ended"
            seen.offered = time.monotonic() - begun
            partner.go(seen, ANGLES[0])
            assert partner.until(lambda: partner.states)
            partner.call("emergency_stop")
            assert partner.until(lambda: partner.states[-1].mode == "stopped")
            assert partner.until(lambda: partner.call("resume"))
            partner.go(seen, ANGLES[1] if not seen.failures[0] else ANGLES[0])
        finally:
            boom.send_signal(signal.SIGINT)
            try:
                boom.wait(PATIENCE_S)
            finally:
                partner.close()
    return seen


def main() -> int:
    """Measures and prints."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--starts", type=int, default=50, help="by topic and by action so many each (default: 50)")
    parser.add_argument("--realtime-priority", help="as of ./boom sim")
    parser.add_argument("--json", type=Path, help="write what was seen to this file")
    parser.add_argument("--log", type=Path, help="append what the processes say to this file")
    args = parser.parse_args()
    with metronomes(dict.fromkeys(sorted(os.sched_getaffinity(0)), HIGHEST)) as woken:
        seen = measure(args)
        late = [(when, over) for when, over in woken() if over > STOOD_STILL_S]
    if args.json:
        args.json.write_text(json.dumps([asdict(start) for start in seen], indent=2) + "\n", encoding="utf-8")
    return tell(seen, late)


def measure(args: argparse.Namespace) -> list[Start]:
    """All starts; failures are printed as they come."""
    seen: list[Start] = []
    words = [] if args.realtime_priority is None else ["--realtime-priority", args.realtime_priority]
    for k in range(2 * args.starts):
        seen.append(one(("topic", "action")[k % 2], words, args.log))
        for which, failure in zip(("start", "resume"), seen[-1].failures, strict=True):
            if failure:
                print(f"start {k}, {seen[-1].way}: first goal after {which} failed: {failure}", flush=True)
    return seen


def tell(seen: list[Start], late: list[tuple[float, float]]) -> int:
    """Prints the table; late: (when, how late [s]) the computer was. Returns how many failed while it went on."""
    failed = 0
    print("                       succeeded  stood still  offered [s]    answered [ms]  oldest angle [ms]")
    for way in ("topic", "action"):
        mine = [start for start in seen if start.way == way]
        for k, after in enumerate(("start", "resume")):
            good = sum(not start.failures[k] for start in mine)
            stood = sum(
                bool(start.failures[k])
                and any(start.begun[k] <= when and when - by <= start.ended[k] for when, by in late)
                for start in mine
            )
            failed += len(mine) - good - stood
            offered = _of([start.offered for start in mine], 1.0)
            answered = _of([start.answered[k] for start in mine], 1e3)
            oldest = _of([start.oldest[k] for start in mine], 1e3)
            print(
                f"by {way:6s} after {after:6s}  {good:3d} of {len(mine):3d}  {stood:11d}  {offered:13s}  {answered:13s}  {oldest}"
            )
    print(f"the computer stood still {len(late)} times for more than {1e3 * STOOD_STILL_S:.0f} ms", end="")
    print(f", for {1e3 * max(over for _, over in late):.0f} ms at most" if late else "")
    return int(failed > 0)


def _of(values: list[float], scale: float) -> str:
    """Median and largest."""
    ordered = sorted(value * scale for value in values)
    return f"{ordered[len(ordered) // 2]:.1f} ({ordered[-1]:.1f})"


if __name__ == "__main__":
    sys.exit(main())
