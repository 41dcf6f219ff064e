"""Which minutes of a long recording are screened first: those that together show most of how the machine was worked.

The screen's derivatives cost more than all else that is done with a recording, and a machine at work repeats itself. The minutes
are put into an order by how the boom was moved, measured, and never by how well the model predicts them: minutes that were chosen
because they fit badly would make a sound machine look changed. With phi(t) = (1, x, x^2), apart for standing, extending and
retracting,

    x = angle, rate, both pressures, both currents, and how the rate and the pressures change        of unit variance
    M_k = sum of phi phi' over minute k, in units of its mean over the whole recording

the next minute is the one that adds most to log det(I + sum M_k) (``boom_estimation.design``): what the model's numbers do to a
prediction depends on where it is made. In this order minutes are screened until one has sharpened by less than
``boom_estimation.design.SHARPER`` what the recording says of the machine (:func:`lasting`).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from boom_estimation.design import knowledge, most_telling
from boom_fleet.evidence import spreads
from boom_fleet.judging import UNKNOWN
from boom_fleet.numbers import Numbers
from boom_input.channels import CURRENTS
from boom_model.sensors import OUTPUTS
from boom_recording.recording import Recording

Array = NDArray[np.float64]

PERIOD = 0.1
"""s. Of the samples that are looked at."""
STANDING = 0.02
"""rad/s."""
_SEEN = (*OUTPUTS, *(channel.name for channel in CURRENTS))
_CHANGING = OUTPUTS[1:]


def in_order(blocks: Sequence[Recording]) -> list[int]:
    """Indices of the blocks, the most telling first."""
    features = [_features(block) for block in blocks]
    together = np.concatenate(features) if features else np.zeros((0, 1))
    if len(together) == 0:
        return list(range(len(blocks)))
    scale = together.std(axis=0)
    x = [(f - together.mean(axis=0)) / np.where(scale > 0.0, scale, 1.0) for f in features]
    rows = [_spread_out(own, raw[:, OUTPUTS.index("rate")]) for own, raw in zip(x, features, strict=True)]
    everything = np.concatenate(rows)
    size, axes = np.linalg.eigh(everything.T @ everything / len(everything))
    kept = size > 1e-6 * size[-1]
    unit = axes[:, kept] / np.sqrt(size[kept])
    return [k for k, _ in most_telling([(r @ unit).T @ (r @ unit) for r in rows])]


def lasting(matrix: Array, numbers: Numbers) -> float:
    """What a recording's A (k, k) says of its machine and not of its day, as :func:`boom_estimation.design.knowledge`.

    What the numbers differ by from day to day, W, no length of a recording takes away: A' = (A^-1 + W^2)^-1, in units of what is
    known of the numbers beforehand.
    """
    effects = np.arange(len(matrix)) >= numbers.tolerated
    spread, wander = spreads(effects, numbers.own, *UNKNOWN)
    inner = np.linalg.inv(np.eye(len(matrix)) + wander[:, None] * matrix * wander)
    left = matrix - matrix @ (wander[:, None] * inner * wander) @ matrix
    return knowledge(spread[:, None] * left * spread)


def _features(block: Recording) -> Array:
    """(n, 9) what was measured, where all of it was."""
    columns = block.on_grid(PERIOD).columns
    series = [columns[name] for name in _SEEN]
    series += [np.gradient(columns[name], PERIOD) if len(columns[name]) > 1 else columns[name] for name in _CHANGING]
    table = np.stack(series, axis=-1)
    return table[np.isfinite(table).all(axis=1)]


def _spread_out(x: Array, rate: Array) -> Array:
    """(n, 3 (2 m + 1)) 1, x, x^2 of each way of moving; zero for the others."""
    each = np.concatenate([np.ones((len(x), 1)), x, x**2], axis=1)
    ways = (np.abs(rate) <= STANDING, rate > STANDING, rate < -STANDING)
    return np.concatenate([each * way[:, None] for way in ways], axis=1)
