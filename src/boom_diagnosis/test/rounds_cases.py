"""A case of the diagnosis whose fits are given."""

from types import SimpleNamespace
from typing import Any

import numpy as np
from diagnosis_samples import tz17

from boom_diagnosis.case import Case
from boom_diagnosis.fitting import WHITE, Point
from boom_diagnosis.search import Fitted
from boom_diagnosis.weighing import Weighed

SAMPLES = 10_000


def point(excess: float) -> Point:
    """A fit that loses so many nats more than white noise."""
    w, used = np.zeros(SAMPLES), np.ones(SAMPLES, dtype=bool)
    return Point(np.zeros(1), {}, w, used, WHITE * SAMPLES + excess, [], [])


def weighed(effect: str, gain: float, held_out_gain: float, base: float) -> Weighed:
    left = point(base - gain - held_out_gain)
    return Weighed(Fitted(effect, left, (), np.zeros((SAMPLES, 1)), gain, ()), gain, held_out_gain, 0.0)


def first_round() -> Any:
    """A case whose first round begins with 1000 nats too many."""
    made: Any = Case.__new__(Case)
    made.__dict__ |= {
        "machine": tz17(), "bags": [],
        "select": [np.ones((SAMPLES // 4, 4), dtype=bool)], "floor": WHITE, "proving": [], "taken": [], "disproved": [],
        "spared": {}, "weighed": [[]], "impossible": [], "trained": [point(1000.0)],
        "rounds": [SimpleNamespace(base=point(1000.0), problem=None, fitted=())],
    }  # fmt: skip
    return made
