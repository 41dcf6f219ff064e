"""Does the integrator survive whatever machine it is given? Full and reduced model of randomly drawn machines.

    python benchmarks/integration_robustness.py [--draws 300] [--seed 0] [--json PATH]

Every draw varies Table 6.1 (pre-charge, bulk modulus, friction, load), switches on one or two effects of the catalogue
within their ranges, takes a pose, and runs the currents of one of the four healthy recordings freely from a rest in
equilibrium. A run counts as physical when it ends with pressures, stroke and volumes within their range, or with an
error that names time and state (a heavy load makes the cylinder cavitate, or the boom drifts to its
end of stroke). Everything else is a failure: exit status 1.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections import Counter
from pathlib import Path
from time import perf_counter

import numpy as np
from integration import _held

from boom_model.errors import ModelError, SimulationError
from boom_model.machine_file import load_machine
from boom_model.plant import Plant
from boom_model.variation import draw
from boom_recording.errors import RecordingError
from boom_recording.loading import load

BAGS = Path(__file__).resolve().parents[1] / "bags" / "healthy"
PERIOD = 0.01


def main(argv: list[str] | None = None) -> int:
    """Runs all draws and prints the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--draws", type=int, default=300, help="how many machines (default: %(default)s)")
    parser.add_argument("--seed", type=int, default=0, help="of the draws (default: %(default)s)")
    parser.add_argument("--tolerance", type=float, default=1e-5, help="of the integrator (default: %(default)s)")
    parser.add_argument("--json", type=Path, help="write one entry per run to this file")
    options = parser.parse_args(argv)
    if options.draws < 1 or not 1e-12 < options.tolerance < 1e-1:
        parser.error("--draws must be 1 or more, --tolerance within 1e-12 .. 1e-1")
    try:
        nominal = load_machine("tz17")
        inputs = {path.name: _currents(path) for path in sorted(BAGS.iterdir()) if path.is_dir()}
    except (RecordingError, ModelError, OSError) as problem:
        print(f"integration_robustness: {problem}", file=sys.stderr)
        return 2
    rng = np.random.default_rng(options.seed)
    names = sorted(inputs)
    entries, failures = [], 0
    pressures: dict[str, list[float]] = {}
    seconds = simulated = 0.0
    for k in range(options.draws):
        variation = draw(nominal, rng)
        name = names[k % len(names)]
        currents = inputs[name]
        time = np.arange(len(currents)) * PERIOD
        angle = float(rng.uniform(0.1, 0.8))
        for kind in ("full", "reduced"):
            plant = Plant(variation.machine, variation.pose, "full" if kind == "full" else "reduced")
            entry = {"draw": k, "model": kind, "recording": name, **variation.factors, "effects": variation.effects}
            begin = perf_counter()
            try:
                run = plant.run(time, currents, time, plant.equilibrium(angle), tolerance=options.tolerance)
            except SimulationError as end:
                entry |= {"ended_s": end.time, "state": end.state, "message": str(end)}
                failed = end.state is None
                simulated += end.time
            else:
                failed = not np.isfinite(run.states).all()
                entry |= {"ended_s": float(time[-1]), "state": "", "steps": run.steps}
                simulated += float(time[-1])
                for state in plant.state_names:
                    pressures.setdefault(state, []).extend((run.state(state).min(), run.state(state).max()))
            seconds += perf_counter() - begin
            entry["failed"] = failed
            failures += failed
            entries.append(entry)
        if (k + 1) % 25 == 0:
            print(f"  {k + 1} of {options.draws} machines ...", file=sys.stderr, flush=True)
    _show(entries, pressures, failures, seconds, simulated)
    if options.json:
        options.json.write_text(json.dumps({"seed": options.seed, "runs": entries}, indent=1) + "\n", encoding="utf-8")
    return 1 if failures else 0


def _currents(path: Path) -> np.ndarray:
    table = load(path).on_grid(PERIOD)
    return np.column_stack([_held(table.columns[name]) for name in ("retract_current", "extend_current")])


def _show(
    entries: list[dict[str, object]], ranges: dict[str, list[float]], failures: int, seconds: float, simulated: float
) -> None:
    ends = Counter((str(e["model"]), str(e["state"]) or "ran to the end") for e in entries if not e["failed"])
    print(f"\n{'model':<10} {'end of the run':<40} {'runs':>6}")
    for (model, state), count in sorted(ends.items(), key=lambda item: (item[0][0], -item[1])):
        text = state if state == "ran to the end" else f"ended with an error: {state} left its range"
        print(f"{model:<10} {text:<40} {count:>6}")
    print(f"failures (step size vanished, or a number that is not finite): {failures} of {len(entries)} runs")
    print(f"\n{'state, runs to the end':<30} {'smallest':>12} {'largest':>12}")
    for name, values in ranges.items():
        unit, factor = ("bar", 1e-5) if "pressure" in name else ("SI", 1.0)
        print(f"{name + ' [' + unit + ']':<30} {factor * min(values):>12.4g} {factor * max(values):>12.4g}")
    print(f"\n{simulated:.0f} s simulated in {seconds:.1f} s: {simulated / seconds:.0f} times real time")
    for entry in entries:
        if entry["failed"]:
            print(
                f"FAILED draw {entry['draw']} ({entry['model']}, {entry['recording']}): "
                f"{entry.get('message', '')} {entry['effects']}"
            )


if __name__ == "__main__":
    sys.exit(main())
