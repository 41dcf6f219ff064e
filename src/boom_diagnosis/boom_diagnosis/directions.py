"""What of a pass over a recording moves with a hypothesis: numbers, initial state, inputs, when its samples were taken."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from boom_diagnosis.bag_samples import Bag
from boom_model.observer import Job
from boom_model.sensitivities import Directions

Array = NDArray[np.float64]


def directions(
    bag: Bag, job: Job, numbers: Sequence[Array], clocks: Sequence[tuple[float, ...]], step: float
) -> Directions:
    """From the pass ``job`` towards each of M sets of ``numbers`` (NP,), ``step`` away.

    clocks: how late each channel is (NY,) [s], or nothing where none is; of the pass, then of each set. Of dead times that of the
    command is told; one of the pressures takes samples to other intervals, and no tolerance is one.
    """
    plant, samples, x0, _, p = job
    states = [bag.initial_state(plant, there) for there in numbers]
    found = Directions(_changes(numbers, p) / step, _changes(states, x0) / step)
    timed, share, measured = [*found.timed], np.zeros_like(samples.share), np.zeros_like(samples.share)
    late = [np.array(row or np.zeros(len(timed))) for row in clocks]
    for k, there in enumerate(numbers):
        delayed, own = plant.delays(there)[0] != plant.delays(p)[0], np.flatnonzero(late[k + 1] - late[0])
        if not (delayed or len(own)):
            continue
        moved = bag.samples(*plant.delays(there), clocks[k + 1])
        if delayed:
            found = replace(found, moved=k, inputs=(moved.currents - samples.currents) / step)
        for j in own:
            timed[j] = k
            share[:, j] = (moved.share - samples.share)[:, j] / step
            measured[:, j] = np.nan_to_num(moved.measured - samples.measured)[:, j] / step
    return replace(found, timed=tuple(timed), share=share, measured=measured)


def _changes(there: Sequence[Array], here: Array) -> Array:
    """(.., M)."""
    return np.stack([other - here for other in there], axis=-1)
