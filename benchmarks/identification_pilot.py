"""Are pilot valves found? Chapter 5.1 on measurement campaigns whose answer is known.

    ./boom python benchmarks/identification_pilot.py [BAG...] [--machines 3] [--json PATH]

BAG: oscilloscope bags of a valve with the numbers of the machine file tz17. Beside them so many machines with random pilot
valves go through the campaign of ch. 4.1 (boom_sim.campaigns). Printed are the error of the pole, the largest error of h over
0.30 to 0.55 A, and the error of the pressure in traces that the linear part has not seen, averaged over the PWM period and as
measured. Exit status 1 if a pole is off by more than 2 %, h by more than 0.15 bar or a trace by 0.25 bar rms or more.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Sequence
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np

from boom_identification.pilot_valve import identify_pilot_valves
from boom_model.components.pilot_valve import BAR, static_pressure
from boom_model.errors import ModelError
from boom_model.machine import Machine
from boom_model.machine_file import load_machine
from boom_recording.errors import RecordingError
from boom_recording.oscilloscope import OscilloscopeTrace, load_traces
from boom_sim.campaigns import pilot_campaign

POLE, CURVE_BAR, TRACE_BAR = 0.02, 0.15, 0.25
RANGE = (0.30, 0.55)
"""A."""


def main(argv: list[str] | None = None) -> int:
    """Identifies all campaigns and prints the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("bags", nargs="*", metavar="BAG", help="oscilloscope bags of tz17's valves")
    parser.add_argument("--machines", type=int, default=3, help="random ones that are simulated (default: %(default)s)")
    parser.add_argument("--json", type=Path, help="write the table to this file")
    options = parser.parse_args(argv)
    try:
        nominal = load_machine("tz17")
        given = [trace for bag in options.bags for trace in load_traces(bag)]
    except (RecordingError, ModelError, OSError) as problem:
        print(f"identification_pilot: {problem}", file=sys.stderr)
        return 2
    campaigns = [("bags given", nominal, given)] if given else []
    for seed in range(options.machines):
        machine = random_valve(nominal, seed)
        campaigns.append((f"machine {seed}", machine, list(pilot_campaign(machine, seed=seed))))
    print(f"{'':12s} {'pole [1/s]':>10s} {'found':>8s} {'error':>8s} {'h off by [bar]':>15s} {'trace [bar rms]':>16s} "
          f"{'with ripple':>12s} {'intervals':>10s} {'time [s]':>9s}")  # fmt: skip
    rows = []
    for name, machine, traces in campaigns:
        row = judged(machine, traces) | {"campaign": name}
        rows.append(row)
        print(
            f"{name:12s} {row['pole']:10.3f} {row['found']:8.3f} {100 * row['pole_error']:7.2f} % {row['curve_bar']:15.3f} "
            f"{row['trace_bar']:16.3f} {row['trace_with_ripple_bar']:12.3f} {row['inside']:6d} / 6 {row['seconds']:9.0f}",
            flush=True,
        )
    if options.json:
        options.json.write_text(json.dumps(rows, indent=1) + "\n", encoding="utf-8")
    bad = [r["campaign"] for r in rows
           if abs(r["pole_error"]) > POLE or r["curve_bar"] > CURVE_BAR or r["trace_with_ripple_bar"] >= TRACE_BAR]  # fmt: skip
    for name in bad:
        print(f"FAILED: {name}")
    return 1 if bad else 0


def random_valve(machine: Machine, seed: int) -> Machine:
    """The machine with other pilot valves: pole 10 to 35 1/s, static gain one as the Wiener model has it."""
    rng = np.random.default_rng(seed)
    pole, through = rng.uniform(10.0, 35.0), rng.uniform(-0.05, 0.02)
    h = (rng.uniform(60.0, 95.0), rng.uniform(-3.0, 3.0), rng.uniform(0.1, 1.0))
    return machine.with_values({
        "pilot_valves.a1_s": -pole, "pilot_valves.b1_s": through, "pilot_valves.b0_s": pole * (1.0 - through),
        "pilot_valves.h": h,
    })  # fmt: skip


def judged(machine: Machine, traces: Sequence[OscilloscopeTrace]) -> dict[str, Any]:
    """What is found on traces of ``machine``'s valves beside what it has."""
    begin = perf_counter()
    found = identify_pilot_valves(traces)
    seconds = perf_counter() - begin
    truth = {
        name: value
        for p in machine.parameters.values()
        for name, value in zip(p.specification.components, p.value, strict=True)
    }
    estimates = {e.key: e for e in found.estimates()}
    right, pole = -truth["pilot_valves.a1_s"], -estimates["pilot_valves.a1_s"].value
    current = np.linspace(*RANGE, 101)
    h, true_h = (
        [source(f"pilot_valves.h.{k}") for k in range(3)] for source in (lambda key: estimates[key].value, truth.get)
    )
    difference = np.asarray(static_pressure(current, h), float) - np.asarray(static_pressure(current, true_h), float)
    checks = [c for c in found.checks if c.held_out]
    return {
        "pole": right, "found": pole, "pole_error": pole / right - 1.0, "seconds": seconds,
        "curve_bar": float(np.abs(difference).max()) / BAR,
        "trace_bar": max(c.rms for c in checks) / BAR, "trace_with_ripple_bar": max(c.rms_raw for c in checks) / BAR,
        "inside": sum(e.interval_90[0] <= truth[key] <= e.interval_90[1] for key, e in estimates.items()),
    }  # fmt: skip


if __name__ == "__main__":
    sys.exit(main())
