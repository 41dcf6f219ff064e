"""The closed loop in one process: wanted angles -> generator -> control law -> simulated crane -> recording. No ROS.

The same cores as the nodes use, without supervision: what the loop itself does, at 100 Hz, each command acting at once or after
a dead time.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from boom_controller.references.trajectory_generator import TrajectoryGenerator
from boom_controller.types import Controller, Measurement
from boom_model.errors import SimulationError
from boom_recording import writing
from boom_recording.recording import Configuration, Recording
from boom_sim.simulated_crane import PERIOD, EndedEarlyError, SimulatedCrane

Array = NDArray[np.float64]

_COLUMNS = (
    "angle", "rate", "hose_pressure", "rod_pressure", "retract_current", "extend_current", "retract_current_command",
    "extend_current_command", "reference_angle", "smooth_reference_angle", "smooth_reference_rate",
    "smooth_reference_acceleration", "smooth_reference_jerk",
)  # fmt: skip


def follow(
    crane: SimulatedCrane,
    controller: Controller,
    generator: TrajectoryGenerator,
    wanted: Array,
    configuration: Configuration,
    *,
    name: str = "closed loop",
    told: Callable[[float], None] | None = None,
    dead_time: float = 0.0,
    age: float = 0.0,
) -> Recording:
    """Lets a crane that rests follow wanted angles.

    Args:
        crane: at time zero; its sample time is that of controller and generator.
        controller: the control law.
        generator: makes the wanted angle smooth.
        wanted: (n,) [rad], one for every period.
        configuration: what the recording shall say.
        name: of the recording.
        told: called with the simulated time [s] once a second.
        dead_time: from a sample until the command that answers it acts [s], less than a period.
        age: of the samples, as the control law is told [s].

    Returns:
        A recording with all signals of the machine, the commands, the wanted and the smooth reference.

    Raises:
        SimulationError: a state left its range; the loop has diverged. An EndedEarlyError where something ran before.
    """
    generator.reset(float(wanted[0]))
    rows = np.empty((len(wanted), len(_COLUMNS)))

    def recorded(count: int) -> Recording:
        time: Array = np.arange(count, dtype=np.float64) * PERIOD
        columns = {column: rows[:count, i].copy() for i, column in enumerate(_COLUMNS)}
        return writing.from_columns(name, time, columns, configuration)

    sample = crane.sample
    for k, angle in enumerate(wanted.tolist()):
        measurement = Measurement(
            sample.time, sample.angle, sample.rate, sample.hose_pressure, sample.rod_pressure, age
        )
        if k == 0:
            controller.reset(measurement)
        reference = generator.step(angle)
        output = controller.step(reference, measurement)
        crane.command(output.retract, output.extend, sample.time + dead_time)
        try:
            after = crane.advance()
        except SimulationError as error:
            if k < 2:
                raise
            raise EndedEarlyError(error, recorded(k)) from None
        rows[k] = (
            sample.angle, sample.rate, sample.hose_pressure, sample.rod_pressure, after.retract_current,
            after.extend_current, output.retract, output.extend, angle, reference.angle, reference.rate,
            reference.acceleration, reference.jerk,
        )  # fmt: skip
        sample = after
        if told is not None and k % round(1 / PERIOD) == 0:
            told(k * PERIOD)
    return recorded(len(wanted))


def wanted_angles(recording: Recording) -> Array:
    """The reference of a recording, one angle [rad] a period: its ``/boom/reference``, else its measured angle; held over gaps.

    Raises:
        ValueError: nothing valid in it.
    """
    signal = recording.signals.get("reference_angle") or recording.signals.get("angle")
    if signal is None or not signal.valid.any():
        raise ValueError(f"{recording.path}: no valid angle in it that could be the reference")
    time, values = signal.time[signal.valid], signal.values[signal.valid]
    grid = np.arange(math.floor(recording.duration / PERIOD + 1e-9) + 1) * PERIOD
    return np.asarray(values[np.maximum(np.searchsorted(time, grid + 0.5 * PERIOD) - 1, 0)], np.float64)
