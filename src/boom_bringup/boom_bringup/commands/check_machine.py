"""Check a machine file: list all its faults, one line each, or print what its numbers mean.

FILE is a path or the name of a shipped machine. Nothing is simulated. The table holds quantities that follow from the file and that
data sheets state: compare them with yours. Status 0: the file can be used; 2: it has faults, one line each on stderr, or numbers
that no machine has.

  ./boom check-machine tz17
  ./boom check-machine my_crane.yaml
"""

from __future__ import annotations

import argparse
import sys

HELP = "list the faults of a machine file, one line each, or what its numbers mean"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("file", metavar="FILE", help="machine file, or the name of a shipped machine")
    parser.add_argument("--json", metavar="F", help="also write faults and quantities to this file")


def run(args: argparse.Namespace) -> int:
    """Print faults or quantities; returns 0, or 2 where there are faults."""
    from rich.table import Table

    from boom_bringup.outputs import checked_json, write_json
    from boom_model.derived import quantities
    from boom_model.errors import MachineError
    from boom_model.machine_file import check_machine
    from boom_report.console import console_for

    path = checked_json(args.json, "faults", "quantities")
    try:
        machine, faults = check_machine(args.file)
    except MachineError as error:  # not to be read at all: a fault like others
        machine, faults = None, [str(error)]
    rows = quantities(machine) if machine else []
    faults = [*faults, *(f"{row.source}: {row.meaning} {row.value}: {row.fault}" for row in rows if row.fault)]
    if path:
        listed = [{"meaning": row.meaning, "value": row.value, "source": row.source} for row in rows]
        write_json(path, {"file": args.file, "faults": faults, "quantities": listed})
    for fault in faults:
        print(f"boom: {fault}", file=sys.stderr)
    if machine is None:
        return 2
    table = Table(title=f"{args.file}: machine {machine.name}", box=None, title_justify="left", pad_edge=False)
    for heading in ("quantity", "value", "from"):
        table.add_column(heading, overflow="fold", no_wrap=heading == "quantity")
    for row in rows:
        table.add_row(row.meaning, row.value, row.source)
    console = console_for()
    console.print(table)
    if machine.effects or machine.learned:
        named = [*machine.effects, *(f"a learned term in {term.equation}" for term in machine.learned)]
        console.print(f"not in these numbers: {', '.join(named)}", soft_wrap=True)
    return 2 if faults else 0
