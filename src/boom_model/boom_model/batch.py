"""Many runs at once, on all cores: each with parameters, inputs and initial state of its own, of one plant or of several.

The integrator holds no lock of Python, so that threads are enough.
"""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from os import cpu_count
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from boom_model.plant import Plant

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Job:
    """One run of a batch; shapes, units and rules as for ``Plant.run``.

    Attributes:
        plant: whose equations.
        parameters: (NP,) in the order of ``plant.parameter_names``; they decide the delays, too.
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
    """Outputs (n, 4) of every job, NaN from where a run failed on.

    stop: set to non-zero from another thread to end all runs; an exception such as Ctrl-C in this one does it, too.

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
    with ThreadPoolExecutor(workers or cpu_count()) as pool:
        try:
            return list(pool.map(one, jobs))
        except BaseException:
            halt.value = 1
            pool.shutdown(cancel_futures=True)
            raise
