"""Turn foreign recordings into a bag that every command takes: CSV, MAT, MF4, rosbag2 .db3, ROS 1 bags, MCAP with other topics.

Several FILEs are parts of one recording. Without --mapping the command proposes one from names, units, ranges and dynamics, shows
it as a table and as a page with a plot of each signal, and writes it to a file. What it cannot tell it asks; without a terminal it
ends with exit status 2 and names the file to edit.

  ./boom import test3.csv --q3 0.28 --q4 2.2 --load 0 --output output/test3
  ./boom import test3.csv --mapping output/import-test3.csv.yaml --output output/test3
  ./boom validate output/test3 --machine my_crane.yaml

Angle and rate become positive while the boom is lifted, pressures absolute [Pa] on the wire, currents [A].
"""

from __future__ import annotations

import argparse
import hashlib
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from boom_bringup import arguments
from boom_bringup.cli import UsageError
from boom_bringup.outputs import (
    PAGE,
    checked,
    default_report,
    new_bag,
    refuse_existing,
    write,
    write_recording,
    write_text,
)
from boom_bringup.showing import asked
from boom_input.shown import typable

if TYPE_CHECKING:
    from boom_import.assembly import Proposal
    from boom_import.source import Source
    from boom_import.timing import TimeChoice
    from boom_model.machine import Machine
    from boom_recording.recording import Recording

HELP = "turn CSV, MAT, MF4, .db3, ROS 1 and other foreign recordings into a bag"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument(
        "files", nargs="+", metavar="FILE", help="file or rosbag2 folder; several are parts of one recording"
    )
    parser.add_argument("--output", metavar="BAG", required=True, help="folder of the new bag; must not exist")
    parser.add_argument("--mapping", metavar="M.yaml", help="which column is which signal; default: propose one")
    parser.add_argument(
        "--write-mapping", metavar="M.yaml", help="write the proposed mapping here (default: output/import-FILE.yaml)"
    )
    parser.add_argument(
        "--yes", action="store_true", help="take the proposal without asking; what is not sure is asked all the same"
    )
    parser.add_argument("--time", metavar="COLUMN", default="", help="column of the time in a table (default: found)")
    parser.add_argument(
        "--time-unit", choices=("s", "ms", "us", "ns", "min", "h", "d"), help="its unit (default: found)"
    )
    parser.add_argument(
        "--sample-rate", type=_sample_rate, metavar="HZ", help="samples per second of a table without a time"
    )
    report = parser.add_mutually_exclusive_group()
    report.add_argument("--report", metavar="F.html", help="path of the page (default: output/import-FILE.html)")
    report.add_argument("--no-report", action="store_true", help="write no page")
    parser.add_argument(
        "--machine", metavar="FILE",
        help="machine file of the recorded machine, or its name (default: what the recording says, else not known)",
    )  # fmt: skip
    arguments.add_configuration(parser)


def _sample_rate(text: str) -> float:
    from boom_import.timing import FASTEST  # not there before the set-up

    rate = arguments.positive(text)
    if rate > FASTEST:
        raise argparse.ArgumentTypeError(f"give at most {FASTEST:g} samples a second")
    return rate


def run(args: argparse.Namespace) -> int:
    """Read, propose or take a mapping, convert, write; returns 0."""
    page = (
        None if args.no_report else checked(args.report, "--report", PAGE) or default_report("import", args.files[:1])
    )
    written = checked(args.write_mapping, "--write-mapping") or default_report("import", args.files[:1]).with_suffix(
        ".yaml"
    )

    refuse_existing(Path(args.output))

    from boom_import import mapping as mappings
    from boom_import.assembly import Proposal, propose
    from boom_import.timing import TimeChoice

    given = mappings.read(args.mapping) if args.mapping else None
    choice = TimeChoice(args.time, args.time_unit or "", args.sample_rate or 0.0)
    if given is not None and choice == TimeChoice():
        choice = given.time
    source = _read(args.files, choice)
    proposal = Proposal(given) if given is not None else propose(source, choice, args.joint or "")
    _configure(source, proposal, args)
    _show(source, proposal)
    command = arguments.command_line("import", *sys.argv[2:])
    if page is not None:
        from boom_report.importing.report import write_import_page

        write(page, lambda: write_import_page(page, source, proposal, command))
        print(f"page: {page}")
    if given is None:
        _settle(proposal, written, args)
    elif given.open():
        raise UsageError(f"{args.mapping}: {given.open()[0]} is not decided: write its column in the place of 'ask'")
    return _convert(args, source, proposal)


