"""Write a machine in a pose as an FMU for co-simulation: for Simulink, OpenModelica, FMPy and all other tools that import FMI.

The FMU holds the equations of the machine file, its effects and learnt terms included, as C source, and a library built from
it for this platform; it needs no Python. Inputs are the currents of the solenoids, outputs what the sensors show without noise.
All numbers of the machine are parameters. It starts at rest, and gives what `./boom simulate --sensors ideal` gives.

  ./boom export-fmu --output tz17.fmu
  ./boom export-fmu --machine output/diagnosis/machine.yaml --q3 0.28 --q4 2.8 --load 300 --angle 0.2 --output crane.fmu
  ./boom export-fmu --machine loader_crane --input supply_pressure --fmi 2 --output crane.fmu
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from boom_bringup import __version__, arguments
from boom_bringup.cli import UsageError
from boom_bringup.outputs import checked, write

if TYPE_CHECKING:
    from boom_model.fmu.variables import FmuVariable
    from boom_model.machine import Machine, Pose

HELP = "write a machine as an FMU (FMI 3.0 or 2.0, co-simulation), C source inside"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("--output", metavar="F.fmu", required=True, help="the file; an FMU of this command is replaced")
    parser.add_argument(
        "--machine", metavar="FILE", default="tz17", help="machine file or shipped name (default: tz17)"
    )
    parser.add_argument("--fmi", type=int, choices=(2, 3), default=3, help="version of FMI (default: 3)")
    parser.add_argument(
        "--effect", metavar="ID.NAME=VALUE", action="append", default=[],
        help="physics in addition to the machine file, SI, e.g. hose_burst_valve_lag.tau=0.09; repeatable",
    )  # fmt: skip
    parser.add_argument(
        "--input", choices=("supply_pressure", "tank_pressure"), action="append", default=[],
        help="a pressure that becomes an input, in place of the machine's constant; repeatable",
    )  # fmt: skip
    parser.add_argument(
        "--angle", type=arguments.finite, metavar="RAD", default=0.3, help="initial boom angle [rad] (default: 0.3)"
    )
    pose = "(default: the first of the machine file's configurations)"
    parser.add_argument("--q3", type=arguments.finite, metavar="RAD", help=f"angle of the outer boom [rad] {pose}")
    parser.add_argument("--q4", type=arguments.finite, metavar="M", help=f"length of the telescope [m] {pose}")
    parser.add_argument(
        "--load", type=arguments.finite, metavar="KG", default=0.0, help="load at the tip [kg] (default: 0)"
    )


def run(args: argparse.Namespace) -> int:
    """Write the FMU; returns 0."""
    path = checked(args.output, "--output", "sources/boom.c")
    assert path is not None
    if path.suffix != ".fmu":
        raise UsageError(f"--output {args.output}: importers want a file that ends with .fmu: give {path.stem}.fmu")
    from boom_bringup.commands.simulate import parse_effects
    from boom_model.machine_file import load_machine

    machine = load_machine(args.machine).driven_by(args.input)
    machine = machine.with_effects({**machine.effects, **parse_effects(args.effect)})
    pose = _pose(machine, args)

    from boom_input.whole import write_whole
    from boom_model.fmu.archive import export, meaning
    from boom_model.plant import Plant

    plant = Plant(machine, pose)
    made = export(plant, args.angle, version=args.fmi, program=__version__)
    write(path, lambda: write_whole(path, made.data))
    _show(path, args.fmi, meaning(plant), made.variables)
    return 0


def _pose(machine: Machine, args: argparse.Namespace) -> Pose:
    first = machine.tabulated[0]
    q3 = first.outer_boom_angle if args.q3 is None else args.q3
    q4 = first.telescope_length if args.q4 is None else args.q4
    return machine.pose(q3, q4, args.load)


def _show(path: Path, version: int, meaning: str, rows: list[FmuVariable]) -> None:
    from rich.table import Table

    from boom_report.console import console_for

    table = Table(title=f"{path}: FMI {version}.0", box=None, title_justify="left", pad_edge=False)
    for heading in ("variable", "unit", "is", "meaning"):
        table.add_column(heading, overflow="fold")
    for row in rows:
        if row.causality in ("input", "output") or row.name.startswith("start."):
            table.add_row(row.name, row.unit, row.causality, row.meaning)
    counted = sum(row.variability == "tunable" for row in rows)
    console = console_for()
    console.print(table)
    console.print(f"and {counted} tunable parameters, all states and inner quantities", soft_wrap=True)
    console.print(meaning, soft_wrap=True)
