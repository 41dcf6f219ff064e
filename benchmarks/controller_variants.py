"""Which change makes the printed control law stable: every combination of three, on all trajectories, C0 to C4.

    ./boom python benchmarks/controller_variants.py

friction  tau~_f of (6.13a) at the wanted rate instead of the measured one
pilot     currents that make up for the lag of the pilot stage, instead of (6.25), (6.26)
spool     pilot pressures that make up for the spool's friction too, instead of (6.24); only together with the former

Per configuration: diverged runs of nine, mean MAE / MAXE [mm] of the others. Force: rms of f_p - f_p^f above 0.8 Hz at C0 [kN],
folded / extended / log, beside that of mode improved. The least combination without a diverged run is mode baseline.
"""

from __future__ import annotations

import argparse
import itertools
import json
import multiprocessing
import os
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any

from boom_controller.laws import cascade
from boom_trials.robustness.plants import CONFIGURATIONS, TRAJECTORIES
from boom_trials.robustness.study import Result, StudyRun, carry_out, carry_out_one, summary, with_poses

BAGS = [bag for group in TRAJECTORIES.values() for bag in group]
FOLDER = str(Path(__file__).parents[1] / "bags")
TERMS = ("friction", "pilot", "spool")


def runs(variant: cascade.Variant) -> dict[str, list[Result]]:
    """Configuration -> results of all trajectories; for a process of its own, in which the variant takes the baseline's place."""
    cascade.VARIANTS["baseline"] = variant
    return {
        name: [carry_out_one(StudyRun("baseline", bag, case, folder=FOLDER)) for bag in BAGS]
        for name, case in CONFIGURATIONS.items()
    }


def oscillation(results: list[Result]) -> dict[str, float | None]:
    """Pose -> mean rms [N] of the force."""
    return {pose: numbers["force_oscillation_n"] for pose, numbers in with_poses(results)["poses"].items()}


def text(values: dict[str, float | None]) -> str:
    """In kN."""
    return " / ".join("-" if v is None else f"{v / 1e3:.1f}" for v in values.values())


def told(switches: tuple[bool, ...], results: dict[str, list[Result]]) -> dict[str, Any]:
    """Prints a line of the table; the same as numbers."""
    name = " + ".join(term for term, on in zip(TERMS, switches, strict=True) if on) or "as printed"
    means = {case: summary(some) for case, some in results.items()}
    force = oscillation(results["C0"])
    cells = (
        f"{case} {m['diverged']} diverged"
        + ("" if m["mae_mm"] is None else f", {m['mae_mm']:.1f} / {m['maxe_mm']:.0f}")
        for case, m in means.items()
    )
    print(f"{name:24s} force {text(force)} kN; {'; '.join(cells)}", flush=True)
    return {name: {"force_oscillation_n": force, "configurations": means}}


def main() -> None:
    """Runs, prints."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--json", metavar="F", help="write the numbers to this file")
    args = parser.parse_args()
    improved = oscillation(carry_out([StudyRun("improved", bag, CONFIGURATIONS["C0"], folder=FOLDER) for bag in BAGS]))
    found: dict[str, Any] = {"improved": {"force_oscillation_n": improved}}
    print(f"{'improved':24s} force {text(improved)} kN", flush=True)
    chosen = [s for s in itertools.product((False, True), repeat=3) if s[1] or not s[2]]
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(os.cpu_count(), mp_context=context, max_tasks_per_child=1) as pool:
        every = pool.map(runs, [cascade.Variant(*switches) for switches in chosen])
        for switches, results in zip(chosen, every, strict=True):
            found.update(told(switches, results))
    if args.json:
        Path(args.json).write_text(json.dumps(found, indent=2) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
