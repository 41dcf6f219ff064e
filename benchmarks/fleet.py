"""A simulated fleet through `./boom fleet`: what is found, how soon, at what cost, and whether a killed run ends in the same table.

    python benchmarks/fleet.py output/fleet_year                                     40 cranes x 12 recordings of 10 minutes
    python benchmarks/fleet.py output/small --machines 4 --recordings 4 --seconds 60 --fates accumulator_precharge,pressure_bias

Makes the recordings (``fleet_cranes.py``: concealed plant) in as many processes as --workers, runs the command, and prints:
machines that were raised and should be, or should not; of each change the first recording that raised it, and its size there;
processor seconds a recorded hour. Killed at any point and started again with the same options it goes on with what is missing.

--detectable also tells from which recording on a change is detectable in one recording by the concealed plant's own measure
(``concealed_plant.detectability``). With --kill N the command is killed N times first (SIGKILL, after a share of the recordings was
screened), started again, and compared with an undisturbed run. With --workers-compared it is run with one worker and with two, each
in a folder of its own. The last table is a simulation of the scheduler, not a measurement: the measured task times, handed out in
order to 1 .. 32 workers.
"""

from __future__ import annotations

import argparse
import heapq
import json
import os
import shutil
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

from fleet_cranes import FATES, Fleet, make, shown

from boom_fleet.engine import workers
from boom_input.whole import write_whole
from boom_node.children import die_with_parent

ROOT = Path(__file__).resolve().parents[1]
MACHINE = ROOT / "src/boom_model/boom_model/machines/tz17.yaml"


