"""A recording prepared for estimation: stretches for free runs, their initial states, and the samples that count.

Runs end and restart where ``boom_estimation.runs`` says. Samples are assigned to nodes, the stamps of the
currents, at which the noise is propagated (``whitening``); the model is sampled at the samples' own stamps.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from boom_estimation.currents import HeldCurrents, held_inputs
from boom_estimation.free_run import plant_for
from boom_estimation.initial_state import UNCERTAINTY, initial_state, means_at_rest, rest_end
from boom_estimation.runs import free_stretches
from boom_model.batch import Job
from boom_model.machine import Machine
from boom_model.observer import Samples
from boom_model.plant import Plant
from boom_model.sensors import OUTPUTS, PRESSURES
from boom_recording.recording import Recording, Signal

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]
Indices = NDArray[np.int64]

SHORTEST = 2.0
"""s. Shorter stretches give less information than the estimate of their initial state costs."""


@dataclass(frozen=True)
class Segment:
    """One stretch of a recording for a free run.

    Attributes:
        start, end: [s].
        rest: means of the outputs (``boom_model.sensors.OUTPUTS``) where the boom rests at the beginning, else None.
        moving_state: (NX,) state at ``start``, where the boom does not rest there.
        times: (n,) [s] stamps at which the model is sampled.
        nodes: (K,) [s] the stamps of the currents, filled up to one a period.
        where: (K, NY) index into ``times`` of the sample of each channel at each node, -1 where there is none.
        measured: (K, NY) what was measured there, SI; NaN where there is nothing.
        training: (K,) whether the samples of a node are used in a fit (else they are held out).
    """

    start: float
    end: float
    rest: dict[str, float] | None
    moving_state: Array | None
    times: Array
    nodes: Array
    where: Indices
    measured: Array
    training: Flags

    @property
    def stamps(self) -> Array:
        """(K, NY) [s] when it was measured; NaN where there is nothing."""
        return np.where(self.valid, self.times[np.maximum(self.where, 0)], np.nan)

    @property
    def valid(self) -> Flags:
        """(K, NY) whether there is a sample."""
        return self.where >= 0

    def at_nodes(self, outputs: Array) -> Array:
        """(K, NY) the model's outputs (n, NY) at the nodes' samples, NaN where there is none."""
        channel = np.arange(len(OUTPUTS))[None, :]
        return np.where(self.valid, outputs[np.maximum(self.where, 0), channel], np.nan)


@dataclass(frozen=True)
class PreparedRecording:
    """A recording with the model that has to reproduce it.

    Attributes:
        name: of the recording; unique among the experiments of a fit.
        plant: model in the pose of the recording, with the structure, including effects, that is estimated.
        currents: held currents.
        segments: stretches, in order.
        duration: [s] of the recording.
        period: [s] between two nodes: the median period of the currents.
    """

    name: str
    recording: Recording
    plant: Plant
    currents: HeldCurrents
    segments: tuple[Segment, ...]
    duration: float
    period: float

    def initial_state(self, segment: Segment, parameters: Array) -> Array:
        """State (NX,) at the start of a segment; at rest it follows from the parameters and the measured means."""
        if segment.rest is None:
            assert segment.moving_state is not None
            return segment.moving_state
        rest = self.plant.rest_state
        angle, hose, rod = segment.rest["angle"], segment.rest["hose_pressure"], segment.rest["rod_pressure"]
        acting = self.currents.at(segment.start)
        outputs = self.plant.outputs(rest(angle, hose, rod, parameters, acting), parameters=parameters)
        seen = dict(zip(OUTPUTS, outputs.tolist(), strict=True))
        # a biased sensor is seen through
        return rest(
            2 * angle - seen["angle"],
            2 * hose - seen["hose_pressure"],
            2 * rod - seen["rod_pressure"],
            parameters,
            acting,
        )

    def initial_spread(self, segment: Segment) -> Array:
        """Standard deviation (NX,) of that state."""
        spread = UNCERTAINTY if segment.rest is None else _SPREAD_AT_REST
        scale = self.plant.scale
        return np.array([spread.get(name, 1e-3 * s) for name, s in zip(self.plant.state_names, scale, strict=True)])

    def free_run(self, segment: Segment, parameters: Array) -> Job:
        """The free run of a segment, sampled at ``segment.times``."""
        state = self.initial_state(segment, parameters)
        return Job(
            self.plant, parameters, self.currents.time, self.currents.values, segment.times, state, segment.start
        )

    def samples(self, segment: Segment, parameters: Array) -> Samples:
        """Input of an observer of a segment: the samples of the node at the end of each interval.

        Delays are those of ``parameters``: the currents act later, and a pressure belongs to an earlier time.
        """
        command_delay, pressure_delay = self.plant.delays(parameters)
        measured = np.where(segment.training[:, None], segment.measured, np.nan)[1:]
        share = (segment.stamps[1:] - segment.nodes[:-1, None]) / np.diff(segment.nodes)[:, None]
        if pressure_delay != 0.0:
            periods = round(pressure_delay / self.period)
            n = len(measured)
            late = np.minimum(np.arange(n) + periods, n - 1)
            lost = np.arange(n) + periods >= n
            measured = np.where(PRESSURES, np.where(lost[:, None], np.nan, measured[late]), measured)
            share = np.where(PRESSURES, share[late] - (pressure_delay / self.period - periods), share)
        share = np.where(np.isfinite(measured), share, 1.0)
        return Samples(segment.nodes, share, measured, self.currents.time + command_delay, self.currents.values)


_SPREAD_AT_REST = {
    "angle": 1.5e-4, "rate": 1e-4, "head_pressure": 1e4, "rod_pressure": 5e3, "hose_pressure": 5e3,
    "accumulator_pressure_1": 1e4, "accumulator_pressure_2": 1e4, "spool_position": 1e-5, "spool_velocity": 1e-4,
    "pilot_retract": 1e-5, "pilot_extend": 1e-5,
}  # fmt: skip


def prepare(
    recording: Recording,
    machine: Machine,
    *,
    held_out: Sequence[tuple[float, float]] = (),
    name: str | None = None,
) -> PreparedRecording:
    """An experiment of a recording.

    Args:
        recording: the recording.
        machine: machine whose model has to reproduce it, including the effects to estimate.
        held_out: (start, end) [s] of the blocks that are not used in a fit.
        name: of the experiment, by default the recording's.

    Raises:
        MachineError: a pose or load that the machine cannot have.
    """
    plant = plant_for(recording, machine, "full")
    currents = held_inputs(recording, plant.machine)
    period = float(np.median(np.diff(currents.time))) if len(currents.time) > 1 else 0.01
    segments = []
    for start, end in free_stretches(recording, currents, plant.machine, plant.holds):
        if end - start < SHORTEST:
            continue
        segment = _segment(recording, plant, currents, start, end, period, held_out)
        if segment is not None:
            segments.append(segment)
    return PreparedRecording(
        name or recording.name, recording, plant, currents, tuple(segments), recording.duration, period
    )


def last_part(recording: Recording, share: float) -> list[tuple[float, float]]:
    """The last ``share`` of a recording as a block to be held out."""
    return [(recording.duration * (1.0 - share), recording.duration + 1.0)] if share > 0 else []


def _segment(
    recording: Recording,
    plant: Plant,
    currents: HeldCurrents,
    start: float,
    end: float,
    period: float,
    held_out: Sequence[tuple[float, float]],
) -> Segment | None:
    rest = means_at_rest(recording, start, rest_end(currents, start, end))
    state = None
    if rest is None:
        begin = initial_state(recording, plant, currents, start, end)
        if begin is None:
            return None
        state = begin.state
    chosen = {n: _chosen(recording.signals[n], start, end) for n in OUTPUTS}
    times = np.unique(np.concatenate([recording.signals[n].time[k] for n, k in chosen.items()]))
    if len(times) == 0:
        return None
    nodes = _nodes(currents.time, start, end, period)
    where = np.full((len(nodes), len(OUTPUTS)), -1, dtype=np.int64)
    measured = np.full((len(nodes), len(OUTPUTS)), np.nan)
    for i, n in enumerate(OUTPUTS):
        time = recording.signals[n].time[chosen[n]]
        node = _nearest(nodes, time)
        where[node, i] = np.searchsorted(times, time)
        measured[node, i] = recording.signals[n].values[chosen[n]]
    training = np.ones(len(nodes), dtype=bool)
    for first, last in held_out:
        training &= (nodes < first) | (nodes > last)
    return Segment(start, end, rest, state, times, nodes, where, measured, training)


def _chosen(signal: Signal, start: float, end: float) -> Indices:
    return np.flatnonzero(signal.valid & (signal.time >= start) & (signal.time <= end))


def _nodes(time: Array, start: float, end: float, period: float) -> Array:
    """The currents' stamps, where an interval of held input ends; evenly filled up where stamps are lost."""
    stamps = np.unique(time[(time >= start) & (time <= end)])
    pieces = []
    for left, right in pairwise(stamps):
        parts = max(1, round((right - left) / period))
        pieces.append(left + (right - left) / parts * np.arange(parts))
    last = stamps[-1] + period * np.arange(int((end - stamps[-1]) / period) + 1)
    return np.concatenate([*pieces, last])


def _nearest(nodes: Array, time: Array) -> Indices:
    right = np.clip(np.searchsorted(nodes, time), 1, len(nodes) - 1)
    return np.where(time - nodes[right - 1] < nodes[right] - time, right - 1, right).astype(np.int64)
