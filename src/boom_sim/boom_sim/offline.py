"""Simulates a whole run at once, from currents to a recording like the machine's. No ROS, no real time."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from boom_model.equations import Kind
from boom_model.errors import SimulationError
from boom_model.machine import Machine
from boom_model.plant import Plant
from boom_model.sensors import OUTPUTS, SensorNoise
from boom_recording import writing
from boom_recording.recording import Configuration, Recording
from boom_sim.simulated_crane import PERIOD, CraneStart, EndedEarlyError

Array = NDArray[np.float64]


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
) -> Recording:
    """Run a model on held currents and measure at 100 Hz.

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

    Raises:
        MachineError: an impossible pose or load.
        SimulationError: a state left its range; the message names it and the time. An EndedEarlyError if part of the run exists.
    """
    load = 0.0 if math.isnan(configuration.load_mass) else configuration.load_mass
    pose = machine.pose(configuration.outer_boom_angle, configuration.telescope_length, load)
    plant = Plant(machine.carrying(name), pose, kind)
    end = float(time[-1]) + PERIOD if duration is None else duration
    grid: Array = np.arange(math.floor(end / PERIOD + 1e-9) + 1, dtype=np.float64) * PERIOD
    initial = start.state(plant)
    try:
        outputs, ended = plant.run(time, currents, grid, initial, start=0.0, tolerance=1e-6).outputs, None
    except SimulationError as error:
        outputs, ended = plant.integrate(time, currents, grid, initial, 0.0, tolerance=1e-6)[1], error
        reached = int(np.argmin(np.append(np.isfinite(outputs).all(axis=1), False)))
        if reached < 2:
            raise
        grid, outputs = grid[:reached], outputs[:reached]
    rng = np.random.default_rng(seed)
    measured = noise.outputs(outputs, rng)
    result = writing.from_columns(name, grid, {o: measured[:, i] for i, o in enumerate(OUTPUTS)}, configuration)
    shown_time = _current_times(time, grid)
    acting = currents[np.maximum(np.searchsorted(time, shown_time + 1e-9, side="right") - 1, 0)]
    shown = noise.currents(acting, rng)
    columns = {"retract_current": shown[:, 0], "extend_current": shown[:, 1]}
    result.signals |= writing.from_columns(name, shown_time, columns, configuration).signals
    if ended is not None:
        raise EndedEarlyError(ended, result)
    return result


def _current_times(time: Array, grid: Array) -> Array:
    """Times at which the currents are measured: as given, and at 100 Hz where none is given within half a period."""
    inside = time[(time >= 0.0) & (time <= grid[-1])]
    if len(inside) == 0:
        return grid
    after = np.minimum(np.searchsorted(inside, grid), len(inside) - 1)
    distance = np.minimum(np.abs(inside[after] - grid), np.abs(inside[np.maximum(after - 1, 0)] - grid))
    return np.unique(np.concatenate((inside, grid[distance > 0.5 * PERIOD])))