def main() -> int:
    """Make, run, compare; exit status 1 where a machine was raised falsely or not at all."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--machines", type=int, default=40)
    parser.add_argument("--recordings", type=int, default=12)
    parser.add_argument("--seconds", type=float, default=600.0)
    parser.add_argument("--fates", default=",".join(f.effect for f in FATES))
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--workers", type=int, default=os.cpu_count())
    parser.add_argument("--detectable", action="store_true", help="also tell from when on each change is detectable")
    parser.add_argument("--kill", type=int, default=0, metavar="N")
    parser.add_argument("--workers-compared", action="store_true")
    parser.add_argument("--diagnose", action="store_true", help="also diagnose what is raised")
    args = parser.parse_args()
    chosen = tuple(f for name in args.fates.split(",") for f in FATES if f.effect == name)
    fleet = Fleet(args.machines, args.recordings, args.seconds, chosen, args.seed)
    bags = args.folder / "bags"
    try:
        make(fleet, MACHINE, bags, args.workers, say)
    except ValueError as error:
        parser.error(str(error))
    since = detectable(fleet, bags.with_suffix(".shown.json"), args.workers) if args.detectable else {}
    options = [] if args.diagnose else ["--no-diagnosis"]
    if args.workers_compared:
        compare_workers(bags, args.folder, options)
    output = args.folder / "results"
    for k in range(args.kill):
        killed(bags, output, options, (k + 1) * len(list(bags.glob("*/*"))) // (args.kill + 1))
    seconds = finished(bags, output, ["--workers", str(args.workers), *options])
    rows = table(output)
    print(f"{len(rows)} recordings, {args.workers} workers: {seconds:.0f} s")
    if args.kill:
        whole = args.folder / "undisturbed"
        finished(bags, whole, ["--workers", str(args.workers), *options])
        same = told(rows) == told(table(whole))
        print(f"killed {args.kill} times and resumed: {'the same table' if same else 'ANOTHER TABLE'}")
    wrong = found(rows, json.loads(bags.with_suffix(".json").read_text()), since, args.machines)
    cost(rows)
    return int(wrong)


def say(text: str) -> None:
    """Progress."""
    print(f"{time.strftime('%H:%M:%S')} {text}", file=sys.stderr, flush=True)


def detectable(fleet: Fleet, file: Path, processes: int) -> dict[str, int]:
    """Crane -> index of the first recording that alone shows its fate; those of a drift are looked at until one does."""
    known: dict[str, float] = json.loads(file.read_text()) if file.exists() else {}
    names = fleet.names()
    left = {
        machine: [k for k in range(fleet.recordings) if fleet.size(machine, k) > 0.0]
        for machine in range(min(fleet.machines, len(fleet.fates)))
    }
    since: dict[str, int] = {}

    def done(case: str, ratio: float) -> None:
        known[case] = ratio
        write_whole(file, json.dumps(known, indent=1) + "\n")
        say(f"detectability of crane and recording {case}: {ratio:.2f}")

    with workers(None, processes) as engine:
        while left:
            cases = [f"{m} {ks[0]}" for m, ks in left.items() if ks]
            missing = [case for case in cases if case not in known]
            engine.each(shown, missing, lambda case: (fleet, MACHINE, *map(int, case.split())), done)
            for machine, k in (map(int, case.split()) for case in cases):
                if known[f"{machine} {k}"] >= 1.0:
                    since[names[machine]] = k
                    left.pop(machine)
                else:
                    left[machine].pop(0)
            left = {m: ks for m, ks in left.items() if ks}
    return since


def command(bags: Path, output: Path, options: list[str]) -> list[str]:
    """The command line."""
    return [sys.executable, "-m", "boom_bringup.cli", "fleet", str(bags), "--output", str(output), *options]


def finished(bags: Path, output: Path, options: list[str]) -> float:
    """Run to the end; returns the time [s]."""
    begin = time.monotonic()
    if started(bags, output, options).wait():
        raise SystemExit("the command failed")
    return time.monotonic() - begin


def started(bags: Path, output: Path, options: list[str]) -> subprocess.Popen[bytes]:
    """The command, which ends with this process."""
    return subprocess.Popen(command(bags, output, options), stdout=sys.stderr, preexec_fn=die_with_parent(os.getpid()))


def killed(bags: Path, output: Path, options: list[str], screened: int) -> None:
    """Run until so many recordings are screened, then kill it."""
    process = started(bags, output, options)
    while process.poll() is None and len(list((output / "work").glob("screen-*"))) < screened:
        time.sleep(0.2)
    process.kill()
    process.wait()
    say(f"killed with {len(list((output / 'work').glob('screen-*')))} recordings screened")


def compare_workers(bags: Path, folder: Path, options: list[str]) -> None:
    """The same with one worker and with two."""
    took = {}
    for count in (1, 2):
        output = folder / f"workers_{count}"
        shutil.rmtree(output, ignore_errors=True)
        took[count] = finished(bags, output, ["--workers", str(count), *options])
    print(f"one worker {took[1]:.0f} s, two workers {took[2]:.0f} s: {took[1] / took[2]:.2f} times")


def table(output: Path) -> list[dict[str, Any]]:
    """Rows of the dataset."""
    import pyarrow.dataset

    rows: list[dict[str, Any]] = pyarrow.dataset.dataset(output / "recordings").to_table().to_pylist()
    return sorted(rows, key=lambda row: (row["machine"], row["time"]))


def told(rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """What a run says, without what it took."""
    return [{k: v for k, v in row.items() if not k.endswith("processor_s")} for row in rows]


def found(rows: list[dict[str, Any]], truth: dict[str, Any], since: dict[str, int], machines: int) -> bool:
    """Print what was found of each crane with a fate, and the others that were raised; whether anything is wrong."""
    wrong = False
    for name, fate in truth.items():
        own = [row for row in rows if row["machine"] == name]
        first = next((k for k, row in enumerate(own) if row["raised"]), None)
        began = next(k for k, size in enumerate(fate["sizes"]) if size > 0.0)
        line = f"{name}: {fate['kind']} {fate['effect']}, from recording {began + 1} on"
        line += f", detectable in recording {since[name] + 1}: " if name in since else ": "
        if first is None:
            wrong = True
            print(line + "not raised")
            continue
        names = [c["quantity"].split(".")[0] for c in own[-1]["changes"]]
        right = [n for n in names if n in fate["quantity"]]
        line += f"raised after recording {first + 1} (size {fate['sizes'][first]:.3g}); named {', '.join(names)}"
        print(line + ("" if right else " - WRONG NAME"))
        wrong |= first < began
    falsely = sorted({row["machine"] for row in rows if row["raised"] and row["machine"] not in truth})
    print(f"raised falsely: {len(falsely)} of {machines - len(truth)} healthy cranes {', '.join(falsely)}")
    return wrong or bool(falsely)


def cost(rows: list[dict[str, Any]]) -> None:
    """Print the cost, and what more workers would take."""
    hours = sum(row["duration_s"] for row in rows) / 3600
    screen = [row["screen_processor_s"] for row in rows]
    diagnoses = [row["diagnosis_processor_s"] for row in rows if row["diagnosis_processor_s"]]
    print(f"screen: {sum(screen) / hours:.0f} processor s a recorded hour")
    if diagnoses:
        print(
            f"diagnosis: {sum(diagnoses) / len(diagnoses):.0f} processor s each, {len(diagnoses)} of {len(rows)} recordings"
        )
    alone = simulated(screen, 1)
    print(
        "simulated with the measured task times: "
        + ", ".join(f"{n}: {alone / simulated(screen, n):.1f}" for n in (2, 4, 8, 16, 32))
    )


def simulated(seconds: list[float], workers: int) -> float:
    """Time [s] of tasks handed out in order to whoever is free."""
    free = [0.0] * workers
    for task in seconds:
        heapq.heappush(free, heapq.heappop(free) + task)
    return max(free)


if __name__ == "__main__":
    sys.exit(main())
