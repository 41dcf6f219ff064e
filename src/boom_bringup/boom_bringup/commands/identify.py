"""Estimate the machine's parameters from recordings, as in chapter 5 of the thesis.

The content of each BAG decides what it is used for:

  oscilloscope traces of a pilot valve   static curve h, linear part, both valves compared        (5.1)
  recordings of the machine              orifice areas, friction, then all numbers jointly        (5.2, 5.3)

Where the machine file is too far from the machine for the joint search, all numbers that have a tolerance are fitted within it.

  ./boom identify bags/healthy/* --output output/machine.yaml
  ./boom simulate --campaign pilot --output output/pilot && ./boom identify output/pilot/*

Numbers that the recordings do not determine are listed with the reason and left unchanged. The machine file that --output writes
states the source of each number; every command accepts it as --machine. The report is one HTML file with the figures of chapter 5.
"""

from __future__ import annotations

import argparse
import math
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from boom_bringup import arguments
from boom_bringup.cli import UsageError
from boom_bringup.outputs import PAGE, checked, checked_json, default_report, write, write_json
from boom_bringup.replica import machine_of
from boom_bringup.showing import progress

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from rich.console import Console

    from boom_identification.identify import Identification, Inputs, Refiner
    from boom_model.machine import Machine
    from boom_recording.recording import Recording

HELP = "estimate the machine's parameters from recordings, with intervals"

_STEPS = 14


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument(
        "bags", nargs="+", metavar="BAG", help="recording or oscilloscope bag: a folder or a .mcap file"
    )
    parser.add_argument(
        "--machine",
        metavar="FILE",
        help="initial machine file, or a shipped name (default: the recordings', else tz17)",
    )
    arguments.add_configuration(parser)
    arguments.add_other_joints(parser)
    parser.add_argument("--output", metavar="machine.yaml", help="write a machine file with the identified numbers")
    arguments.add_documents(parser, "identify")
    parser.add_argument(
        "--hose-burst-valve-curve", metavar="CSV",
        help="points of the curve in the data sheet, header pressure_drop_bar,flow_lpm; negative: out of the cylinder",
    )  # fmt: skip
    parser.add_argument(
        "--smoothing", type=arguments.finite, metavar="LAMBDA",
        help="smoothing of the P-splines (5.24), over s_s/s_s,max and A/A_0 (default: chosen by cross-validation)",
    )  # fmt: skip
    parser.add_argument(
        "--parameters", metavar="KEY,KEY",
        help="keys of the machine file, joined with dots: the refinement estimates only these (default: eighteen numbers of "
        "friction, oil, accumulators and orifices), e.g. friction.tau_C_pos,fluid.beta",
    )  # fmt: skip
    parser.add_argument(
        "--stationary-only", action="store_true",
        help="use only the stationary points of ch. 5.2 and 5.3; skip the joint refinement",
    )  # fmt: skip


def run(args: argparse.Namespace) -> int:
    """Identify; returns 0, even if nothing was determined."""
    if args.smoothing is not None and not 0.0 <= args.smoothing < float("inf"):
        raise UsageError(f"--smoothing {args.smoothing:g}: give a number of 0 or more")
    names = None
    if args.parameters is not None:
        names = [*dict.fromkeys(filter(None, map(str.strip, args.parameters.split(","))))]
        if not names:
            raise UsageError("--parameters: there is no name in it")
    if names is not None and args.stationary_only:
        raise UsageError("--parameters concerns the refinement, which --stationary-only skips: leave one of them out")
    report = None if args.no_report else checked(args.report, "--report", PAGE) or default_report("identify", args.bags)
    output = checked(args.output, "--output", "# Identified on ")
    if output is not None and output.suffix not in (".yaml", ".yml"):
        raise UsageError(f"--output {output}: a machine file ends in .yaml")
    json_path = checked_json(args.json, "parameters", "not_determined")
    command = arguments.command_line("identify", *_words(args))

    from boom_bringup.given import load_given, refuse_repeated, sha256
    from boom_identification.identify import identify, read_inputs
    from boom_recording.recording import told_apart

    with progress(_STEPS) as step:
        inputs = read_inputs(args.bags, lambda text: step(text, 0), lambda bag: load_given(bag, args))
        paths = [*dict.fromkeys(trace.path for trace in inputs.traces), *(r.path for r in inputs.recordings)]
        refuse_repeated([str(path) for path in paths], [sha256(path) for path in paths])
        inputs = replace(inputs, recordings=tuple(told_apart(inputs.recordings)))
        machine, source = _machine(args.machine, inputs)
        result = identify(
            inputs, machine,
            curve=Path(args.hose_burst_valve_curve) if args.hose_burst_valve_curve else None,
            smoothing=args.smoothing,
            refiner=None if args.stationary_only else _refiner(names, machine),
            progress=lambda text: step(text, 1),
        )  # fmt: skip

    from boom_report.console import console_for

    console = console_for()
    _show(result, console)
    if json_path:
        write_json(json_path, result.document())
    if output:
        from boom_identification.machine_output import write_machine

        write(output, lambda: write_machine(output, machine, result.estimates, command=command))
        console.print(f"machine file: {output}", markup=False, soft_wrap=True)
    if report:
        from boom_report.identification.report import write_identification_report

        write(report, lambda: write_identification_report(result, report, command=command, machine_source=source))
        console.print(f"report: {report}", markup=False, soft_wrap=True)
    return 0


def _machine(wanted: str | None, inputs: Inputs) -> tuple[Machine, str]:
    if wanted is None and not inputs.recordings:
        wanted = "tz17"  # the bench does not tell whose valve it is
    return machine_of({str(recording.path): recording for recording in inputs.recordings}, wanted)


