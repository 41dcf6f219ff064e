"""Random, mutated and truncated frames against the checks of the bridge, for both shipped machines.

    python benchmarks/can_fuzz.py --frames 1000000 --seed 0

Exit status 1 if an exception left the checks or a bad value came out.
"""

import argparse
import time

from boom_can_bridge.codec import Codec
from boom_can_bridge.fuzz import fuzz


def main() -> int:
    """Run and print a table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--frames", type=int, default=1_000_000, help="frames, of each machine (default: 1000000)")
    parser.add_argument("--seed", type=int, default=0, help="seed (default: 0)")
    options = parser.parse_args()
    bad = 0
    print("| machine | frames | passed | dropped, by reason | exceptions | bad values | seconds |")
    print("|---|---|---|---|---|---|---|")
    for machine in ("tz17", "other_machine"):
        begin = time.monotonic()
        result = fuzz(Codec.load(machine), options.frames, options.seed)
        reasons = ", ".join(f"{name} {number}" for name, number in sorted((result.bad or {}).items()))
        print(
            f"| {machine} | {result.frames} | {result.readings} | {reasons} | {result.escaped} | {result.bad_values} "
            f"| {time.monotonic() - begin:.0f} |",
            flush=True,
        )
        bad += result.escaped + result.bad_values
    return 1 if bad else 0


if __name__ == "__main__":
    raise SystemExit(main())
