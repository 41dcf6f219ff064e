"""Find the physics that the model lacks to explain recordings, prove it on held-out data, and add it to the machine file.

Possible causes are tried in this order: clock and delay, sensors, parameters within and outside their tolerance, physics of the
catalogue, unmodelled physics. The command writes diagnosis.json, report.html and machine.yaml; every other command accepts the last
as --machine. Where two explanations remain, next_experiment is a bag of the currents that would tell them apart.
Without --hold-out the last third of each recording is held out.

  ./boom diagnose bags/explained/hose_burst_valve_lag_a --hold-out bags/explained/hose_burst_valve_lag_b
  ./boom validate bags/explained/hose_burst_valve_lag_b --machine output/diagnosis/machine.yaml

A mismatch is a result, not an error: the exit status is 0.
"""

from __future__ import annotations

import argparse
import shutil
import time
from pathlib import Path
from typing import TYPE_CHECKING

from boom_bringup import __version__, arguments
from boom_bringup.cli import UsageError
from boom_bringup.memory import keep_memory
from boom_bringup.outputs import PAGE, checked, checked_json, held, json_text, write, write_text
from boom_bringup.replica import machine_of
from boom_bringup.showing import progress

if TYPE_CHECKING:
    from boom_diagnosis.document import DiagnosisResult
    from boom_recording.recording import Recording

HELP = "find the physics that the model lacks to explain recordings, and prove it"

