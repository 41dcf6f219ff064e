"""Derivatives of an observer's innovations in many directions at once, by the sensitivities of the model.

S = dx/dz follows S' = df/dx S + df/dp dp/dz + df/du du/dz with the steps of the integrator, and is corrected as the state is.
Derivatives of f are exact (CasADi); where it has a kink, those of one side count. Sixty directions cost as much as four passes.
"""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from boom_model.compiled_model import pointer
from boom_model.cores import usable_cores
from boom_model.observer import Job, Observed, arguments, pool, sampled
from boom_model.sensors import OUTPUTS

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Directions:
    """M directions in which a pass moves.

    Attributes:
        numbers: (NP, M) dp. state: (NX, M) dx at the beginning.
        inputs: (m, NU) du of ``Samples.currents`` in the direction ``moved``; None: in none.
        share, measured: (n, NY) of those of the samples, of each channel in its direction ``timed`` (NY,); -1: in none.
    """

    numbers: Array
    state: Array
    moved: int = -1
    inputs: Array | None = None
    timed: tuple[int, ...] = (-1,) * len(OUTPUTS)
    share: Array | None = None
    measured: Array | None = None


def sensitivities(job: Job, along: Directions, *, tolerance: float = 1e-5) -> tuple[Observed, Array]:
    """One pass as ``observe``, and the derivatives (n, NY, M) of its innovations in these directions; 0 where none was."""
    plant, samples, initial_state, gain, parameters = job
    n, nx, m = len(samples.grid) - 1, len(plant.state_names), along.state.shape[1]
    x, p = np.array(initial_state, dtype=float), np.ascontiguousarray(parameters, dtype=float)
    plant.set_time(x, samples.grid[0])
    innovations, states, report = np.full((n, len(OUTPUTS)), np.nan), np.full((n, nx), np.nan), np.zeros(8)
    number, column = np.nonzero(along.numbers)
    first, columns = np.searchsorted(number, np.arange(len(p) + 1)).astype(np.int32), column.astype(np.int32)
    size, timed = np.ascontiguousarray(along.numbers[number, column]), np.array(along.timed, dtype=np.int32)
    inputs = np.ascontiguousarray(np.zeros_like(samples.currents) if along.inputs is None else along.inputs)
    share, measured = (
        np.zeros((n, len(OUTPUTS))) if a is None else np.ascontiguousarray(a) for a in (along.share, along.measured)
    )
    state, changes = np.array(along.state, dtype=float, order="C"), np.zeros((n, len(OUTPUTS), m))
    work, g = np.empty((4 * nx + 2 * len(OUTPUTS)) * m), np.ascontiguousarray(gain)
    whole = ctypes.POINTER(ctypes.c_int)
    plant.sensitive_to(_moved(job, along)).boom_sensitivity(
        *arguments(plant, samples, p, x, sampled(samples), g, innovations, states, tolerance, report), ctypes.c_long(m),
        first.ctypes.data_as(whole), columns.ctypes.data_as(whole), pointer(size), ctypes.c_long(along.moved), pointer(inputs),
        timed.ctypes.data_as(whole), pointer(share), pointer(measured), pointer(state), pointer(changes), pointer(work),
    )  # fmt: skip
    return Observed(innovations, states, int(report[0]) == 0), changes


def _moved(job: Job, along: Directions) -> frozenset[str]:
    """Effects whose numbers move."""
    names = (job[0].parameter_names[k] for k in np.flatnonzero(along.numbers.any(axis=1)))
    return frozenset(name.split(".")[1] for name in names if name.startswith("effects."))


def sensitivities_of(
    wanted: Sequence[tuple[Job, Directions]], *, tolerance: float = 1e-5, workers: int | None = None
) -> list[tuple[Observed, Array]]:
    """:func:`sensitivities` of several passes on all cores."""
    for job, along in wanted:
        job[0].sensitive_to(_moved(job, along))  # compiled here, once, and not in every thread
    return list(pool(workers or usable_cores()).map(lambda row: sensitivities(*row, tolerance=tolerance), wanted))
