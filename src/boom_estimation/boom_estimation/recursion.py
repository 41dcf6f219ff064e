"""A model linearised along one pass: its likelihood for any size of the discrepancies, and derivatives, without integration.

The Kalman filter of the deviations from the pass, ``recursion.c``. Near the pass it is the extended Kalman filter with the
hypothesis' own gains; log-likelihood of innovations e with covariances S: -sum rho(L^-1 e) - sum log det S / 2, S = L L',
rho(w) = w^2 / 2 up to ``HUBER``, linear beyond (Huber 1964).
"""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from copy import copy
from dataclasses import dataclass
from functools import lru_cache
from importlib.resources import files
from typing import Any

import numpy as np
from numpy.typing import NDArray

from boom_estimation.system import Columns, Model, Pass, Tangent
from boom_model.codegen.compiled import load_c
from boom_model.cores import usable_cores

Array = NDArray[np.float64]

HUBER = 4.0
"""Standard deviations."""
MOST_HELD = 8
"""As in recursion.c."""


@lru_cache(maxsize=1)
def threads() -> ThreadPoolExecutor:
    """For what runs beside each other in C."""
    return ThreadPoolExecutor(usable_cores())


def rho(w: Array) -> float:
    """Sum of Huber's function."""
    a = np.abs(w)
    return float(np.sum(np.where(a <= HUBER, 0.5 * a * a, HUBER * (a - 0.5 * HUBER))))


def huber_weights(w: Array) -> Array:
    """rho'(w) / w: 1 up to ``HUBER``, HUBER / |w| beyond."""
    return np.asarray(np.minimum(1.0, HUBER / np.maximum(np.abs(w), 1e-9)))


@lru_cache(maxsize=64)
def _library(states: int, outputs: int, discrepancies: int) -> Any:
    head = f"#define NX {states}\n#define NY {outputs}\n#define NQ {discrepancies}\n"
    return load_c(head + files("boom_estimation").joinpath("recursion.c").read_text())


def _pointer(array: NDArray[Any] | None) -> Any:
    return None if array is None else array.ctypes.data_as(ctypes.c_void_p)


@dataclass(frozen=True)
class Filtered:
    """What the recursion gives, (n, ...).

    Attributes:
        white: (n, NY) whitened innovations. factor: (n, NY, NY) Cholesky factors of their covariances.
        innovations: (n, NY). by: (n, NY, c) derivatives of the whitened ones at fixed covariances. gain: (n, NX, NY).
        filtered: (n + 1, NX, NX), predicted: (n, NX, NX) covariances, where they were asked for.
    """

    white: Array
    factor: Array
    innovations: Array
    by: Array | None
    gain: Array | None
    filtered: Array | None = None
    predicted: Array | None = None


@dataclass(frozen=True)
class Exact:
    """Derivatives along a pass by differences of predictions.

    Attributes:
        transition: (n, NX, NX).
        columns: of the numbers ``at`` these inner coordinates, in their order.
    """

    transition: Array
    columns: Columns
    at: dict[str, float]


