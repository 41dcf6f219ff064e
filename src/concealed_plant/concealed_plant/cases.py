"""The cases of a trial of K, in an order without information: a function of seed and K only.

Kinds: ``effect`` (each of the 29 at 0.5, 1 and 3 times its detectability), ``healthy``, ``parameters`` (one to three numbers
wrong by 1-4 standard deviations), ``pair`` (two effects of different subsystems), ``outside`` (physics that is in no catalogue)
and ``idle`` (too little excitation, with or without an effect).
"""

from __future__ import annotations

from dataclasses import dataclass
from hashlib import sha256

import numpy as np

from concealed_plant.concealments import CONCEALMENTS, KNOWN, OUTSIDE

SHARES = {"effect": 0.58, "healthy": 0.12, "parameters": 0.10, "pair": 0.08, "outside": 0.08, "idle": 0.04}
STRENGTHS = (0.5, 1.0, 3.0)
"""Multiples of the detectability."""
STRONG = (1.0, 3.0)


@dataclass(frozen=True)
class CaseSpec:
    """One case before it is made.

    Attributes:
        name: name of its folder, without information.
        seed: seed of all random numbers of the case.
        kind: see above.
        effects: ids with their strength in multiples of the detectability.
    """

    name: str
    seed: tuple[int, int]
    kind: str
    effects: tuple[tuple[str, float], ...] = ()


def cases(seed: int, count: int) -> list[CaseSpec]:
    """The trial's cases.

    Raises:
        ValueError: fewer than one case.
    """
    if count < 1:
        raise ValueError(f"{count} cases: at least one is needed")
    rng = np.random.default_rng([seed, 0])
    numbers = _shared_out(count)
    drawn: list[tuple[str, tuple[tuple[str, float], ...]]] = []
    ladder = [(name, strength) for strength in STRENGTHS for name in KNOWN]
    drawn += [("effect", (ladder[k],)) for k in _rounds(len(ladder), numbers["effect"], rng)]
    drawn += [("healthy", ())] * numbers["healthy"]
    drawn += [("parameters", ())] * numbers["parameters"]
    drawn += [("pair", pair(rng)) for _ in range(numbers["pair"])]
    outside = [(name, strength) for strength in STRONG for name in OUTSIDE]
    drawn += [("outside", (outside[k],)) for k in _rounds(len(outside), numbers["outside"], rng)]
    for k in range(numbers["idle"]):
        chosen = ((str(rng.choice(KNOWN)), 1.0),) if k % 2 else ()
        drawn.append(("idle", chosen))
    order = rng.permutation(len(drawn))
    return [
        CaseSpec(sha256(f"{seed}/{count}/{k}".encode()).hexdigest()[:10], (seed, 1 + k), *drawn[index])
        for k, index in enumerate(order)
    ]


def pair(rng: np.random.Generator) -> tuple[tuple[str, float], ...]:
    """Two known effects of different subsystems, both well visible, and not both with a course over time."""
    while True:
        first, second = (str(name) for name in rng.choice(KNOWN, size=2, replace=False))
        if not set(CONCEALMENTS[first].subsystems) & set(CONCEALMENTS[second].subsystems):
            return ((first, 3.0), (second, 3.0))


def _shared_out(count: int) -> dict[str, int]:
    """Cases per kind: the shares, rounded so that they add up to ``count``; the remainder goes where most is missing."""
    exact = {kind: share * count for kind, share in SHARES.items()}
    whole = {kind: int(value) for kind, value in exact.items()}
    for kind in sorted(exact, key=lambda kind: whole[kind] - exact[kind])[: count - sum(whole.values())]:
        whole[kind] += 1
    return whole


def _rounds(size: int, count: int, rng: np.random.Generator) -> list[int]:
    """``count`` indices below ``size``: each once in random order before any comes again."""
    result: list[int] = []
    while len(result) < count:
        result += [int(k) for k in rng.permutation(size)]
    return result[:count]
