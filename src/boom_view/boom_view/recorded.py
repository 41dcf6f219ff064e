"""A recording beside free runs of the model, as the page of the moving crane shows it."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from boom_estimation.free_run import predict
from boom_input.channels import CURRENTS, SENSORS
from boom_model.machine import Machine
from boom_recording.recording import Recording
from boom_report.view.scene import scene
from boom_report.view.series import Series, limits, on_grid

Array = NDArray[np.float64]

FINEST = 0.001
"""s. The page's grid is a whole number of these."""
MOST = 60_000
"""Samples a channel: ten minutes as they are, longer recordings thinned out."""


def series(recording: Recording, machine: Machine, start: float = 0.0, end: float = math.inf) -> Series:
    """What the page shows of [start, end] [s] of a recording.

    That is the measured channels and currents, and a free run of the full model where currents were recorded.

    Raises:
        MachineError: a pose or load that the machine cannot have.
    """
    driven = all(c.name in recording.signals and recording.signals[c.name].valid.any() for c in CURRENTS)
    run = predict(recording, machine, "full") if driven else None
    end = min(end, recording.duration)
    channels = (*SENSORS, *CURRENTS)
    there = {c.name: recording.signals[c.name] for c in channels if c.name in recording.signals}
    times = {name: signal.time - start for name, signal in there.items()}
    values = {name: np.where(signal.valid, signal.values, np.nan) for name, signal in there.items()}
    period = _period(recording)
    count = max(2, int((end - start) / period) + 1)
    measured = on_grid(times, values, period, count)
    models = {} if run is None else {"model": on_grid(times, run.values, period, count)}
    return Series(recording.name, period, measured, models, limits(machine)).thinned(MOST)


def _period(recording: Recording) -> float:
    """The page's grid [s]: the period of the angle."""
    apart = np.diff(recording.signals["angle"].time)
    return max(FINEST, round(float(np.median(apart)) / FINEST) * FINEST) if len(apart) else 0.01


def scene_of(recording: Recording, machine: Machine) -> dict[str, object]:
    """The drawing of the machine in the pose and with the load of a recording.

    Raises:
        MachineError: a pose or load that the machine cannot have.
    """
    c = recording.configuration
    load = 0.0 if math.isnan(c.load_mass) else c.load_mass
    return scene(machine, machine.pose(c.outer_boom_angle, c.telescope_length, load))
