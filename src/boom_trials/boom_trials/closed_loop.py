"""The closed loop in one process: reference -> control law -> crane with its sensors, one sample time after the other. No ROS.

The same cores as the nodes use, without supervision: what the loop itself does. The crane is the simulated one of ``boom_sim``
(:func:`follow` makes a recording of it), or that of a study (``boom_trials.robustness.crane``).
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from boom_controller.references.governor import Governor, sampled
from boom_controller.references.trajectory_generator import TrajectoryGenerator
from boom_controller.types import Controller, ControlOutput, Measurement, Reference
from boom_input.channels import CURRENTS
from boom_model.errors import SimulationError
from boom_model.sensors import OUTPUTS
from boom_recording import writing
from boom_recording.recording import Configuration, Recording
from boom_sim.simulated_crane import PERIOD, CraneSample, EndedEarlyError, SimulatedCrane

Array = NDArray[np.float64]

_MEASURED = len(Measurement._fields) - 1  # a sample begins with what the control law sees of it


class Crane(Protocol):
    """What is controlled."""

    period: float
    """Sample time [s]."""

    @property
    def sample(self) -> CraneSample:
        """What the sensors show now."""

    def command(self, retract: float, extend: float, at: float | None = None) -> None:
        """Both currents [A] from ``at`` [s] on, within the period that follows."""

    def advance(self) -> CraneSample:
        """One period. Raises SimulationError where a state leaves its range."""


@dataclass
class LoopRun:
    """What happened, period by period.

    Attributes:
        samples: what the sensors showed at the beginning of each period, and after the last one that came to its end.
        outputs: of the control law, one a period, the last one included.
        references: that were followed, one a period: where the boom cannot follow, the given ones at a slower pace.
        failed: a state left its range in the last period; None if none did.
        stopped: (time [s], reason) where the control law asked to stop, with which the run ended.
        astray: beginning of the period [s] after which the crane was too far from its reference; None if it never was.
    """

    samples: list[CraneSample]
    outputs: list[ControlOutput] = field(default_factory=list)
    references: list[Reference] = field(default_factory=list)
    failed: SimulationError | None = None
    stopped: tuple[float, str] | None = None
    astray: float | None = None


def run(
    controller: Controller,
    crane: Crane,
    references: Sequence[Reference],
    *,
    dead_time: float = 0.0,
    age: float = 0.0,
    heed: bool = False,
    astray: Callable[[float], bool] | None = None,
    told: Callable[[float], None] | None = None,
    governor: Governor | None = None,
) -> LoopRun:
    """Runs the loop along the references, one each period, for as many periods.

    Args:
        controller: reset here, from what the sensors show at the beginning; its sample time is the crane's.
        crane: at time zero.
        references: one a period, the first at time zero.
        dead_time: from a sample until the command that answers it acts [s]; no current before.
        age: of the samples, as the control law is told [s].
        heed: the run ends where the control law asks to stop, as the supervision would.
        astray: whether the crane is too far from a wanted angle [rad] after a period, with which the run ends.
        told: called with the simulated time [s] once a second.
        governor: slows the references along themselves where the boom cannot follow, as the controller's node does.
    """
    periods = int(dead_time / crane.period + 1e-9)
    rest = dead_time - periods * crane.period
    waiting = deque([(0.0, 0.0)] * periods)
    sample = crane.sample
    result = LoopRun([sample])
    outputs, samples = result.outputs, result.samples
    step, command, advance = controller.step, crane.command, crane.advance
    every = round(1.0 / crane.period)
    measurement = Measurement._make((*sample[:_MEASURED], age))
    controller.reset(measurement)
    if governor:
        governor.start(sampled(references, crane.period), -crane.period)
    for k, planned in enumerate(references):
        reference = governor.advance(crane.period) if governor else planned
        output = step(reference, measurement)
        if governor:
            governor.allow(output)
        outputs.append(output)
        result.references.append(reference)
        if heed and output.reason:
            result.stopped = (sample.time, output.reason)
            return result
        retract, extend = output.retract, output.extend
        if waiting:
            waiting.append((retract, extend))
            retract, extend = waiting.popleft()
        begin = sample.time
        command(retract, extend, begin + rest)
        try:
            sample = advance()
        except SimulationError as error:
            result.failed = error
            return result
        samples.append(sample)
        measurement = Measurement._make((*sample[:_MEASURED], age))
        if astray is not None and astray(reference.angle):
            result.astray = begin
            return result
        if told is not None and k % every == 0:
            told(begin)
    return result


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
    governor: Governor | None = None,
) -> Recording:
    """Let a crane at rest follow reference angles.

    Args:
        crane: at time zero; its sample time is that of controller and generator.
        controller: the control law.
        generator: smooths the reference angle.
        wanted: (n,) [rad], one for every period.
        configuration: configuration for the recording.
        name: of the recording.
        told: as in :func:`run`.
        dead_time: as in :func:`run`.
        age: as in :func:`run`.
        governor: as in :func:`run`.

    Returns:
        A recording with all signals of the machine, the commands, the wanted and the smooth reference.

    Raises:
        SimulationError: a state left its range; the loop has diverged. An EndedEarlyError if part of the run exists.
    """
    angles = wanted.tolist()
    generator.reset(angles[0])
    references = [generator.step(angle) for angle in angles]
    done = run(controller, crane, references, dead_time=dead_time, age=age, told=told, governor=governor)
    if done.failed is not None and len(done.samples) < 3:
        raise done.failed
    recording = _recording(name, done, angles, configuration)
    if done.failed is not None:
        raise EndedEarlyError(done.failed, recording)
    return recording


def _recording(name: str, done: LoopRun, angles: list[float], configuration: Configuration) -> Recording:
    """Every period that came to its end; measured currents are those at its end."""
    begins, ends = done.samples[:-1], done.samples[1:]
    n = len(ends)
    shown = {key: [getattr(s, key) for s in begins] for key in OUTPUTS}
    currents = {channel.name: [getattr(s, channel.name) for s in ends] for channel in CURRENTS}
    commands = {
        f"{side}_current_command": [getattr(o, side) for o in done.outputs[:n]] for side in ("retract", "extend")
    }
    smooth = {f"smooth_reference_{key}": [getattr(r, key) for r in done.references[:n]] for key in Reference._fields}
    columns = shown | currents | commands | {"reference_angle": angles[:n]} | smooth
    time: Array = np.arange(n, dtype=np.float64) * PERIOD
    return writing.from_columns(name, time, {key: np.array(v) for key, v in columns.items()}, configuration)


def wanted_angles(recording: Recording) -> Array:
    """The reference of a recording, one angle [rad] a period: its ``/boom/reference``, else its measured angle; held over gaps.

    Raises:
        ValueError: the recording has no valid angle.
    """
    signal = recording.signals.get("reference_angle") or recording.signals.get("angle")
    if signal is None or not signal.valid.any():
        raise ValueError(f"{recording.path}: it has no valid angle for a reference")
    time, values = signal.time[signal.valid], signal.values[signal.valid]
    grid = np.arange(math.floor(recording.duration / PERIOD + 1e-9) + 1) * PERIOD
    return np.asarray(values[np.maximum(np.searchsorted(time, grid + 0.5 * PERIOD) - 1, 0)], np.float64)
