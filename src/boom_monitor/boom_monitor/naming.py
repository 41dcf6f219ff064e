"""Names the cause of an alarm: puts each suspect at several sizes into the model and runs it over the beginning of the alarm.

The score test of the filter shows that something is wrong, but is biased in naming the cause of a large mismatch. Here the model
with the suspect predicts the same samples again, with the same gains (:func:`boom_model.observer.observe`); the suspect that
leaves the smallest innovations is named. States, gains and samples of the last few seconds are stored for this.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from boom_model.observer import Samples, observe_all
from boom_monitor.model import Suspect, WatchModel

Array = NDArray[np.float64]

_SIZES = (0.04, 0.1, 0.2, 0.35, 0.6, 1.0)  # of the plausible range, to both sides where there are two
_MODEL_ERROR = (
    10.0  # so many samples count as one: what is left of a wrong model is not independent from sample to sample
)


@dataclass(frozen=True)
class Interval:
    """One period of the filter.

    Attributes:
        begin, end: [s]. state: (n,) at its beginning. currents: (from when, retract, extend) that acted.
        measured, share: (NY,) as `WatchFilter.advance` got them. gain: (n, NY). whitening: (NY, NY), zero rows where
            nothing was measured.
    """

    begin: float
    end: float
    state: Array
    currents: Sequence[tuple[float, float, float]]
    measured: Array
    share: Array
    gain: Array
    whitening: Array


@dataclass(frozen=True)
class Named:
    """The suspect that explains most, its size [its unit], and each subsystem's share, the largest first."""

    suspect: Suspect
    size: float
    share: dict[str, float]


def name(model: WatchModel, intervals: Sequence[Interval]) -> Named | None:
    """Name the cause over the given intervals, without gaps; None if no suspect explains anything."""
    samples = _samples(intervals)
    gain = np.array([i.gain for i in intervals])
    whitening = np.array([i.whitening for i in intervals])
    index = {n: i for i, n in enumerate(model.plant.parameter_names)}
    tried: list[tuple[Suspect, float]] = []
    sets = [model.plant.p]
    for suspect in model.suspects:
        for limit in (suspect.low, suspect.high):
            for share in _SIZES if limit != 0.0 else ():
                changed = model.plant.p.copy()
                changed[index[f"effects.{suspect.effect}.{suspect.parameter}"]] += share * limit * suspect.scale
                tried.append((suspect, share * limit * suspect.scale))
                sets.append(changed)
    runs = observe_all([(model.plant, samples, intervals[0].state, gain, p) for p in sets])
    left = np.array([_square(run.innovations, samples.measured, whitening) for run in runs])
    best = int(np.argmin(left))
    if best == 0:
        return None
    count = max(1.0, float(np.isfinite(samples.measured).sum()))
    spread = 2.0 * _MODEL_ERROR * max(1.0, left[best] / count)
    weight: dict[str, float] = {}
    for (suspect, _), square in zip(tried, left[1:], strict=True):
        likely = math.exp(-(square - left[best]) / spread) if math.isfinite(square) else 0.0
        weight[suspect.subsystem] = max(weight.get(suspect.subsystem, 0.0), likely)
    total = sum(weight.values())
    suspect, size = tried[best - 1]
    return Named(suspect, size, {n: weight[n] / total for n in sorted(weight, key=lambda n: -weight[n])})


def _samples(intervals: Sequence[Interval]) -> Samples:
    inputs = [c for k, i in enumerate(intervals) for c in (i.currents if k == 0 else i.currents[1:])]
    # the first of an interval acts from its beginning on, whenever it was measured; only what is new is taken on
    for k, interval in enumerate(intervals):
        if k and interval.currents[0][1:] != intervals[k - 1].currents[-1][1:]:
            inputs.append((interval.begin, *interval.currents[0][1:]))
    inputs.sort(key=lambda c: c[0])
    grid = np.array([intervals[0].begin, *(i.end for i in intervals)])
    given = np.array(inputs)
    return Samples(
        grid, np.array([i.share for i in intervals]), np.array([i.measured for i in intervals]),
        np.ascontiguousarray(given[:, 0]), np.ascontiguousarray(given[:, 1:]),
    )  # fmt: skip


def _square(innovations: Array, measured: Array, whitening: Array) -> float:
    """Sum of the squared whitened innovations; infinite if the run did not reach its end."""
    if not np.array_equal(np.isfinite(innovations), np.isfinite(measured)):
        return math.inf
    white = np.einsum("kij,kj->ki", whitening, np.nan_to_num(innovations))
    return float(np.sum(white**2))
