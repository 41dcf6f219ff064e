"""Many runs at once on all cores, each with its own parameters, inputs and initial state, of one plant or several.

The integrator releases Python's lock, so threads suffice.
"""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from boom_model.cores import usable_cores
from boom_model.plant import Plant

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Job:
    """One run of a batch; shapes, units and rules as for ``Plant.run``.

    Attributes:
        plant: plant with the equations.
        parameters: (NP,) in the order of ``plant.parameter_names``; they also set the delays.
        input_time, currents: (m,) [s], (m, 2) [A].
        output_time: (n,) [s].
        initial_state: (NX,) at ``start`` [s].
    """

    plant: Plant
    parameters: Array
    input_time: Array
    currents: Array
    output_time: Array
    initial_state: Array
    start: float


def run_jobs(
    jobs: Sequence[Job], *, tolerance: float = 1e-4, workers: int | None = None, stop: ctypes.c_int | None = None
) -> list[Array]:
    """Outputs (n, NY) of every job, NaN from where a run failed on.

    stop: set to non-zero from another thread to end all runs; an exception such as Ctrl-C in this thread does the same.

    Raises:
        ModelError: shapes that do not fit, values that are not finite.
    """
    halt = ctypes.c_int(0) if stop is None else stop

    def one(job: Job) -> Array:
        _, outputs, _, _ = job.plant.integrate(
            job.input_time, job.currents, job.output_time, job.initial_state, job.start,
            tolerance=tolerance, parameters=job.parameters, stop=halt,
        )  # fmt: skip
        return outputs

    if len(jobs) == 1:
        return [one(jobs[0])]
    with ThreadPoolExecutor(workers or usable_cores()) as pool:
        try:
            return list(pool.map(one, jobs))
        except BaseException:
            halt.value = 1
            pool.shutdown(cancel_futures=True)
            raise


def run_sets(
    plant: Plant,
    parameter_sets: ArrayLike,
    input_time: ArrayLike,
    currents: ArrayLike,
    output_time: ArrayLike,
    initial_state: ArrayLike,
    *,
    tolerance: float = 1e-4,
    workers: int | None = None,
) -> Array:
    """Outputs (M, n, NY) of runs of one plant with M parameter sets (M, NP); NaN from where a run failed on.

    The other arguments are those of `Plant.run`; for runs that differ in more than their parameters use `run_jobs`.
    """
    sets = np.ascontiguousarray(parameter_sets, dtype=float)
    t_in, u = np.asarray(input_time, dtype=float), np.ascontiguousarray(currents, dtype=float)
    t_out, x0 = np.asarray(output_time, dtype=float), np.asarray(initial_state, dtype=float)
    jobs = [Job(plant, p, t_in, u, t_out, x0, float(t_out[0])) for p in sets]
    return np.array(run_jobs(jobs, tolerance=tolerance, workers=workers)).reshape(len(sets), len(t_out), -1)