class LinearisedPass:
    """A model linearised along a pass.

    Raises:
        FloatingPointError: equations without solution; from :meth:`run`, a covariance that is not positive.
    """

    def __init__(self, model: Model, along: Pass, given: Array, tangent: Tangent, exact: Exact | None) -> None:
        self.model, self.along, self.exact = model, along, exact
        n, nx = along.states.shape
        ny, q, h = len(tangent.output), len(model.discrepancies), model.interval
        self.transition, self.process = np.empty((n, nx, nx)), np.empty((n, nx, nx))
        self.entry = np.empty((n, nx, q))
        self.output = np.ascontiguousarray(tangent.output)
        held, density = np.ascontiguousarray(tangent.held), np.ascontiguousarray(tangent.density)
        if held.shape[2] > MOST_HELD:
            raise ValueError(f"{held.shape[2]} noises held in an interval, more than {MOST_HELD}")
        bad = _library(nx, ny, q).discretise(
            ctypes.c_long(n), ctypes.c_long(held.shape[2]), ctypes.c_double(h), _pointer(np.ascontiguousarray(tangent.jacobian)),
            _pointer(held), _pointer(density), _pointer(np.ascontiguousarray(model.discrepancies, dtype=np.int64)),
            _pointer(self.transition), _pointer(self.process), _pointer(self.entry),
        )  # fmt: skip
        if bad:
            raise FloatingPointError(f"the equations have no solution in interval {bad - 1}")
        if exact is None:
            changes = Columns.none(nx, ny, n)
        else:
            changes = exact.columns
            self.transition = np.ascontiguousarray(exact.transition)
        self.forced = np.ascontiguousarray(changes.ends)
        self.shown = np.ascontiguousarray(changes.outputs)
        self.begin = np.ascontiguousarray(changes.begin)
        self.given = self.pass_gain = np.ascontiguousarray(given)
        self.pass_transition, self.pass_output = self.transition, self.output
        self.spread, self.unknown = model.spread, model.discrepancies
        self.valid = np.ascontiguousarray(along.valid, dtype=np.uint8)

    def with_columns(self, changes: Columns) -> LinearisedPass:
        """The same with further numbers, behind its own."""
        other = copy(self)
        grown = np.zeros((len(self.forced), self.forced.shape[1], changes.ends.shape[2]))
        grown[:, : changes.ends.shape[1]] = changes.ends
        begin = np.zeros((self.forced.shape[1], changes.begin.shape[1]))
        begin[: len(changes.begin)] = changes.begin
        other.forced = np.concatenate([self.forced, grown], axis=2)
        other.shown = np.concatenate([self.shown, changes.outputs], axis=2)
        other.begin = np.concatenate([self.begin, begin], axis=1)
        return other

    def wandering(self, columns: Sequence[int], scales: Array) -> LinearisedPass:
        """The same with numbers that wander about their value: c_j + scale_j d_j, d_j a further discrepancy."""
        n, nx, q = self.entry.shape
        k, decay = len(columns), np.exp(-self.model.interval / self.model.memory)
        more = nx + np.arange(k)
        other = copy(self)
        other.transition, other.process = np.zeros((n, nx + k, nx + k)), np.zeros((n, nx + k, nx + k))
        other.transition[:, :nx, :nx], other.process[:, :nx, :nx] = self.transition, self.process
        other.transition[:, :nx, nx:] = self.forced[:, :, list(columns)] * scales
        other.transition[:, more, more] = decay
        other.entry = np.zeros((n, nx + k, q + k))
        other.entry[:, :nx, :q] = self.entry
        other.entry[:, more, q + np.arange(k)] = 1.0
        other.output = np.concatenate([self.output, np.zeros((len(self.output), k))], axis=1)
        other.forced = np.concatenate([self.forced, np.zeros((n, k, self.forced.shape[2]))], axis=1)
        other.begin = np.concatenate([self.begin, np.zeros((k, self.begin.shape[1]))])
        other.given = np.concatenate([self.given, np.zeros((n, k, self.given.shape[2]))], axis=1)
        other.spread = np.concatenate([self.spread, np.zeros(k)])
        other.unknown = np.concatenate([self.unknown, more])
        return other

    def run(
        self, sizes: Array, moved: Array | None = None, *, by: bool = False, gain: bool = False, keep: bool = False
    ) -> Filtered:
        """The filter with discrepancies of stationary deviations ``sizes`` (q,) and the numbers ``moved`` (c,) from the pass."""
        n, nx = self.transition.shape[:2]
        ny, count = self.output.shape[0], self.forced.shape[2]
        if not by and (moved is None or not np.any(moved)):
            count, forced, shown, begin, shift = 0, np.zeros(1), np.zeros(1), np.zeros(1), np.zeros(1)
        elif not by:  # one column: all that is moved together
            assert moved is not None
            count, shift = 1, np.ones(1)
            forced, shown, begin = self.forced @ moved, self.shown @ moved, self.begin @ moved
        else:
            forced, shown, begin = self.forced, self.shown, self.begin
            shift = np.zeros(max(count, 1)) if moved is None else np.ascontiguousarray(moved, dtype=float)
        white, innovations, factor = np.empty((n, ny)), np.empty((n, ny)), np.empty((n, ny, ny))
        derivatives = np.empty((n, ny, count)) if by else None
        gains = np.empty((n, nx, ny)) if gain else None
        filtered = np.empty((n + 1, nx, nx)) if keep else None
        predicted = np.empty((n, nx, nx)) if keep else None
        work = np.empty(max(1, (2 * nx + ny) * count))
        spread = self.spread.copy()
        spread[self.unknown] = sizes
        start = np.diag(np.square(spread))
        variance = 2.0 * self.model.interval / self.model.memory * np.square(sizes)
        bad = _library(nx, ny, len(sizes)).kalman_recursion(
            ctypes.c_long(n), ctypes.c_long(count), _pointer(self.transition), _pointer(self.process), _pointer(self.entry),
            _pointer(variance), _pointer(self.output), _pointer(self.along.share), _pointer(self.valid),
            _pointer(self.model.variance), _pointer(start), _pointer(self.along.innovations), _pointer(self.given),
            _pointer(forced), _pointer(shown), _pointer(begin), _pointer(shift), _pointer(innovations), _pointer(factor),
            _pointer(white), _pointer(derivatives), _pointer(gains), _pointer(filtered), _pointer(predicted), _pointer(work),
        )  # fmt: skip
        if bad:
            raise FloatingPointError(f"the covariance of the observer grew without bounds in interval {bad - 1}")
        return Filtered(white, factor, innovations, derivatives, gains, filtered, predicted)

    def log_likelihood(self, filtered: Filtered) -> float:
        """Of the intervals that count [nats], but for a constant."""
        counted = self.model.counted
        diagonal = np.diagonal(filtered.factor[counted], axis1=1, axis2=2)
        return -rho(filtered.white[counted]) - float(np.sum(np.log(diagonal)))


