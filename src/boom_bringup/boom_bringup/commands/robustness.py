"""Run the closed loop with the full model under the configurations C0 to C4 (chapter 6.4) and compare with Table 6.3 of the thesis.

Nine recorded angles are the reference trajectories, three in each of three poses. The plant is the full model, 10 ms, with the
noisy sampled sensors of ch. 6.4; the load is attached from the first instant, and the supply is unlimited, as in the thesis, unless
--supply limited is given. Errors are those of the piston, in mm. A run that diverges is counted, not averaged.

  ./boom robustness                                   all modes, C0 to C4
  ./boom robustness --modes improved --repeat 5       with 90 % intervals over the seeds of the noise
  ./boom robustness --modes improved --monte-carlo 500
  ./boom robustness --requirements                    dead time, bending and every effect of the catalogue: asked and reached
  ./boom robustness --stability-map                   where the modes are stable: dead time, stiffness, load
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

from boom_bringup import arguments
from boom_bringup.cli import UsageError
from boom_bringup.outputs import PAGE, checked, checked_json, default_report, write, write_json
from boom_bringup.showing import progress
from boom_controller import laws

if TYPE_CHECKING:
    from boom_trials.robustness.plants import PlantCase
    from boom_trials.robustness.study import Result, StudyRun

HELP = "run all control laws on varied plants: Table 6.3 of the thesis"

PICTURED = "explained/payload_change_b"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument(
        "--modes",
        nargs="+",
        choices=tuple(laws.described()),
        default=list(laws.described()),
        metavar="MODE",
        help=f"control modes: {', '.join(laws.described())} (default: all)",
    )
    parser.add_argument(
        "--bags", default="bags", metavar="FOLDER", help="folder of the recorded trajectories (default: bags)"
    )
    parser.add_argument(
        "--machine", default="tz17", metavar="FILE", help="machine file, or the name of a shipped one (default: tz17)"
    )
    parser.add_argument("--seed", type=_seed, default=0, metavar="N", help="seed of the sensors' noise (default: 0)")
    parser.add_argument(
        "--repeat", type=_count, default=1, metavar="N", help="repeat with N seeds and give 90 %% intervals"
    )
    parser.add_argument(
        "--supply",
        choices=("unlimited", "limited"),
        default="unlimited",
        help="limited: 250 bar and 84 l/min (default: unlimited)",
    )
    parser.add_argument(
        "--off-nominal",
        action="store_true",
        help="also run C0 with dead zone, spring, areas, pilot lag 5 %% off, one at a time",
    )
    parser.add_argument(
        "--monte-carlo", type=_count, default=0, metavar="N",
        help="also run N plants drawn from all of Table 6.1 with dead zone, spring, areas and pilot lag within 5 %%, and N "
        "with the latter only; one trajectory each, in turn",
    )  # fmt: skip
    parser.add_argument(
        "--requirements",
        action="store_true",
        help="also run improved and simple on plants with dead time, bending and each effect of the catalogue, told to the law "
        "or not, with loads under the default supervision, on recorded and fresh trajectories, and print what is asked and what "
        "is reached (some minutes)",
    )
    parser.add_argument(
        "--scattered", type=_count, default=20, metavar="N", help="plants of its last rows (default: 20)"
    )
    parser.add_argument(
        "--stability-map",
        action="store_true",
        help="also compute the map of dead time, oil stiffness and load (about a minute)",
    )
    parser.add_argument("--workers", type=_count, default=None, metavar="N", help="processes (default: one per core)")
    parser.add_argument("--json", metavar="F", help="write the numbers as a JSON document to F")
    report = parser.add_mutually_exclusive_group()
    report.add_argument("--report", metavar="F.html", help="path of the report (default: output/robustness.html)")
    report.add_argument("--no-report", action="store_true", help="write no report")


def run(args: argparse.Namespace) -> int:
    """Run everything requested; returns 0."""
    json_path = checked_json(args.json, "modes", "trajectories")
    report = None if args.no_report else checked(args.report, "--report", PAGE) or default_report("robustness")
    modes = list(dict.fromkeys(args.modes))

    from boom_report.console import console_for
    from boom_trials.robustness.document import document
    from boom_trials.robustness.plants import CONFIGURATIONS, TRAJECTORIES, monte_carlo, off_nominal
    from boom_trials.robustness.requirements import MODES, requirement_document, requirement_jobs, rows
    from boom_trials.robustness.stability import stability_jobs
    from boom_trials.robustness.study import carry_out
    from boom_trials.robustness.tables import print_document

    bags = [bag for group in TRAJECTORIES.values() for bag in group]
    missing = [bag for bag in bags if not (Path(args.bags) / bag).exists()]
    if missing:
        raise UsageError(
            f"--bags {args.bags}: there is no {missing[0]}: run in the folder of the repository, or give the folder of its bags"
        )
    _check_poses(args, [group[0] for group in TRAJECTORIES.values()])
    seeds = range(args.seed, args.seed + args.repeat)
    parts: dict[str, list[StudyRun]] = {
        "configurations": [
            _job(args, mode, bag, case, seed, keep=report is not None and bag == PICTURED and seed == args.seed)
            for mode in modes for case in CONFIGURATIONS.values() for seed in seeds for bag in bags
        ]
    }  # fmt: skip
    if args.off_nominal:
        parts["off_nominal"] = [
            _job(args, mode, bag, case, args.seed) for mode in modes for case in off_nominal() for bag in bags
        ]
    if args.monte_carlo:
        for name, loaded in (("monte_carlo", True), ("monte_carlo_unloaded", False)):
            cases = monte_carlo(args.monte_carlo, args.seed, loaded=loaded)
            parts[name] = [
                _job(args, mode, bags[k % len(bags)], case, args.seed + k) for mode in modes for k, case in enumerate(cases)
            ]  # fmt: skip
    if args.stability_map:
        parts["stability_map"] = stability_jobs(modes, args.bags, args.machine)
    asked = rows(args.scattered, args.seed, args.machine) if args.requirements else []
    judged = [mode for mode in MODES if mode in modes]
    parts["requirements"] = requirement_jobs(asked, judged, args.bags, args.machine, args.seed)
    results: dict[str, list[Result]] = {}
    with progress(sum(len(jobs) for jobs in parts.values())) as step:
        for name, jobs in ((name, jobs) for name, jobs in parts.items() if jobs):
            step(f"{name.replace('_', ' ')}: {len(jobs)} runs", 0)
            results[name] = carry_out(jobs, args.workers, lambda: step("", 1))
    numbers = document(results, modes, bags, args.seed)
    numbers |= requirement_document(asked, judged, results.get("requirements", ()))
    console = console_for()
    print_document(numbers, console, limited=args.supply == "limited")
    if json_path:
        write_json(json_path, numbers)
    if report:
        from boom_trials.robustness.report import write_report

        command = arguments.command_line("robustness", *_words(args))
        write(report, lambda: write_report(report, numbers, results, command=command, limited=args.supply == "limited"))
        console.print(f"report: {report}", markup=False, soft_wrap=True)
    return 0


def _check_poses(args: argparse.Namespace, bags: list[str]) -> None:
    """Raises UsageError where the machine cannot take a pose of the recordings that it is to follow."""
    from boom_model.errors import MachineError
    from boom_model.machine_file import load_machine
    from boom_recording.loading import load

    machine = load_machine(args.machine)
    for bag in bags:
        c = load(Path(args.bags) / bag).configuration
        try:
            machine.pose(c.outer_boom_angle, c.telescope_length, c.load_mass)
        except MachineError as error:
            raise UsageError(
                f"the trajectories are recordings, and machine {machine.name} cannot take the pose of {bag}: {error}. Give --bags "
                "with recordings of this machine under these names, or look at one motion: ./boom simulate BAG --reference"
            ) from None


def _job(args: argparse.Namespace, mode: str, bag: str, case: PlantCase, seed: int, keep: bool = False) -> StudyRun:
    from boom_trials.robustness.study import StudyRun

    return StudyRun(mode, bag, case, seed, args.bags, args.machine, limited=args.supply == "limited", keep=keep)


def _count(text: str) -> int:
    return _whole(text, 1, 100_000)


def _seed(text: str) -> int:
    return _whole(text, 0, 2**31 - 1)


def _whole(text: str, low: int, high: int) -> int:
    try:
        number = int(text)
    except ValueError:
        number = low - 1
    if not low <= number <= high:
        raise argparse.ArgumentTypeError(f"{text!r}: give a whole number of {low} to {high}")
    return number


def _words(args: argparse.Namespace) -> list[str]:
    """The command line, rebuilt from the parsed arguments."""
    words: list[Any] = ["--modes", *args.modes, "--seed", args.seed, "--repeat", args.repeat, "--supply", args.supply]
    words += ["--off-nominal"] if args.off_nominal else []
    words += ["--monte-carlo", args.monte_carlo] if args.monte_carlo else []
    words += ["--requirements", "--scattered", args.scattered] if args.requirements else []
    words += ["--stability-map"] if args.stability_map else []
    return [str(word) for word in words]
