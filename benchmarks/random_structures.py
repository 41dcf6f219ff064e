"""Cranes of random structure through the commands: which run, which end with one line, which with a traceback.

    python benchmarks/random_structures.py [--count 200] [--seed 0] [--commands simulate,validate] [--seconds 20] [--json PATH]

Each draw is a machine file (linkage x friction x valve x spool x burst or load-holding valve x accumulators x pilot stage x load in
steps x effect of the catalogue x learned term) with a recording made by its own model: 20 Hz to 1 kHz, some sensors missing,
pressures coarse or repeated, rate without a gyro, supply measured or not. All commands run but ``identify``, ``diagnose`` and
``likelihood`` (diagnose with that engine), which take half a minute each; they can be added. ``watch`` is the watch without its
ROS node. Exit status 1 if a command ends with a traceback, warns, prints a number that is none, or validate does not agree with
the very machine although all sensors are there.
"""

from __future__ import annotations

import argparse
import contextlib
import io
import json
import re
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
from boom_model.machine_file import load_machine
from boom_model.sensors import OUTPUTS
from boom_monitor.watch import CURRENTS, Watch
from boom_recording.loading import load
from boom_recording.writing import write
from boom_trials.structures import DrawnCrane, complete, draw

LARGEST = {"angle_mae_rad": 3e-3, "hose_pressure_rmse_pa": 3e5, "rod_pressure_rmse_pa": 3e5}
"""Errors that the noise of the rest state and of the currents makes at most; a hose behind a shut valve keeps its share of them,
and a load-holding valve that hunts makes more of them."""
CHEAP = ("check-machine", "simulate", "control", "validate", "chain", "view", "export-fmu", "new-machine", "watch")
KNOWN = (*CHEAP, "identify", "diagnose", "likelihood")
ANSWERS = {
    "name": "drawn", "foot_distance": 1.32, "eye_distance": 0.61, "closed_length": 0.905, "stroke": 0.62, "lowest_angle": -21.6,
    "piston_diameter": 80, "rod_diameter": 45, "inner_mass": 300, "inner_length": 2.2, "outer_mass": 120, "outer_length": 1.5,
    "outer_angle": -20, "pump_pressure": 165, "opening_current": 0.09, "full_current": 1.0, "lift_flow": 26, "lower_flow": 22,
    "flow_drop": 4,
}  # fmt: skip
"""Of the crane of docs/new_machine.md, whatever was drawn."""
NO_NUMBER = re.compile(r".*\b(?:nan|inf|None)\b.*|.*Warning:.*")
EVERY = 0.2
"""s between two questions to the watch."""


def arguments(command: str, file: Path, bag: Path, folder: Path) -> list[str]:
    """What a user would type."""
    given = [str(bag), "--machine", str(file)]
    answers = ["--answers", str(folder / "answers.yaml"), "--yes", "--no-manoeuvre"]
    return {
        "check-machine": ["check-machine", str(file)],
        "simulate": ["simulate", *given, "--output", str(folder / "again")],
        "control": ["simulate", *given, "--reference", "--duration", "6", "--output", str(folder / "followed")],
        "validate": ["validate", *given, "--json", str(folder / "v.json"), "--report", str(folder / "v.html")],
        "chain": ["chain", *given, "--json", str(folder / "c.json"), "--report", str(folder / "c.html")],
        "view": ["view", *given, "--output", str(folder / "view.html")],
        "export-fmu": ["export-fmu", "--machine", str(file), "--output", str(folder / "crane.fmu")],
        "new-machine": ["new-machine", *answers, "--output", str(folder / "new.yaml"), str(bag)],
        "identify": ["identify", *given, "--json", str(folder / "i.json"), "--report", str(folder / "i.html")],
        "diagnose": ["diagnose", *given, "--output", str(folder / "rounds")],
        "likelihood": ["diagnose", *given, "--engine", "likelihood", "--output", str(folder / "likelihood")],
    }[command]


def watched(file: Path, bag: Path) -> int:
    """The watch over the recording, asked every 0.2 s; samples come in the order of their stamps."""
    machine, recording = load_machine(str(file)), load(bag, require=())
    c = recording.configuration
    watch = Watch(machine, machine.pose(c.outer_boom_angle, c.telescope_length, c.load_mass))
    signals = [recording.signals[name] for name in (*OUTPUTS, *CURRENTS) if name in recording.signals]
    samples = [(t, s.name, v) for s in signals for t, v in zip(s.time[s.valid], s.values[s.valid], strict=True)]
    due = EVERY
    for time, name, value in sorted(samples):
        watch.add(name, time, value)
        if time >= due:
            due = time + EVERY
            watch.advance()
    status = watch.status
    print(f"watching {status.watching}, score {status.score:.2f}, {status.alarms} alarms {status.waits_for}")
    return 0 if status.watching else 2


