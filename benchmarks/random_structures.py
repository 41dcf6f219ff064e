"""Cranes of random structure through the commands: which run, which end with one line, which with a traceback.

    python benchmarks/random_structures.py [--count 200] [--seed 0] [--commands simulate,validate] [--seconds 20] [--json PATH]

Each draw is a machine file (linkage x friction x valve x spool x burst or load-holding valve x accumulators x pilot stage x load in
steps) with a recording made by its own model, some sensors missing. ``simulate`` and ``validate`` run by default; ``identify``,
``diagnose`` and ``check-machine`` can be added. Exit status 1 if a command ends with a traceback, or validate does not agree with
the very machine although all sensors are there.
"""

from __future__ import annotations

import argparse
import contextlib
import io
import json
import sys
import tempfile
import traceback
from collections import Counter
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np
import yaml

from boom_bringup.cli import main as boom
from boom_model.errors import SimulationError
from boom_recording.writing import write
from boom_trials.structures import complete, draw

LARGEST = {"angle_mae_rad": 3e-3, "hose_pressure_rmse_pa": 3e5, "rod_pressure_rmse_pa": 3e5}
"""Errors that the noise of the rest state and of the currents makes at most; a hose behind a shut valve keeps its share of them,
and a load-holding valve that hunts makes more of them."""
KNOWN = ("check-machine", "simulate", "validate", "identify", "diagnose")


def arguments(command: str, file: Path, bag: Path, folder: Path) -> list[str]:
    """What a user would type."""
    machine = ["--machine", str(file)]
    return {
        "check-machine": ["check-machine", str(file)],
        "simulate": ["simulate", str(bag), *machine, "--output", str(folder / "again")],
        "validate": [
            "validate",
            str(bag),
            *machine,
            "--json",
            str(folder / "v.json"),
            "--report",
            str(folder / "v.html"),
        ],
        "identify": ["identify", str(bag), *machine, "--json", str(folder / "i.json")],
        "diagnose": ["diagnose", str(bag), *machine, "--output", str(folder / "diagnosis")],
    }[command]


def run(command: str, file: Path, bag: Path, folder: Path) -> dict[str, Any]:
    """Exit status, the last line on stderr, and the end of the traceback if there is one."""
    said, begin = io.StringIO(), perf_counter()
    status, trace = 0, ""
    with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(said):
        try:
            status = boom(arguments(command, file, bag, folder))
        except SystemExit as left:
            status = int(left.code or 0)
        except Exception:  # what a user would see as a traceback is what is looked for
            status, trace = -1, "".join(traceback.format_exc().splitlines(keepends=True)[-3:])
    return {"status": status, "said": said.getvalue().strip()[-200:], "trace": trace, "seconds": perf_counter() - begin}


def one(seed: int, seconds: float, commands: list[str]) -> dict[str, Any]:
    """One draw through the commands."""
    rng = np.random.default_rng(seed)
    try:
        crane = draw(rng, seconds)
    except SimulationError as error:
        return {"seed": seed, "not_simulated": str(error)}
    with tempfile.TemporaryDirectory(prefix="boom-structure-") as name:
        folder = Path(name)
        file, bag = folder / "machine.yaml", folder / "drawn"
        file.write_text(yaml.safe_dump(crane.document, sort_keys=False), encoding="utf-8")
        write(bag, crane.recording)
        results = {command: run(command, file, bag, folder) for command in commands}
        if results.get("validate", {}).get("status") == 0:
            seen = json.loads((folder / "v.json").read_text("utf-8"))["bags"][0]
            results["validate"] |= {"agrees": seen["agrees"], "full": seen["full"], "complete": complete(crane)}
    return {"seed": seed, "choices": crane.choices, "duration_s": crane.recording.duration, "results": results}


def wrong(row: dict[str, Any]) -> list[str]:
    """What must not be: a traceback; a machine that does not reproduce what it made itself."""
    results = row.get("results", {})
    found = [f"{command}: {result['trace']}" for command, result in results.items() if result["status"] == -1]
    seen = results.get("validate", {})
    if seen.get("complete") and "stopped" not in seen["full"]:
        found += [
            f"validate: {key} {seen['full'][key]:.3g}" for key, most in LARGEST.items() if not seen["full"][key] <= most
        ]
    return found


def main() -> int:
    """Draw, run, count."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--count", type=int, default=200)
    parser.add_argument("--seed", type=int, default=0, help="of the first draw")
    parser.add_argument("--seconds", type=float, default=20.0, help="length of a recording")
    parser.add_argument("--commands", default="simulate,validate", help=f"some of {','.join(KNOWN)}")
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    commands = options.commands.split(",")
    if unknown := set(commands) - set(KNOWN):
        parser.error(f"--commands: {', '.join(sorted(unknown))} is not one of {', '.join(KNOWN)}")
    rows = []
    for seed in range(options.seed, options.seed + options.count):
        row = one(seed, options.seconds, commands)
        rows.append(row)
        for text in wrong(row):
            print(f"{seed}: {row['choices']}\n  {text}", flush=True)
    if options.json:
        options.json.write_text(json.dumps(rows, indent=1), encoding="utf-8")
    ran = [row for row in rows if "results" in row]
    print(f"{len(rows)} drawn, {len(rows) - len(ran)} left the model's range at once")
    for command in commands:
        counted = Counter(row["results"][command]["status"] for row in ran)
        print(
            f"{command}: "
            + ", ".join(
                f"exit status {status}: {n}" if status >= 0 else f"traceback: {n}"
                for status, n in sorted(counted.items())
            )
        )
    agreed = [row["results"]["validate"]["agrees"] for row in ran if row["results"].get("validate", {}).get("complete")]
    print(f"all sensors there: {len(agreed)}, of which validate agrees with {sum(agreed)}")
    return int(any(wrong(row) for row in rows))


if __name__ == "__main__":
    sys.exit(main())
