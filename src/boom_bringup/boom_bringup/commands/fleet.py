"""Screen and diagnose many recordings of many machines, and compare each machine with its own past: what changed, and since when.

Below FOLDER each machine has a folder with its bags; its name is that of the folder. The machine file is that of --machines (a CSV
table with the columns machine,file), else machine.yaml in the machine's folder, else --machine, else the shipped machine that a
recording names. FOLDER and --output may be URLs that fsspec knows, such as s3://bucket/fleet.

Every recording is checked and screened once. One whose machine has changed is diagnosed like by `boom diagnose`. Written to DIR:
recordings/ (Parquet, one row a recording), report.html, work/ (what a run that is started again need not do again).
A recording that cannot be read is told, and the rest goes on. A change is a result, not an error: the exit status is 0; it is 1
where no recording could be screened.

  ./boom fleet recordings/2025 --output output/fleet
  ./boom fleet s3://cranes/2025 --output s3://cranes/results --scheduler tcp://127.0.0.1:8786
"""

from __future__ import annotations

import argparse
import os
import sys
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING

from boom_bringup.arguments import command_line, positive
from boom_bringup.cli import UsageError
from boom_bringup.outputs import checked, held
from boom_bringup.showing import progress
from boom_input.files import is_below
from boom_model.cores import usable_cores

if TYPE_CHECKING:
    from boom_fleet.run import FleetRun
    from boom_fleet.store import Store
    from boom_fleet.tasks import Task

HELP = "screen and diagnose the recordings of many machines, and tell what changed in which, since when"

_FALSE_ALARMS = 0.05


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument(
        "folders", nargs="+", metavar="FOLDER", help="folder or URL; below it each machine has a folder of bags"
    )
    parser.add_argument(
        "--output", required=True, metavar="DIR", help="folder or URL for the results; give it again to resume"
    )
    parser.add_argument("--machines", metavar="TABLE", help="CSV table with the columns machine,file")
    parser.add_argument(
        "--machine", default="", metavar="FILE", help="machine file, or a shipped name, of all other machines"
    )
    parser.add_argument(
        "--scheduler",
        metavar="URL",
        help="dask scheduler that is running, e.g. tcp://127.0.0.1:8786 (default: own processes)",
    )
    parser.add_argument(
        "--workers", type=int, default=usable_cores(), metavar="N", help="own processes (default: one a core)"
    )
    parser.add_argument(
        "--false-alarms",
        type=positive,
        default=_FALSE_ALARMS,
        metavar="N",
        help=f"machines raised for nothing that are expected in one run (default: {_FALSE_ALARMS})",
    )
    parser.add_argument("--no-diagnosis", action="store_true", help="screen and compare only")
    parser.add_argument(
        "--publish", metavar="BAG", help="also write the results as /diagnostics messages into a new bag"
    )


def run(args: argparse.Namespace) -> int:
    """Screen, compare, diagnose; returns 0 whatever is found, 1 where nothing could be screened."""
    if args.workers < 1:
        raise UsageError(f"--workers {args.workers}: give 1 or more")
    if any(os.path.realpath(folder) == os.path.realpath(args.output) for folder in args.folders):
        raise UsageError(f"--output {args.output}: the recordings lie there: give another folder")
    if args.publish and _among_recordings(args.publish, args):
        raise UsageError(
            f"--publish {args.publish}: the next run would take it for a recording: give a folder elsewhere"
        )
    if args.publish and os.path.lexists(args.publish):
        raise UsageError(f"{args.publish} exists already: give another --publish, nothing is overwritten")
    if args.machine and "://" not in args.machine:
        from boom_model.machine_file import load_machine

        load_machine(args.machine)  # what is wrong with it is told once
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # of the workers

    from boom_fleet import manifest, scratch, table
    from boom_fleet.engine import workers
    from boom_fleet.run import Night
    from boom_fleet.store import Store

    scratch.clear()
    tasks = _tasks(args)
    with ExitStack() as stack:
        store = Store(args.output)
        if store.local is not None:
            stack.enter_context(held(store.local))
        checked(args.publish, "--publish")  # it may lie in the output
        engine = stack.enter_context(workers(args.scheduler, args.workers))
        outputs = manifest.claim(store, args.folders, {task.bag.machine for task in tasks})
        step = stack.enter_context(progress(len(tasks)))
        result = Night(tasks, store, engine, step, args.false_alarms, not args.no_diagnosis).run()
        table.write(store, table.rows(result))
        status = _tell(args, store, result)
        outputs.settle()
    return status


def _among_recordings(path: str, args: argparse.Namespace) -> bool:
    """Whether the next run would find a bag here."""
    there = os.path.isdir(os.path.dirname(os.path.abspath(path)))
    return there and any(is_below(path, f) for f in args.folders) and not is_below(path, args.output)


def _tasks(args: argparse.Namespace) -> list[Task]:
    """The recordings with their machine files."""
    from boom_fleet.run import tasks_of
    from boom_fleet.store import find_bags, machine_table, read_file

    files = machine_table(args.machines) if args.machines else {}
    bags = list({bag.key: bag for folder in args.folders for bag in find_bags(folder, args.output)}.values())
    unused = sorted(set(files) - {bag.machine for bag in bags})
    if unused:
        print(f"boom: {args.machines} names machines without a recording: {', '.join(unused)}", file=sys.stderr)
    return tasks_of(bags, files, args.machine, read_file)


def _tell(args: argparse.Namespace, store: Store, result: FleetRun) -> int:
    from boom_fleet import table
    from boom_fleet.manifest import REPORT
    from boom_report.console import console_for
    from boom_report.fleet.report import page_of
    from boom_report.fleet.terminal import print_fleet

    rows = table.rows(result)
    command = command_line("fleet", *sys.argv[2:])
    store.write(REPORT, page_of(rows, command).encode())
    if args.publish:
        from boom_fleet.publishing import publish

        publish(Path(args.publish), rows)
    console = console_for()
    print_fleet(rows, console)
    equal = sorted({row["machine"] for row in rows if table.EQUAL_TIME in row.get("warnings", [])})
    if equal:
        console.print(f"{', '.join(equal)}: {table.EQUAL_TIME}", markup=False, soft_wrap=True)
    console.print(f"written to {store.url}: {table.FOLDER}/, {REPORT}" + (f"; {args.publish}" if args.publish else ""))
    return 0 if any(row.get("screened_s") for row in rows) else 1
