"""Is every fault of a recording told as what it is, and none where there is none?

    python benchmarks/recording_checks.py [BAG ...] [--machine FILE] [--effects FOLDER]

Each fault of ``test/recording_faults.py`` is put into each recording (default: six of the shipped ones), written as a bag,
loaded and checked; right is exactly one check that spoils, of the right kind and topic. ``--effects``: cases of the concealed
plant, one of each effect at three times its detectability, are made in that folder; none may be told as a fault. Exit status 1
if anything is wrong.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from importlib.resources import files
from pathlib import Path

from boom_checks.doubts import checks
from boom_model.machine import Machine
from boom_model.machine_file import load_machine
from boom_recording import writing
from boom_recording.loading import load
from concealed_plant.cases import CaseSpec
from concealed_plant.concealments import CONCEALMENTS
from concealed_plant.generator import RECORDING, make_case

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "test"))

from recording_faults import FAULTS  # noqa: E402

BAGS = [
    "healthy/extended", "healthy/extended_log", "healthy/folded_fast", "healthy/folded_slow", "explained/hose_burst_valve_lag_a",
    "explained/payload_change_a",
]  # fmt: skip
SEED = 77
STRONG = 3.0


def told(path: Path, machine: Machine) -> list[tuple[str, str]]:
    """(kind, topic) of the checks that spoil."""
    return [(check.kind, check.topic) for check in checks(load(path), machine) if check.spoils]


def main() -> int:
    """Runs; returns the exit status."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("bags", nargs="*", type=Path, default=[ROOT / "bags" / name for name in BAGS])
    parser.add_argument("--machine", default="tz17")
    parser.add_argument("--effects", type=Path)
    args = parser.parse_args()
    machine, wrong = load_machine(args.machine), 0
    with tempfile.TemporaryDirectory() as folder:
        for name, (kind, topic, make) in FAULTS.items():
            right = 0
            for k, bag in enumerate(args.bags):
                path = Path(folder) / f"{kind}_{len(name)}_{k}_{right}_{wrong}"
                writing.write(path, make(load(bag)))
                found = told(path, machine)
                right += found == [(kind, topic)]
                if found != [(kind, topic)]:
                    print(f"  {bag.name}: {found}")
            wrong += len(args.bags) - right
            print(f"{name}: {right} of {len(args.bags)}")
    quiet = [(bag.name, told(bag, machine)) for bag in args.bags]
    if args.effects:
        source = str(files("boom_model").joinpath("machines", "tz17.yaml"))
        for k, name in enumerate(CONCEALMENTS):
            make_case(
                CaseSpec(name, (SEED, k), "effect", ((name, STRONG),)), source, args.effects, args.effects / "sealed"
            )
            quiet.append((name, told(args.effects / name / RECORDING, load_machine("tz17"))))
    alarms = [(name, found) for name, found in quiet if found]
    print(f"false alarms: {len(alarms)} of {len(quiet)}", *alarms, sep="\n  ")
    return int(bool(wrong or alarms))


if __name__ == "__main__":
    sys.exit(main())
