"""One likelihood (issue 24) on recordings or on cases of the blind trial: every hypothesis weighed, with its probability.

    python benchmarks/likelihood.py BAG...                   the hypotheses of these recordings of one crane, together
    python benchmarks/likelihood.py --seed 7 --cases 20      of cases of plant P, each against its truth

``./boom diagnose --engine likelihood`` gives the answer to one recording; docs/likelihood.md says how far it is.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from importlib.resources import files
from pathlib import Path
from typing import Any

from boom_diagnosis.assumptions import EFFECT_LOG_ODDS
from boom_diagnosis.bag_samples import prepare
from boom_diagnosis.crane_system import CraneSystem, catalogue_effects, tolerance_numbers
from boom_estimation.search import Search, WeighedHypothesis
from boom_model.machine_file import load_machine
from boom_recording.loading import load
from concealed_plant.cases import cases
from concealed_plant.generator import ANSWER, RECORDING, make_case

SHOWN = 8


def weighed(
    paths: Sequence[Path], machine: str, report: Callable[[str], None]
) -> list[tuple[WeighedHypothesis, float]]:
    """The search over recordings of one crane."""
    own = load_machine(machine)
    bags = [bag for bag in (prepare(load(path), own, aligned=True) for path in paths) if bag is not None]
    if not bags:
        raise SystemExit("likelihood.py: none of the recordings has all channels")
    system = CraneSystem(own, bags)
    longest = max(bag.recording.duration for bag in bags)
    search = Search(
        system, tolerance_numbers(system.nuisances), catalogue_effects(own, longest, EFFECT_LOG_ODDS), report=report
    )
    return search.run()


def row(found: WeighedHypothesis, probability: float) -> dict[str, Any]:
    """What is told of a hypothesis."""
    effects = {k: float(f"{v:.3g}") for k, v in found.fit.values().items() if k.startswith("effects.")}
    return {
        "hypothesis": found.hypothesis.label, "posterior": probability, "log_likelihood": round(found.fit.log_likelihood, 1),
        "log_prior": round(found.log_prior, 2), "evidence": round(found.fit.evidence, 1), "numbers": effects,
        "sizes": {k: float(f"{v:.2g}") for k, v in found.fit.sizes.items()},
    }  # fmt: skip


def show(rows: Sequence[dict[str, Any]]) -> None:
    """The table of the likeliest hypotheses."""
    best = rows[0]["evidence"]
    for r in rows[:SHOWN]:
        print(f"{r['posterior']:9.4f}  {r['evidence'] - best:9.1f} nats  {r['hypothesis']}  {r['numbers']}")


def main() -> int:
    """Command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("bags", nargs="*", type=Path)
    parser.add_argument("--machine", default="tz17", help="machine file")
    parser.add_argument("--seed", type=int, default=1, help="of the cases")
    parser.add_argument("--cases", type=int, default=0, help="how many of plant P, instead of recordings")
    parser.add_argument("--first", type=int, default=0, help="number of the first of them")
    parser.add_argument("--json", type=Path, help="a line for each case, with all hypotheses")
    parser.add_argument("--verbose", action="store_true", help="every fit, as it ends")
    args = parser.parse_args()

    def report(text: str) -> None:
        if args.verbose:
            print(f"  {time.process_time():6.0f} s  {text}", file=sys.stderr, flush=True)

    if not args.cases:
        show([row(*found) for found in weighed(args.bags, args.machine, report)])
        return 0
    right = 0
    with tempfile.TemporaryDirectory() as folder:
        blind, sealed = Path(folder) / "blind", Path(folder) / "sealed"
        for spec in cases(args.seed, args.cases)[args.first :]:
            make_case(spec, str(files("boom_model") / "machines" / "tz17.yaml"), blind, sealed)
            truth = json.loads((sealed / spec.name / ANSWER).read_text())
            begun = time.process_time()
            rows = [row(*found) for found in weighed([blind / spec.name / RECORDING], args.machine, report)]
            seconds = time.process_time() - begun
            wanted = " + ".join(sorted(e["effect"] for e in truth["effects"] if e["known"])) or "nothing"
            right += rows[0]["hypothesis"] == wanted
            found = f"{rows[0]['hypothesis']} ({rows[0]['posterior']:.3f})"
            print(f"{spec.name} {spec.kind}: {wanted} -> {found}, {seconds:.0f} s", flush=True)
            if args.json:
                with args.json.open("a", encoding="utf-8") as out:
                    out.write(json.dumps({"case": spec.name, "truth": truth, "rows": rows, "seconds": seconds}) + "\n")
    print(f"{right} of {args.cases - args.first} likeliest hypotheses are the truth")
    return 0


if __name__ == "__main__":
    sys.exit(main())
