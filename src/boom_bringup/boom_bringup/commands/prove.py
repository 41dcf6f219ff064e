"""Run the blind trial: conceal physics in a second plant, let the diagnosis find it, and score the answers.

The second plant (concealed_plant) shares no line with the model and no functional form with the effects of the catalogue. With
--plant q it is a third one (unseen_plant), which draws the form of every effect, operator and sensors, too. All cases are made
and sealed first; only a checksum of the answers is shown. The diagnosis then works on each recording in a process that can open
nothing else of the trial. Finally the answers are opened, and the table, the report and the worst cases are shown.

  ./boom prove --cases 30                     a small trial with a fresh seed, some minutes
  ./boom prove --cases 300                    the published one, about an hour on two cores
  ./boom prove --seed 7 --cases 300 --output output/prove-7-300     the same again, or resume one that was stopped
  ./boom prove --plant q --seed 7 --cases 12 --cases-only cases     only make the cases, to look at them

A measure that is not met is a result: the exit status is 0, or 1 with --strict.
"""

from __future__ import annotations

import argparse
import secrets
import signal
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from types import FrameType
from typing import TYPE_CHECKING, NoReturn

from boom_bringup.cli import UsageError
from boom_bringup.outputs import checked, checked_json, held, json_text, write_text
from boom_input.ending import ending_signals
from boom_model.cores import usable_cores

if TYPE_CHECKING:
    from rich.console import Console

    from boom_trials.blind.outcomes import Row
    from boom_trials.blind.trial import Progress, Trial

HELP = "conceal physics in a second plant, let the diagnosis find it blindly, score it"

_MOST_CASES = 10_000
_LARGEST_SEED = 2**31 - 1
_EVERY = 20.0  # s between two lines where there is no terminal


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument(
        "--seed", type=int, metavar="N", help="repeat the trial with this seed (default: a fresh one, which is printed)"
    )
    parser.add_argument(
        "--plant",
        choices=("p", "q"),
        default="p",
        help="who conceals: p, the concealed plant, or q, the unseen one (default: p)",
    )
    parser.add_argument(
        "--structures", choices=("tz17", "any"), default="tz17",
        help="with --plant q: cranes like the TZ17, or of any structure, each with its owner's machine file (default: tz17)",
    )  # fmt: skip
    parser.add_argument("--cases", type=int, metavar="K", default=300, help="number of cases (default: 300)")
    parser.add_argument(
        "--engine", choices=("rounds", "likelihood"), default="rounds", help="as of ./boom diagnose (default: rounds)"
    )
    parser.add_argument(
        "--output",
        metavar="DIR",
        help="folder of the trial; resumes a trial that was stopped (default: output/prove-N-K)",
    )
    parser.add_argument(
        "--cases-only",
        metavar="DIR",
        help="only make the cases, with their answers, in DIR; --output DIR goes on from there",
    )
    parser.add_argument("--json", metavar="F", help="write the score as a JSON document to F")
    parser.add_argument(
        "--document", metavar="F", help="write the trial as a page of the documentation to F (default: proof.md in DIR)"
    )
    parser.add_argument(
        "--machine", metavar="FILE", help="machine file around which the cranes are drawn (default: tz17)"
    )
    parser.add_argument(
        "--workers",
        type=int,
        metavar="W",
        default=usable_cores(),
        help="local worker processes (default: one per core)",
    )
    parser.add_argument(
        "--scheduler", metavar="ADDRESS",
        help="use the workers of this dask scheduler, tcp://HOST:PORT, which see the same folder and packages (default: local)",
    )  # fmt: skip
    parser.add_argument("--strict", action="store_true", help="exit with status 1 if a measure is not met")


def run(args: argparse.Namespace) -> int:
    """Run the trial; returns 0, or 1 with --strict and a measure that is not met."""
    _check(args)
    json_path = checked_json(args.json, "measures", "calibration")
    page_path = checked(args.document, "--document", "# The blind trial\n")
    machine = _machine_file(args.machine, args.structures)

    from boom_fleet.engine import workers
    from boom_report.console import console_for
    from boom_trials.blind import scoring, tables
    from boom_trials.blind.page import page
    from boom_trials.blind.report import report
    from boom_trials.blind.trial import Trial, default_folder, stored

    console = console_for()
    seed = args.seed
    if seed is None:
        known = stored(Path(args.output)) if args.output else None
        seed = known.seed if known else secrets.randbelow(_LARGEST_SEED)
    folder = Path(
        args.cases_only or args.output or default_folder(args.plant, args.structures, seed, args.cases, args.engine)
    )
    # workers first: nothing is written where a scheduler does not answer
    with _stopped_by_term(), workers(args.scheduler, min(args.workers, args.cases)) as engine, held(folder):
        trial = Trial(folder, seed, args.cases, machine, args.plant, args.structures, args.engine)
        begin, drawn_anew = time.monotonic(), trial.finished
        again = f"prove {trial.state.options} --output {folder}"
        console.print(f"seed {seed}: repeat or resume with ./boom {again}", soft_wrap=True)
        try:
            with _progress() as progress:
                checksum = trial.prepare(engine, progress)
                console.print(f"{args.cases} answers are sealed, SHA-256 {checksum}", soft_wrap=True)
                if args.cases_only:
                    _show_cases(console, trial)
                    return 0
                trial.diagnose(engine, progress)
                rows = trial.score(engine, progress)
        finally:
            if not drawn_anew:
                trial.spent(time.monotonic() - begin)
        seconds = trial.state.seconds
        _show(console, rows)
        page_path, report_path = page_path or folder / "proof.md", folder / "report.html"
        write_text(page_path, page(trial.state, rows, seconds))
        if json_path:
            write_text(json_path, json_text(tables.document(trial.state, rows, seconds)))
        write_text(report_path, report(trial, rows, seconds))
        console.print(f"{seconds / 60:.1f} minutes; report: {report_path}, page: {page_path}", soft_wrap=True)
        missed = [m for m in scoring.measures(rows) if m.met is False]
        return 1 if args.strict and missed else 0


