"""Simulates a whole run at once, from currents to a recording like the machine's. No ROS, no real time."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from boom_model import joint_motion
from boom_model.equations import Kind
from boom_model.errors import SimulationError
from boom_model.machine import Machine
from boom_model.plant import FINE, Plant
from boom_model.sensors import OUTPUTS, SensorNoise
from boom_recording import writing
from boom_recording.joint_motion import JointMotion
from boom_recording.recording import Configuration, Recording
from boom_sim.simulated_crane import PERIOD, CraneStart, EndedEarlyError
from boom_sim.work_cycle import measured as measured_joints

Array = NDArray[np.float64]
Series = tuple[Array, Array]

JOINT_STEP = 0.002
"""s. Far finer than the recording, so that it does not share the error of the model that holds the joints for a period."""


def simulate(
    machine: Machine,
    configuration: Configuration,
    start: CraneStart,
    time: Array,
    currents: Array,
    *,
    noise: SensorNoise,
    seed: int = 0,
    kind: Kind = "full",
    duration: float | None = None,
    name: str = "simulated",
    tolerance: float = FINE,
    motion: JointMotion | None = None,
    pressures: Mapping[str, Series] = MappingProxyType({}),
    loads_of: str = "",
    period: float = PERIOD,
) -> Recording:
    """Run a model on held currents and measure periodically.

    Args:
        machine: the machine with its effects.
        configuration: pose and load, also stored in the recording. An unknown load (NaN) counts as none.
        start: rest state at time zero.
        time: (m,) [s], ascending, start of each current.
        currents: (m, 2) [A]: retract, extend.
        noise: noise of the sensors. The currents in the recording are the given ones, as measured.
        seed: of the noise.
        kind: ``full`` or ``reduced``.
        duration: [s]; default: up to one period after the last current.
        name: of the recording.
        tolerance: relative, of the integration.
        motion: of the other joints; without, they are locked as configured.
        pressures: supply and tank pressure by channel, time (k,) [s] and value (k,) [Pa gauge]: they drive the model instead of its
            constants, between their samples by lines, and are in the recording as given.
        loads_of: the recording whose steps of the load act (``payload.recordings``); default: ``name``.
        period: of the sensors [s].

    Raises:
        MachineError: an impossible pose or load, or joints that move without bodies in the file.
        SimulationError: a state left its range; the message names it and the time. An EndedEarlyError if part of the run exists.
    """
    load = 0.0 if math.isnan(configuration.load_mass) else configuration.load_mass
    pose = machine.pose(configuration.outer_boom_angle, configuration.telescope_length, load)
    carrying = machine.carrying(loads_of or name).driven_by(pressures)
    plant = Plant(carrying if motion is None else carrying.with_moving_joints(), pose, kind)
    end = float(time[-1]) + period if duration is None else duration
    grid: Array = np.arange(math.floor(end / period + 1e-9) + 1, dtype=np.float64) * period
    driving = [pressures[channel] for channel in carrying.structure.driven]
    held, inputs = _inputs(machine, configuration, time, currents, driving, motion, end)
    initial = start.state(plant, inputs[0])
    try:
        outputs, ended = plant.run(held, inputs, grid, initial, start=0.0, tolerance=tolerance).outputs, None
    except SimulationError as error:
        outputs, ended = plant.integrate(held, inputs, grid, initial, 0.0, tolerance=tolerance)[1], error
        reached = int(np.argmin(np.append(np.isfinite(outputs).all(axis=1), False)))
        if reached < 2:
            raise
        grid, outputs = grid[:reached], outputs[:reached]
    rng = np.random.default_rng(seed)
    measured = noise.outputs(outputs, rng)
    shown_outputs = {o: measured[:, i] for i, o in enumerate(OUTPUTS)}
    if motion is not None:
        shown_outputs |= measured_joints(motion, grid, noise, rng)
    result = writing.from_columns(name, grid, shown_outputs, configuration)
    shown_time = _current_times(time, grid, period)
    acting = currents[np.maximum(np.searchsorted(time, shown_time + 1e-9, side="right") - 1, 0)]
    shown = noise.currents(acting, rng)
    columns = {"retract_current": shown[:, 0], "extend_current": shown[:, 1]}
    result.signals |= writing.from_columns(name, shown_time, columns, configuration).signals
    for channel, (sampled, values) in pressures.items():
        seen = sampled <= grid[-1]
        result.signals |= writing.from_columns(name, sampled[seen], {channel: values[seen]}, configuration).signals
    if ended is not None:
        raise EndedEarlyError(ended, result)
    return result


def _inputs(
    machine: Machine, configuration: Configuration, time: Array, currents: Array, driving: Sequence[Series],
    motion: JointMotion | None, end: float,
) -> tuple[Array, Array]:  # fmt: skip
    """From when each input acts, and the inputs of the plant; joints that move are held for ``JOINT_STEP``, as in its middle."""
    more = [sampled[(sampled > time[0]) & (sampled < end)] for sampled, _ in driving]
    more += [np.arange(0.0, end, JOINT_STEP)] if motion is not None else []
    if not more:
        return time, currents
    held = np.unique(np.concatenate((time, *more)))
    acting = np.maximum(np.searchsorted(time, held + 1e-9, side="right") - 1, 0)
    columns = [currents[acting], *(np.interp(held, sampled, values) for sampled, values in driving)]
    if motion is not None:
        pose, ends = (configuration.outer_boom_angle, configuration.telescope_length), np.append(held[1:], held[-1])
        columns.append(joint_motion.inputs(machine.document, pose, *motion.at(0.5 * (held + ends))))
    return held, np.column_stack(columns)


def _current_times(time: Array, grid: Array, period: float) -> Array:
    """Times at which the currents are measured: as given, and on the grid where none is given within half a period [s]."""
    inside = time[(time >= 0.0) & (time <= grid[-1])]
    if len(inside) == 0:
        return grid
    after = np.minimum(np.searchsorted(inside, grid), len(inside) - 1)
    distance = np.minimum(np.abs(inside[after] - grid), np.abs(inside[np.maximum(after - 1, 0)] - grid))
    return np.unique(np.concatenate((inside, grid[distance > 0.5 * period])))