def _read(files: list[str], choice: TimeChoice) -> Source:
    from boom_bringup.showing import progress
    from boom_import import reading

    done = 0
    with progress(100) as step:
        step(f"reading {Path(files[0]).name}", 0)

        def advance(part: float) -> None:
            nonlocal done
            step("", max(0, round(100 * part) - done))
            done = max(done, round(100 * part))

        return reading.read([Path(file) for file in files], choice, advance)


def _configure(source: Source, proposal: Proposal, args: argparse.Namespace) -> None:
    mapping, machine = proposal.mapping, _machine(args.machine)
    mapping.machine = (machine.name if machine else args.machine) or mapping.machine
    mapping.joint = args.joint or mapping.joint
    for name in ("q3", "q4", "load"):
        value = getattr(args, name)
        if value is not None:
            setattr(mapping, name, value)
    if (
        machine
        and source.configuration is None
        and mapping.q3 is None
        and mapping.q4 is None
        and (pose := machine.only_pose)
    ):
        mapping.q3, mapping.q4 = pose.outer_boom_angle, pose.telescope_length
        proposal.notes.append(f"pose: q3 {mapping.q3:g} rad, q4 {mapping.q4:g} m, the only one of {args.machine}")


def _machine(file: str | None) -> Machine | None:
    """The machine of a file; None for a name, by which a bag may call a machine that has none."""
    if not file or not Path(file).is_file():
        return None
    from boom_model.machine_file import load_machine

    return load_machine(file)


def _show(source: Source, proposal: Proposal) -> None:
    from rich.table import Table

    from boom_report.console import console_for
    from boom_report.importing.report import rows

    console = console_for()
    count = max(len(column.values) for column in source.columns)
    console.print(
        f"{source.path.name}: {source.kind}, {len(source.columns)} columns of up to {count} samples; time: {source.time}",
        soft_wrap=True,
    )
    table = Table()
    for heading in ("signal", "column", "unit", "sign", "range", "sure"):
        whole = heading in ("range", "sure")
        table.add_column(heading, justify="right" if heading == "sure" else "left", overflow="fold", no_wrap=whole)
    for signal, column, unit, sign, reference, reach, sure, _ in rows(source, proposal):
        table.add_row(signal, column, f"{unit} {reference}".strip(), sign, reach, sure)
    console.print(table)
    for note in (*proposal.notes, *source.notes):
        console.print(f"note: {note}", soft_wrap=True)


def _settle(proposal: Proposal, written: Path, args: argparse.Namespace) -> None:
    """Ask for what is open, and whether the proposal is taken. Raises UsageError where nobody can be asked."""
    written = _kept(written)
    _write_mapping(proposal, written, args)
    again = typable("./boom", "import", *args.files, "--mapping", str(written), "--output", args.output)
    asking = sys.stdin.isatty() and sys.stdout.isatty()
    if proposal.questions:
        if not asking:
            signal, question = next(iter(proposal.questions.items()))
            more = f" (and {len(proposal.questions) - 1} more)" if len(proposal.questions) > 1 else ""
            raise UsageError(f"{args.files[0]}: {signal}: {question}{more}: decide it in {written}, then: {again}")
        from boom_bringup.commands import _import_asking

        _import_asking.ask(proposal)
        _write_mapping(proposal, written, args)
    elif args.yes:
        return
    elif not asking:
        raise UsageError(f"{args.files[0]}: take this mapping with --yes, or edit {written}, then: {again}")
    try:
        answer = "y" if args.yes else asked("import with this mapping? [Y/n] ").lower()
    except EOFError:
        answer = "n"
    if answer not in ("", "y", "yes"):
        raise UsageError(f"not imported: edit {written}, then: {again}")


