"""The processes of a demo and how they run: over CAN or with the simulation directly on the topics, in open or closed loop."""

from __future__ import annotations

import os
import re
import socket
import sys
import threading
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from boom_bringup import environment, replica
from boom_bringup.node_command import node_command
from boom_bringup.supervisor import Outcome, Program, Supervisor

if TYPE_CHECKING:
    from rich.progress import Progress, TaskID

TRANSPORTS = {
    "can": "replay -> bridge -> CAN bus -> ECU with the simulated crane, and back",
    "topics": "replay -> simulated crane -> recorder",
}
CLOSED_TRANSPORTS = {
    "can": "trajectory -> controller -> bridge -> CAN bus -> ECU with the simulated crane, and back",
    "topics": "trajectory -> controller -> simulated crane, and back",
}
# In lockstep the replay begins only when everybody is there, and each command waits for the one before.
REPLAY = {"lockstep": True, "wait_for_recorder": True, "wait_for": 2}
CAN_REPLAY = REPLAY | {"wait_for_motion": True, "on_ticks": True}
# What the closed loop says beside what the machine does.
CAN_DELAY_S = 0.01
CLOSED_TOPICS = ("/boom/reference", "/boom/reference_state", "/boom/controller_state")
_DONE = re.compile(r"replayed \d+ messages")
_PROGRESS = re.compile(r"replayed ([0-9.]+) of ([0-9.]+) s")


class DemoError(RuntimeError):
    """The demo failed; one line that says why.

    Attributes:
        exit_status: for the shell.
    """

    def __init__(self, message: str, exit_status: int = 2) -> None:
        super().__init__(message)
        self.exit_status = exit_status


def over_topics(bag: Path, target: Path, simulation: Mapping[str, Any]) -> list[Program]:
    """Recorder, simulation and replay; parameters of the simulation as `replica.simulation_parameters` gives them."""
    return [
        Program("recorder", node_command("boom_recording.recorder_node", {"output": str(target)})),
        Program("simulation", node_command("boom_sim.simulation_node", simulation)),
        Program("replay", node_command("boom_recording.replay_node", {"bag": str(bag), **REPLAY}), main=True),
    ]


def over_can(bag: Path, target: Path, simulation: Mapping[str, Any], bridge: Mapping[str, Any]) -> list[Program]:
    """The chain over a CAN bus on 127.0.0.1; parameters as `replica` gives them."""
    bus = free_bus()
    return [
        Program("bus", bus_command(bus)),
        Program("bridge", node_command("boom_can_bridge.bridge_node", {**bridge, **bus})),
        Program("ecu", node_command("boom_sim.ecu_node", {**replica.ecu_parameters(simulation), **bus})),
        Program("enable", node_command("boom_can_bridge.enable_node", {}), may_end=True),
        Program("recorder", node_command("boom_recording.recorder_node", {"output": str(target)})),
        Program("replay", node_command("boom_recording.replay_node", {"bag": str(bag), **CAN_REPLAY}), main=True),
    ]


def close_loop(
    programs: Sequence[Program], target: Path, controller: Mapping[str, Any], delay: float, duration: float
) -> list[Program]:
    """The same processes in closed loop: the recorded angle becomes the reference, and a controller commands.

    Args:
        programs: of `over_topics` or `over_can`.
        target: folder of the new bag.
        controller: parameters of the controller.
        delay: age of the sensors' samples at their tick [s].
        duration: duration of the recorded angle to follow [s]; 0: all.
    """
    from boom_recording.recorder import DEFAULT_TOPICS

    lockstep: dict[str, Any] = {"time": "lockstep", "lockstep_reference": True, "lockstep_delay": delay, "wait_for": 2}
    recorder: dict[str, Any] = {"output": str(target), "topics": (*DEFAULT_TOPICS, *CLOSED_TOPICS)}
    result = []
    for program in programs:
        if program.name == "recorder":
            program = Program("recorder", node_command("boom_recording.recorder_node", recorder))
        if program.name == "replay":
            result.append(
                Program("controller", node_command("boom_controller.controller_node", {**controller, **lockstep}))
            )
            # beside its own parameters: a parameter that is given twice counts as it was given last
            program = replace(
                program, command=[*program.command, "-p", 'what:="reference"', "-p", f"duration:={duration}"]
            )
        result.append(program)
    return result


def free_bus() -> dict[str, str]:
    """Interface and channel, as node parameters, of a bus on a port of 127.0.0.1 that is free now."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return {"interface": "remote", "channel": f"ws://127.0.0.1:{probe.getsockname()[1]}/"}


def bus_command(bus: Mapping[str, str]) -> list[str]:
    """Command line of the server of that bus."""
    port = bus["channel"].rstrip("/").rpartition(":")[2]
    return [sys.executable, "-m", "boom_can_bridge.bus_server", "--port", port]


@dataclass
class _Watcher:
    """Reads the output of the processes: progress for the bar, other lines only if they matter."""

    progress: Progress
    task: TaskID
    moving: bool = False
    lines: list[str] = field(default_factory=list)

    def line(self, name: str, text: str) -> None:
        found = _PROGRESS.search(text)
        if found:
            self.moving = True
            self.progress.update(self.task, completed=float(found[1]))
            return
        self.lines.append(f"[{name}] {text}")
        # Until everybody is there, and while all are stopped, each complains of those that are not.
        if _DONE.search(text):
            self.moving = False
        if (self.moving and ("[WARN]" in text or "[ERROR]" in text)) or "Traceback" in text:
            self.progress.console.print(f"[{name}] {text}", markup=False, soft_wrap=True)


def run(programs: Sequence[Program], title: str, duration: float) -> tuple[float, list[environment.BoundSocket]]:
    """Run the processes to their end, with a bar for the duration [s] of the recording.

    Returns:
        Time taken [s], and the sockets that were seen.

    Raises:
        DemoError: a process ended too early, or SIGTERM came.
        KeyboardInterrupt: Ctrl-C.
    """
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

    from boom_report.console import console_for

    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        TextColumn("{task.completed:.0f} of {task.total:.0f} s"),
        TimeElapsedColumn(),
    )
    seen: list[environment.BoundSocket] = []
    with Progress(*columns, console=console_for(sys.stderr)) as progress, environment.private_domain() as domain:
        watcher = _Watcher(progress, progress.add_task(title, total=duration))
        # A closed system: nobody outside hears it, whatever the user's own network is.
        variables = environment.for_processes(os.environ | {"BOOM_NETWORK": "loopback"}) | {"ROS_DOMAIN_ID": domain}
        supervisor = Supervisor(programs, environment=variables, on_line=watcher.line)
        ended = threading.Event()

        def look() -> None:
            while not ended.wait(0.5):
                seen.extend(s for pid in list(supervisor.pids().values()) for s in environment.bound_sockets(pid))

        looker = threading.Thread(target=look, daemon=True)
        looker.start()
        begin = time.perf_counter()
        try:
            outcome = supervisor.run()
        finally:
            ended.set()
            looker.join()
        spent = time.perf_counter() - begin
    _judge(outcome, watcher.lines)
    return spent, seen


def _judge(outcome: Outcome, lines: list[str]) -> None:
    if outcome.interrupted is not None:
        if outcome.exit_status == 130:
            raise KeyboardInterrupt
        raise DemoError("stopped", outcome.exit_status)
    if outcome.exit_status:
        said = [line for line in lines if line.startswith(f"[{outcome.failed[0]}]")]
        told = said[-1] if said else "it printed nothing"
        raise DemoError(f"the process {', '.join(outcome.failed)} ended before its work was done: {told[-300:]}")
