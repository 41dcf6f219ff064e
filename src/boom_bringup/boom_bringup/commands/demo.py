"""The main job, end to end, as separate ROS 2 processes.

One process replays the currents of a recording. The CAN bridge turns them into frames on a bus inside this computer, the ECU
stand-in moves the simulated crane and sends sensor frames, the bridge publishes these as topics, and a recorder records them; all
in lockstep, faster than real time. The new bag is then validated against the recording: table, HTML report, JSON. Then the loop is
closed: the recorded angle becomes the reference, and the controller computes the currents, over the same bus; the report shows how
well the boom followed.

  ./boom demo                                         a healthy recording: the model agrees
  ./boom demo bags/explained/hose_burst_valve_lag_b   a machine with physics that the model lacks
  ./boom demo --transport topics                      the simulated crane directly on the topics, without CAN
  ./boom demo --loop closed --mode thesis             only the closed loop, with the controller of the thesis
"""

from __future__ import annotations

import argparse
import sys
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from boom_bringup import arguments, demo_processes, environment
from boom_bringup.demo_processes import DemoError
from boom_controller import laws

if TYPE_CHECKING:
    from boom_bringup.demo_folder import DemoFolder
    from boom_model.machine import Machine
    from boom_recording.recording import Recording

HELP = "replay a recording on the simulated crane over CAN, open and closed loop; record, compare, report"

DEFAULT_BAG = Path("bags/healthy/extended")
CLOSED_DURATION_S = 6.0  # both acts together stay below half a minute on two idle cores


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("bag", nargs="?", metavar="BAG", help=f"recording to repeat (default: {DEFAULT_BAG})")
    parser.add_argument("--machine", metavar="FILE", help="machine file or shipped name (default: the recording's)")
    parser.add_argument(
        "--output", metavar="DIR", default="output/demo", help="folder of the results (default: output/demo)"
    )
    parser.add_argument(
        "--transport", choices=tuple(demo_processes.TRANSPORTS), default="can",
        help="can: ECU stand-in, bus and bridge; topics: the simulation directly (default: can)",
    )  # fmt: skip
    parser.add_argument(
        "--loop", choices=("both", "open", "closed"), default="both",
        help="open: recorded currents, validated; closed: the controller follows the recorded angle (default: both)",
    )  # fmt: skip
    parser.add_argument(
        "--mode", choices=tuple(laws.described()), default=laws.DEFAULT,
        help=f"control law of the closed loop (default: {laws.DEFAULT})",
    )  # fmt: skip
    parser.add_argument(
        "--closed-duration", type=_seconds, default=CLOSED_DURATION_S, metavar="S",
        help=f"seconds of the recorded angle that the closed loop follows, 0: all (default: {CLOSED_DURATION_S:g} s)",
    )  # fmt: skip
    parser.add_argument(
        "--seed", type=arguments.seed, default=0, help="seed of the simulated sensors' noise (default: 0)"
    )
    parser.add_argument("--json", metavar="F", help="also write the numbers to this file")
    arguments.add_configuration(parser)
    arguments.add_other_joints(parser)


def run(args: argparse.Namespace) -> int:
    """Run the processes, then validate; returns 0."""
    from rich.text import Text

    from boom_bringup import demo_folder, outputs, replica, showing
    from boom_bringup.demo_results import Results, Tracked
    from boom_bringup.given import load_given
    from boom_identification.validation import validate
    from boom_report.console import console_for
    from boom_report.tracking import position_error

    console = console_for()
    json_path = outputs.checked_json(args.json, "machine", "bags")
    bag = Path(args.bag) if args.bag else _shipped_bag()
    recording = load_given(bag, args)
    machine, source = replica.machine_of({str(bag): recording}, args.machine)
    simulation = replica.simulation_parameters(recording, str(bag), machine, source, args.seed)
    with demo_folder.held(Path(args.output)) as folder:
        report = outputs.checked(str(folder.path / "report.html"), "report")
        assert report is not None
        console.print(
            Text.assemble((recording.name, "bold"), f": {recording.duration:.0f} s, {_pose(recording)}"), soft_wrap=True
        )
        chain = _Chain(console, bag, recording, folder, simulation, machine, args.transport)
        validation = tracked = None
        if args.loop != "closed":
            validation = validate(recording, machine, simulated=chain.run(demo_folder.BAG))
        if args.loop != "open":
            controller = {"mode": args.mode, "machine": source}
            closed = chain.run(demo_folder.CLOSED_BAG, controller, args.closed_duration)
            tracked = Tracked(closed, position_error.of_recording(closed, machine), args.mode)
        results = Results(machine, args.machine, recording, validation, tracked)
        results.show(console)
        outputs.write(report, lambda: results.report(report, "./boom " + " ".join(sys.argv[1:])))
        if json_path:
            outputs.write_json(json_path, results.document())
        console.print(f"report: {report.resolve()}", soft_wrap=True)
        for name in chain.kept:
            console.print(f"bag:    {folder.bag(name).resolve()}", soft_wrap=True)
        if validation is not None and validation.mismatches:
            for line in showing.diagnose_next([str(bag)], args.machine):
                console.print(line, markup=False, soft_wrap=True)
    return 0


@dataclass
class _Chain:
    """Runs the processes, open or closed loop, and keeps their recordings."""

    console: Any
    bag: Path
    recording: Recording
    folder: DemoFolder
    simulation: dict[str, Any]
    machine: Machine
    transport: str
    kept: list[str] = field(default_factory=list)

    def run(self, name: str, controller: dict[str, Any] | None = None, duration: float = 0.0) -> Recording:
        """Records the bag `name`, in closed loop if there are controller parameters; returns the recording.

        duration: part of the recording to repeat [s]; 0: all.
        """
        from boom_bringup import replica
        from boom_recording.loading import load

        target, over_can = self.folder.recording(name), self.transport == "can"
        if over_can:
            bridge = replica.bridge_parameters(self.simulation, self.machine)
            programs = demo_processes.over_can(self.bag, target, self.simulation, bridge)
        else:
            programs = demo_processes.over_topics(self.bag, target, self.simulation)
        titles = demo_processes.TRANSPORTS
        if controller is not None:
            # Over CAN a cycle's frames show the crane as it was when the command before the last one went out.
            delay = demo_processes.CAN_DELAY_S if over_can else 0.0
            programs = demo_processes.close_loop(programs, target, controller, delay, duration)
            titles = demo_processes.CLOSED_TRANSPORTS
        simulated = min(duration or self.recording.duration, self.recording.duration)
        spent, seen = demo_processes.run(programs, titles[self.transport], simulated)
        load(target)  # only what can be read replaces the old bag
        result = load(self.folder.keep(name))
        self.kept.append(name)
        self.console.print(
            f"{'closed loop' if controller else 'simulated'} by {len(programs)} processes in {spent:.1f} s: "
            f"{simulated:.0f} s, {simulated / spent:.1f} times real time; {_network(seen)}",
            soft_wrap=True,
        )
        return result


def _seconds(text: str) -> float:
    try:
        number = float(text)
    except ValueError:
        number = -1.0
    if not (number == 0.0 or 5.0 <= number <= 3600.0):
        raise argparse.ArgumentTypeError(f"{text!r}: give 5 to 3600 seconds, or 0 for all")
    return number


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
