"""What the boom does, sample by sample: direction, speed, starts and stops, pressure level, ends of stroke."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from boom_diagnosis.bag_samples import PERIOD, Bag
from boom_diagnosis.document import Regime
from boom_model.sensors import OUTPUTS

Array = NDArray[np.float64]
Index = NDArray[np.int64]
Flags = NDArray[np.bool_]

STANDSTILL, FAST = 0.01, 0.15
"""rad/s."""
TRANSIENT = 0.4
"""s. So long behind a start, a stop or a reversal counts as part of it."""
NEAR = 0.1
"""s."""
WINDOW = 0.25
"""s. Resolution of the windows in which a mismatch shows."""

CELLS: tuple[tuple[str, str, str], ...] = (
    ("standstill", "rest", "standing still"),
    ("stopping", "rest", f"first {TRANSIENT:g} s after a stop"),
    ("starting to extend", "extending", f"first {TRANSIENT:g} s of a movement"),
    ("extending slowly", "extending", f"below {FAST:g} rad/s"),
    ("extending fast", "extending", f"above {FAST:g} rad/s"),
    ("starting to retract", "retracting", f"first {TRANSIENT:g} s of a movement"),
    ("retracting slowly", "retracting", f"below {FAST:g} rad/s"),
    ("retracting fast", "retracting", f"above {FAST:g} rad/s"),
)


@dataclass(frozen=True)
class Where:
    """When a mismatch shows: in words, and as (start, end) [s] of the first recording."""

    text: str
    intervals: tuple[tuple[float, float], ...]


def classify(bag: Bag) -> Index:
    """(n,) index into CELLS; -1 where the rate was not measured within ``NEAR``."""
    filled, known = bag.speed()
    kernel = np.ones(9) / 9
    smooth = np.convolve(filled, kernel, mode="same")
    direction = np.where(smooth > STANDSTILL, 1, np.where(smooth < -STANDSTILL, -1, 0))
    changed = [int(k) + 1 for k in np.flatnonzero(np.diff(direction) != 0)]
    since = np.full(len(direction), np.inf)
    for k in changed:
        until = min(len(since), k + round(TRANSIENT / PERIOD))
        since[k:until] = np.arange(until - k) * PERIOD
    new = since < TRANSIENT
    fast = np.abs(smooth) > FAST
    result = np.zeros(len(direction), dtype=np.int64)
    result[(direction == 0) & new] = 1
    for sign, first in ((1, 2), (-1, 5)):
        moving = direction == sign
        result[moving & new] = first
        result[moving & ~new & ~fast] = first + 1
        result[moving & ~new & fast] = first + 2
    beside = np.convolve(known, np.ones(2 * round(NEAR / PERIOD) + 1), mode="same") > 0.5
    result[~beside] = -1
    return result


def table(
    cells: list[Index], counted: Sequence[Flags], nominal: list[Array], explained: list[Array], healthy: Array
) -> tuple[Regime, ...]:
    """The map over regimes.

    counted: (n, NY) per recording, samples that tell; nominal, explained: whitened innovations; healthy: (NY,) mean squares.
    """
    index, tells = np.concatenate(cells), np.concatenate(list(counted))
    before, after = np.concatenate(nominal), np.concatenate(explained)
    regimes = []
    for k, (label, direction, detail) in enumerate(CELLS):
        inside = index == k
        count = int(inside.sum())

        def mean(w: Array, inside: Flags = inside) -> dict[str, float]:
            many = tells[inside].sum(axis=0)
            squares = np.sum(w[inside] ** 2, axis=0, where=tells[inside]) / np.where(many > 0, many, np.nan) / healthy
            return {name: float(v) for name, v in zip(OUTPUTS, squares, strict=True)}

        regimes.append(Regime(label, direction, detail, count * PERIOD, mean(before), mean(after)))  # type: ignore[arg-type]
    return tuple(regimes)


def windows(gain: Array, share: float = 0.8, longest: int = 6) -> tuple[tuple[float, float], ...]:
    """The stretches [s] that hold most of a gain (n,) [nats per interval]: joined windows, the first of them in time."""
    width = round(WINDOW / PERIOD)
    count = len(gain) // width
    if count == 0:
        return ()
    sums = np.maximum(gain[: count * width].reshape(count, width).sum(axis=1), 0.0)
    total = float(sums.sum())
    if total <= 0.0:
        return ()
    order = np.argsort(-sums)
    needed = int(np.searchsorted(np.cumsum(sums[order]), share * total)) + 1
    chosen = np.zeros(count, dtype=bool)
    chosen[order[: max(1, min(needed, count))]] = True
    edges = np.flatnonzero(np.diff(np.concatenate(([0], chosen.astype(int), [0]))))
    found = [(a, b, float(sums[a:b].sum())) for a, b in zip(edges[::2], edges[1::2], strict=True)]
    best = sorted(sorted(found, key=lambda f: -f[2])[:longest])
    return tuple((round(a * WINDOW, 2), round(b * WINDOW, 2)) for a, b, _ in best)


def where(cells: list[Index], gains: list[Array]) -> Where:
    """In which regimes an explanation gains, and when. gains: (n,) per recording, decrease of the loss per interval."""
    index, gain = np.concatenate(cells), np.maximum(np.concatenate(gains), -5.0)
    sums = np.array([float(gain[index == k].sum()) for k in range(len(CELLS))])
    total = float(np.maximum(sums, 0.0).sum())
    if total <= 0.0:
        return Where("no regime stands out", ())
    seconds = np.array([float((index == k).sum()) * PERIOD for k in range(len(CELLS))])
    sides = {
        "retracting": float(np.maximum(sums[5:8], 0).sum()),
        "extending": float(np.maximum(sums[2:5], 0).sum()),
        "at rest": float(np.maximum(sums[:2], 0).sum()),
    }
    main = max(sides, key=lambda k: sides[k])
    if sides[main] > 0.6 * total:
        text = main
    else:
        text = " and ".join(name for name, v in sorted(sides.items(), key=lambda s: -s[1]) if v > 0.25 * total)
    density = np.where(seconds > 0.3, sums / np.maximum(seconds, 0.3), 0.0)
    most = int(np.argmax(density))
    detail = f", most of all {CELLS[most][0]}"
    if sums[most] > 0.3 * total and CELLS[most][0] not in text:
        text += detail
    return Where(text or "everywhere", windows(gains[0]))
