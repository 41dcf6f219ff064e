"""The main job, end to end, as separate ROS 2 processes.

One process replays the currents of a recording, a second is the simulated crane, a third records what both publish, all in
lockstep, faster than real time. The new bag is then validated against the recording: table, HTML report, JSON.

  ./boom demo                                         a healthy recording: the model agrees
  ./boom demo bags/explained/hose_burst_valve_lag_b   the machine does something that the model does not have
"""

from __future__ import annotations

import argparse
import json
import os
import re
import shutil
import sys
import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from boom_bringup import environment
from boom_bringup.commands._node_command import node_command

if TYPE_CHECKING:
    from rich.progress import Progress, TaskID

    from boom_model.machine import Machine
    from boom_recording.recording import Recording

HELP = "replay a recording into the simulated crane, record and validate it"

DEFAULT_BAG = Path("bags/healthy/extended")
_PROGRESS = re.compile(r"replayed ([0-9.]+) of ([0-9.]+) s")


class DemoError(RuntimeError):
    """The demo could not be carried out; one line that says why."""

    exit_status = 2


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("bag", nargs="?", metavar="BAG", help=f"recording to repeat (default: {DEFAULT_BAG})")
    parser.add_argument("--machine", metavar="FILE", help="machine file or shipped name (default: the recording's)")
    parser.add_argument(
        "--output", metavar="DIR", default="output/demo", help="where the results go (default: output/demo)"
    )
    parser.add_argument("--seed", type=int, default=0, help="seed of the simulated sensors' noise (default: 0)")
    parser.add_argument("--json", metavar="F", help="write the numbers to this file too")


def run(args: argparse.Namespace) -> int:
    """Run the processes, then validate; returns 0."""
    from rich.console import Console

    from boom_diagnosis.initial_state import resting_start
    from boom_model.machine_file import load_machine
    from boom_recording.loading import load

    console = Console(highlight=False)
    bag = Path(args.bag) if args.bag else _shipped_bag()
    recording = load(bag)
    machine = load_machine(args.machine or recording.configuration.machine)
    rest = resting_start(recording)
    if rest is None:
        raise DemoError(f"{bag}: the boom does not rest at the beginning, so that the simulation cannot start like it")
    output = Path(args.output)
    simulated_bag = _fresh(output)
    console.print(f"[bold]{recording.name}[/bold]: {recording.duration:.0f} s, {_pose(recording)}", soft_wrap=True)
    spent, network = _simulate(recording, machine, args, rest, bag, simulated_bag)
    simulated = load(simulated_bag)
    console.print(
        f"simulated by three processes in {spent:.1f} s: {recording.duration / spent:.1f} times real time; {network}",
        soft_wrap=True,
    )
    return _validate(console, recording, simulated, machine, args, output)


def _shipped_bag() -> Path:
    for folder in (Path.cwd(), *Path(__file__).resolve().parents):
        if (folder / DEFAULT_BAG).is_dir():
            return folder / DEFAULT_BAG
    raise DemoError(f"{DEFAULT_BAG} is not here: run ./boom demo in the repository, or name a bag")


def _fresh(output: Path) -> Path:
    """The folder for the new bag. What an earlier demo left there is removed, nothing else."""
    simulated = output / "simulated"
    try:
        output.mkdir(parents=True, exist_ok=True)
        if (simulated / "metadata.yaml").exists() or list(simulated.glob("*.mcap")):
            shutil.rmtree(simulated)
    except OSError as error:
        raise DemoError(f"{output}: cannot be written: {error.strerror}; give another --output") from None
    if simulated.exists():
        raise DemoError(f"{simulated} exists and is not a bag of an earlier demo: give another --output")
    return simulated


def _pose(recording: Recording) -> str:
    c = recording.configuration
    return (
        f"machine {c.machine}, q3 = {c.outer_boom_angle:g} rad, q4 = {c.telescope_length:g} m, load {c.load_mass:g} kg"
    )


