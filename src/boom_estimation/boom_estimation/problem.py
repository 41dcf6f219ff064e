"""Experiments and unknowns together: predictions, their innovations, and their sensitivities by finite differences.

All runs of a call, whichever recording and parameter set they belong to, are one batch on all cores.
"""

from __future__ import annotations

import ctypes
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from boom_estimation.experiment import PreparedRecording, Segment
from boom_estimation.unknown import Unknown, parameters
from boom_estimation.whitening import PredictorGains, first_gains, gains
from boom_model.batch import run_jobs
from boom_model.observer import Job, Observed, observe_all
from boom_model.plant import FINE

Array = NDArray[np.float64]

FREE_TOLERANCE = 1e-5
"""Tolerance of the integrator in free runs that are only compared with the measurement."""


@dataclass
class EstimationProblem:
    """The unknowns to estimate, and the experiments.

    Attributes:
        experiments: recordings; names must differ.
        unknowns: in the order of z.
        stop: set to non-zero from another thread to end all runs.
    """

    experiments: Sequence[PreparedRecording]
    unknowns: Sequence[Unknown]
    stop: ctypes.c_int = field(default_factory=lambda: ctypes.c_int(0))

    @property
    def segments(self) -> list[tuple[PreparedRecording, Segment]]:
        """Every stretch, in order."""
        return [(e, s) for e in self.experiments for s in e.segments]

    def parameters(self, experiment: PreparedRecording, z: Array) -> Array:
        """Parameter vector (NP,) of an experiment's plant."""
        return parameters(experiment.plant, self.unknowns, z, experiment.name)

    def values(self, z: Array) -> Array:
        """The unknowns' numbers (m,) for z."""
        return np.array([u.value(float(v)) for u, v in zip(self.unknowns, z, strict=True)])

    def free_errors(self, z: Array) -> list[Array]:
        """Measured minus model (K, NY) [SI] of the free run of every segment; NaN without sample or behind a failure."""
        jobs = [e.free_run(s, self.parameters(e, z)) for e, s in self.segments]
        outputs = run_jobs(jobs, tolerance=FREE_TOLERANCE, stop=self.stop)
        return [s.measured - s.at_nodes(y) for (_, s), y in zip(self.segments, outputs, strict=True)]

    def observed(self, z: Array, gains: Sequence[PredictorGains], *, tolerance: float = FINE) -> list[Observed]:
        """Innovations and states of the observers of all segments. Differences of them need 1e-6 or finer."""
        return self.observed_with([{}], z, gains, tolerance=tolerance)[0]

    def observed_with(
        self,
        others: Sequence[Mapping[str, float]],
        z: Array,
        gains: Sequence[PredictorGains],
        *,
        tolerance: float = FINE,
    ) -> list[list[Observed]]:
        """The same for each of several sets of values of further parameters of the plants, by name; all in one batch."""
        jobs = [self._job(i, z, g, more) for more in others for i, g in enumerate(gains)]
        observed = observe_all(jobs, tolerance=tolerance)
        return [observed[k : k + len(gains)] for k in range(0, len(observed), len(gains))]

    def sensitivities(
        self,
        z: Array,
        gains: Sequence[PredictorGains],
        columns: Sequence[int] | None = None,
        *,
        steps: Array | None = None,
        tolerance: float = FINE,
    ) -> tuple[list[Array], list[Array]]:
        """Innovations (n, NY) [SI] and their derivatives by z (n, NY, m), zero for unknowns that a segment does not have.

        columns: the unknowns wanted, by index; all by default. steps: (m,) of z, of the finite differences.
        """
        wanted = range(len(self.unknowns)) if columns is None else columns
        jobs, places = [], []
        for i, (e, _) in enumerate(self.segments):
            jobs.append(self._job(i, z, gains[i]))
            places.append((i, -1, 0.0))
            for column, j in enumerate(wanted):
                unknown = self.unknowns[j]
                if unknown.bag and unknown.bag != e.name:
                    continue
                step = unknown.step if steps is None else float(steps[j])
                step = step if z[j] + step <= unknown.bounds[1] else -step
                moved = z.copy()
                moved[j] += step
                jobs.append(self._job(i, moved, gains[i]))
                places.append((i, column, step))
        innovations = [run.innovations for run in observe_all(jobs, tolerance=tolerance)]
        nominal = {i: seen for (i, column, _), seen in zip(places, innovations, strict=True) if column < 0}
        derivatives = [np.zeros((*nominal[i].shape, len(wanted))) for i in range(len(self.segments))]
        for (i, column, step), seen in zip(places, innovations, strict=True):
            if column >= 0:
                derivatives[i][:, :, column] = np.nan_to_num((seen - nominal[i]) / step)
        return [nominal[i] for i in range(len(self.segments))], derivatives

    def first_gains(self) -> list[PredictorGains]:
        """Initial gains for every segment."""
        return [first_gains(e, s) for e, s in self.segments]

    def gains(self, z: Array, along: Sequence[PredictorGains], *, level: float = 1.0) -> list[PredictorGains]:
        """New gains for every segment, linearised along the observers with z and the gains ``along``."""
        states = [run.states for run in self.observed(z, along, tolerance=FREE_TOLERANCE)]
        runs = [(e, s, self.parameters(e, z), x) for (e, s), x in zip(self.segments, states, strict=True)]
        return gains(runs, level=level)

    def _job(
        self, index: int, z: Array, gain: PredictorGains, others: Mapping[str, float] = MappingProxyType({})
    ) -> Job:
        experiment, segment = self.segments[index]
        p = self.parameters(experiment, z)
        for name, value in others.items():
            p[experiment.plant.parameter_names.index(name)] = value
        state = experiment.initial_state(segment, p)
        return experiment.plant, experiment.samples(segment, p), state, gain.gain, p
