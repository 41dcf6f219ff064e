"""Run a model on given currents, or let the controller follow a given reference, and write a bag like the machine's.

INPUT is a bag, which gives currents, pose, load and initial state at rest, or a .csv file with the header
time_s,retract_a,extend_a (separated by commas, semicolons or tabs), for which pose, load and initial angle are options.

  ./boom simulate bags/healthy/extended --output output/extended
  ./boom simulate bags/healthy/extended --output output/leak --effect piston_leakage.c=1e-12
  ./boom simulate bags/healthy/extended --output output/work --work-cycle      (the other joints move, too)
  ./boom simulate steps.csv --angle 0.4 --load 300 --output output/steps
  ./boom simulate bags/healthy/extended --reference --mode thesis --output output/followed
  ./boom simulate --campaign pilot --output output/pilot      (ch. 4.1: eleven oscilloscope bags in that folder)
  ./boom simulate --campaign cylinder --output output/crane   (ch. 4.2: twelve recordings in that folder)

A run that leaves the range of the model keeps its data up to that point, says where it ended, and exits with status 2. Every
command accepts the bag as a recording, e.g. ./boom validate output/extended.
"""

from __future__ import annotations

import argparse
import math
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from boom_bringup import arguments
from boom_bringup.given import load_given
from boom_bringup.outputs import held, new_bag, write_recording
from boom_controller import laws

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from boom_model.machine import Machine
    from boom_recording.joint_motion import JointMotion
    from boom_recording.recording import Configuration, Recording
    from boom_sim.simulated_crane import CraneStart, EndedEarlyError

    Array = NDArray[np.float64]

HELP = "run a model on given currents or a given reference and write a bag like the machine's"


class SimulateError(ValueError):
    """Options that contradict each other."""

    exit_status = 2


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("input", metavar="INPUT", nargs="?", help="bag (folder or .mcap) or .csv with the currents")
    parser.add_argument(
        "--campaign",
        choices=("pilot", "cylinder"),
        help="instead of INPUT: simulate a whole measurement campaign of ch. 4 as bags in the folder --output",
    )
    parser.add_argument("--output", metavar="BAG", required=True, help="folder of the new bag; must not exist")
    parser.add_argument(
        "--machine", metavar="FILE", help="machine file or shipped name (default: the input's, else tz17)"
    )
    parser.add_argument("--model", choices=("full", "reduced"), default="full", help="(5.39) or (5.47); default: full")
    parser.add_argument(
        "--effect", metavar="ID.NAME=VALUE", action="append", default=[],
        help="physics in addition to the machine file, SI, e.g. hose_burst_valve_lag.tau=0.09; repeatable",
    )  # fmt: skip
    parser.add_argument(
        "--reference", action="store_true",
        help="INPUT is a bag whose reference, or else angle, the controller follows in closed loop",
    )  # fmt: skip
    parser.add_argument(
        "--mode", choices=tuple(laws.described()), default=laws.DEFAULT,
        help=f"control law of --reference (default: {laws.DEFAULT})",
    )  # fmt: skip
    parser.add_argument(
        "--tolerance", type=arguments.tolerance, default=1e-9, metavar="T",
        help="relative tolerance of the integration with given currents (default: 1e-9, as in an FMU)",
    )  # fmt: skip
    parser.add_argument(
        "--work-cycle", nargs="?", const="outer_boom,telescope,slewing", metavar="JOINTS",
        help="a drawn work cycle moves these of outer_boom,telescope,slewing (default: all three); joints that move in "
        "INPUT, a bag, move as they did there without this option",
    )  # fmt: skip
    parser.add_argument(
        "--seed", type=arguments.seed, default=0, help="seed of the sensor noise and of the work cycle (default: 0)"
    )
    parser.add_argument(
        "--sensors", choices=("thesis", "ideal"), default="thesis", help="noise of ch. 6.4 or none (default: thesis)"
    )
    parser.add_argument(
        "--duration", type=arguments.duration, metavar="S", help="duration [s] (default: up to the last current)"
    )
    parser.add_argument(
        "--angle",
        type=arguments.finite,
        metavar="RAD",
        help="initial boom angle [rad] (default: the input's, csv: 0.3)",
    )
    parser.add_argument(
        "--q3", "--outer-boom-angle", type=arguments.finite, metavar="RAD",
        help="q3 [rad] (default: the input's, csv: 0.28, or the first pose of the file)",
    )  # fmt: skip
    parser.add_argument(
        "--q4", "--telescope-length", type=arguments.finite, metavar="M",
        help="q4 [m] (default: the input's, csv: 2.2, or the first pose of the file)",
    )  # fmt: skip
    parser.add_argument(
        "--load", type=arguments.finite, metavar="KG", help="load at the tip [kg] (default: the input's, csv: 0)"
    )
    arguments.add_joint(parser)
    arguments.add_other_joints(parser)


