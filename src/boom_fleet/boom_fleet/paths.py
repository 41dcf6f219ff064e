"""How a quantity moves the numbers of a machine: along a path z = v(s), s its level; and how likely a change along one is.

The screen knows what a quantity does near nothing and at its far points (``boom_fleet.numbers``), each a column d_c with the level
s_c it was asked at. v is linear between nothing, v(0) = 0, and these points, v(s_c) = s_c d_c, and goes on beyond the last ones;
with one column it is straight. Of a change delta (``boom_fleet.evidence``) recording r, where it was at l_r before, has of each
column

    x_r(delta) = w(l_r + delta g_r) - w(l_r),        v(s) = sum_c w_c(s) d_c

which is linear in delta between corners. So ln L + ln prior = x'j - x'Jx / 2 - delta^2 / 2 is quadratic there, J and j the
information and score of x, and its integral over delta is a sum of normal ones: nothing is searched or approximated.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.special import log_ndtr

from boom_fleet.past import Direction

Array = NDArray[np.float64]

_NARROW = 1e-9
"""Width of a piece between corners that coincide; it counts for nothing."""
_FLAT = 1e-6
"""Precision of a level beforehand."""
_ROUNDS = 50


@dataclass(frozen=True)
class Path:
    """A quantity: its id, and its columns in the order of their nodes."""

    id: str
    columns: tuple[Direction, ...]

    @property
    def key(self) -> tuple[str, ...]:
        """Ids of the columns: equal of equal paths."""
        return tuple(column.id for column in self.columns)

    @property
    def range(self) -> tuple[float, float]:
        """Plausible levels: those of the outermost columns."""
        return self.columns[0].low, self.columns[-1].high

    @cached_property
    def corners(self) -> Array:
        """(m,) levels at which the path is given, ascending; nothing is one of them."""
        return np.sort([0.0, *(column.node for column in self.columns)])

    @cached_property
    def _points(self) -> Array:
        """(m, columns) w at the corners."""
        levels = self.corners[:, None]
        return np.asarray(levels * (levels == [column.node for column in self.columns]))

    @cached_property
    def _slopes(self) -> Array:
        """(m - 1, columns) dw/ds between the corners."""
        return np.asarray(np.diff(self._points, axis=0) / np.diff(self.corners)[:, None])

    def at(self, levels: Array) -> Array:
        """(..., columns) w at the levels (...)."""
        piece = self._piece(levels)
        return np.asarray(self._points[piece] + (levels - self.corners[piece])[..., None] * self._slopes[piece])

    def slope(self, levels: Array) -> Array:
        """(..., columns) dw/ds at the levels (...)."""
        return np.asarray(self._slopes[self._piece(levels)])

    def _piece(self, levels: Array) -> NDArray[np.int64]:
        return np.clip(np.searchsorted(self.corners, levels) - 1, 0, len(self.corners) - 2)

    def likeliest(self, information: Array, score: Array) -> float:
        """The level of one recording, where (columns, columns) and (columns,) are all that is known of its w."""
        slopes, starts = self._slopes, self.corners[:-1]
        steepness = np.sum(slopes * (score - self._points[:-1] @ information), axis=1)
        curvature = np.sum(slopes * (slopes @ information), axis=1) + _FLAT
        ends = np.array([[-np.inf, *self.corners[1:-1]], [*self.corners[1:-1], np.inf]])
        levels = np.clip(starts + steepness / curvature, *ends)
        w = self.at(levels)
        return float(levels[np.argmax(w @ score - 0.5 * np.sum(w * (w @ information), axis=1))])


def straight(direction: Direction, name: str = "") -> Path:
    """A quantity with one column, called as that or otherwise."""
    return Path(name or direction.id, (direction,))


def along_path(
    path: Path, start: Array, courses: Array, information: Array, score: Array
) -> tuple[Array, Array, Array]:
    """Log evidence (f, c) of changes whose sizes delta are N(0, 1) and in their range at last, likeliest size, standard deviation.

    The latter is that of the piece that holds the likeliest size, as if it went on.

    Args:
        path: of the quantity, of m columns.
        start: (n,) l, the levels before.
        courses: (c, n) g, above zero in the last recording.
        information: (f, c or 1, n m, n m) J of the columns' sizes in the recordings.
        score: (f, c or 1, n m) j.
    """
    edges = _edges(path, start, courses)
    x = path.at(start + edges[..., None] * courses[:, None]) - path.at(start)
    x = x.reshape(*edges.shape, -1)
    pushed = x @ information
    low, width = edges[:, :-1], np.maximum(np.diff(edges), _NARROW)
    rate = np.diff(x, axis=-2) / width[..., None]
    left = score[..., None, :] - pushed[..., :-1, :]
    value = 0.5 * np.sum(x[..., :-1, :] * (score[..., None, :] + left), axis=-1) - 0.5 * low**2
    steepness = np.sum(rate * left, axis=-1) - low
    precision = 1.0 + np.sum(rate * np.diff(pushed, axis=-2), axis=-1) / width
    peak, deviation = steepness / precision, 1.0 / np.sqrt(precision)
    log_mass = _log_mass(-peak / deviation, (width - peak) / deviation)
    pieces = value + 0.5 * steepness * peak + np.log(deviation) + log_mass
    inside = np.clip(peak, 0.0, width)
    best = np.argmax(value + inside * (steepness - 0.5 * precision * inside), axis=-1)[..., None]
    odds = np.logaddexp.reduce(pieces, axis=-1) - _log_mass(edges[:, 0], edges[:, -1])
    return odds, *(np.take_along_axis(row, best, axis=-1)[..., 0] for row in (low + inside, deviation))


def likeliest_levels(path: Path, information: Array, score: Array) -> tuple[Array, Array]:
    """Levels (n,) in the recordings beyond the first one's, and standard deviations; J (n, columns, n, columns), j (n, columns).

    In turn each recording's own, the others given, and a Newton step of all, where it gains.
    """
    count = len(score)
    levels, best = np.zeros(count), 0.0
    for _ in range(_ROUNDS):
        for r in range(1, count):
            others = path.at(levels)
            others[r] = 0.0
            levels[r] = path.likeliest(information[r, :, r], score[r] - np.tensordot(information[r], others, 2))
        before, (step, _) = best, _newton(path, levels, information, score)
        levels = max((levels, levels + step), key=lambda s: _gain(path.at(s), information, score))
        best = _gain(path.at(levels), information, score)
        if best - before < _FLAT:
            break
    return levels, _newton(path, levels, information, score)[1]


def _newton(path: Path, levels: Array, information: Array, score: Array) -> tuple[Array, Array]:
    """Step to the levels (n,) that are likeliest on the pieces they are on, and their standard deviations; of the first 0."""
    slope = path.slope(levels)
    curvature = np.einsum("rc,rcsd,sd->rs", slope, information, slope)[1:, 1:]
    covariance = np.linalg.inv(curvature + _FLAT * np.eye(len(levels) - 1))
    left = np.sum(slope * (score - np.tensordot(information, path.at(levels), 2)), axis=1)[1:]
    return np.append(0.0, covariance @ left), np.append(0.0, np.sqrt(np.diag(covariance)))


def _gain(w: Array, information: Array, score: Array) -> float:
    """Nats."""
    return float(np.sum(w * (score - 0.5 * np.tensordot(information, w, 2))))


def _edges(path: Path, start: Array, courses: Array) -> Array:
    """(c, e) sizes between which x is linear: those at which a recording is at a corner of the path, in its range at last."""
    last = courses[:, -1:]
    low, high = ((limit - start[-1]) / last for limit in path.range)
    begun = courses > 0.0
    inner = (path.corners[1:-1] - start[:, None])[None] / np.where(begun, courses, 1.0)[..., None]
    inner = np.where(begun[..., None], inner, 0.0).reshape(len(courses), -1)
    return np.sort(np.concatenate([low, np.clip(inner, low, high), high], axis=1), axis=1)


def _log_mass(a: Array, b: Array) -> Array:
    """Log probability of a standard normal number between a and b, a < b."""
    low, high = np.where(a > 0.0, -b, a), np.where(a > 0.0, -a, b)
    upper = log_ndtr(high)
    return np.asarray(upper + np.log(-np.expm1(np.minimum(-1e-300, log_ndtr(low) - upper))))
