"""The main job, end to end, as separate ROS 2 processes.

One process replays the currents of a recording, the CAN bridge turns them into frames on a bus inside this computer, the ECU
stand-in moves the simulated crane by them and sends its sensors' frames, the bridge makes topics of these, and a recorder records
them; all in lockstep, faster than real time. The new bag is then validated against the recording: table, HTML report, JSON.

  ./boom demo                                         a healthy recording: the model agrees
  ./boom demo bags/explained/hose_burst_valve_lag_b   the machine does something that the model does not have
  ./boom demo --transport topics                      the simulated crane on the topics itself, without CAN
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

from boom_bringup import arguments, demo_processes, environment
from boom_bringup.demo_processes import DemoError

if TYPE_CHECKING:
    from boom_model.machine import Machine
    from boom_recording.recording import Recording

HELP = "replay a recording into the simulated crane over CAN, record and validate it"

DEFAULT_BAG = Path("bags/healthy/extended")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("bag", nargs="?", metavar="BAG", help=f"recording to repeat (default: {DEFAULT_BAG})")
    parser.add_argument("--machine", metavar="FILE", help="machine file or shipped name (default: the recording's)")
    parser.add_argument(
        "--output", metavar="DIR", default="output/demo", help="where the results go (default: output/demo)"
    )
    parser.add_argument(
        "--transport", choices=tuple(demo_processes.TRANSPORTS), default="can",
        help="can: ECU stand-in, bus and bridge; topics: the simulation itself (default: can)",
    )  # fmt: skip
    parser.add_argument(
        "--seed", type=arguments.seed, default=0, help="seed of the simulated sensors' noise (default: 0)"
    )
    parser.add_argument("--json", metavar="F", help="write the numbers to this file too")


def run(args: argparse.Namespace) -> int:
    """Run the processes, then validate; returns 0."""
    from rich.console import Console

    from boom_bringup import demo_folder, outputs, replica
    from boom_recording.loading import load

    console = Console(highlight=False)
    json_path = outputs.checked(args.json, "--json")
    bag = Path(args.bag) if args.bag else _shipped_bag()
    recording = load(bag)
    machine, source = replica.machine_of({str(bag): recording}, args.machine)
    simulation = replica.simulation_parameters(recording, str(bag), machine, source, args.seed)
    with demo_folder.held(Path(args.output)) as folder:
        report = outputs.checked(str(folder.path / "report.html"), "report")
        assert report is not None
        if args.transport == "can":
            bridge = replica.bridge_parameters(simulation, machine)
            programs = demo_processes.over_can(bag, folder.recording, simulation, bridge)
        else:
            programs = demo_processes.over_topics(bag, folder.recording, simulation)
        console.print(f"[bold]{recording.name}[/bold]: {recording.duration:.0f} s, {_pose(recording)}", soft_wrap=True)
        spent, seen = demo_processes.run(programs, demo_processes.TRANSPORTS[args.transport], recording.duration)
        load(folder.recording)  # only what can be read replaces the old bag
        simulated = load(folder.keep())
        console.print(
            f"simulated by {len(programs)} processes in {spent:.1f} s: {recording.duration / spent:.1f} times real time; "
            f"{_network(seen)}",
            soft_wrap=True,
        )
        validation = _validate(console, recording, simulated, machine, args.machine, report)
        if json_path:
            outputs.write_json(json_path, validation.document())
        console.print(f"report: {report.resolve()}", soft_wrap=True)
        console.print(f"bag:    {folder.bag.resolve()}", soft_wrap=True)
    return 0


def _shipped_bag() -> Path:
    for folder in (Path.cwd(), *Path(__file__).resolve().parents):
        if (folder / DEFAULT_BAG).is_dir():
            return folder / DEFAULT_BAG
    raise DemoError(f"{DEFAULT_BAG} is not here: run ./boom demo in the repository, or name a bag")


def _pose(recording: Recording) -> str:
    c = recording.configuration
    return (
        f"machine {c.machine}, q3 = {c.outer_boom_angle:g} rad, q4 = {c.telescope_length:g} m, load {c.load_mass:g} kg"
    )


def _network(seen: list[environment.BoundSocket]) -> str:
    outside = sorted({f"{s.protocol} {s.address}:{s.port}" for s in environment.off_loopback(seen)})
    if outside:
        return f"sockets outside the loopback: {', '.join(outside)}"
    return "no socket outside the loopback"


def _validate(
    console: Any, recording: Recording, simulated: Recording, machine: Machine, source: str | None, report: Path
) -> Any:
    from boom_bringup import outputs
    from boom_diagnosis import tables
    from boom_diagnosis.report import write_report
    from boom_diagnosis.validation import Validation, validate

    validation = Validation(machine.name, [validate(recording, machine, simulated=simulated)])
    tables.print_validation(validation, console)
    outputs.write(
        report,
        lambda: write_report(
            validation, report, title=f"Demo: {recording.name}", machine=machine, machine_source=source,
            command="./boom " + " ".join(sys.argv[1:]),
        ),
    )  # fmt: skip
    return validation