@dataclass
class _Watcher:
    """Reads the processes' lines: progress for the bar, the rest only where it matters."""

    progress: Progress
    task: TaskID
    lines: list[str] = field(default_factory=list)

    def line(self, name: str, text: str) -> None:
        found = _PROGRESS.search(text)
        if found:
            self.progress.update(self.task, completed=float(found[1]))
            return
        self.lines.append(f"[{name}] {text}")
        if "[WARN]" in text or "[ERROR]" in text or "Traceback" in text:
            self.progress.console.print(f"[{name}] {text}", markup=False, soft_wrap=True)


def _simulate(
    recording: Recording, machine: Machine, args: argparse.Namespace, rest: dict[str, float], bag: Path, target: Path
) -> tuple[float, str]:
    """Runs the three processes; returns the time [s] from the first command on, and what was seen of the network."""
    import threading

    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

    from boom_bringup.supervisor import Program, Supervisor

    c = recording.configuration
    simulation = {
        "machine": args.machine or c.machine, "outer_boom_angle": c.outer_boom_angle, "telescope_length": c.telescope_length,
        "load_mass": c.load_mass if c.load_mass == c.load_mass else 0.0, "initial_angle": rest["angle"],
        "initial_hose_pressure": rest["hose_pressure"], "initial_rod_pressure": rest["rod_pressure"], "mode": "lockstep",
        "seed": args.seed, "robot_description": str(Path(__file__).parents[1] / "urdf" / "epsilon_tz17.urdf"),
    }  # fmt: skip
    programs = [
        Program("recorder", node_command("boom_recording.recorder_node", {"output": str(target)})),
        Program("simulation", node_command("boom_sim.simulation_node", simulation)),
        Program(
            "replay",
            node_command(
                "boom_recording.replay_node",
                {"bag": str(bag), "lockstep": True, "wait_for_recorder": True, "wait_for": 2},
            ),
            main=True,
        ),
    ]
    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        TextColumn("{task.completed:.0f} of {task.total:.0f} s"),
        TimeElapsedColumn(),
    )
    seen: list[environment.BoundSocket] = []
    with Progress(*columns, console=Console(stderr=True)) as progress:
        task = progress.add_task("replay -> simulated crane -> recorder", total=recording.duration)
        watcher = _Watcher(progress, task)
        supervisor = Supervisor(programs, environment=environment.for_processes(os.environ), on_line=watcher.line)
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
    if outcome.interrupted is not None:
        raise KeyboardInterrupt
    if outcome.exit_status:
        said = "; ".join(
            line for line in watcher.lines if outcome.failed and line.startswith(f"[{outcome.failed[0]}]")
        )[-300:]
        raise DemoError(
            f"the process {', '.join(outcome.failed)} ended before its work was done: {said or 'it said nothing'}"
        )
    return spent, _network(seen)


def _network(seen: list[environment.BoundSocket]) -> str:
    outside = sorted({f"{s.protocol} {s.address}:{s.port}" for s in environment.off_loopback(seen)})
    if outside:
        return f"sockets outside the loopback: {', '.join(outside)}"
    return "no socket outside the loopback"


def _validate(
    console: Any, recording: Recording, simulated: Recording, machine: Machine, args: argparse.Namespace, output: Path
) -> int:
    from boom_diagnosis import tables
    from boom_diagnosis.report import write_report
    from boom_diagnosis.validation import Validation, validate

    validation = Validation(machine.name, [validate(recording, machine, simulated=simulated)])
    tables.print_validation(validation, console)
    report = output / "report.html"
    write_report(
        validation, report, title=f"Demo: {recording.name}", machine=machine, machine_source=args.machine,
        command="./boom " + " ".join(sys.argv[1:]),
    )  # fmt: skip
    if args.json:
        Path(args.json).write_text(json.dumps(validation.document(), indent=1) + "\n", encoding="utf-8")
    console.print(f"report: {report.resolve()}", soft_wrap=True)
    console.print(f"bag:    {output.resolve() / 'simulated'}", soft_wrap=True)
    return 0