def run(command: str, file: Path, bag: Path, folder: Path) -> dict[str, Any]:
    """Exit status, the last line on stderr, lines without sense, and the end of the traceback if there is one."""
    said, printed, begin = io.StringIO(), io.StringIO(), perf_counter()
    status, trace = 0, ""
    with contextlib.redirect_stdout(printed), contextlib.redirect_stderr(said):
        try:
            status = watched(file, bag) if command == "watch" else boom(arguments(command, file, bag, folder))
        except SystemExit as left:
            status = int(left.code or 0)
        except Exception:  # what a user would see as a traceback is what is looked for
            status, trace = -1, "".join(traceback.format_exc().splitlines(keepends=True)[-3:])
    lines = (printed.getvalue() + said.getvalue()).replace("\r", "\n").splitlines()
    return {
        "status": status, "said": said.getvalue().strip()[-300:], "trace": trace, "seconds": perf_counter() - begin,
        "senseless": [line.strip() for line in lines if NO_NUMBER.match(line) and not (command == "watch" and status)],
    }  # fmt: skip


def through(crane: DrawnCrane, commands: list[str]) -> dict[str, Any]:
    """The results of the commands on one crane."""
    with tempfile.TemporaryDirectory(prefix="boom-structure-") as name:
        folder = Path(name)
        file, bag = folder / "machine.yaml", folder / "drawn"
        file.write_text(yaml.safe_dump(crane.document, sort_keys=False), encoding="utf-8")
        (folder / "answers.yaml").write_text(yaml.safe_dump(ANSWERS), encoding="utf-8")
        write(bag, crane.recording)
        results = {command: run(command, file, bag, folder) for command in commands}
        if results.get("validate", {}).get("status") == 0:
            seen = json.loads((folder / "v.json").read_text("utf-8"))["bags"][0]
            results["validate"] |= {"agrees": seen["agrees"], "full": seen["full"], "complete": complete(crane)}
        for engine in ("rounds", "likelihood"):
            if (told := folder / engine / "diagnosis.json").exists():
                document = json.loads(told.read_text("utf-8"))
                command = "diagnose" if engine == "rounds" else engine
                results[command]["verdict"] = [document["verdict"], *(f["effect"] for f in document["findings"])]
    return results


def one(seed: int, seconds: float, commands: list[str]) -> dict[str, Any]:
    """One draw through the commands."""
    try:
        crane = draw(np.random.default_rng(seed), seconds)
    except SimulationError as error:
        return {"seed": seed, "not_simulated": str(error)}
    return {
        "seed": seed, "choices": crane.choices, "duration_s": crane.recording.duration, "results": through(crane, commands)
    }  # fmt: skip


def wrong(row: dict[str, Any]) -> list[str]:
    """What must not be: a traceback; a line without sense; a machine that does not reproduce what it made itself."""
    results = row.get("results", {})
    found = [f"{command}: {result['trace']}" for command, result in results.items() if result["status"] == -1]
    found += [f"{command}: {line}" for command, result in results.items() for line in result["senseless"]]
    seen = results.get("validate", {})
    if seen.get("complete") and "stopped" not in seen["full"]:
        values = {key: seen["full"][key] for key in LARGEST}
        found += [f"validate: {key} {v}" for key, v in values.items() if v is None or not v <= LARGEST[key]]
    return found


def summary(ran: list[dict[str, Any]], commands: list[str]) -> None:
    """Exit statuses by command, and the lines with which commands refused, numbers left out."""
    for command in commands:
        results = [row["results"][command] for row in ran]
        counted = sorted(Counter(result["status"] for result in results).items())
        words = [f"exit status {status}: {n}" if status >= 0 else f"traceback: {n}" for status, n in counted]
        print(f"{command}: {', '.join(words)}; {np.mean([result['seconds'] for result in results]):.1f} s each")
        refused = Counter(
            re.sub(r"[-\d.]+|\S*/", "#", r["said"].splitlines()[-1]) for r in results if r["status"] == 2 and r["said"]
        )
        for line, n in refused.most_common():
            print(f"  {n} x {line}")


def main() -> int:
    """Draw, run, count."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--count", type=int, default=200)
    parser.add_argument("--seed", type=int, default=0, help="of the first draw")
    parser.add_argument("--seconds", type=float, default=20.0, help="length of a recording")
    parser.add_argument("--commands", default=",".join(CHEAP), help=f"some of {','.join(KNOWN)}")
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    commands = options.commands.split(",")
    if unknown := set(commands) - set(KNOWN):
        parser.error(f"--commands: {', '.join(sorted(unknown))} is not one of {', '.join(KNOWN)}")
    rows = []
    for seed in range(options.seed, options.seed + options.count):
        row = one(seed, options.seconds, commands)
        rows.append(row)
        if options.json:
            options.json.write_text(json.dumps(rows, indent=1), encoding="utf-8")
        for text in wrong(row):
            print(f"{seed}: {row['choices']}\n  {text}", flush=True)
    ran = [row for row in rows if "results" in row]
    print(f"{len(rows)} drawn, {len(rows) - len(ran)} left the model's range at once")
    summary(ran, commands)
    agreed = [row["results"]["validate"]["agrees"] for row in ran if row["results"].get("validate", {}).get("complete")]
    print(f"all sensors there: {len(agreed)}, of which validate agrees with {sum(agreed)}")
    return int(any(wrong(row) for row in rows))


if __name__ == "__main__":
    sys.exit(main())