def _kept(path: Path) -> Path:
    """Where a proposal goes: one that somebody has edited stays as it is."""
    if not path.is_file():
        return path
    head, _, rest = path.read_text(encoding="utf-8", errors="replace").partition("\n")
    if head == _seal(rest):
        return path
    other = _kept(path.with_suffix(f".new{path.suffix}"))
    print(f"note: {path} was edited and stays as it is (give it back with --mapping); this proposal goes to {other}")
    return other


def _seal(text: str) -> str:
    """First line of a proposal, by which one that was edited is known."""
    written = text.encode("utf-8", "backslashreplace")  # as the file has it
    return f"# proposal {hashlib.sha256(written).hexdigest()[:12]}"


def _write_mapping(proposal: Proposal, path: Path, args: argparse.Namespace) -> None:
    from boom_import import mapping as mappings

    comments = {}
    for signal in proposal.mapping.signals:
        lines = [proposal.why.get(signal, "")]
        if signal in proposal.questions:
            lines = [f"to be decided: {proposal.questions[signal]}"]
            lines += [
                f"  {mappings.entry_text(entry)}   ({100 * p:.0f} %)"
                for entry, p in proposal.options.get(signal, [])[:4]
                if p > 0.005
            ]
        comments[signal] = "\n".join(line for line in lines if line)
    heading = [
        f"Proposed by {typable('./boom', 'import', *args.files)}",
        "Edit it, and give it back with --mapping.",
    ]
    text = mappings.text(proposal.mapping, comments, heading)
    write_text(path, f"{_seal(text)}\n{text}")
    print(f"mapping: {path}")


def _convert(args: argparse.Namespace, source: Source, proposal: Proposal) -> int:
    from boom_checks.even_series import seldom
    from boom_import.conversion import convert
    from boom_import.mapping import is_piston
    from boom_input.channels import ESSENTIAL
    from boom_report.console import console_for

    output = Path(args.output)
    with new_bag(output) as made:
        recording = convert(output.name, source, proposal.mapping)
        write_recording(made, recording)
    console = console_for()
    missing = [signal for signal, entry in proposal.mapping.signals.items() if entry == "none"]
    rare = seldom(*recording.signals.values())
    doubts = [f"{rare}; if it was more often, the unit of the time is another (--time-unit)"] if rare else []
    for note in (*recording.notes, *doubts):
        console.print(f"note: {note}", soft_wrap=True)
    for missed, said in (
        ([name for name in missing if name in ESSENTIAL], "the commands will refuse the bag"),
        ([name for name in missing if name not in ESSENTIAL], "what only that shows cannot be told"),
    ):
        if missed:
            console.print(f"note: without {', '.join(missed)}: {said}", soft_wrap=True)
    console.print(f"{recording.duration:.1f} s imported; the bag is {output}", soft_wrap=True)
    if is_piston(proposal.mapping):
        console.print("the joint is the piston of a cylinder: only its hydraulics can be examined")
        areas = f"./boom chain {typable(str(output))} --areas A_A A_B"
        console.print(f"do so with its areas in m^2, head and rod side: {areas}", soft_wrap=True)
    elif not any(name in ESSENTIAL for name in missing):
        for line in _next(args.machine, args.load, recording, output):
            console.print(line, soft_wrap=True)
    return 0


def _next(machine: str | None, load: float | None, recording: Recording, output: Path) -> list[str]:
    """What the bag does not say, and the command to type next, with the options that it then needs."""
    from boom_model.machine_file import shipped_machines

    known = recording.stored_configuration
    lines, words = [], ["./boom", "validate", typable(str(output))]
    named = known.machine if known else ""
    if known is None:
        lost = f"; the load of {load:g} kg is not kept without a pose" if load is not None else ""
        lines.append(f"note: pose and load are not known: every command that needs them takes them as options{lost}")
        words.append("--q3 RAD --q4 M --load KG")
    if known is None and machine:
        lines.append(
            "note: without a pose the bag cannot name its machine either: repeat --machine, or import with --q3 and --q4"
        )
    elif not named:
        lines.append("note: the machine is not named: every command that runs a model takes its file as an option")
    if named not in shipped_machines():
        usable = machine and (Path(machine).is_file() or machine in shipped_machines())
        words.append(f"--machine {typable(machine) if machine and usable else 'FILE'}")
    return [*lines, f"compare it with the model: {' '.join(words)}"]
