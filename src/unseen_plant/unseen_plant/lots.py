"""The cases of a trial of K, in an order that tells nothing: a function of seed and K only."""

from __future__ import annotations

from dataclasses import dataclass, replace
from hashlib import sha256

import numpy as np

from unseen_plant.families import FAMILIES, gather, known, outside

SHARES = {"effect": 0.56, "healthy": 0.12, "parameters": 0.10, "pair": 0.10, "outside": 0.12}
STRENGTHS = (0.5, 1.0, 3.0)
"""Classes of visibility, in multiples of the 1 x size: faint, visible, strong."""
STRONG = (1.0, 3.0)


@dataclass(frozen=True)
class Lot:
    """One case before it is made.

    Attributes:
        name: of its folder; it tells nothing.
        seed: of all its random numbers.
        kind: see ``SHARES``.
        effects: names with their class of visibility.
        anything: whether structure and sensors are drawn, too.
    """

    name: str
    seed: tuple[int, int]
    kind: str
    effects: tuple[tuple[str, float], ...] = ()
    anything: bool = False


def lots(seed: int, count: int, anything: bool = False) -> list[Lot]:
    """The trial's cases. Raises ValueError for fewer than one."""
    if count < 1:
        raise ValueError(f"{count} cases: at least one is needed")
    gather()
    rng = np.random.default_rng([0x51, seed])
    exact = np.array(list(SHARES.values())) * count
    numbers = np.floor(exact).astype(int)
    numbers[np.argsort(numbers - exact, kind="stable")[: count - numbers.sum()]] += 1
    drawn: list[tuple[str, tuple[tuple[str, float], ...]]] = []
    for kind, number in zip(SHARES, numbers, strict=True):
        drawn += [(kind, effects) for effects in _effects(kind, int(number), rng)]
    order = rng.permutation(len(drawn))
    return [
        Lot(
            sha256(f"q/{anything}/{seed}/{count}/{k}".encode()).hexdigest()[:10],
            (seed, k + 1),
            drawn[at][0],
            drawn[at][1],
            anything,
        )
        for k, at in enumerate(order)
    ]


def _effects(kind: str, count: int, rng: np.random.Generator) -> list[tuple[tuple[str, float], ...]]:
    """What each of the cases of a kind conceals; each effect at each strength once before any comes again."""
    if kind == "pair":
        return [pair(rng) for _ in range(count)]
    if kind not in ("effect", "outside"):
        return [()] * count
    names, strengths = (known(), STRENGTHS) if kind == "effect" else (outside(), STRONG)
    ladder = [(name, strength) for strength in strengths for name in names]
    rounds = [int(k) for _ in range(count // len(ladder) + 1) for k in rng.permutation(len(ladder))]
    return [(ladder[k],) for k in rounds[:count]]


def redrawn(lot: Lot, turn: int) -> Lot:
    """The lot with other effects of its kind and class after ``turn`` vain turns, always the same ones."""
    if turn == 0 or not lot.effects:
        return lot
    rng = np.random.default_rng([*lot.seed, turn, 0x52])
    if lot.kind == "pair":
        return replace(lot, effects=pair(rng))
    names = known() if lot.kind == "effect" else outside()
    return replace(lot, effects=((str(rng.choice(names)), lot.effects[0][1]),))


def pair(rng: np.random.Generator) -> tuple[tuple[str, float], ...]:
    """Two known effects of different subsystems, both strong, at most one with an equation of motion of its own."""
    while True:
        first, second = (FAMILIES[str(name)] for name in rng.choice(known(), size=2, replace=False))
        if not set(first.subsystems) & set(second.subsystems) and not (first.coupled and second.coupled):
            return ((first.name, 3.0), (second.name, 3.0))
