"""A compiled model whose measured states are forced to what was measured, sample by sample; the others run free.

What an equation of a forced state leaves unexplained is then the fault of its own link, not of those before it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from boom_checks.even_series import PERIOD, EvenSeries
from boom_identification.signals import stretches
from boom_model.components.oil import VOID
from boom_model.plant import Plant

Array = NDArray[np.float64]

MEASURED = ("angle", "rate", "hose_pressure", "rod_pressure", "head_pressure")
STEPS = 2
"""Of the free states between two samples."""
LEAST = 100
"""Samples of a stretch that is worth starting in."""
BLOCK = 6000
"""Samples whose inner quantities are made at once: of an hour all of them together would take a gigabyte."""


@dataclass(frozen=True)
class ForcedRun:
    """Derivatives of the forced states by the model (n,) [unit/s] and the inner quantities that were asked for (n,), by name."""

    rates: dict[str, Array]
    inner: dict[str, Array]


def forced_run(series: EvenSeries, plant: Plant, wanted: Sequence[str]) -> ForcedRun:
    """Steps the model over the recording; NaN where a measurement is missing or the free states left their range."""
    names = plant.state_names
    given = {"head_pressure": "hose_pressure"} if not plant.machine.separates else {}
    forced = [
        (k, series.smooth(given.get(n, n))) for k, n in enumerate(names) if given.get(n, n) in series and n in MEASURED
    ]
    inputs = np.column_stack((series.smooth("retract_current"), series.smooth("extend_current")))
    known = np.logical_and.reduce([np.isfinite(v) for _, v in forced]) & np.isfinite(inputs).all(axis=1)
    states = np.full((len(series.time), len(names)), np.nan)
    rates = {names[k]: np.full(len(states), np.nan) for k, _ in forced}
    where, values = [k for k, _ in forced], np.column_stack([v for _, v in forced])
    inputs = np.maximum(inputs, 0.0)
    for first, end in stretches(known):
        if end - first >= LEAST:
            _stretch(plant, first, end, where, values, inputs, states, rates)
    inner = {name: np.full(len(states), np.nan) for name in wanted}
    for reached in np.array_split(np.flatnonzero(np.isfinite(states).all(axis=1)), len(states) // BLOCK + 1):
        if len(reached):
            found = plant.auxiliary(states[reached], inputs[reached])
            for name, values in inner.items():
                values[reached] = found[name]
    return ForcedRun(rates, inner)


def _stretch(
    plant: Plant, first: int, end: int, where: list[int], values: Array, inputs: Array, states: Array,
    rates: dict[str, Array],
) -> None:  # fmt: skip
    """Linearly implicit Euler steps of the free states alone: a forced one must not move on its own between two samples."""
    names = plant.state_names
    begin = dict(zip((names[k] for k in where), values[first], strict=True))
    pressure = begin.get("hose_pressure", begin.get("head_pressure", 0.0))
    x = plant.rest_state(begin["angle"], pressure, begin["rod_pressure"])
    free = np.setdiff1d(np.arange(len(names)), where)
    lowest = plant.lowest(VOID)  # no linear step leads out of a void
    block, stiff = np.ix_(free, free), np.eye(len(free)) * STEPS / PERIOD
    for k in range(first, end):
        x[where] = values[k]
        for step in range(STEPS):
            rate, jacobian = plant.derivative(x, inputs[k])
            if step == 0:
                states[k] = x
                for column, at in zip(rates.values(), where, strict=True):
                    column[k] = rate[at]
            x[free] += np.linalg.solve(stiff - jacobian[block], rate[free])
            np.clip(x, lowest, plant.maximum, out=x)
        if not np.isfinite(x).all():
            return
