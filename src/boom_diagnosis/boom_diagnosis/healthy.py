"""A healthy machine driven by the same currents: what chance alone looks like in this very recording."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from boom_diagnosis.bag_samples import Bag, prepare
from boom_diagnosis.disturbances import Values
from boom_diagnosis.freerun import COMPARED
from boom_diagnosis.nuisances import clocks_in
from boom_diagnosis.prediction import CURRENT_NOISE, carrying
from boom_estimation.free_run import plant_for
from boom_input.channels import BY_NAME
from boom_model.machine import Machine
from boom_model.sensors import OUTPUTS
from boom_model.structure import CURRENTS, DRIVING
from boom_recording.recording import Recording
from boom_recording.writing import from_columns

Array = NDArray[np.float64]

LEAST = 10.0
"""s of a copy that is worth having, or ``COMPARED`` of a recording that is shorter itself."""


def simulated(bag: Bag, machine: Machine, values: Values, seed: int) -> Bag | None:
    """The recording as a machine with these numbers (and no effects) would have given it, as far as it runs.

    None where it is too short (``LEAST``): without what holds it, a boom may run into its stops.
    Its channels are as late as these numbers say. The measured currents stand for the true ones, in between one course of many;
    what the copy shows of them has their noise once more.
    """
    recording, currents = bag.recording, bag.currents
    plant = plant_for(recording, carrying(machine), "full")
    p = plant.p.copy()
    for name, value in bag.own_values(values).items():
        if name in plant.parameter_names:
            p[plant.parameter_names.index(name)] = value
    rng = np.random.default_rng(seed)
    grid = bag.grid[bag.grid <= currents.time[-1]]
    inputs = currents.drawn(rng)
    late = np.array(clocks_in(values) or (0.0,) * len(OUTPUTS))
    told = np.maximum(grid[:, None] - late, grid[0])  # when what a channel shows was
    times, where = np.unique(told, return_inverse=True)
    _, outputs, _, _ = plant.integrate(
        currents.time, inputs, times, bag.initial_state(plant, p), float(grid[0]), parameters=p
    )
    outputs = outputs[where.reshape(told.shape), np.arange(len(OUTPUTS))]
    reached = int(np.isfinite(outputs).all(axis=1).sum())  # behind a failure all are NaN
    grid, outputs = grid[:reached], outputs[:reached]
    if reached == 0 or grid[-1] < min(LEAST, COMPARED * bag.grid[-1]):
        return None
    measured = machine.sensor_noise().outputs(outputs, rng)
    columns = {name: measured[:, i] for i, name in enumerate(OUTPUTS)}
    copy: Recording = from_columns(recording.name, grid, columns, recording.configuration)
    known = (currents.time <= grid[-1]) & (True if currents.sampled is None else currents.sampled)
    time, true = currents.time[known], currents.values[known, : len(CURRENTS)]
    shown = np.maximum(true + CURRENT_NOISE * rng.standard_normal(true.shape), 0.0)
    driven = {"retract_current": shown[:, 0], "extend_current": shown[:, 1]}
    copy.signals |= from_columns(recording.name, time, driven, recording.configuration).signals
    copy.signals |= {
        name: signal for name, signal in recording.signals.items() if BY_NAME[name].joint or name in DRIVING
    }
    result = prepare(copy, machine)
    if result is None:
        return None
    result = replace(result.straying(currents.strays), places=bag.places)
    count = min(len(result.counted), len(bag.counted))
    result.counted[:count] &= bag.counted[:count]
    return result
