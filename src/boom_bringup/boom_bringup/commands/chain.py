"""Drive one link of the chain after the other with what was measured, and show which link breaks.

First the recording itself is doubted: signs, units, swapped channels, a command that was not applied, clocks. Then each link
is fed with measurements on both sides: angle into rate, motion into the pressure that the boom needs, currents and motion into
the flows at both ports. Last, the flow at the cylinder is set against each pressure: is there a valve, and what opens it? The
valve is fitted on all recordings but the last and judged on the last one; a single one is used in turns of five seconds.

Without a machine file the hydraulics at the cylinder are examined alone: --areas gives the piston's areas, and the joint that was
recorded is the piston, its position in m.

  ./boom chain bags/explained/payload_change_a
  ./boom chain run_1 run_2 run_3 --areas 0.0201 0.0123 --joint boom_cylinder
"""

from __future__ import annotations

import argparse
import math
from typing import TYPE_CHECKING

from boom_bringup import arguments
from boom_bringup.cli import UsageError
from boom_bringup.outputs import PAGE, checked, checked_json, default_report, write, write_json
from boom_bringup.replica import machine_of, misfit
from boom_bringup.showing import progress

if TYPE_CHECKING:
    from collections.abc import Callable

    from boom_checks.chain import RecordingChain
    from boom_recording.recording import Recording

    Examination = Callable[[str, Recording], RecordingChain]

HELP = "drive one link after the other with what was measured and show which one breaks"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    arguments.add_recordings(parser)
    known = parser.add_mutually_exclusive_group()
    arguments.add_machine(known)
    known.add_argument(
        "--areas", nargs=2, type=_area, metavar=("A_A", "A_B"),
        help="areas of the piston [m^2], head and rod side: examines the hydraulics at the cylinder alone",
    )  # fmt: skip
    arguments.add_configuration(parser)
    arguments.add_other_joints(parser)
    arguments.add_documents(parser, "chain")


def run(args: argparse.Namespace) -> int:
    """Examine the chain; returns 0, a broken link is a result."""
    posed = arguments.option_words(args, "q3", "q4", "load")
    if args.areas and posed:
        raise UsageError(f"{posed[0]}: with --areas there is no boom whose pose or load counts: leave it out")
    json_path = checked_json(args.json, "bags", "valve")
    report = None if args.no_report else checked(args.report, "--report", PAGE) or default_report("chain", args.bags)

    from boom_bringup.given import load_all, refuse_repeated, sha256
    from boom_recording.channels import JOINT_STATES

    required = (JOINT_STATES,) if args.areas else None
    with progress(2 * len(args.bags)) as step:
        read = load_all(args.bags, args, lambda text: step(text, 1), required)
        refuse_repeated(args.bags, [sha256(recording.path) for recording in read])
        recordings = dict(zip(args.bags, read, strict=True))

        from boom_checks.chain import study

        chains = []
        examine, source = _cylinder(args.areas) if args.areas else _machine(recordings, args.machine)
        for bag, recording in recordings.items():
            step(f"driving the links of {recording.name}", 1)
            chains.append(examine(bag, recording))
        found = study(chains)

    from boom_report.chain.terminal import print_chain
    from boom_report.console import console_for

    console = console_for()
    print_chain(found, console)
    if json_path:
        write_json(json_path, found.document())
    if report:
        from boom_report.chain.report import write_chain_report

        command = arguments.command_line("chain", *_words(args))
        write(report, lambda: write_chain_report(found, report, command=command, machine_source=source))
        console.print(f"report: {report}", markup=False, soft_wrap=True)
    return 0


def _machine(recordings: dict[str, Recording], wanted: str | None) -> tuple[Examination, str]:
    from boom_checks.chain import chain_of_machine
    from boom_model.errors import MachineError

    machine, source = machine_of(recordings, wanted)

    def examine(bag: str, recording: Recording) -> RecordingChain:
        try:
            return chain_of_machine(recording, machine)
        except MachineError as error:
            raise UsageError(misfit(bag, machine, recording.configuration, error)) from None

    return examine, source


def _cylinder(areas: list[float]) -> tuple[Examination, None]:
    from boom_checks.chain import chain_of_cylinder

    def examine(bag: str, recording: Recording) -> RecordingChain:
        found = chain_of_cylinder(recording, *areas)
        if found.valve is None:
            raise UsageError(
                f"{bag}: /boom/hose_pressure, /boom/rod_pressure and /boom/head_pressure are needed to examine the cylinder alone: "
                "record them too, or give a machine file with --machine"
            )
        return found

    return examine, None


def _area(text: str) -> float:
    """An area [m^2] of a piston."""
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not 1e-5 <= value <= 1.0:
        raise argparse.ArgumentTypeError(f"{text} is not the area of a piston: give 0.00001 to 1 m^2")
    return value


def _words(args: argparse.Namespace) -> list[str]:
    """The command line, rebuilt from the parsed arguments."""
    words = [
        *args.bags,
        *arguments.option_words(args, "machine", "json", "report"),
        *arguments.configuration_words(args),
    ]
    return words + (["--areas", *(f"{area:g}" for area in args.areas)] if args.areas else [])
