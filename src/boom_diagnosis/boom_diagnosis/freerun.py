"""Free runs of the models that a diagnosis compares, and their errors: what the ladder and ``fit`` are made of."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from boom_diagnosis.bag_samples import at_stamps
from boom_diagnosis.prediction import CURRENT_NOISE
from boom_estimation.currents import held_inputs
from boom_estimation.free_run import FreeRun, plant_for, predict
from boom_model.errors import SimulationError
from boom_model.machine import Machine
from boom_model.plant import FAST
from boom_model.sensors import OUTPUTS
from boom_model.structure import CURRENTS
from boom_recording.recording import Recording

Array = NDArray[np.float64]
Errors = tuple[float, ...]
"""One per output."""
COMPARED = 0.9
"""Share of the samples that a run must reach to be compared with them."""
DRAWS = 16
"""Of noise, for what it leaves in a free run."""
TYPICAL = 4.0
"""Times the median of their mean squares, that the mean of alike ones does not reach (of a random walk: 1.7)."""
UNKNOWN: Errors = (float("nan"),) * len(OUTPUTS)


@dataclass(frozen=True)
class Span:
    """The part of a recording that is judged: from, to [s]; how far the samples of its currents stray [s].

    clocks: (NY,) how late its channels are [s]; empty if none is. resolution: (NY,) standard deviation of each sensor's noise [its
    unit]; empty if it has none.
    """

    recording: Recording
    start: float
    end: float
    strays: float = 0.0
    clocks: tuple[float, ...] = ()
    resolution: tuple[float, ...] = ()

    def spread(self) -> Errors:
        """(NY,) what errors are measured by: standard deviation of each channel, that of its noise at least where it stands still.

        NaN of a channel that has no samples here.
        """
        result = []
        for name, least in zip(OUTPUTS, self.resolution or (0.0,) * len(OUTPUTS), strict=True):
            signal = self.recording.signals[name]
            measured = signal.values[signal.valid & (signal.time >= self.start) & (signal.time <= self.end)]
            known = max(float(np.std(measured)), least) if len(measured) else 0.0
            result.append(known if known > 0.0 else float("nan"))
        return tuple(result)


@dataclass(frozen=True)
class Elsewhere:
    """A block of a long recording, that nothing is fitted to.

    later: how far behind the beginning of the first stretch that is searched it begins [s]; None in another recording.
    """

    recording: Recording
    later: float | None


def free_run(recording: Recording, machine: Machine) -> FreeRun:
    """The full model's free run over a recording."""
    return predict(recording, machine, "full")


def errors(span: Span, run: FreeRun) -> Errors:
    """Root mean square error over the spread of the measured channel, one per channel."""
    result = []
    late = span.clocks or (0.0,) * len(OUTPUTS)
    for name, lag, spread in zip(OUTPUTS, late, span.spread(), strict=True):
        signal = span.recording.signals[name]
        inside = (signal.time >= span.start) & (signal.time <= span.end)
        measured, said = at_stamps(signal, lag)[inside[signal.valid]], run.values[name][inside & signal.valid]
        known = np.isfinite(said)
        if known.sum() < COMPARED * len(measured):
            result.append(float("nan"))
            continue
        result.append(
            float(np.sqrt(np.mean((said[known] - measured[known]) ** 2))) / spread if known.any() else float("nan")
        )
    return tuple(result)


def noise_floor(span: Span, machine: Machine, seed: int) -> Errors:
    """The errors that the sensors' noise and that of the currents would leave if the model were exactly right.

    Root mean square of ``DRAWS``: the angle's, in which the currents' noise adds up, differs from one to the next threefold. Where
    a few diverge, as a valve that chatters makes them, it is at most twice the median: they say nothing of the others. Nor do those
    that leave the model's range; unknown where more than half do.
    """
    recording = span.recording
    plant = plant_for(recording, machine, "full")
    currents = replace(held_inputs(recording, plant.machine), strays=span.strays)
    rng = np.random.default_rng(seed)
    first = {n: recording.signals[n].values[recording.signals[n].valid][:50] for n in OUTPUTS}
    shown = {n: float(np.mean(values)) if len(values) else float("nan") for n, values in first.items()}
    x0 = plant.rest_state_measured(
        shown["angle"], shown["hose_pressure"], shown["rod_pressure"], inputs=currents.at(0.0)
    )
    grid = np.arange(currents.time[0], min(span.end, currents.time[-1]), 0.01)
    given = currents.values[:, : len(CURRENTS)]
    inside, squares = grid >= span.start, []
    try:
        exact = plant.run(currents.time, currents.values, grid, x0, tolerance=FAST).outputs
    except SimulationError:
        return UNKNOWN
    for _ in range(DRAWS):
        noisy = currents.drawn(rng)
        noisy[:, : len(CURRENTS)] += CURRENT_NOISE * rng.standard_normal(given.shape) * (given > 0.05)
        with suppress(SimulationError):  # one that leaves the model's range says nothing of the others
            other = plant.run(currents.time, noisy, grid, x0, tolerance=FAST).outputs
            measured = machine.sensor_noise().outputs(other, rng)
            squares.append(np.mean((measured[inside] - exact[inside]) ** 2, axis=0))
    if len(squares) < DRAWS // 2:
        return UNKNOWN
    return tuple((np.sqrt(typical(np.array(squares))) / span.spread()).tolist())


def typical(squares: Array) -> Array:
    """(NY,) mean of the draws' mean squares (draws, NY), at most ``TYPICAL`` times their median."""
    return np.asarray(np.minimum(np.mean(squares, axis=0), TYPICAL * np.median(squares, axis=0)))


def median(rows: Sequence[Errors]) -> Errors:
    """Channel by channel, over recordings; a run that ended early errs without end. NaN where that is the median."""
    if not rows:
        return UNKNOWN
    middle = np.median(np.nan_to_num(np.array(rows), nan=np.inf), axis=0)
    return tuple(np.where(np.isfinite(middle), middle, np.nan).tolist())
