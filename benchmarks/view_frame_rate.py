"""The page of `./boom view` beside a running controller: frames per second, processor time, and what the controller loses by it.

    python benchmarks/view_frame_rate.py --seconds 30

Starts as processes, in a ROS domain of their own: the simulated crane in real time, the controller that follows the recorded angle
of a bag, and that bag's replay; then the same with the page in a headless Chromium, which draws with the processor in place of
a graphics card. Where a computer has other work to do, compare processor times and the two columns, not frames.

frames          animation frames of the page, and those later than 25 ms, by the page's own clock
processor       user and system time of each process and its children over the time measured, in percent of a core
travel          of the boom, by its angle: what is measured is a boom that moves, or the benchmark ends with status 2
commands        of the controller, by their stamps: how many came, jitter |time between two - 10 ms|, periods without one
"""

from __future__ import annotations

import argparse
import contextlib
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "test"))
os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")

import numpy as np
import psutil
from headless_browser import Browser

from boom_bringup import environment
from boom_bringup.node_command import node_command

ROOT = Path(__file__).resolve().parents[1]
FRAMES = "window.times = []; (function f(t) { window.times.push(t); requestAnimationFrame(f); })(performance.now())"


@contextlib.contextmanager
def process(module: str, parameters: dict[str, Any], **options: Any) -> Iterator[subprocess.Popen[str]]:
    """A node, ended by SIGINT."""
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL, "text": True} | options
    started = subprocess.Popen(node_command(module, parameters), **quiet)
    try:
        yield started
    finally:
        started.send_signal(signal.SIGINT)
        started.wait(30)


def used(pid: int) -> float:
    """Processor time [s] of a process and its children."""
    total = 0.0
    for one in (psutil.Process(pid), *psutil.Process(pid).children(recursive=True)):
        with contextlib.suppress(psutil.NoSuchProcess):
            times = one.cpu_times()
            total += times.user + times.system
    return total


class Commands:
    """Stamps [s] of the controller's commands and angles [rad] of the boom, heard in this process."""

    def __init__(self) -> None:
        import rclpy
        from rclpy.executors import SingleThreadedExecutor
        from sensor_msgs.msg import JointState

        from boom_interfaces.msg import SolenoidCurrents
        from boom_node import qos
        from boom_node.stamps import to_ns
        from boom_recording.channels import DEFAULT_JOINT

        rclpy.init()
        self.node = rclpy.create_node("view_benchmark")
        self.stamps: list[float] = []
        self.node.create_subscription(
            SolenoidCurrents,
            "/boom/current_command",
            lambda message: self.stamps.append(to_ns(message.header.stamp) * 1e-9),
            qos.EVERY_SENSOR_SAMPLE,
        )
        self.angles: list[float] = []
        self.node.create_subscription(
            JointState,
            "/joint_states",
            lambda message: self.angles.append(message.position[message.name.index(DEFAULT_JOINT)]),
            qos.EVERY_SENSOR_SAMPLE,
        )
        self.executor = SingleThreadedExecutor()
        self.executor.add_node(self.node)

    def hear(self, seconds: float) -> list[float]:
        """The stamps of the next seconds."""
        for duration in (0.5, seconds):  # first what has queued up meanwhile
            self.stamps.clear()
            self.angles.clear()
            end = time.monotonic() + duration
            while time.monotonic() < end:
                self.executor.spin_once(timeout_sec=0.1)
        return list(self.stamps)

    def travel(self) -> str:
        """How the boom moved."""
        if not self.angles:
            return "no angle heard"
        return f"boom moved {self.moving():.0%} of the time, {min(self.angles):.2f} to {max(self.angles):.2f} rad"

    def wait(self) -> None:
        """Until the boom moves."""
        end = time.monotonic() + 60.0
        while not self.hear(0.5) or self.moving() < 0.5:
            if time.monotonic() > end:
                sys.exit("the boom did not move within 60 s: is this computer that busy?")

    def moving(self) -> float:
        """The part of the time heard in which the boom turned by 5 mrad/s or more."""
        steps = np.abs(np.diff(self.angles[::20])) if len(self.angles) > 40 else np.zeros(1)  # 0.2 s each
        return float(np.mean(steps > 1e-3))


