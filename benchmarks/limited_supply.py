"""How the improved control law follows with a load on the crane's real supply of 250 bar and 84 l/min, extended boom.

    ./boom python benchmarks/limited_supply.py

The closed loop in one process (full model, sensors of ch. 6.4) over whole recorded trajectories. A load that the supply cannot hold
is recognised, and the boom stopped.
"""

from __future__ import annotations

import argparse
from pathlib import Path

from boom_trials.robustness.plants import TRAJECTORIES, PlantCase
from boom_trials.robustness.study import StudyRun, carry_out_one

FOLDER = str(Path(__file__).parents[1] / "bags")
LOADS_KG = (700.0, 2000.0)


def main() -> None:
    """Runs and prints."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--loads", nargs="+", type=float, default=LOADS_KG, metavar="KG", help="default: 700 2000")
    for load in parser.parse_args().loads:
        for bag in TRAJECTORIES["extended"]:
            result = carry_out_one(
                StudyRun("improved", bag, PlantCase(f"{load:g} kg", load), folder=FOLDER, limited=True)
            )
            said = f"MAE {1e3 * result.mae:.2f} mm" if result.finished else result.diverged
            if result.stopped is not None:
                said = f"stopped after {result.stopped[0]:.2f} s: {result.stopped[1]}"
            print(f"{load:g} kg, {bag}: {said}", flush=True)


if __name__ == "__main__":
    main()
