"""Compare the model with recordings: free runs on the recorded currents, Tables 5.1 and 5.2, an HTML report.

The recorded currents drive the full and the reduced model, whose predictions are compared with the measured angle, rate and
pressures. The command prints both tables, one verdict per recording, and the defects of the recordings. A mismatch is a result, not
an error: the exit status is 0 unless --strict is given.
"""

from __future__ import annotations

import argparse
import math
from typing import TYPE_CHECKING

from boom_bringup import arguments
from boom_bringup.cli import UsageError
from boom_bringup.outputs import PAGE, checked, checked_json, default_report, write, write_json
from boom_bringup.replica import machine_of, misfit
from boom_bringup.showing import diagnose_next, progress

if TYPE_CHECKING:
    from boom_checks.doubts import FirstLook
    from boom_identification.validation import Validation
    from boom_model.machine import Machine
    from boom_recording.recording import Recording

HELP = "run the model on recorded currents and compare it with the measurement"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    arguments.add_recordings(parser)
    arguments.add_machine(parser)
    arguments.add_configuration(parser)
    arguments.add_other_joints(parser)
    parser.add_argument(
        "--simulated",
        metavar="BAG",
        help="take the full model's prediction from this bag of a simulation instead of running the model (for one BAG)",
    )
    arguments.add_documents(parser, "validate")
    parser.add_argument(
        "--strict", action="store_true", help="exit with status 1 unless every recording agrees within noise"
    )


def run(args: argparse.Namespace) -> int:
    """Validate; returns 0, or 1 with --strict and a recording that does not agree."""
    if args.simulated and len(args.bags) > 1:
        raise UsageError(f"--simulated needs one recording, {len(args.bags)} were given: validate them one by one")
    json_path = checked_json(args.json, "machine", "bags")
    report = None if args.no_report else checked(args.report, "--report", PAGE) or default_report("validate", args.bags)

    from boom_bringup.given import load_all

    with progress(len(args.bags)) as step:
        # All are read before the first is run: a misspelt name is told at once, not after minutes.
        recordings = load_all(args.bags, args, lambda text: step(text, 0))
        simulated = _simulated(args, recordings[0]) if args.simulated else None

        from boom_identification.validation import Validation, validate
        from boom_model.errors import MachineError
        from boom_report.console import console_for
        from boom_report.doubts import print_first_looks, section
        from boom_report.validation.terminal import print_validation

        machine, source = machine_of(dict(zip(args.bags, recordings, strict=True)), args.machine)
        validation, looks = Validation(machine.name), []
        for bag, recording in zip(args.bags, recordings, strict=True):
            step(f"running the models over {recording.name}", 0)
            try:
                looks.append(_look(recording, machine))
                validation.bags.append(validate(recording, machine, simulated=simulated))
            except MachineError as error:
                raise UsageError(misfit(bag, machine, recording.configuration, error)) from None
            step("", 1)
    notes = _notes(recordings, machine.name)
    console = console_for()
    print_validation(validation, console)
    print_first_looks(looks, console)
    for note in notes:
        console.print(f"note: {note}", markup=False)
    if json_path:
        document = validation.document()
        bags = [bag | look.document() for bag, look in zip(document["bags"], looks, strict=True)]
        write_json(json_path, document | {"bags": bags})
    if report:
        from boom_report.validation.report import write_report

        command = arguments.command_line("validate", *_words(args))
        write(
            report,
            lambda: write_report(
                validation,
                report,
                command=command,
                machine=machine,
                machine_source=source,
                notes=tuple(notes),
                sections=(section(looks),),
            ),
        )
        console.print(f"report: {report}", markup=False, soft_wrap=True)
    status = 1 if args.strict and not all(found.agrees for found in validation.bags) else 0
    differing = _differing(args.bags, recordings, validation)
    if differing:
        console.print(
            "the file's numbers as they are; whether tolerances explain this, or physics is left out:",
            markup=False, soft_wrap=True,
        )  # fmt: skip
    spoilt = [look for look in looks if any(check.spoils for check in look.checks)]
    if spoilt:
        console.print(
            f"next: repair {spoilt[0].name} as said above (./boom import with a mapping), before any physics is looked for",
            markup=False, soft_wrap=True,
        )  # fmt: skip
        return status
    for line in diagnose_next(differing, args.machine, arguments.configuration_words(args)):
        console.print(line, markup=False, soft_wrap=True)
    return status


def _differing(bags: list[str], recordings: list[Recording], validation: Validation) -> list[str]:
    """Recordings that a diagnosis can go on with: of this machine, compared, and different."""
    return [
        bag for bag, recording, found in zip(bags, recordings, validation.bags, strict=True)
        if found.mismatches and (found.compared_s or found.full.stopped)
        and recording.configuration.machine in ("", validation.machine)
    ]  # fmt: skip


def _look(recording: Recording, machine: Machine) -> FirstLook:
    """Doubts and levels of a recording of this machine: by another crane's masses a sound one would be in doubt."""
    from boom_checks.doubts import FirstLook, first_look

    other = recording.configuration.machine
    if other in ("", machine.name):
        return first_look(recording, machine)
    return FirstLook(recording.name, (), None, f"no doubts and no levels: it was recorded on machine '{other}'")


def _simulated(args: argparse.Namespace, recording: Recording) -> Recording:
    """The simulation that is compared with a recording. Raises UsageError: it is of another pose."""
    from boom_bringup.given import load_given

    simulated = load_given(args.simulated, args)
    wanted, given = _pose(recording), _pose(simulated)
    if given != wanted:
        raise UsageError(
            f"{args.simulated} was simulated with {given}, {args.bags[0]} recorded with {wanted}: simulate that one"
        )
    return simulated


def _pose(recording: Recording) -> str:
    """Where the other joints stand."""
    c = recording.configuration
    return f"q3 = {c.outer_boom_angle:.3g} rad, q4 = {c.telescope_length:.3g} m"


def _notes(recordings: list[Recording], machine: str) -> list[str]:
    """Assumptions behind the numbers that were not requested: another machine than the recorded one, an unknown load."""
    from boom_recording.joint_motion import moving_joints

    notes = []
    for recording in recordings:
        c = recording.configuration
        moving = moving_joints(recording)
        if moving:
            notes.append(f"{recording.name}: other joints move and drive the model: {moving}")
        if c.machine not in ("", machine):
            notes.append(f"{recording.name} was recorded on machine '{c.machine}', the model is that of '{machine}'")
        if math.isnan(c.load_mass):
            notes.append(f"{recording.name} does not state its load: 0 kg is assumed")
    return notes


def _words(args: argparse.Namespace) -> list[str]:
    """The command line, rebuilt from the parsed arguments."""
    options = arguments.option_words(args, "machine", "simulated", "json", "report")
    return [*args.bags, *options, *arguments.configuration_words(args), *(["--strict"] if args.strict else [])]