_STEPS = 100
_MARKS = {"machine.yaml": "# Diagnosed on ", "diagnosis.json": '\n  "verdict": ', "report.html": PAGE}
"""What is written, and what marks it."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    arguments.add_recordings(parser)
    parser.add_argument(
        "--hold-out", nargs="+", default=[], metavar="BAG", help="recordings for the proof; nothing is fitted to them"
    )
    arguments.add_machine(parser)
    arguments.add_configuration(parser)
    arguments.add_other_joints(parser)
    parser.add_argument(
        "--output", metavar="DIR", default="output/diagnosis", help="folder for the results (default: output/diagnosis)"
    )
    parser.add_argument("--json", metavar="F", help="also write diagnosis.json to F")
    parser.add_argument("--seed", type=int, default=0, help="seed of the simulated healthy recordings (default: 0)")
    parser.add_argument(
        "--engine", choices=("rounds", "likelihood"), default="rounds",
        help="how hypotheses are weighed: effect after effect (rounds, the default), or all by one likelihood (docs/likelihood.md)",
    )  # fmt: skip
    parser.add_argument("--explain", action="store_true", help="list every hypothesis that was weighed")
    parser.add_argument("--no-report", action="store_true", help="write no report.html")


def run(args: argparse.Namespace) -> int:
    """Diagnose; returns 0 whatever is found."""
    if args.seed < 0:
        raise UsageError(f"--seed {args.seed}: give a number of 0 or more")
    json_path = checked_json(args.json, "verdict", "hypotheses")
    with held(args.output) as folder:
        for name, mark in _MARKS.items():
            checked(str(folder / name), "--output", mark)
        return _run(args, folder, json_path)


def _run(args: argparse.Namespace, folder: Path, json_path: Path | None) -> int:
    command = arguments.command_line("diagnose", *_words(args))

    keep_memory()

    from boom_bringup.given import load_all, refuse_repeated, sha256

    with progress(_STEPS) as step:
        everything = load_all([*args.bags, *args.hold_out], args, lambda text: step(text, 0))
        recordings, held_out = everything[: len(args.bags)], everything[len(args.bags) :]
        machine, _ = machine_of(dict(zip([*args.bags, *args.hold_out], everything, strict=True)), args.machine)
        for recording in everything:
            if recording.configuration.machine not in ("", machine.name):
                raise UsageError(
                    f"{recording.name} was recorded on machine '{recording.configuration.machine}', the machine file is that "
                    f"of '{machine.name}': give the file of that machine"
                )
        checksums = [sha256(recording.path) for recording in everything]
        sums = dict(zip([*args.bags, *args.hold_out], checksums, strict=True))
        for bag in args.hold_out:  # compared is what was read: a path has many spellings
            same = next((other for other in args.bags if sums[other] == sums[bag]), "")
            if same:
                what = bag if bag == same else f"{bag} is the same recording as {same}"
                raise UsageError(f"{what}: given both to diagnose and to hold out: remove one of the two")
        refuse_repeated([*args.bags, *args.hold_out], checksums)

        from boom_diagnosis.run import diagnose
        from boom_model.errors import MachineError

        done, begin = 0, time.monotonic()

        def show(text: str, share: float) -> None:
            nonlocal done
            more = max(0, round(share * _STEPS) - done)
            done += more
            step(f"{text} ({100 * done / _STEPS:.0f} %, {time.monotonic() - begin:.0f} s)", more)

        try:
            result = diagnose(
                recordings, machine, held_out=held_out, seed=args.seed, progress=show, version=__version__,
                inputs_sha256=sums, command=command, engine=args.engine,
            )  # fmt: skip
        except MachineError as error:
            raise UsageError(f"the configuration of a recording does not fit machine {machine.name}: {error}") from None

    from boom_diagnosis.found_machine import write_machine
    from boom_report.console import console_for
    from boom_report.diagnosis.terminal import print_diagnosis, print_hypotheses
    from boom_report.diagnosis.words import headline

    said = {"headline": headline(result), "notes": list(result.notes), "remaining": result.remaining}
    moved = {name: number.document() for name, number in result.tolerances_used.items()}
    document = json_text({**result.document.document(), **said, "moved_parameters": moved})
    for path in [folder / "diagnosis.json", *([json_path] if json_path else [])]:
        write_text(path, document)
    machine_path, report, proposal = folder / "machine.yaml", folder / "report.html", folder / "next_experiment"
    report.unlink(missing_ok=True)  # of another answer, whatever may become of the writing
    shutil.rmtree(proposal, ignore_errors=True)
    write(machine_path, lambda: write_machine(machine_path, result.explained, command=command))
    if not args.no_report:
        from boom_report.diagnosis.report import write_diagnosis_report

        write(report, lambda: write_diagnosis_report(result, report, result.searched or everything))
    proposed = _next_experiment(result, recordings[0], proposal)
    console = console_for()
    print_diagnosis(result, console)
    if args.explain:
        print_hypotheses(result, console)
    named = ["diagnosis.json", "machine.yaml", *([] if args.no_report else ["report.html"]), *proposed]
    console.print(f"written to {folder}: {', '.join(named)}", markup=False, soft_wrap=True)
    return 0


def _next_experiment(result: DiagnosisResult, like: Recording, path: Path) -> list[str]:
    """Write the proposed currents and the expected measurements as a bag for `boom simulate` and `boom replay`.

    Returns its name, if there is one.
    """
    from boom_model.sensors import OUTPUTS
    from boom_recording import writing

    temporary = path.with_name(path.name + ".new") / path.name  # the data file bears the name of its folder
    shutil.rmtree(temporary.parent, ignore_errors=True)
    try:
        if result.experiment is not None:
            given = result.experiment
            columns = {name: given.expected[:, i] for i, name in enumerate(OUTPUTS)}
            columns |= {"retract_current": given.currents[:, 0], "extend_current": given.currents[:, 1]}
            recording = writing.from_columns(path.name, given.time, columns, like.configuration)
            write(temporary, lambda: writing.write(temporary, recording))
            temporary.rename(path)
    finally:
        shutil.rmtree(temporary.parent, ignore_errors=True)
    return [path.name] if result.experiment is not None else []


def _words(args: argparse.Namespace) -> list[str]:
    """The command line, rebuilt from the parsed arguments."""
    words = list(args.bags)
    if args.hold_out:
        words += ["--hold-out", *args.hold_out]
    words += arguments.option_words(args, "machine", "output", "json") + arguments.configuration_words(args)
    words += [] if args.engine == "rounds" else ["--engine", args.engine]
    return words + (["--seed", str(args.seed)] if args.seed else [])
