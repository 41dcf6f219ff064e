"""An unknown input of an equation over time, and what it is made of: products of states, direction and memory.

An observer made very loose follows the measured signals whatever the equations say; what it must add to an equation to do so is
that equation's unknown input. Where the mismatch is large it shows plainly what is missing, even where the one-step errors are so
large that their derivatives say nothing.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from boom_diagnosis.bag_samples import PERIOD
from boom_diagnosis.disturbances import Values, capacities
from boom_diagnosis.prediction import Predictor
from boom_model.learned import PLACES, VARIABLES, evaluate, state_of
from boom_model.observer import observe

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

FORCING = 200.0
"""Looseness of an observer that follows the measured signals whatever the equations say."""
SMOOTHED = 10
"""Intervals over which what it adds is averaged."""
CORNERS = 40
"""Places of a corner that are tried over the range of its variable."""
WORTH = 0.1
"""Share of what is left of the unknown input's power that a further product must explain."""
MOST_PRODUCTS = 4
FOLDS = 6
FORGOTTEN = 1e-12
"""Share of a past value below which a memory has lost it."""
ONE_SIDED = (
    "minus(angle,{})", "plus(angle,{})", "rate*below(angle,{})", "rate*above(angle,{})", "sign(rate)*below(angle,{})",
    "sign(rate)*above(angle,{})",
)  # fmt: skip
"""Springs, dampers and friction that are there beyond a corner only."""
OPENING = ("plus(head_pressure,{})", "plus(hose_pressure,{})", "plus(rod_pressure,{})")
"""Flows through what a pressure opens beyond a corner: a relief valve."""


@dataclass(frozen=True)
class Forced:
    """One recording: corrections per interval (n,) by state, smoothed over ``SMOOTHED`` intervals; states (n,) by name."""

    corrections: dict[str, Array]
    states: dict[str, Array]


@dataclass(frozen=True)
class Regression:
    """Products, their coefficients in units of the place's scale, and the share of the unknown input's power they explain.

    The share is of data not used: ``FOLDS`` parts of each recording, each explained with coefficients from all others.
    """

    basis: tuple[str, ...]
    coefficients: tuple[float, ...]
    share: float


def forced(predictor: Predictor, numbers: Values) -> list[Forced]:
    """What the observer must give to each state's equation, recording by recording."""
    loose = Predictor(predictor.machine, predictor.bags, numbers, FORCING)
    kernel = np.ones(SMOOTHED) / SMOOTHED
    result = []
    for i, bag in enumerate(predictor.bags):
        plant, samples, x0, gain, p = loose.job(i, numbers)
        seen = observe(plant, samples, x0, gain, parameters=p)
        e = np.where(np.isfinite(seen.innovations) & bag.counted, seen.innovations, 0.0)
        given = (gain @ e[:, :, None])[:, :, 0]
        corrections = {n: np.convolve(given[:, k], kernel, mode="same") for k, n in enumerate(plant.state_names)}
        result.append(Forced(corrections, {n: seen.states[:, k] for k, n in enumerate(plant.state_names)}))
    return result


