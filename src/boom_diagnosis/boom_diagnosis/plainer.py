"""An effect without those of its numbers that gain too little to be needed."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from boom_diagnosis.coordinates import Coordinate, idle
from boom_diagnosis.fitting import Point, Problem
from boom_diagnosis.onset import neutral
from boom_model.catalogue import EFFECTS

Array = NDArray[np.float64]

TIMED = 100.0
"""Nats from which on an effect has a time of its own: a load that comes, or another step of it, a lag, or a wander."""


def plainer(
    problem: Problem, point: Point, jacobian: Array, names: tuple[Coordinate, ...], effect: str, *, iterations: int
) -> tuple[Point, Array, tuple[Coordinate, ...]]:
    """Point, jacobian and coordinates without the numbers of an effect that need states (``moving``), unless these gain ``TIMED``.

    Beside a wander that is not there an offset would be anything, and pay for both.
    """
    moving = {f"effects.{effect}.{number}" for number in EFFECTS[effect].moving}
    if moving.isdisjoint(c.name for c in names):
        return point, jacobian, names
    values = {name: neutral(name) if name in moving else value for name, value in point.effects.items()}
    kept = tuple(c for c in names if c.name not in idle(values))
    start = problem.points([(point.z, values)])[0]
    plain, own = problem.fit(start, jacobian[:, : len(point.z)], kept, iterations=iterations)
    return (point, jacobian, names) if plain.loss - point.loss > TIMED else (plain, own, kept)