def _show(result: Identification, console: Console) -> None:
    from rich.table import Table

    from boom_identification.search import GOOD_LEVEL
    from boom_report.channels import number

    if result.estimates:
        table = Table(title=f"Identified: {result.machine.name}", title_justify="left")
        for heading, side in (("parameter", "left"), ("value", "right"), ("90 % interval", "right"), ("unit", "left")):
            table.add_column(heading, justify=side)  # type: ignore[arg-type]
        table.add_column("before", justify="right")
        before = {
            name: value
            for p in result.machine.parameters.values()
            for name, value in zip(p.specification.components, p.value, strict=True)
        }
        for e in result.estimates:
            low, high = e.interval_90
            old = number(before[e.key], 4) if e.key in before else ""
            table.add_row(e.key, number(e.value, 4), f"{number(low, 4)} .. {number(high, 4)}", e.unit, old)
        console.print(table)
    for check in result.pilot.checks if result.pilot else ():
        if check.held_out:
            console.print(
                f"held-out trace {check.trace}: {check.rms / 1e5:.3f} bar rms (with the PWM ripple {check.rms_raw / 1e5:.3f} bar)"
            )
    if result.unexcited:
        console.print(f"not enough excitation for: {', '.join(result.unexcited)}", markup=False, soft_wrap=True)
    _show_held_out(result, console)
    level = result.refined.document()["noise_level"] if result.refined else 1.0
    if level > GOOD_LEVEL:
        bags = " ".join(str(recording.path) for recording in result.inputs.recordings)
        console.print(
            f"from sample to sample the model errs {level:.1f} times as much as noise explains: it lacks something",
            f"next: ./boom diagnose {bags}", sep="\n", markup=False, soft_wrap=True,
        )  # fmt: skip
    for why, keys in result.reasons().items():
        if set(keys) <= set(result.unexcited) and "not enough excitation" in why:
            continue  # said above
        console.print(f"not determined: {', '.join(keys)}: {why}", markup=False, soft_wrap=True)


def _show_held_out(result: Identification, console: Console) -> None:
    from rich.table import Table

    from boom_diagnosis.assumptions import AT_FLOOR
    from boom_input.channels import PREDICTED
    from boom_report.channels import short

    refined = result.refined.document() if result.refined else {}
    if refined.get("fitted_to"):
        console.print(f"fitted to what tells most: {', '.join(refined['fitted_to'])}", markup=False, soft_wrap=True)
    check = refined.get("held_out")
    if not check:
        return
    title = (
        "Free runs over the end of each recording, which the search has not used: rms error / standard deviation [%]"
    )
    table = Table(title=title, title_justify="left")
    table.add_column("recording")
    for sensor in PREDICTED:
        table.add_column(f"{short(sensor)} before", justify="right")
        table.add_column("after", justify="right")
    for row in check:
        errors = [row[side].get(sensor.name) for sensor in PREDICTED for side in ("before", "after")]
        cells = ["\N{EN DASH}" if error is None else f"{100 * error:.2f}" for error in errors]
        table.add_row(row["bag"], *cells)
    console.print(table)
    factor = _further_off(check)
    if factor > AT_FLOOR:
        worse = f"err {factor:.1f} times as much as before" if math.isfinite(factor) else "do not end any more"
        console.print(
            f"note: with these numbers free runs over data not used {worse}. The recordings do not tell them, as where the boom "
            "swings by itself or physics is missing: keep the file as it was, and see ./boom diagnose",
            markup=False, soft_wrap=True,
        )  # fmt: skip


def _further_off(check: Sequence[Mapping[str, Any]]) -> float:
    """Factor by which held-out free runs err more after the fit than before, the geometric mean of all channels.

    Infinite where one that ran to its end before does not any more.
    """
    pairs = [
        (b, row["after"].get(name)) for row in check for name, b in row["before"].items() if b and math.isfinite(b)
    ]
    if any(after is None or not math.isfinite(after) for _, after in pairs):
        return math.inf
    ratios = [math.log(after / before) for before, after in pairs if after]
    return math.exp(math.fsum(ratios) / len(ratios)) if ratios else 1.0


def _words(args: argparse.Namespace) -> list[str]:
    """The command line, rebuilt from the parsed arguments."""
    names = ("machine", "output", "json", "report", "hose-burst-valve-curve", "smoothing", "parameters")
    words = [*args.bags, *arguments.option_words(args, *names), *arguments.configuration_words(args)]
    return words + (["--stationary-only"] if args.stationary_only else [])


def _refiner(names: list[str] | None, machine: Machine) -> Refiner:
    from boom_checks.doubts import checks
    from boom_diagnosis.tolerance_fit import fit_tolerances
    from boom_estimation.unknown import machine_unknown
    from boom_identification.refine import Refinement, refine

    for name in names or ():
        machine_unknown(machine, name)  # a wrong name is told before anything takes time

    def refiner(recordings: Sequence[Recording], machine: Machine, say: Callable[[str], None]) -> Refinement:
        near = refine(recordings, machine, say, unknowns=names)
        if near.explains or names or not near.held_out:
            return near
        doubts = [f"{r.name}, {c.topic}: {c.sentence}" for r in recordings for c in checks(r, machine) if c.spoils]
        if doubts:  # numbers that make up for a wrong sign are no numbers of the machine
            missing = [replace(n, why=f"repair the recording first: {doubts[0]}") for n in near.not_determined]
            return replace(near, not_determined=tuple(missing))
        far = fit_tolerances(recordings, machine, say)
        return far if far.errs < near.errs else near

    return refiner
