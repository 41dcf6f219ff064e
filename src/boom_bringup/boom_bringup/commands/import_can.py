"""Turn a CAN log into a bag with the codec of the bridge, like one that was recorded live.

LOG is a .blf, .asc, candump .log, .csv (python-can's) or .trc file. Frames that the mapping does not know are listed; damaged
frames are counted and left out; a truncated log is read up to its last complete frame.

  ./boom import-can machine.blf --dbc tz17 --output output/machine
  ./boom import-can machine.log --dbc other.dbc --mapping other.yaml --output output/other --load 300

Every command accepts the bag as a recording, e.g. ./boom validate output/machine.
"""

from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path
from typing import TYPE_CHECKING

from boom_bringup import arguments
from boom_bringup.outputs import new_bag, write_recording

if TYPE_CHECKING:
    from boom_recording.can_import import Imported

HELP = "turn a CAN log into a bag"
_MANY = 12


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("log", metavar="LOG", help="CAN log: .blf, .asc, .log, .csv or .trc (.mf4: ./boom import)")
    parser.add_argument("--dbc", metavar="FILE", default="tz17", help="DBC file or shipped name (default: tz17)")
    parser.add_argument("--mapping", metavar="FILE", help="mapping file (default: the .yaml beside the DBC file)")
    parser.add_argument("--output", metavar="BAG", required=True, help="folder of the new bag; must not exist")
    parser.add_argument(
        "--machine", metavar="NAME", default="tz17", help="machine file of the recorded machine (default: tz17)"
    )
    parser.add_argument(
        "--q3",
        "--outer-boom-angle",
        type=arguments.finite,
        metavar="RAD",
        default=0.28,
        help="q3 [rad] (default: 0.28)",
    )
    parser.add_argument(
        "--q4", "--telescope-length", type=arguments.finite, metavar="M", default=2.2, help="q4 [m] (default: 2.2)"
    )
    parser.add_argument(
        "--load",
        type=arguments.load_mass,
        metavar="KG",
        default=0.0,
        help="load at the tip [kg], nan = not known (default: 0)",
    )


def run(args: argparse.Namespace) -> int:
    """Read, decode, write; returns 0."""
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

    from boom_can_bridge.codec import Codec
    from boom_recording import can_import, can_log
    from boom_recording.recording import Configuration
    from boom_report.console import console_for

    output = Path(args.output)
    codec = Codec.load(args.dbc, args.mapping, of_log=True)
    note = f"imported from the CAN log {Path(args.log).name}"
    configuration = Configuration(args.machine, args.q3, args.q4, args.load, note)
    begin = time.perf_counter()
    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        TextColumn("{task.percentage:>3.0f} %"),
        TimeElapsedColumn(),
    )
    shown = Progress(*columns, console=console_for(sys.stderr), transient=True, disable=not sys.stderr.isatty())
    with new_bag(output) as made, shown as bar:
        reading = bar.add_task("reading the log", total=1.0)
        frames = can_log.read(args.log, lambda part: bar.update(reading, completed=part))
        decoding = bar.add_task("decoding", total=1.0)
        imported = can_import.convert(
            output.name, frames, codec, configuration, lambda part: bar.update(decoding, completed=part)
        )
        bar.add_task("writing the bag", total=None)
        write_recording(made, imported.recording)
    _show(imported, len(frames.ids), time.perf_counter() - begin, output)
    return 0


def _show(imported: Imported, count: int, spent: float, output: Path) -> None:
    from rich.table import Table

    from boom_report.console import console_for

    console = console_for()
    recording = imported.recording
    table = Table(title=f"{output.name}: {recording.duration:.1f} s, {count} frames")
    for heading in ("frame", "identifier", "used", "lost", "left out"):
        table.add_column(heading, justify="left" if heading in ("frame", "left out") else "right")
    for row in imported.frames:
        bad = ", ".join(f"{number} {reason.replace('_', ' ')}" for reason, number in sorted(row.bad.items()))
        table.add_row(row.name, row.identifier, str(row.used), str(row.lost), bad or "-")
    console.print(table)
    if imported.unknown:
        listed = sorted(imported.unknown.items(), key=lambda item: -item[1])
        text = ", ".join(f"{name}: {number}" for name, number in listed[:_MANY])
        more = f" and {len(listed) - _MANY} more" if len(listed) > _MANY else ""
        console.print(f"identifiers that the mapping does not know, with their frames: {text}{more}", soft_wrap=True)
    for kind, number in sorted(imported.left_out.items()):
        console.print(f"left out: {number} {kind}", soft_wrap=True)
    for warning in imported.recording.warnings:
        console.print(f"note: {warning}", soft_wrap=True)
    console.print(
        f"{count} frames in {spent:.2f} s ({count / max(spent, 1e-9):.0f} frames/s); the bag is {output}",
        soft_wrap=True,
    )
    c = recording.configuration
    console.print(
        f"stored with it: machine {c.machine}, q3 = {c.outer_boom_angle:g} rad, q4 = {c.telescope_length:g} m, load "
        f"{c.load_mass:g} kg; if that is wrong, give --machine, --q3, --q4, --load",
        soft_wrap=True,
    )
    console.print(f"compare it with the model: ./boom validate {output}", soft_wrap=True)
