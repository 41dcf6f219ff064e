"""Is each effect of the catalogue named where it is at the middle of its range? A smoke test: the equations are shared.

    python benchmarks/diagnosis_effects.py [--effects ID ...] [--bag BAG] [--duration S] [--seed N] [--json PATH]

The currents of a recording drive a simulated machine that has the effect; the result, with the sensors' noise, is diagnosed.
For end cushioning the boom begins as high as the currents allow, so that it comes near the end of the stroke.
Its last third is held out. Right is an effect that is named first, or stands in the list of an ambiguous answer. ``--json`` is
read first and continued, so that a run can be stopped and taken up. Exit status 1 if more than two of those run are wrong.
"""

from __future__ import annotations

import argparse
import json
import sys
from contextlib import suppress
from pathlib import Path
from time import perf_counter

import numpy as np

from boom_diagnosis.coordinates import coordinates
from boom_diagnosis.document import DiagnosisResult
from boom_diagnosis.run import diagnose
from boom_estimation.currents import held_currents
from boom_model.catalogue import CATALOGUE, EFFECTS
from boom_model.errors import ModelError, SimulationError
from boom_model.machine_file import load_machine
from boom_recording.loading import load
from boom_recording.recording import Recording
from boom_sim.offline import simulate
from boom_sim.simulated_crane import CraneStart

BAG = Path(__file__).resolve().parents[1] / "bags" / "healthy" / "extended"
ALLOWED = 2
ONSET = 0.45
"""Share of the recording at which a load comes."""


def middle(effect: str, duration: float) -> dict[str, float]:
    """Its parameters at the middle of the plausible range.

    Geometric where the number is positive by its meaning and neutral is no part of the range; the middle of the upper half
    where the middle is neutral.
    """
    result = {}
    for row, coordinate in zip(EFFECTS[effect].parameters, coordinates(EFFECTS[effect]), strict=True):
        if row.name == EFFECTS[effect].onset:
            result[row.name] = ONSET * duration
        elif coordinate.positive and not row.low < row.neutral < row.high:
            result[row.name] = float(np.sqrt(row.low * row.high))
        elif abs(0.5 * (row.low + row.high) - row.neutral) < 0.05 * (row.high - row.low):
            result[row.name] = row.neutral + 0.5 * (row.high - row.neutral)
        else:
            result[row.name] = 0.5 * (row.low + row.high)
    return result


def recorded(effect: str, like: Recording, duration: float, seed: int) -> Recording:
    """What the machine with the effect would have recorded with the same currents for ``duration`` [s]."""
    machine = load_machine("tz17").with_effects({effect: middle(effect, duration)})
    driven = held_currents(like)
    first = {name: like.signals[name].values[:50] for name in ("angle", "hose_pressure", "rod_pressure")}
    angle, hose, rod = (float(np.nanmean(values)) for values in first.values())

    def run(rise: float) -> Recording:
        return simulate(
            machine, like.configuration, CraneStart(angle + rise, hose, rod), driven.time, driven.values,
            noise=machine.sensor_noise(), seed=seed, duration=duration, name=f"{effect}, simulated",
        )  # fmt: skip

    if effect == "end_cushioning":  # nothing is told of the end of the stroke by a boom that does not come near it
        room = machine.angle_limits[1] - float(np.nanmax(like.signals["angle"].values))
        for share in np.arange(0.98, 0.0, -0.02):
            with suppress(
                SimulationError
            ):  # over the end: the same currents move it further where gravity's arm differs
                return run(share * room)
    return run(0.0)


def judged(effect: str, result: DiagnosisResult) -> bool:
    """Whether the effect is named first, or stands in the list of an ambiguous answer."""
    findings = result.document.findings
    if not findings:
        return False
    listed = [a.effect for a in findings[0].alternatives[:3]] if result.document.verdict == "ambiguous" else []
    return effect in (findings[0].effect, *listed)


def main(argv: list[str] | None = None) -> int:
    """Runs the effects and prints one line each."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    possible = [e.id for e in CATALOGUE if load_machine("tz17").structure.has(e.needs)]
    parser.add_argument("--effects", nargs="+", default=possible, metavar="ID", help="default: all that tz17 can have")
    parser.add_argument(
        "--bag", default=str(BAG), help="recording whose currents are used (default: bags/healthy/extended)"
    )
    parser.add_argument("--duration", type=float, metavar="S", help="how much of it [s] (default: all)")
    parser.add_argument("--seed", type=int, default=0, help="of the noise (default: 0)")
    parser.add_argument("--json", type=Path, metavar="PATH", help="results so far; read first and continued")
    args = parser.parse_args(argv)
    like = load(args.bag)
    duration = min(args.duration or like.duration, like.duration)
    done = json.loads(args.json.read_text()) if args.json and args.json.is_file() else {}
    for effect in args.effects:
        if effect in done:
            continue
        begin = perf_counter()
        try:
            result = diagnose([recorded(effect, like, duration, args.seed)], load_machine("tz17"), seed=args.seed)
        except ModelError as error:
            print(f"{effect}: {error}", file=sys.stderr)
            return 2
        findings = result.document.findings
        named = [[f.effect, round(f.confidence, 3)] for f in findings]
        done[effect] = {
            "right": judged(effect, result), "verdict": result.document.verdict, "named": named,
            "seconds": round(perf_counter() - begin, 1), "given": middle(effect, duration),
            "found": {k: round(e.value, 12) for k, e in findings[0].parameters.items()} if findings else {},
        }  # fmt: skip
        print(
            f"{'right' if done[effect]['right'] else 'WRONG':6} {effect:28} {done[effect]['verdict']:20} "
            f"{done[effect]['seconds']:5.0f} s {named}",
            flush=True,
        )
        if args.json:
            args.json.write_text(json.dumps(done, indent=1))
    wrong = [effect for effect in args.effects if not done[effect]["right"]]
    print(f"{len(args.effects) - len(wrong)} of {len(args.effects)} right; wrong: {', '.join(wrong) or 'none'}")
    return int(len(wrong) > ALLOWED)


if __name__ == "__main__":
    sys.exit(main())
