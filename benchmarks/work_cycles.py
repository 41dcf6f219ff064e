"""Work cycles of the concealed plant, in which all joints move: `./boom validate` and `./boom diagnose` take them.

  ./boom python benchmarks/work_cycles.py --output output/work_cycles
  ./boom validate output/work_cycles/healthy_*
  ./boom diagnose output/work_cycles/load_a --hold-out output/work_cycles/load_b
  ./boom diagnose output/work_cycles/valve_lag_a --hold-out output/work_cycles/valve_lag_b

Each is 60 s long. What is hidden: 220 kg at the tip that the configuration does not tell; a hose burst valve whose poppet is
a critically damped mass of 22 rad/s, 90 ms late in a ramp, not the first-order lag of the catalogue.
"""

from __future__ import annotations

import argparse
from importlib.resources import files
from pathlib import Path

from boom_recording import writing
from concealed_plant.joint_work import work_recording
from concealed_plant.machine import MachineFile, Posture

HIDDEN = {"healthy": {}, "load": {"extra_load": 220.0}, "valve_lag": {"poppet_frequency": 22.0}}
POSE = Posture(0.6, 1.5, 0.0)


def main() -> None:
    """Write the recordings."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument(
        "--output", type=Path, required=True, metavar="FOLDER", help="of the bags; must not hold them yet"
    )
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args()
    machine = MachineFile.read(str(files("boom_model").joinpath("machines", "tz17.yaml")))
    for k, (name, changes) in enumerate(HIDDEN.items()):
        for j, letter in enumerate("ab"):
            recording = work_recording(f"{name}_{letter}", machine, POSE, changes, 100 * given.seed + 10 * k + j)
            writing.write(given.output / recording.name, recording)
            print(given.output / recording.name, flush=True)


if __name__ == "__main__":
    main()
