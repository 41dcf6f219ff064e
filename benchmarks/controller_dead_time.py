"""What a dead time between samples and currents costs in tracking, and what is left of it once the control law is told.

    ./boom python benchmarks/controller_dead_time.py

The closed loop in one process (full model, sensors of ch. 6.4), where each command acts so long after the sample that it answers.
Ratios are MAE of the piston against the loop without dead time. Told: the law knows how old its samples are.
"""

from __future__ import annotations

import argparse
import math
from pathlib import Path

from boom_controller.controller import MODES, Settings, make_controller
from boom_controller.references.trajectory_generator import TrajectoryGenerator
from boom_model.errors import SimulationError
from boom_model.machine_file import shipped_machine
from boom_recording.loading import load
from boom_recording.recording import Recording
from boom_report.tracking import position_error
from boom_sim.simulated_crane import PERIOD, CraneStart, SimulatedCrane
from boom_trials.closed_loop import follow, wanted_angles

BAGS = ("healthy/folded_fast", "healthy/extended", "healthy/extended_log")
DEAD_TIMES_MS = (1.0, 2.0, 4.0, 9.9)


def mean_error(recording: Recording, mode: str, seconds: float, dead_time: float, age: float) -> float:
    """MAE of the piston [m]; NaN where the loop diverges."""
    c = recording.configuration
    machine = shipped_machine(c.machine)
    pose = machine.pose(c.outer_boom_angle, c.telescope_length, 0.0 if math.isnan(c.load_mass) else c.load_mass)
    wanted = wanted_angles(recording)[: round(seconds / PERIOD)]
    settings = Settings()
    try:
        result = follow(
            SimulatedCrane(machine, pose, CraneStart(float(wanted[0])), machine.sensor_noise()),
            make_controller(mode, machine, pose, settings), TrajectoryGenerator(settings.generator_pole, PERIOD), wanted, c,
            dead_time=dead_time, age=age,
        )  # fmt: skip
    except SimulationError:
        return math.nan
    return position_error.of_recording(result, machine).errors.mae


def main() -> None:
    """Runs and prints."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--mode", default="improved", choices=MODES, help="control law (default: improved)")
    parser.add_argument("--seconds", type=float, default=30.0, help="how much of each recording [s] (default: 30)")
    args = parser.parse_args()
    for bag in BAGS:
        recording = load(Path(__file__).parents[1] / "bags" / bag)
        at_once = mean_error(recording, args.mode, args.seconds, 0.0, 0.0)
        print(f"{bag}, {args.mode}: {1e3 * at_once:.4f} mm without dead time", flush=True)
        for dead_time in (1e-3 * value for value in DEAD_TIMES_MS):
            ratios = [
                mean_error(recording, args.mode, args.seconds, dead_time, age) / at_once for age in (0.0, dead_time)
            ]
            print(f"  {1e3 * dead_time:4.1f} ms: not told {ratios[0]:.2f}, told {ratios[1]:.2f} times", flush=True)


if __name__ == "__main__":
    main()
