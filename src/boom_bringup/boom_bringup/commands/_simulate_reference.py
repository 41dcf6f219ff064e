"""`./boom simulate --reference`: the boom follows the input's angle; the control law computes the currents."""

from __future__ import annotations

import argparse
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from boom_bringup.given import load_given

if TYPE_CHECKING:
    from boom_model.machine import Machine
    from boom_model.sensors import SensorNoise
    from boom_recording.recording import Configuration, Recording
    from boom_report.tracking.position_error import Tracking


@dataclass(frozen=True)
class Law:
    """How to follow it.

    mode   control law
    told   machine file of the control law
    """

    mode: str
    told: Machine


def load_reference(source: str | Path, args: argparse.Namespace) -> Recording:
    """Load the recording whose angle is the reference; nothing else of it is needed. Raises RecordingError."""
    from boom_recording.channels import JOINT_STATES, MACHINE_CONFIGURATION

    return load_given(source, args, require=(JOINT_STATES, MACHINE_CONFIGURATION))


def simulate_reference(
    recording: Recording,
    machine: Machine,
    configuration: Configuration,
    law: Law,
    *,
    angle: float | None,
    noise: SensorNoise,
    seed: int,
    duration: float | None,
    name: str,
) -> Recording:
    """Run the closed loop and show its progress.

    Args:
        recording: holds the reference.
        machine: of the crane, with its effects.
        configuration: pose and load, of the crane and of the control law.
        law: control law and its machine.
        angle: initial angle at rest [rad]; default: the first reference angle.
        noise: sensor noise.
        seed: seed of the noise.
        duration: [s]; default: the whole recording.
        name: name of the result.

    Raises:
        SimulationError: the loop diverged until a state left its range (an EndedEarlyError where something ran before).
    """
    import math

    from rich.progress import BarColumn, Progress, TextColumn

    from boom_controller.controller import Settings, make_controller
    from boom_controller.references.governor import Governor
    from boom_controller.references.trajectory_generator import TrajectoryGenerator
    from boom_model.derived import valve_currents
    from boom_report.console import console_for
    from boom_sim.simulated_crane import PERIOD, CraneStart, SimulatedCrane
    from boom_trials.closed_loop import follow, wanted_angles

    angles = wanted_angles(recording)
    if duration is not None:
        angles = angles[: max(round(duration / PERIOD), 1)]
    load = 0.0 if math.isnan(configuration.load_mass) else configuration.load_mass
    place = (configuration.outer_boom_angle, configuration.telescope_length, load)
    opened, largest = valve_currents(law.told)[1], Settings().largest_current
    settings = Settings(sample_time=PERIOD, largest_current=min(max(largest, opened), 1.5))  # its range's end
    controller = make_controller(law.mode, law.told, law.told.pose(*place), settings)
    generator = TrajectoryGenerator(settings.generator_pole, PERIOD)
    start = CraneStart(float(angles[0]) if angle is None else angle)
    crane = SimulatedCrane(machine, machine.pose(*place), start, noise, seed)
    columns = (TextColumn("{task.description}"), BarColumn(), TextColumn("{task.completed:.0f} of {task.total:.0f} s"))
    with Progress(*columns, console=console_for(sys.stderr), transient=True) as progress:
        task = progress.add_task(f"{law.mode} follows {recording.name}", total=len(angles) * PERIOD)
        governor = Governor(PERIOD)
        result = follow(
            crane, controller, generator, angles, configuration, name=name, governor=governor,
            told=lambda now: progress.update(task, completed=now),
        )  # fmt: skip
    if governor.slowed_once:
        print(
            f"valve and pump cannot follow the path: it was slowed, at most to {governor.least:.0%} of its speed, "
            f"and {governor.time:.1f} of {len(angles) * PERIOD:.1f} s of it were followed"
        )
    return result


def tracking_line(result: Recording, machine: Machine) -> str:
    """The tracking numbers of a result in one line."""
    from boom_report.tracking.position_error import of_recording

    found: Tracking = of_recording(result, machine)
    e = found.errors
    return f"piston position error: mean {1e3 * e.mae:.2f} mm, largest {1e3 * e.maxe:.2f} mm, rms {1e3 * e.rmse:.2f} mm"