def run(args: argparse.Namespace) -> int:
    """Simulate and write; returns 0."""
    output = Path(args.output)
    if args.campaign:
        return _campaign(args, output)
    if args.input is None:
        raise SimulateError(
            "nothing to simulate: give INPUT, a bag or .csv with currents, or --campaign pilot|cylinder"
        )
    given = _given(args, Path(args.input))
    machine = given.machine.with_effects({**given.machine.effects, **parse_effects(args.effect)})

    from boom_sim.simulated_crane import EndedEarlyError

    ended = None
    with new_bag(output) as made:
        begin = time.perf_counter()
        try:
            result = _simulated(args, given, machine, output.name)
        except EndedEarlyError as error:
            result, ended = error.recording, error
        spent = time.perf_counter() - begin
        write_recording(made, result)
    following = arguments.command_line("validate", str(output), *arguments.option_words(args, "machine"))
    _show(result, machine, spent, output, following)
    loaded = given.recording.name if given.recording and not args.reference else ""
    if loaded in machine.payloads and loaded != output.name:
        print(
            f"its loads are payload.recordings.{loaded} of the machine file: to validate it, give it the name {loaded}"
        )
    if args.reference:
        from boom_bringup.commands._simulate_reference import tracking_line

        print(tracking_line(result, machine))
    if ended is not None:
        raise SimulateError(_ended(ended, output))
    return 0


@dataclass
class _Given:
    """What INPUT holds, with what the options change of it; the machine as told, without ``--effect``."""

    machine: Machine
    configuration: Configuration
    start: CraneStart
    stamps: Array | None = None
    currents: Array | None = None
    recording: Recording | None = None


def _given(args: argparse.Namespace, source: Path) -> _Given:
    from boom_bringup import replica
    from boom_sim.simulated_crane import CraneStart

    given = _from_reference(args, source) if args.reference else _with_currents(args, source)
    if args.angle is not None:
        given.start = CraneStart(args.angle)  # the measured pressures belong to the measured angle
    pose = {"outer_boom_angle": args.q3, "telescope_length": args.q4, "load_mass": args.load}
    changed = {key: value for key, value in pose.items() if value is not None}
    if changed:
        given.configuration = replace(given.configuration, **changed)
        given.start = CraneStart(given.start.angle)
    replica.check_pose(args.input, given.machine, given.configuration)
    return given


def _from_reference(args: argparse.Namespace, source: Path) -> _Given:
    from boom_bringup import replica
    from boom_bringup.commands._simulate_reference import load_reference
    from boom_sim.simulated_crane import CraneStart

    if args.work_cycle is not None:
        raise SimulateError(
            "--work-cycle goes with given currents: leave out --reference, in which the joints are locked"
        )
    if source.suffix == ".csv" or args.model != "full":
        raise SimulateError("--reference needs a bag and runs the full model: leave out --model, or give a bag")
    recording = load_reference(source, args)
    machine, _ = replica.machine_of({args.input: recording}, args.machine)
    return _Given(machine, recording.configuration, CraneStart(0.0), recording=recording)


def _with_currents(args: argparse.Namespace, source: Path) -> _Given:
    from boom_bringup import replica
    from boom_model.machine_file import load_machine
    from boom_sim import csv_currents
    from boom_sim.simulated_crane import CraneStart

    if source.suffix == ".csv":
        stamps, currents = csv_currents.read(source)
        machine = load_machine("tz17" if args.machine is None else args.machine)
        return _Given(machine, replica.pose_of(machine), CraneStart(0.3), stamps, currents)
    recording, stamps, currents = _from_bag(source, args)
    machine, _ = replica.machine_of({args.input: recording}, args.machine)
    start = CraneStart(0.0)
    if args.angle is None:
        rest = replica.rest_of(recording, args.input, "give --angle")
        start = CraneStart(rest["angle"], rest["hose_pressure"], rest["rod_pressure"])
    if args.duration is None:
        args.duration = recording.duration
    return _Given(machine, recording.configuration, start, stamps, currents, recording)


