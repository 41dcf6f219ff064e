"""How fast the model is integrated: this project's integrator beside others, on the same equations and recorded inputs.

    python benchmarks/integration.py [--recording BAG] [--json PATH]

Prints a table (ms for the whole recording, times real time, ratio to ours) at a relative error of 1e-4 and of 1e-6,
then the cost of one 10 ms step called from Python, then parameter sets per second. Error: the largest difference to a
reference run over all states and samples, relative to the range of the state. Each route gets the loosest tolerance
that reaches the error. Times are the least of several, in processor time, so that other programs disturb them little.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
from collections.abc import Callable, Iterable
from pathlib import Path
from time import perf_counter, process_time
from typing import Any

import numpy as np
from integration_routes import PERIOD, Array, Case

from boom_model.batch import run_sets
from boom_model.errors import ModelError, SimulationError
from boom_model.machine_file import shipped_machine
from boom_model.plant import Plant
from boom_recording.errors import RecordingError
from boom_recording.loading import load

DEFAULT_RECORDING = Path(__file__).resolve().parents[1] / "bags" / "healthy" / "folded_fast"
REST = 0.95  # s, for which recordings rest at their beginning
TARGETS = (1e-4, 1e-6)
SETS, SET_SECONDS = 100, 20.0


def case_from(path: Path) -> Case:
    """Full model, start and inputs of a recording. Raises RecordingError, ModelError."""
    recording = load(path)
    table = recording.on_grid(PERIOD)
    currents = np.column_stack([_held(table.columns[name]) for name in ("retract_current", "extend_current")])
    machine = shipped_machine(recording.configuration.machine)
    setting = recording.configuration
    plant = Plant(machine, machine.pose(setting.outer_boom_angle, setting.telescope_length, setting.load_mass))
    rest = table.time < REST
    start = [float(np.nanmean(table.columns[name][rest])) for name in ("angle", "hose_pressure", "rod_pressure")]
    return Case(plant, plant.rest_state(*start), currents)


def _held(values: Array) -> Array:
    """A column without NaN: what is missing keeps the value before it."""
    last = np.maximum.accumulate(np.where(np.isnan(values), 0, np.arange(len(values))))
    return np.nan_to_num(values[last])


def error(states: Array, reference: Array) -> float:
    """Largest deviation over all states and samples, relative to the range of the state."""
    used = np.ptp(reference, axis=0) > 0
    deviation = np.abs(states - reference)[:, used] / np.ptp(reference, axis=0)[used]
    largest = float(deviation.max())
    return largest if np.isfinite(largest) else float("inf")


def shortest(function: Callable[[], object], repetitions: int, clock: Callable[[], float] = process_time) -> float:
    """Least of several timings [s] in processor time: what disturbs on a shared computer only adds."""
    best = float("inf")
    for _ in range(repetitions):
        begin = clock()
        function()
        best = min(best, clock() - begin)
    return best


def tune(run: Callable[[float], Array], reference: Array, targets: Iterable[float]) -> dict[float, tuple[float, float]]:
    """Target -> (loosest tolerance that reaches it, error there): three steps a decade, 1e-2 .. 1e-11."""
    found: dict[float, tuple[float, float]] = {}
    for exponent in range(6, 34):
        tolerance = 10.0 ** (-exponent / 3)
        try:
            achieved = error(run(tolerance), reference)
        except (SimulationError, RuntimeError):  # too coarse: left the range of the states, or gave up
            continue
        for target in targets:
            if target not in found and achieved <= target:
                found[target] = (tolerance, achieved)
        if all(target in found for target in targets):
            break
    return found


def measure(case: Case, repetitions: int, quick: bool, say: Callable[[str], None]) -> list[dict[str, Any]]:
    """One row per route: name and, per target, tolerance, error, seconds."""
    say("reference run")
    reference = case.ours(4)(1e-11)
    say(f"reference, order 4 against order 3: {error(case.ours(3)(1e-11), reference):.1e}")
    routes: list[
        tuple[str, Callable[[], Callable[[float], Array]], Callable[[], Callable[[float], Array]] | None, int]
    ] = [
        ("this project, order 3", lambda: case.ours(3), None, repetitions),
        ("this project, order 4", lambda: case.ours(4), None, repetitions),
        ("numbalsoda", case.numbalsoda, None, max(3, repetitions // 8)),
        ("CasADi CVODES", case.cvodes, None, 2),
        ("scipy LSODA, compiled right-hand side and Jacobian", case.lsoda_compiled, None, 2),
    ]
    if not quick:
        # tuned with the compiled right-hand side: the same algorithm on the same numbers, twenty times sooner
        routes.append(("scipy LSODA, Python right-hand side", case.lsoda_python, lambda: case.lsoda_compiled(False), 1))
    rows = []
    for name, make, make_tuner, count in routes:
        try:
            run = make()
        except ImportError:
            say(f"{name}: not installed, left out (benchmarks/README.md)")
            rows.append({"route": name, "results": {}, "note": "not installed"})
            continue
        say(f"{name}: tuning")
        found = tune(make_tuner() if make_tuner else run, reference, TARGETS)
        results = {}
        for target, (tolerance, achieved) in found.items():
            say(f"{name}: timing at {target:g}")
            seconds = shortest(lambda run=run, tolerance=tolerance: run(tolerance), count)
            results[f"{target:g}"] = {"tolerance": tolerance, "error": achieved, "seconds": seconds}
        rows.append({"route": name, "results": results})
    for row, order in zip(rows, (3, 4), strict=False):  # minutes later: another chance to meet a quiet moment
        run = case.ours(order)
        for result in row["results"].values():
            again = shortest(lambda run=run, result=result: run(result["tolerance"]), repetitions)
            result["seconds"] = min(result["seconds"], again)
    return rows


def single_step(case: Case, tolerance: float, repetitions: int) -> float:
    """Mean time [s] of one 10 ms step called from Python over the whole recording; the least of several means."""
    inputs = [(float(a), float(b)) for a, b in case.currents]

    def once() -> None:
        stepper = case.plant.stepper(case.start, tolerance=tolerance)
        step = stepper.step
        for retract, extend in inputs:
            step(retract, extend)

    return shortest(once, repetitions) / len(inputs)


def parameter_sets(case: Case, tolerance: float, workers: int, repetitions: int) -> tuple[float, float]:
    """Runs per second of SETS parameter sets of SET_SECONDS each: by the clock, and per processor time of ``workers`` cores."""
    rng = np.random.default_rng(0)
    sets = np.tile(case.plant.p, (SETS, 1))
    for name in ("friction.tau_C_pos", "fluid.beta", "accumulators.V_g0", "main_valve_orifices.A_sa_max"):
        sets[:, case.plant.parameter_names.index(name)] *= rng.uniform(0.9, 1.1, SETS)
    # from the first command on: the rest at the beginning costs next to nothing
    first = int(np.argmax(case.currents.max(axis=1) > 0.1))
    part = slice(first, first + int(SET_SECONDS / PERIOD))
    time, currents = case.time[part] - case.time[first], case.currents[part]

    def once() -> None:
        run_sets(case.plant, sets, time, currents, time, case.start, tolerance=tolerance, workers=workers)

    return SETS / shortest(once, repetitions, perf_counter), workers * SETS / shortest(once, repetitions)


def show(rows: list[dict[str, Any]], duration: float) -> None:
    """The table, ratios to the quicker of our two orders at the same error."""
    for target in TARGETS:
        key = f"{target:g}"
        ours = min(r["results"][key]["seconds"] for r in rows[:2] if key in r["results"])
        print(f"\nrelative error {key}, {duration:.0f} s recording, one core")
        print(f"{'route':<52} {'ms':>9} {'x real time':>12} {'ratio':>8} {'tolerance':>10} {'error':>8}")
        for row in rows:
            result = row["results"].get(key)
            if result is None:
                print(f"{row['route']:<52} {row.get('note', 'not reached'):>9}")
                continue
            s = result["seconds"]
            print(
                f"{row['route']:<52} {1e3 * s:>9.1f} {duration / s:>12.0f} {s / ours:>8.1f}"
                f" {result['tolerance']:>10.1e} {result['error']:>8.1e}"
            )


def main(argv: list[str] | None = None) -> int:
    """Runs the benchmark; exit status 2 for a wrong input."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument(
        "--recording", type=Path, default=DEFAULT_RECORDING, help="bag with the currents (default: healthy/folded_fast)"
    )
    parser.add_argument(
        "--repetitions", type=int, default=40, help="timings of which the least counts (default: %(default)s)"
    )
    parser.add_argument("--quick", action="store_true", help="without the Python right-hand side, which takes minutes")
    parser.add_argument("--json", type=Path, help="write the numbers to this file")
    options = parser.parse_args(argv)
    if options.repetitions < 1:
        parser.error("--repetitions: give 1 or more")

    def say(text: str) -> None:
        print(f"  {text} ...", file=sys.stderr, flush=True)

    try:
        case = case_from(options.recording)
    except (RecordingError, ModelError, OSError) as problem:
        print(f"integration: {problem}", file=sys.stderr)
        return 2
    duration = len(case.currents) * PERIOD
    rows = measure(case, options.repetitions, options.quick, say)
    show(rows, duration)
    best = min((r["results"]["0.0001"] for r in rows[:2]), key=lambda r: float(r["seconds"]))
    say("single steps")
    step = single_step(case, best["tolerance"], options.repetitions)
    fine_step = single_step(case, 1e-6, options.repetitions)
    say("parameter sets")
    workers = min(2, os.cpu_count() or 1)
    rate, undisturbed = parameter_sets(case, best["tolerance"], workers, max(3, options.repetitions // 4))
    print(f"\none 10 ms step called from Python, mean: {1e6 * step:.1f} us (tolerance {best['tolerance']:.1e}), "
          f"{1e6 * fine_step:.1f} us (tolerance 1e-6)")  # fmt: skip
    print(f"{SETS} parameter sets of {SET_SECONDS:g} s on {workers} cores at 1e-4: {rate:.0f} runs/s by the clock, "
          f"{undisturbed:.0f} runs/s per processor time")  # fmt: skip
    load = os.getloadavg()[0]
    print(
        f"load average of the computer at the end: {load:.1f} on {os.cpu_count()} cores; all other times are processor time"
    )
    if options.json:
        document = {
            "recording": options.recording.name, "duration_s": duration, "routes": rows, "step_s": step,
            "step_fine_s": fine_step, "runs_per_s": rate, "runs_per_processor_s": undisturbed, "workers": workers,
        }  # fmt: skip
        options.json.write_text(json.dumps(document, indent=1) + "\n", encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