def _check(args: argparse.Namespace) -> None:
    """Raises UsageError for options that cannot be, or not together."""
    if not 1 <= args.cases <= _MOST_CASES:
        raise UsageError(f"--cases {args.cases}: give a number from 1 to {_MOST_CASES}")
    if args.workers < 1:
        raise UsageError(f"--workers {args.workers}: give at least 1")
    if args.seed is not None and not 0 <= args.seed <= _LARGEST_SEED:
        raise UsageError(f"--seed {args.seed}: give a number from 0 to {_LARGEST_SEED}")
    if args.cases_only and (args.output or args.json or args.document):
        raise UsageError("--cases-only ends before there is a score: leave out --output, --json and --document")
    from boom_trials.blind.plants import PLANTS

    if args.structures not in (own := PLANTS[args.plant].structures):
        raise UsageError(f"--structures {args.structures}: plant {args.plant} has only {', '.join(own)}")


def _machine_file(wanted: str | None, structures: str) -> Path:
    """Path of the given machine file, or of a shipped one by name.

    Raises:
        UsageError: there is none, or its structure is not that of the concealed cranes.
    """
    from importlib.resources import files

    from boom_model.machine_file import load_machine

    name = wanted or "tz17"
    if Path(name).suffix in (".yaml", ".yml") or "/" in name:
        path = Path(name)
        if not path.is_file():
            raise UsageError(f"--machine {name}: there is no such file")
    else:
        path = Path(str(files("boom_model").joinpath("machines", f"{name}.yaml")))
        if not path.is_file():
            raise UsageError(f"--machine {name}: no shipped machine has this name: give a file")
    own, known = load_machine(path).structure, load_machine("tz17").structure  # the concealed plant takes it as checked
    other = [f"{'.'.join(c.key)}: {c.name}" for c, k in zip(own, known, strict=True) if c.name != k.name]
    if other and structures == "tz17":
        raise UsageError(
            f"--machine {name}: the plants conceal physics in cranes of the structure of tz17, this one has {', '.join(other)}; "
            "cranes of other structures: --plant q --structures any"
        )
    return path


def _show(console: Console, rows: Sequence[Row]) -> None:
    from rich.table import Table

    from boom_trials.blind import scoring, tables

    table = Table(title="blind trial")
    for title in ("measure", "cases", "measured (95 % bounds)", "required", "met"):
        table.add_column(title, justify="right" if title == "cases" else "left")
    for m in scoring.measures(rows):
        table.add_row(m.title, str(m.count), tables.value_text(m), tables.wanted_text(m), tables.met_text(m))
    console.print(table)


def _show_cases(console: Console, trial: Trial) -> None:
    """What each case conceals; for eyes that judge the cases, not the diagnosis."""
    from rich.table import Table

    table = Table(title=f"cases in {trial.folder}: blind/CASE is shown, sealed/CASE is not")
    for title in ("case", "kind", "concealed"):
        table.add_column(title)
    for answer in trial.answers():
        effects = [f"{e['effect']} {e['strength']:g} x ({e['size']:.3g} {e['unit']})" for e in answer["effects"]]
        wrong = [f"{key} by {off:.1f} standard deviations" for key, off in answer["wrong"].items()]
        table.add_row(answer["name"], answer["kind"], ", ".join([*effects, *wrong]))
    console.print(table)


@contextmanager
def _stopped_by_term() -> Iterator[None]:
    """SIGTERM and SIGHUP act like Ctrl-C: they also stop the workers. One that a library caught counts in the end."""
    asked = False

    def stop(number: int, frame: FrameType | None) -> NoReturn:
        nonlocal asked
        asked = True
        if callable(handler := before[signal.Signals(number)]):
            handler(number, frame)  # remembers the signal for the exit status
        raise KeyboardInterrupt

    before = {number: signal.getsignal(number) for number in ending_signals()}
    for number in before:
        signal.signal(number, stop)
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
    if asked:
        raise KeyboardInterrupt


@contextmanager
def _progress() -> Iterator[Progress]:
    """A progress bar on a terminal; elsewhere a line from time to time."""
    if not sys.stderr.isatty():
        said_at, said = 0.0, ""

        def say(title: str, done: int, total: int) -> None:
            nonlocal said_at, said
            if title != said or done == total or time.monotonic() - said_at > _EVERY:
                print(f"boom: {title}: {done} of {total}", file=sys.stderr, flush=True)
                said_at, said = time.monotonic(), title

        yield say
        return
    from rich.progress import (
        BarColumn,
        MofNCompleteColumn,
        Progress,
        TextColumn,
        TimeElapsedColumn,
        TimeRemainingColumn,
    )

    from boom_report.console import console_for

    columns = (
        TextColumn("{task.description}", markup=False), BarColumn(24), MofNCompleteColumn(), TimeElapsedColumn(),
        TimeRemainingColumn(),
    )  # fmt: skip
    with Progress(*columns, console=console_for(sys.stderr), transient=True) as bar:
        task = bar.add_task("starting the workers", total=None)

        def show(title: str, done: int, total: int) -> None:
            bar.update(task, description=title, completed=done, total=total)

        yield show