def _simulated(args: argparse.Namespace, given: _Given, machine: Machine, name: str) -> Recording:
    from boom_bringup.commands._simulate_reference import Law, simulate_reference
    from boom_model.sensors import IDEAL
    from boom_sim.offline import simulate

    by = f"closed loop, {args.mode}" if args.reference else f"{args.model} model"
    note = f"simulated: {by}, sensors {args.sensors}, seed {args.seed}"
    configuration = replace(given.configuration, machine=machine.name, note=note)
    noise = machine.sensor_noise() if args.sensors == "thesis" else IDEAL
    if args.reference:
        assert given.recording is not None
        return simulate_reference(
            given.recording, machine, configuration, Law(args.mode, given.machine), angle=args.angle, noise=noise,
            seed=args.seed, duration=args.duration, name=name,
        )  # fmt: skip
    assert given.stamps is not None and given.currents is not None
    motion = _motion(args, given, machine, configuration)
    loads_of = given.recording.name if given.recording else ""
    return simulate(
        machine, configuration, given.start, given.stamps, given.currents,
        noise=noise, seed=args.seed, kind=args.model, duration=args.duration, name=name, motion=motion,
        pressures=_pressures(given.recording), loads_of=loads_of, tolerance=args.tolerance,
    )  # fmt: skip


def _pressures(recording: Recording | None) -> dict[str, tuple[Array, Array]]:
    """Supply and tank pressure of a recording that has them, which drive the model as they do in validate."""
    from boom_estimation.currents import driving

    known = () if recording is None else driving(recording)
    return {name: (signal.time[signal.valid], signal.values[signal.valid]) for name, signal in known}


def _motion(
    args: argparse.Namespace, given: _Given, machine: Machine, configuration: Configuration
) -> JointMotion | None:
    """How the other joints move: as drawn, or as in the recording; None where they are locked."""
    if args.work_cycle is None:
        from boom_recording.joint_motion import joint_motion

        return None if given.recording is None else joint_motion(given.recording)
    from boom_input.channels import JOINT_NAMES
    from boom_sim.work_cycle import work_cycle

    joints = tuple(args.work_cycle.split(","))
    for name in joints:
        if name not in JOINT_NAMES:
            raise SimulateError(f"--work-cycle {args.work_cycle}: {name!r} is none of {', '.join(JOINT_NAMES)}")
    assert given.stamps is not None
    duration = args.duration or float(given.stamps[-1]) + 1.0
    return work_cycle(machine.document["rigid_body"], configuration, duration, args.seed, joints)


def _ended(error: EndedEarlyError, output: Path) -> str:
    return f"{error}: the simulation ended there; {output} holds the {error.recording.duration:.2f} s before it"


def _campaign(args: argparse.Namespace, output: Path) -> int:
    """Write a campaign of chapter 4 into the folder, one bag after the other."""
    given = {"INPUT": args.input, "--angle": args.angle, "--q3": args.q3,
             "--q4": args.q4, "--load": args.load}  # fmt: skip
    given["--duration"] = args.duration if args.campaign == "pilot" else None
    given["--model"] = args.model if args.model != "full" else None
    unfit = [name for name, value in given.items() if value is not None]
    if unfit:
        raise SimulateError(f"--campaign {args.campaign} has its own currents and poses: leave out {', '.join(unfit)}")
    from boom_model.machine_file import load_machine

    machine = load_machine(args.machine or "tz17")
    machine = machine.with_effects({**machine.effects, **parse_effects(args.effect)})
    if output.exists():
        raise SimulateError(f"{output} exists already: give another --output, nothing is overwritten")
    from boom_sim.simulated_crane import EndedEarlyError

    count = 0
    with held(output):
        try:
            for name, write in _runs(args, machine):
                print(f"{count + 1:2d} {output / name}", file=sys.stderr, flush=True)
                with new_bag(output / name) as made:
                    write(made)
                count += 1
        except EndedEarlyError as error:
            with new_bag(output / error.recording.name) as made:
                write_recording(made, error.recording)
            raise SimulateError(
                f"{_ended(error, output / error.recording.name)}, whole bags beside it: {count}"
            ) from None
        except KeyboardInterrupt:
            if count:
                print(f"boom: {output} has whole bags, {count}: remove it to begin again", file=sys.stderr, flush=True)
            raise
    print(f"{count} bags in {output}; identify the machine from them: ./boom identify {output}/*")
    return 0


