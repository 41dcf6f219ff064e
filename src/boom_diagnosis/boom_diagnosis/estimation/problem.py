"""Experiments and unknowns together: free runs, their errors, and their sensitivities by finite differences.

All runs of a call, whichever recording and parameter set they belong to, are one batch on all cores.
"""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from boom_diagnosis.estimation.experiment import Experiment, Segment
from boom_diagnosis.estimation.unknown import Unknown, parameters
from boom_diagnosis.estimation.whitening import Whitener, whitener
from boom_model.batch import Job, run_jobs
from boom_model.plant import FINE
from boom_model.sensors import OUTPUTS

Array = NDArray[np.float64]

DIVERGED = 25.0
"""Cost of a sample that a run did not reach: that of an innovation of five standard deviations."""


@dataclass
class Problem:
    """What is estimated from what.

    Attributes:
        experiments: recordings; names must differ.
        unknowns: in the order of z.
        tolerance: of the integrator. Finite differences need 1e-6 or finer.
        stop: set to non-zero from another thread to end all runs.
    """

    experiments: Sequence[Experiment]
    unknowns: Sequence[Unknown]
    tolerance: float = FINE
    stop: ctypes.c_int = field(default_factory=lambda: ctypes.c_int(0))

    @property
    def segments(self) -> list[tuple[Experiment, Segment]]:
        """Every stretch that is run, in order."""
        return [(e, s) for e in self.experiments for s in e.segments]

    def parameters(self, experiment: Experiment, z: Array) -> Array:
        """Parameter vector (NP,) of an experiment's plant."""
        return parameters(experiment.plant, self.unknowns, z, experiment.name)

    def values(self, z: Array) -> Array:
        """The unknowns' numbers (m,) for z."""
        return np.array([u.value(float(v)) for u, v in zip(self.unknowns, z, strict=True)])

    def errors(self, z: Array, *, everything: bool = False) -> list[Array]:
        """Measured minus model (K, 4) [SI] of the free run of every segment; NaN without sample or behind a failure.

        everything: to the end of each segment, not only as far as samples are used in the fit.
        """
        jobs = [self._job(e, s, z, everything) for e, s in self.segments]
        outputs = run_jobs(jobs, tolerance=self.tolerance, stop=self.stop)
        return [s.measured - _at_nodes(s, y) for (_, s), y in zip(self.segments, outputs, strict=True)]

    def sensitivities(
        self, z: Array, columns: Sequence[int] | None = None, *, everything: bool = False
    ) -> tuple[list[Array], list[Array]]:
        """Errors (K, 4) as of :meth:`errors` and d(model)/dz (K, 4, m), zero for unknowns that a segment does not have.

        columns: the unknowns wanted, by index; all by default.
        """
        wanted = range(len(self.unknowns)) if columns is None else columns
        jobs: list[Job] = []
        places: list[tuple[int, int, float]] = []
        for i, (e, s) in enumerate(self.segments):
            jobs.append(self._job(e, s, z, everything))
            places.append((i, -1, 0.0))
            for column, j in enumerate(wanted):
                unknown = self.unknowns[j]
                if unknown.bag and unknown.bag != e.name:
                    continue
                low, high = unknown.bounds
                step = unknown.step if z[j] + unknown.step <= high else -unknown.step
                moved = z.copy()
                moved[j] = min(max(z[j], low), high) + step
                jobs.append(self._job(e, s, moved, everything))
                places.append((i, column, step))
        outputs = run_jobs(jobs, tolerance=self.tolerance, stop=self.stop)
        nominal = {i: y for (i, column, _), y in zip(places, outputs, strict=True) if column < 0}
        errors = [s.measured - _at_nodes(s, nominal[i]) for i, (_, s) in enumerate(self.segments)]
        derivatives = [np.zeros((*s.where.shape, len(wanted))) for _, s in self.segments]
        for (i, column, step), y in zip(places, outputs, strict=True):
            if column >= 0:
                change = _at_nodes(self.segments[i][1], (y - nominal[i]) / step)
                derivatives[i][:, :, column] = np.nan_to_num(change)
        return errors, derivatives

    def whiteners(self, z: Array, *, level: float = 1.0, everything: bool = False) -> list[Whitener | None]:
        """One whitener for each segment, along the runs with z."""
        return [whitener(e, s, self.parameters(e, z), level=level, everything=everything) for e, s in self.segments]

    def _job(self, experiment: Experiment, segment: Segment, z: Array, everything: bool) -> Job:
        until = None if everything else segment.used_until
        return experiment.job(segment, self.parameters(experiment, z), until)


def _at_nodes(segment: Segment, outputs: Array) -> Array:
    """The model's outputs (n, 4) at the nodes' samples (K, 4); the run may have ended before the segment."""
    short = len(segment.times) - len(outputs)
    if short:
        outputs = np.concatenate((outputs, np.full((short, len(OUTPUTS)), np.nan)))
    return segment.at_nodes(outputs)
