"""The controller as a process in real time: missed cycles, jitter, computation, and what the way over topics costs in tracking.

    python benchmarks/controller_timing.py --seconds 600

Starts as processes: the simulated crane in real time and the controller; with --transport can the crane's ECU, a bus inside this
computer and the bridge. This process gives the reference: the recorded angle of a bag, then within 5 s back to its beginning, again
and again. It hears commands and states.

missed cycles   periods of 10 ms in which no command was published, by the stamps of the commands
jitter          |time between two commands - 10 ms|, by their stamps
computation     of one cycle, as the controller measures it: supervision, reference, control law
tracking        (6.29) with the measured angle, first pass of the recording, beside the same loop in one process (no topics)
computer        on each core a process that does nothing but wake up every 3 ms, before all others if it may (on the controller's
                own core just after it): how late it was. A cycle that is missed while one was late too was missed by the
                computer (another process, a virtual machine that stands). And how long the host of a virtual machine has run
                others on cores that had work

So that one late cycle does not end the measurement, the controller's own watch for them is set wide here.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import math
import multiprocessing
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")

import numpy as np
import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.qos import QoSProfile, QoSReliabilityPolicy
from sensor_msgs.msg import JointState

from boom_bringup import demo_processes, environment
from boom_bringup.node_command import node_command
from boom_controller.controller import MODES, Settings, make_controller
from boom_controller.references.trajectory_generator import TrajectoryGenerator
from boom_interfaces.msg import ControllerState, SolenoidCurrents
from boom_model.machine import Machine
from boom_model.machine_file import shipped_machine
from boom_node import qos
from boom_node.stamps import to_ns
from boom_recording.errors import RecordingError
from boom_recording.loading import load
from boom_recording.recording import Recording
from boom_report.tracking import position_error as tracking
from boom_sim.simulated_crane import PERIOD, CraneStart, SimulatedCrane
from boom_trials.closed_loop import follow, wanted_angles

RETURN_S = 5.0
WARM_UP_S = 2.0
HIGHEST = 90
"""SCHED_FIFO priority of the processes that only wake up, where the controller has no core of its own. On its own core they come
just after it: before it, one cycle in thirty would wait for them, and nothing there makes them wait for as much as LATE_S."""
BEAT_S = 3e-3
LATE_S = 1e-3
"""A core that stands still for BEAT_S + LATE_S is always seen. Two that do so one after the other make a cycle count as missed."""
WIDE = {"longest_cycle": 1.0, "most_missed": 100, "sensor_timeout": 0.5, "reference_timeout": 1.0}
PATIENCE_S = 60.0
JOINT = "inner_boom_joint"


@dataclass
class Heard:
    """What was heard: stamps of the commands [ns], states as (stamp [ns], reference, its rate, angle, computation [s]).

    stolen: time [s] in which the host of a virtual machine ran others on cores that had work.
    """

    commands: list[int] = field(default_factory=list)
    states: list[tuple[int, float, float, float, float]] = field(default_factory=list)
    mode: str = ""
    reason: str = ""
    woken_late: list[tuple[float, float]] = field(default_factory=list)
    stolen: float = 0.0


def stolen() -> float:
    """Time [s] since the start of the computer that its host has taken from it (``steal`` of proc(5)), all cores together."""
    return int(Path("/proc/stat").read_text(encoding="ascii").split()[8]) / os.sysconf("SC_CLK_TCK")


@contextlib.contextmanager
def metronomes(priorities: dict[int, int]) -> Iterator[Callable[[], list[tuple[float, float]]]]:
    """On each core a process that only wakes up, with this priority. Call what is given: it ends them and says what they saw."""
    context = multiprocessing.get_context("spawn")
    enough, told = context.Event(), context.Queue()
    running = [
        context.Process(target=wake_up, args=(core, priority, enough, told), daemon=True)
        for core, priority in priorities.items()
    ]
    for process in running:
        process.start()

    def seen() -> list[tuple[float, float]]:
        enough.set()
        return [late for _ in running for late in told.get(timeout=PATIENCE_S)]

    try:
        yield seen
    finally:
        enough.set()
        for process in running:
            process.join(PATIENCE_S)


def wake_up(core: int, priority: int, ended: Any, told: Any) -> None:
    """Puts (when [s], how late [s]) of every wake-up of a core that came more than LATE_S late into the queue at the end."""
    os.sched_setaffinity(0, {core})
    with contextlib.suppress(OSError):  # before all of ours, or it would see them and not the computer
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(priority))
    late, due = [], time.monotonic() + BEAT_S
    while not ended.is_set():
        time.sleep(max(due - time.monotonic(), 0.0))
        over = time.monotonic() - due
        if over > LATE_S:
            late.append((time.time(), over))
        due = max(due + BEAT_S, time.monotonic())
    told.put(late)


def crane_commands(recording: Recording, wanted: np.ndarray, transport: str) -> list[list[str]]:
    """Command lines of what moves the crane; for the bus first, which the others wait for."""
    c = recording.configuration
    pose: dict[str, Any] = {
        "outer_boom_angle": c.outer_boom_angle, "telescope_length": c.telescope_length,
        "load_mass": 0.0 if math.isnan(c.load_mass) else c.load_mass, "machine": c.machine,
    }  # fmt: skip
    crane = {**pose, "initial_angle": float(wanted[0])}
    if transport == "topics":
        return [node_command("boom_sim.simulation_node", crane)]
    bus = demo_processes.free_bus()
    bridge = {**pose, **bus, "wait_for_bus": True, "rise_rate": 1000.0}
    return [
        demo_processes.bus_command(bus),
        node_command("boom_can_bridge.bridge_node", bridge),
        node_command("boom_sim.ecu_node", {**crane, **bus}),
        node_command("boom_can_bridge.enable_node", {}),
    ]


def run_processes(
    recording: Recording, wanted: np.ndarray, transport: str, controller: dict[str, Any], seconds: float
) -> Heard:
    """Runs crane and controller, which gets these parameters, for so many seconds; what was heard from the first reference on."""
    rclpy.init()
    node = rclpy.create_node("controller_timing")
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    heard = Heard()

    def on_state(m: ControllerState) -> None:
        heard.mode, heard.reason = m.mode, m.reason
        heard.states.append((to_ns(m.header.stamp), m.reference_angle, m.reference_rate, m.angle, m.cycle_time))

    reliable, best_effort = (
        QoSProfile(depth=200, reliability=kind)
        for kind in (QoSReliabilityPolicy.RELIABLE, QoSReliabilityPolicy.BEST_EFFORT)
    )
    node.create_subscription(
        SolenoidCurrents, "/boom/current_command", lambda m: heard.commands.append(to_ns(m.header.stamp)), reliable
    )
    node.create_subscription(ControllerState, "/boom/controller_state", on_state, best_effort)
    reference = node.create_publisher(JointState, "/boom/reference", qos.BY_TOPIC["/boom/reference"])
    commands = crane_commands(recording, wanted, transport)
    commands.append(node_command("boom_controller.controller_node", {**controller, **WIDE}))
    cores, own = os.sched_getaffinity(0), controller["realtime_core"]
    os.sched_setaffinity(0, cores - {own} or cores)
    processes = [subprocess.Popen(command) for command in commands[:-1]]
    os.sched_setaffinity(0, cores)
    processes.append(subprocess.Popen(commands[-1]))
    os.sched_setaffinity(0, cores - {own} or cores)
    ended = threading.Event()
    beside = max(controller["realtime_priority"] - 1, 1)
    watching = contextlib.ExitStack()
    woken = watching.enter_context(metronomes({core: beside if core == own else HIGHEST for core in sorted(cores)}))

    def give() -> None:
        begin, k = time.monotonic(), 0
        while not ended.wait(max(begin + k * PERIOD - time.monotonic(), 0.0)):
            message = JointState(name=[JOINT], position=[float(wanted[k % len(wanted)])])
            message.header.stamp = node.get_clock().now().to_msg()
            reference.publish(message)
            k += 1

    giver = threading.Thread(target=give, daemon=True)
    try:
        patience = time.monotonic() + PATIENCE_S
        ready_since = math.inf
        while time.monotonic() - ready_since < WARM_UP_S:
            if time.monotonic() > patience:
                raise SystemExit(f"the controller is not ready: {heard.mode} {heard.reason}")
            executor.spin_once(timeout_sec=0.1)
            if heard.mode == "idle" and not heard.reason:
                ready_since = min(ready_since, time.monotonic())
        heard.commands.clear()
        heard.states.clear()
        giver.start()
        begun, heard.stolen = time.time(), -stolen()
        end, told = time.monotonic() + seconds, time.monotonic() + 10.0
        while time.monotonic() < end and heard.mode not in ("stopping", "stopped"):
            executor.spin_once(timeout_sec=0.1)
            if time.monotonic() > told:
                told += 10.0
                print(
                    f"\r{seconds - (end - time.monotonic()):.0f} of {seconds:.0f} s",
                    end="",
                    file=sys.stderr,
                    flush=True,
                )
        print(file=sys.stderr)
        heard.stolen += stolen()
        heard.woken_late = [(when, over) for when, over in woken() if when >= begun]
    finally:
        ended.set()
        for process in processes:
            process.send_signal(signal.SIGINT)
        for process in processes:
            process.wait(PATIENCE_S)
        watching.close()
        executor.shutdown()
        rclpy.try_shutdown()
    return heard


def over_topics(heard: Heard, machine: Machine, count: int) -> tracking.Errors:
    """Tracking of the first `count` periods from the first motion of the reference on."""
    rows = np.array([row[1:4] for row in heard.states])
    first = int(np.flatnonzero(np.abs(rows[:, 1]) > 1e-6)[0])
    rows = rows[first : first + count]
    time_s = np.array([row[0] for row in heard.states[first : first + count]]) * 1e-9
    return tracking.track(machine, time_s - time_s[0], rows[:, 0], rows[:, 2]).errors


def in_process(recording: Recording, machine: Machine, wanted: np.ndarray, mode: str) -> tuple[tracking.Errors, int]:
    """Tracking of the loop without topics, and how many periods it counts."""
    c = recording.configuration
    pose = machine.pose(c.outer_boom_angle, c.telescope_length, 0.0 if math.isnan(c.load_mass) else c.load_mass)
    settings = Settings()
    result = follow(
        SimulatedCrane(machine, pose, CraneStart(float(wanted[0])), machine.sensor_noise()),
        make_controller(mode, machine, pose, settings), TrajectoryGenerator(settings.generator_pole, PERIOD), wanted, c,
    )  # fmt: skip
    found = tracking.of_recording(result, machine)
    return found.errors, len(found.time)


def main() -> None:
    """Measures and prints."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=float, default=70.0, help="how long to run [s] (default: 70)")
    parser.add_argument("--mode", default="improved", choices=MODES, help="control law")
    parser.add_argument(
        "--bag", default=str(Path(__file__).parents[1] / "bags" / "healthy" / "extended"), help="the reference"
    )
    parser.add_argument(
        "--realtime-priority", type=int, default=0, help="SCHED_FIFO priority of the controller (default: none)"
    )
    parser.add_argument(
        "--core", type=int, default=-1, help="core of the controller, which nothing else is started on (default: any)"
    )
    parser.add_argument(
        "--transport", default="topics", choices=("topics", "can"), help="how the controller reaches the crane"
    )
    parser.add_argument(
        "--command-delay", type=float, default=0.0, help="the controller's parameter of that name [s] (default: 0)"
    )
    parser.add_argument("--json", help="write the numbers to this file")
    args = parser.parse_args()
    try:
        recording = load(args.bag)
    except RecordingError as error:
        parser.error(str(error))
    machine = shipped_machine(recording.configuration.machine)
    wanted = wanted_angles(recording)
    back = 0.5 * (1 - np.cos(np.pi * np.arange(1, round(RETURN_S / PERIOD)) * PERIOD / RETURN_S))
    endless = np.concatenate((wanted, wanted[-1] + (wanted[0] - wanted[-1]) * back))
    part = wanted[: min(len(wanted), round(max(args.seconds - 1.0, 1.0) / PERIOD))]
    alone, count = in_process(recording, machine, part, args.mode)
    told = {"mode": args.mode, "realtime_priority": args.realtime_priority, "command_delay": args.command_delay}
    told["realtime_core"] = args.core
    with environment.private_domain() as domain:
        os.environ["ROS_DOMAIN_ID"] = domain
        heard = run_processes(recording, endless, args.transport, told, args.seconds)
    topics = over_topics(heard, machine, count)
    periods = np.diff(np.array(heard.commands)) * 1e-9
    jitter = np.abs(periods - PERIOD) * 1e3
    computation = np.array([row[4] for row in heard.states]) * 1e6
    lost = np.maximum(np.rint(periods / PERIOD) - 1, 0).astype(int)
    missed, while_late = int(lost.sum()), 0
    for k in np.flatnonzero(lost):
        begin, end = heard.commands[k] * 1e-9, heard.commands[k + 1] * 1e-9
        while_late += int(lost[k]) * any(begin <= when and when - late <= end for when, late in heard.woken_late)
    numbers: dict[str, Any] = {
        "mode": args.mode, "transport": args.transport, "seconds": args.seconds, "cycles": len(heard.commands), "missed": missed,
        "missed_while_the_computer_was_late": while_late,
        "stopped": heard.reason if heard.mode in ("stopping", "stopped") else "",
        "computer": {
            "stolen_s": heard.stolen, "late": len(heard.woken_late),
            "latest_ms": 1e3 * max((late for _, late in heard.woken_late), default=0.0),
        },
        "jitter_ms": {"p50": float(np.percentile(jitter, 50)), "p99": float(np.percentile(jitter, 99)), "max": float(jitter.max())},
        "computation_us": {q: float(np.percentile(computation, p)) for q, p in (("p50", 50), ("p99", 99), ("max", 100))},
        "over_topics": topics.document(), "in_process": alone.document(),
        "ratio": {k: topics.document()[k] / v for k, v in alone.document().items()},
    }  # fmt: skip
    print(
        f"{args.mode} over {args.transport}, {recording.name}, {args.seconds:.0f} s: {len(heard.commands)} cycles, "
        f"{missed} missed, "
        f"{while_late} of them while the computer was late"
    )
    print(
        f"computer           {numbers['computer']['late']} times more than {1e3 * LATE_S:.0f} ms late, "
        f"at most {numbers['computer']['latest_ms']:.0f} ms; taken by its host: {heard.stolen:.2f} s"
    )
    print("jitter [ms]        p50 {p50:.3f}  p99 {p99:.3f}  largest {max:.3f}".format(**numbers["jitter_ms"]))
    print("computation [us]   p50 {p50:.0f}  p99 {p99:.0f}  largest {max:.0f}".format(**numbers["computation_us"]))
    for label, errors in (("over topics", topics), ("in one process", alone)):
        print(
            f"{label:18s} MAE / MAXE / RMSE  {1e3 * errors.mae:.3f} / {1e3 * errors.maxe:.2f} / {1e3 * errors.rmse:.3f} mm"
        )
    print("ratio              " + " / ".join(f"{v:.2f}" for v in numbers["ratio"].values()))
    if numbers["stopped"]:
        print(f"the controller stopped: {heard.reason}")
    if args.json:
        Path(args.json).write_text(json.dumps(numbers, indent=2) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