def regress(
    found: Sequence[Forced],
    equation: str,
    state: str,
    number: Values,
    library: Sequence[str],
    select: Sequence[Flags],
    others: Sequence[Flags],
    term: Regression | None = None,
) -> Regression | None:
    """Least squares of the unknown input of ``equation``, on the derivative of ``state``, over products of ``library``.

    Taken one after the other, corners anywhere in the range of their variable. None where nothing explains anything.

    number: every component of the parameter vector. term: that the observer had already.
    select: (n, NY) per recording, samples that it is fitted to; others: that are predicted, too.
    """
    scale = capacities(number)[state] / PERIOD / PLACES[equation].scale
    variables = [_scaled(f.states, number.get("main_valve_spool.s_max", 1.0)) for f in found]
    counted = np.concatenate([s.any(axis=1) for s in select])  # channels may be sampled in turn
    known = counted | np.concatenate([s.any(axis=1) for s in others])

    def whole(text: str) -> Array:
        return np.concatenate([evaluate(text, v, _lagged) for v in variables])

    def column(text: str) -> Array:
        return np.asarray(whole(text)[counted])

    everything = np.concatenate([f.corrections[state] for f in found]) * scale
    for text, c in zip(term.basis, term.coefficients, strict=True) if term else ():
        everything = everything + c * whole(text)
    target = everything[counted]
    tried, widths = [*library], dict[str, float]()
    for template in ONE_SIDED if equation == "torque" else OPENING:
        variable = _cornered(template)
        if variable in variables[0]:
            seen = column(variable)
            corners, width = np.linspace(float(seen.min()), float(seen.max()), CORNERS, retstep=True)
            tried += [template.format(f"{c:.3f}") for c in corners]
            widths[variable] = float(width)
    columns = np.stack([column(text) for text in tried], axis=-1)
    basis: list[str] = []
    left = float(target @ target)
    while len(basis) < MOST_PRODUCTS:
        best = _most(columns, [column(text) for text in basis], target)
        extended = [*basis, tried[best]]
        for k, text in enumerate(extended):
            extended[k] = _placed(text, [t for i, t in enumerate(extended) if i != k], widths, column, target)
        rest = _left([column(text) for text in extended], target)[0]
        if left - rest < WORTH * left:
            break
        basis, left = extended, rest
    if not basis:
        return None
    sizes = _left([column(text) for text in basis], target)[1]
    folds = np.concatenate([np.arange(len(s)) * FOLDS // len(s) for s in select])[known]
    share = _share([whole(text)[known] for text in basis], everything[known], folds)
    return Regression(tuple(basis), tuple(float(c) for c in sizes), share)


def _share(columns: Sequence[Array], target: Array, folds: NDArray[np.int64]) -> float:
    """Share of the target's power that the columns explain, each fold with coefficients from the others."""
    left = 0.0
    for fold in range(FOLDS):
        own = folds == fold
        coefficients = _left([c[~own] for c in columns], target[~own])[1]
        rest = target[own] - np.stack([c[own] for c in columns], axis=-1) @ coefficients
        left += float(rest @ rest)
    return 1.0 - left / max(float(target @ target), 1e-30)


def _most(columns: Array, taken: Sequence[Array], target: Array) -> int:
    """Which of the columns (n, m) takes most away from what those taken leave of the target."""
    rest = target
    if taken:
        q = np.linalg.qr(np.stack(taken, axis=-1))[0]
        columns, rest = columns - q @ (q.T @ columns), target - q @ (q.T @ target)
    size = np.sum(columns * columns, axis=0)
    known = size > 1e-9 * max(float(size.max()), 1e-30)
    return int(np.argmax(np.where(known, (columns.T @ rest) ** 2 / np.where(known, size, 1.0), 0.0)))


def _cornered(template: str) -> str:
    """The variable that has the corner."""
    return template[template.rindex("(") + 1 : template.rindex(",")]


def _placed(
    text: str, others: Sequence[str], widths: Mapping[str, float], column: Callable[[str], Array], target: Array
) -> str:
    """A one-sided product with its corner where least is left, within its variable's width of where it is.

    To 0.001 (1 mrad, 0.1 bar): models are reused.
    """
    before, found, rest = text.rpartition(",")
    if f"{before}{found}{{}})" not in (*ONE_SIDED, *OPENING):
        return text
    width = widths[_cornered(text)]
    from scipy.optimize import minimize_scalar  # takes a second to load, and most recordings have no unknown input

    corner, fixed = float(rest[:-1]), [column(other) for other in others]
    best = minimize_scalar(
        lambda c: _left([*fixed, column(f"{before},{c:.6g})")], target)[0],
        bounds=(corner - width, corner + width), method="bounded", options={"xatol": 1e-4},
    )  # fmt: skip
    return f"{before},{best.x:.3f})"


def _left(columns: Sequence[Array], target: Array) -> tuple[float, Array]:
    """Sum of squares that the columns leave of the target, and their coefficients."""
    x = np.stack(columns, axis=-1)
    size = np.maximum(np.sqrt(np.sum(x * x, axis=0)), 1e-30)
    coefficients = np.linalg.lstsq(x / size, target, rcond=1e-9)[0] / size
    rest = target - x @ coefficients
    return float(rest @ rest), coefficients


def _scaled(states: Mapping[str, Array], stroke: float) -> dict[str, Array]:
    """The library's variables (n,) that these states have, scaled."""
    result = {}
    for name, variable in VARIABLES.items():
        state, scale = state_of(name, states), stroke if name == "spool" else variable.scale
        if state in states:
            result[name] = states[state] / scale
    return result


def _lagged(_: str, time: float, value: Array) -> Array:
    """T x' = v - x, zero at rest, over intervals of ``PERIOD``: x_k = (1 - d) sum_j d^j v_(k-j), by doubling what is summed."""
    decay, shift = float(np.exp(-PERIOD / time)), 1
    x = (1.0 - decay) * value
    while shift < len(x) and decay > FORGOTTEN:
        x[shift:] += decay * x[:-shift]
        decay, shift = decay * decay, 2 * shift
    return x
