"""Free runs of the model over a recording, from the currents and the initial state only; ch. 5.6.

Runs end and restart where ``boom_estimation.runs`` says. Masked samples are not used. MAE is (5.48).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from boom_estimation.currents import HeldCurrents, driven, held_inputs
from boom_estimation.initial_state import InitialState, initial_state
from boom_estimation.runs import free_stretches
from boom_input.channels import PREDICTED
from boom_model.components.oil import VOID
from boom_model.equations import Kind
from boom_model.errors import SimulationError
from boom_model.machine import Machine
from boom_model.plant import Plant, Trajectory
from boom_model.sensors import OUTPUTS
from boom_recording.recording import Recording

Array = NDArray[np.float64]

TOLERANCE = 1e-5
_OF_OIL = ("head_pressure", "hose_pressure", "rod_pressure")
_SHOWN = next(sensor.shown for sensor in PREDICTED if sensor.is_pressure)
STATISTICS: dict[str, Callable[[Array], float]] = {
    "mae": lambda e: float(np.mean(np.abs(e))),
    "rmse": lambda e: float(np.sqrt(np.mean(e**2))),
}
"""What is said of errors (n,): mean absolute (5.48) and root mean square."""


@dataclass(frozen=True)
class Metrics:
    """Errors of a prediction against a measurement by key ("angle_mae_rad"), SI; None where nothing could be compared.

    The keys are those of the predicted channels (``boom_input.channels.Sensor.metric``), in their order.
    """

    values: Mapping[str, float | None]

    def __getitem__(self, key: str) -> float | None:
        """The error with this key."""
        return self.values[key]

    def document(self) -> dict[str, float | None]:
        """As in ``validate --json``."""
        return dict(self.values)


@dataclass(frozen=True)
class FreeRun:
    """Prediction of a model (or a bag made by one) for a recording.

    Attributes:
        label: ``full``, ``reduced`` or another word for the report.
        values: channel -> (n,) at that channel's own stamps, NaN without a prediction.
        runs: one sentence for each free run: start, end, and how its initial state was found.
        stopped: why a run ended before its end, empty if none ended early.
        evaporated: where the model's oil leaves a void; empty where it does not.
    """

    label: str
    values: Mapping[str, Array]
    metrics: Metrics
    runs: tuple[str, ...] = ()
    stopped: str = ""
    evaporated: str = ""


def predict(recording: Recording, machine: Machine, kind: Kind) -> FreeRun:
    """Free runs of one model over a recording, at the stamps of its channels; measured pressures and joints drive it, too.

    Raises:
        MachineError: a pose or load that the machine cannot have.
    """
    plant = plant_for(recording, machine, kind)
    currents = held_inputs(recording, plant.machine)
    times = {name: recording.signals[name].time for name in OUTPUTS}
    values = {name: np.full(len(time), np.nan) for name, time in times.items()}
    runs: list[str] = []
    stopped = evaporated = ""
    for start, end in free_stretches(recording, currents, plant.machine, plant.holds):
        begin = initial_state(recording, plant, currents, start, end)
        if begin is None:
            runs.append(f"{start:.2f} s to {end:.2f} s: not run, a channel has no valid sample to begin with")
            continue
        inside = {name: np.flatnonzero((time >= start) & (time <= end)) for name, time in times.items()}
        sampled = np.unique(np.concatenate([times[name][k] for name, k in inside.items()]))
        run, reason = _run(plant, currents, sampled, begin)
        stopped = stopped or reason
        if run is None:
            continue
        evaporated = evaporated or _evaporated(run)
        for name, k in inside.items():
            where = np.searchsorted(run.time, times[name][k])
            known = where < len(run.time)
            values[name][k[known]] = run.output(name)[where[known]]
        runs.append(f"{start:.2f} s to {end:.2f} s: {begin.how}")
    return FreeRun(kind, values, metrics(recording, values), tuple(runs), stopped, evaporated)


def _evaporated(run: Trajectory) -> str:
    """Where a pressure of a run is first so low that oil leaves a void; and which."""
    pressures = [name for name in _OF_OIL if name in run.state_names]
    below = {name: run.state(name) < VOID for name in pressures}
    first = min(
        ((float(run.time[np.argmax(where)]), name) for name, where in below.items() if where.any()), default=None
    )
    if first is None:
        return ""
    time, name = first
    lowest = f"{float(run.state(name).min()) * _SHOWN.scale:.3g} {_SHOWN.name}"
    return f"at {time:.1f} s first the model's {name.replace('_', ' ')} falls to {lowest}, where oil evaporates"


def _run(plant: Plant, currents: HeldCurrents, sampled: Array, begin: InitialState) -> tuple[Trajectory | None, str]:
    """The run at the times ``sampled`` (n,) [s], as far as it goes, and why it ended early (else empty)."""
    reached, stopped, dropped = sampled, "", 1
    while len(reached):
        try:
            run = plant.run(currents.time, currents.values, reached, begin.state, start=begin.time, tolerance=TOLERANCE)
            return run, stopped
        except SimulationError as error:
            stopped = stopped or str(error)
            # The range is checked at the end of a step, which may lie behind the last sample: some samples less, then.
            before = int(np.searchsorted(reached, error.time - 1e-6))
            reached = reached[: max(0, min(len(reached) - dropped, before))]
            dropped *= 2
    return None, stopped


def metrics(recording: Recording, values: Mapping[str, Array]) -> Metrics:
    """Errors of predicted values against the valid measured samples."""

    def errors(name: str) -> Array:
        signal = recording.signals[name]
        error = np.where(signal.valid, values[name] - signal.values, np.nan)
        return error[np.isfinite(error)]

    result: dict[str, float | None] = {}
    for sensor in PREDICTED:
        e = errors(sensor.name)
        for statistic in sensor.statistics:
            result[sensor.metric(statistic)] = STATISTICS[statistic](e) if len(e) else None
    return Metrics(result)


def plant_for(recording: Recording, machine: Machine, kind: Kind) -> Plant:
    """The model in the configured pose and with the load of a recording: the configured one (unknown: none), and its steps.

    What was measured of its inputs drives it: other joints that move, supply and tank pressure.

    Raises:
        MachineError: a pose or load that the machine cannot have, or joints that move and bodies that the file does not tell.
    """
    c = recording.configuration
    machine = driven(machine.carrying(recording.name), recording)
    load = 0.0 if math.isnan(c.load_mass) else c.load_mass
    return Plant(machine, machine.pose(c.outer_boom_angle, c.telescope_length, load), kind)