def _runs(args: argparse.Namespace, machine: Machine) -> Iterator[tuple[str, Callable[[Path], None]]]:
    """Name and writer of each bag of a campaign."""
    from functools import partial

    from boom_sim import campaigns

    ideal = args.sensors == "ideal"
    if args.campaign == "pilot":
        from boom_recording.oscilloscope import write_trace
        from boom_sim.pilot_bench import SILENT, BenchNoise

        if not machine.structure.has("pilot_valves"):
            raise SimulateError(f"machine {machine.name} has no pilot valves: there is nothing to put on the bench")
        for trace in campaigns.pilot_campaign(machine, seed=args.seed, noise=SILENT if ideal else BenchNoise()):
            yield trace.name, partial(write_trace, trace=trace)
        return
    from boom_model.sensors import IDEAL

    duration = args.duration or campaigns.CYLINDER_DURATION
    noise = IDEAL if ideal else machine.sensor_noise()
    for recording in campaigns.cylinder_campaign(machine, seed=args.seed, duration=duration, noise=noise):
        yield recording.name, partial(write_recording, recording=recording)


def _from_bag(path: Path, args: argparse.Namespace) -> tuple[Recording, Array, Array]:
    from boom_estimation.currents import held_currents

    recording = load_given(path, args)
    held = held_currents(recording)
    stretches = held.stretches(recording.duration)
    if len(stretches) > 1:
        gap = f"{stretches[0][1]:.1f} s to {stretches[1][0]:.1f} s"
        print(f"note: {path}: no currents from {gap}; the last ones before a gap are held during it")
    return recording, held.time, held.values


def parse_effects(texts: list[str]) -> dict[str, dict[str, float]]:
    """``ID.NAME=VALUE`` texts as effect -> parameter -> value.

    Raises:
        SimulateError: a text of another form, or a number given twice.
    """
    result: dict[str, dict[str, float]] = {}
    for text in texts:
        name, _, value = text.partition("=")
        effect, _, parameter = name.partition(".")
        try:
            number = float(value)
        except ValueError:
            number = math.nan
        if not effect or not parameter or not math.isfinite(number):
            raise SimulateError(f"--effect {text}: expected ID.NAME=NUMBER, e.g. piston_leakage.c=1e-12")
        own = result.setdefault(effect.strip(), {})
        if parameter.strip() in own:
            raise SimulateError(f"--effect {text}: {name} was given before, as {own[parameter.strip()]:g}")
        own[parameter.strip()] = number
    return result


def _show(result: Recording, machine: Machine, spent: float, output: Path, next_line: str) -> None:
    from rich.table import Table

    from boom_report.console import console_for

    c = result.configuration
    table = Table(
        title=f"{result.name}: {machine.name}, q3 {c.outer_boom_angle:g} rad, q4 {c.telescope_length:g} m, load {c.load_mass:g} kg"
    )
    for heading in ("channel", "unit", "first", "least", "most"):
        table.add_column(heading, justify="left" if heading in ("channel", "unit") else "right")
    for signal in result.signals.values():
        bar = signal.unit == "Pa"
        values = signal.values[signal.valid] / (1e5 if bar else 1.0)
        digits = 2 if bar else 4
        numbers = [f"{v:.{digits}f}" for v in (values[0], values.min(), values.max())]
        table.add_row(signal.name, "bar" if bar else signal.unit, *numbers)
    console = console_for()
    console.print(table)
    if machine.effects:
        text = "; ".join(f"{k} " + ", ".join(f"{n} = {v:g}" for n, v in p.items()) for k, p in machine.effects.items())
        console.print(f"with {text}")
    console.print(f"{result.duration:.1f} s simulated in {spent * 1e3:.0f} ms; the bag is {output}", soft_wrap=True)
    console.print(f"compare it with the model: {next_line}", soft_wrap=True)