def difference_columns(
    name: str, pairs: Sequence[tuple[Pass, Pass] | None], steps: Array, gain: Array, transition: Array, output: Array
) -> Columns:
    """What other sets of numbers change per unit of ``steps`` (k,), from passes with both.

    The recursion then has what the passes have.

    Args:
        name: of the experiment.
        pairs: the pass that is linearised and one with other numbers; None where these do nothing.
        steps: how far each is.
        gain: (n, NX, NY) of the passes.
        transition: (n, NX, NX) of the pass.
        output: (NY, NX).

    Raises:
        FloatingPointError: a pass that is not complete.
    """
    n, nx = transition.shape[:2]
    ny, count = len(output), len(pairs)
    found = Columns(np.zeros((n, nx, count)), np.zeros((n, ny, count)), np.zeros((nx, count)))
    library = _library(nx, ny, 1)
    for k, pair in enumerate(pairs):
        if pair is None:
            continue
        base, other = pair
        if not (base.complete and other.complete):
            raise FloatingPointError(f"{name}: the model cannot be run beside these numbers")
        both = np.ascontiguousarray(base.valid & other.valid, dtype=np.uint8)
        library.difference_column(
            ctypes.c_long(n), ctypes.c_long(count), ctypes.c_long(k), ctypes.c_double(float(steps[k])), _pointer(transition),
            _pointer(output), _pointer(gain), _pointer(base.share), _pointer(both), _pointer(base.states), _pointer(other.states),
            _pointer(base.innovations), _pointer(other.innovations), _pointer(found.ends), _pointer(found.outputs),
            _pointer(found.begin),
        )  # fmt: skip
        if other.beside is not None:
            found.outputs[:, :, k] -= other.beside * both / steps[k]
    return found