def first_angle(bag: str) -> float:
    """Where a recording begins [rad]: a controller follows no reference that is far from its boom."""
    from boom_recording.loading import load

    return float(load(bag).signals["angle"].values[0])


def said(stamps: list[float]) -> str:
    """One line of the table."""
    periods = np.diff(stamps)
    late = np.abs(periods - 0.01)
    missed = int(np.sum(np.round(periods / 0.01) - 1))
    jitter = f"jitter p50 {np.median(late) * 1e3:.2f} ms, p99 {np.quantile(late, 0.99) * 1e3:.2f} ms"
    return f"{len(stamps)} commands, {jitter}, missed {missed}"


def main() -> int:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=float, default=30.0, help="of each measurement [s] (default: 30)")
    parser.add_argument("--bag", default=str(ROOT / "bags/healthy/extended"), help="whose angle is followed")
    parser.add_argument("--picture", metavar="F.png", help="write a picture of the page")
    args = parser.parse_args()
    environment.apply()
    with contextlib.ExitStack() as stack:
        os.environ["ROS_DOMAIN_ID"] = stack.enter_context(environment.private_domain())
        browser = stack.enter_context(Browser())  # one that runs already: its own start takes both cores for a second
        browser.open("about:blank", 1300)
        crane = {
            "initial_angle": first_angle(args.bag),
            "outer_boom_angle": 0.28,
            "telescope_length": 2.2,
            "controller_follows": True,
        }
        names = {
            "simulation": stack.enter_context(process("boom_sim.simulation_node", crane)),
            "controller": stack.enter_context(process("boom_controller.controller_node", {"machine": "tz17"})),
        }
        replay = {"bag": args.bag, "what": "reference", "loop": True}
        stack.enter_context(process("boom_recording.replay_node", replay))
        commands = Commands()
        commands.wait()
        print(f"without the page: {said(commands.hear(args.seconds))}, {commands.travel()}", flush=True)
        names["view"] = stack.enter_context(process("boom_view.view_node", {"port": 0}, stdout=subprocess.PIPE))
        assert names["view"].stdout is not None
        address = names["view"].stdout.readline().removeprefix("page: ").split()[0]
        browser.open(address, 1300)
        while not browser.value("Boolean(window.view && view.data && view.data.time.length > 300)"):
            time.sleep(0.2)
        browser.value(FRAMES)
        pids = {name: one.pid for name, one in names.items()} | {"browser": browser._process.pid}
        before, begin = {name: used(pid) for name, pid in pids.items()}, time.monotonic()
        heard = commands.hear(args.seconds)
        took = time.monotonic() - begin
        shares = {name: 100 * (used(pid) - before[name]) / took for name, pid in pids.items()}
        times = np.array(browser.value("window.times"))
        print(f"with the page:    {said(heard)}, {commands.travel()}")
        gaps, span = np.diff(times), (times[-1] - times[0]) / 1e3
        print(f"frames: {len(gaps) / span:.1f} a second over {span:.0f} s, {np.mean(gaps > 25):.1%} later than 25 ms")
        print("processor [% of a core]: " + ", ".join(f"{name} {share:.1f}" for name, share in shares.items()))
        cost = 10 * shares["browser"] * took / len(gaps)
        print(
            f"a frame costs the browser {cost:.1f} ms of processor time; load of the computer {os.getloadavg()[0]:.1f}"
        )
        if args.picture:
            browser.picture(Path(args.picture))
        if commands.moving() < 0.3:
            print(
                "the boom rested while the page was measured, which is an easier picture: run it again on a quieter computer"
            )
            return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
