"""When an effect began in a recording that was not fitted: its time is that recording's own, all else is kept."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np
from numpy.typing import NDArray

from boom_diagnosis.fitting import Point, Problem
from boom_model.catalogue import EFFECTS

Array = NDArray[np.float64]

COARSE, FINE = 2.0, (0.5, 0.1, 0.03)
"""s. Distances of the times that are tried: first over the recording, then about the best."""
NEAR = 1.0
"""s."""


def onset_of(effect: str) -> str:
    """Dotted name of the time at which an effect begins."""
    return f"effects.{effect}.{EFFECTS[effect].onset}"


def time_in(values: Iterable[str]) -> str:
    """Dotted name of the time at which an effect among these begins; empty where none does."""
    return next((name for name in values if name == onset_of(name.split(".")[1])), "")


def onset(problem: Problem, z: Array, effects: Mapping[str, float]) -> float:
    """The likeliest time [s] of the load's change in the recording of ``problem``."""
    lasting = max(bag.recording.duration for bag in problem.predictor.bags)
    best = _best(problem, z, effects, np.arange(COARSE / 2, lasting, COARSE))
    span = COARSE
    for step in FINE:
        best = _best(problem, z, effects, np.arange(max(0.0, best - span), best + span, step))
        span = 2 * step
    return best


def near_onset(problem: Problem, at: Point) -> Point:
    """``at`` with the likeliest time of the load's change within ``NEAR`` of its own."""
    time = time_in(at.effects)
    moved = [
        (at.z, {**at.effects, time: max(0.0, at.effects[time] + float(d))})
        for d in np.arange(-NEAR, NEAR + 1e-9, FINE[1])
    ]
    return min([at, *problem.points(moved)], key=lambda p: p.loss)


def _best(problem: Problem, z: Array, effects: Mapping[str, float], times: Array) -> float:
    points = problem.points([(z, {**effects, time_in(effects): float(t)}) for t in times])
    return float(times[int(np.argmin([p.loss for p in points]))])
