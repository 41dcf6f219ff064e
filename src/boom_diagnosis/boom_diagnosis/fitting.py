"""Maximum a posteriori fit of the tolerances and of the numbers of a hypothesis, on whitened innovations.

Minimised is  1/2 sum rho(w) + 1/2 |z|^2 : rho is Huber's function, z the machine's own numbers in standard deviations of
their tolerance. Numbers of effects have a flat prior between limits. The Jacobian of z costs some passes, so it is kept and
improved by Broyden's rank-one updates while only the few columns of the effect are computed anew.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from boom_diagnosis.coordinates import Coordinate
from boom_diagnosis.nuisances import Nuisance, closed
from boom_diagnosis.prediction import Predictor
from boom_diagnosis.recent import Recent
from boom_diagnosis.sizes import size_of
from boom_diagnosis.steps import inside
from boom_model.codegen.compiled import LANES

Array = NDArray[np.float64]

HUBER = 4.0
"""Standard deviations up to which an innovation counts squared."""
WHITE = 0.5
"""Loss [nats] per innovation that is white noise and nothing else."""
SIZES = (1.0, 0.35, 0.1, 0.03)
"""Shares of a step that are tried, the whole of it at once and the others where nothing gains."""
AGREE = 0.1
"""Share by which an effect's derivatives to either side may differ to count both."""
DAMPED = (1e-2, 1e-4)
"""Shares by which Marquardt stiffens the diagonal, tried before shorter steps: what is hardly told must not hold up what is."""
LEAST_STEP = 0.3
"""Nats. A step that gains less is the last, and moves the derivatives by nothing that counts."""
SLOW, FAST = 5e-4, 0.02
"""Shares of the loss over that of white noise: a step that gains less than the first is the last, too; a search that gains more
than the second by a step has not come near its end."""
AROUND, AROUND_AT_END = (1.0, -1.0, 4.0), (1.0, 2.0, 4.0)
"""Steps of the differences of which the middle one counts."""
CLOSED = 64
"""Sets of tolerances whose closed linkage is remembered: the hypotheses of a pass share most of theirs."""
Z_STEP = 0.1
"""Standard deviations of a tolerance: step of the differences."""
SMALL = 1e-3
"""The same for numbers and times alone. A tenth or ten times of it change 0.1 %; of the currents' clock, which has kinks, 12 %."""


def rho(w: Array) -> float:
    """Sum of Huber's function."""
    a = np.abs(w)
    return float(np.sum(np.where(a <= HUBER, 0.5 * a * a, HUBER * (a - 0.5 * HUBER))))


@dataclass
class Point:
    """A hypothesis and what it predicts.

    Attributes:
        z: standard deviations of the tolerances. effects: values of its effects by dotted name.
        w: (rows,) whitened innovations, used: (rows,) which of them are fitted; the others are held out.
        loss: of the rows used, and of the tolerances' prior. parts: (n, NY) whitened innovations, states: (n, NX), per recording.
    """

    z: Array
    effects: dict[str, float]
    w: Array
    used: NDArray[np.bool_]
    loss: float
    parts: list[Array]
    states: list[Array]

    def over(self, floor: float) -> float:
        """Loss [nats] over that of a machine with ``floor`` nats per innovation; with the tolerances' prior."""
        return self.loss - floor * int(self.used.sum())

    def excess(self, floor: float) -> float:
        """Loss per innovation [nats] over ``floor``, that of a healthy machine; without the tolerances' prior."""
        return (self.loss - 0.5 * float(self.z @ self.z)) / int(self.used.sum()) - floor


def huber_weights(w: Array) -> Array:
    """rho'(w) / w: 1 up to ``HUBER``, HUBER / |w| beyond."""
    return np.asarray(np.minimum(1.0, HUBER / np.maximum(np.abs(w), 1e-9)))


def weights(at: Point) -> Array:
    """Huber's weights; zero for what is held out."""
    return np.where(at.used, huber_weights(at.w), 0.0)


def strained(at: Point, jacobian: Array) -> bool:
    """Whether tolerances cost more [nats] than numbers drawn from their prior, and 3 standard deviations.

    z'z of the n numbers that the innovations tell is chi-squared; n the sum of l / (1 + l), l the eigenvalues of J' Omega J
    (MacKay, Neural Computation 4 (1992) 415). jacobian: (rows, z and more).
    """
    weighted = jacobian[:, : len(at.z)] * np.sqrt(weights(at))[:, None]
    told = np.linalg.eigvalsh(weighted.T @ weighted)
    half = 0.5 * float(np.sum(told / (1.0 + told)))
    return bool(0.5 * float(at.z @ at.z) > half + 3.0 * np.sqrt(half))


@dataclass(frozen=True)
class _Tried:
    """What came of a step.

    Attributes:
        here, whole: where it began and the end of the whole step, predicted in one pass.
        best: end of the best of all steps, gain: nats over where it began, by one pass; promised: more, by the derivatives.
        columns: of :meth:`Problem.effect_jacobian` at ``best``; None where they are to be taken apart.
    """

    here: Point
    whole: Point
    best: Point
    gain: float
    promised: float
    columns: Array | None


class Problem:
    """Tolerances and recordings; hypotheses are fitted in it.

    select: for each recording (n, NY) flags of the samples that are fitted; judged: of those that are only predicted.
    shapes: numbers whose prior is normal about the middle of their plausible range, which is four standard deviations wide; a row
    each behind the innovations.
    """

    def __init__(
        self,
        predictor: Predictor,
        nuisances: Sequence[Nuisance],
        select: Sequence[NDArray[np.bool_]],
        judged: Sequence[NDArray[np.bool_]] | None = None,
        shapes: Sequence[Coordinate] = (),
    ) -> None:
        self.predictor, self.shapes = predictor, tuple(shapes)
        self.nuisances = tuple(nuisances)
        self.select = [np.asarray(s) for s in select]
        self.rows = self.select if judged is None else [s | j for s, j in zip(self.select, judged, strict=True)]
        used = [s[rows] for s, rows in zip(self.select, self.rows, strict=True)]
        self.used = np.concatenate([*used, np.ones(len(self.shapes), dtype=bool)])
        nominal = dict(zip(predictor.base[0].parameter_names, predictor.base[0].p, strict=True))
        self._nominal = {name: nominal.get(name, 0.0) for n in nuisances for name in n.components}
        self._nominal |= {n.name: n.nominal for n in nuisances if n.nominal is not None}
        self._closed = Recent[dict[str, float]](CLOSED)
        self.limits = np.array([n.limits for n in nuisances]).reshape(-1, 2).T
        """(2, number of tolerances) least and largest z."""
        self.size = size_of(predictor.machine)

    def values(self, z: Array, effects: Mapping[str, float]) -> dict[str, float]:
        """Components of the parameter vector."""
        result = dict[str, float]()
        for nuisance, zi in zip(self.nuisances, z, strict=True):
            if zi != 0.0:
                nuisance.move(result, self._nominal, float(zi))
        made = self._closed.get(z.tobytes(), lambda: closed(self.predictor.machine, result))
        return made | dict(effects)

    def points(self, wanted: Sequence[tuple[Array, Mapping[str, float]]]) -> list[Point]:
        """Predictions and losses of several (z, effects)."""
        predicted = self.predictor.predict([self.values(z, e) for z, e in wanted])
        result = []
        for (z, e), rows in zip(wanted, predicted, strict=True):
            parts = [r.whitened for r in rows]
            w = np.concatenate([self._row(parts), self._unlikely(e)])
            loss = rho(w[self.used]) + 0.5 * float(z @ z)
            result.append(Point(z.copy(), dict(e), w, self.used, loss, parts, [r.states for r in rows]))
        return result

    def _changes(self, at: Point, moved: Sequence[tuple[Array, Mapping[str, float]]]) -> list[Array]:
        """(rows,) what each move changes in the innovations."""
        base, others = self.values(at.z, at.effects), [self.values(z, e) for z, e in moved]
        unlikely = [self._unlikely(e) - self._unlikely(at.effects) for _, e in moved]
        changed = self.predictor.changes(base, others)
        return [np.concatenate([self._row(c), u]) for c, u in zip(changed, unlikely, strict=True)]

    def _unlikely(self, effects: Mapping[str, float]) -> Array:
        """(number of shapes,) standard deviations of each from the middle of its plausible range."""
        ends = [(c.inner(c.plausible[0]), c.inner(c.plausible[1]), c.inner(effects[c.name])) for c in self.shapes]
        return np.array([4.0 * (value - 0.5 * (low + high)) / (high - low) for low, high, value in ends])

    def _row(self, parts: Sequence[Array]) -> Array:
        return np.concatenate([part[s] for part, s in zip(parts, self.rows, strict=True)])

    def likelihood(self, at: Point) -> float:
        """Log-likelihood [nats] but for a constant: of observers with different gains, at the same point."""
        size = sum(
            float(np.log(np.diagonal(g.whitening, axis1=1, axis2=2))[s].sum())  # a channel not measured stands apart
            for g, s in zip(self.predictor.gains, self.select, strict=True)
        )
        return size - at.loss

    def likelihood_at(self, z: Array, effects: Mapping[str, float]) -> float:
        """The same of a hypothesis [nats]."""
        return self.likelihood(self.points([(z, effects)])[0])

    def bearing_with(self, looseness: float, boost: Mapping[str, float] | None = None) -> Problem:
        """The same hypotheses, seen by observers of the same gains but for a looser machine, or one equation that is disturbed."""
        p = self.predictor
        return Problem(Predictor(p.machine, p.bags, p.tuned, looseness, boost), self.nuisances, self.select)

    def nuisance_jacobian(self, at: Point, which: Sequence[int] | None = None) -> Array:
        """dw/dz (rows, number of tolerances); ``which``: of these alone. By differences where a derivative tells little."""
        wanted = [*(range(len(self.nuisances)) if which is None else which)]
        units, told = np.eye(len(self.nuisances))[wanted], np.array([self.nuisances[i].smooth for i in wanted])
        base, *near = (self.values(at.z + SMALL * unit, at.effects) for unit in (0.0, *units[told]))
        jacobian = np.zeros((len(at.w), len(units)))
        parts = self.predictor.derivatives(base, near, SMALL) if near else None
        told &= parts is not None
        jacobian[: len(at.w) - len(self.shapes), told] = self._row(parts) if parts else 0.0
        moved = [(at.z + Z_STEP * unit, at.effects) for unit in units[~told]]
        if moved:
            jacobian[:, ~told] = np.stack(self._changes(at, moved), axis=-1) / Z_STEP
        return jacobian

    def effect_jacobian(self, at: Point, names: Sequence[Coordinate], *, exact: bool = False) -> Array:
        """dw/d(inner coordinate) (rows, number of coordinates) by differences; ``exact``: of each row the median of three.

        A switch that another step makes a sample earlier or later is not in two of three differences. Of a single coordinate
        that costs no more than one.
        """
        if not names:
            return np.zeros((len(at.w), 0))
        values = [_around(c, at.effects[c.name], exact or len(names) == 1) for c in names]
        moved = [(at.z, {**at.effects, c.name: v}) for c, own in zip(names, values, strict=True) for v in own]
        changes = iter(self._changes(at, moved))
        columns = []
        for c, own in zip(names, values, strict=True):
            here = c.inner(at.effects[c.name])
            columns.append(np.median([next(changes) / (c.inner(there) - here) for there in own], axis=0))
        return np.stack(columns, axis=-1)

    def fit(
        self,
        start: Point,
        jacobian: Array,
        names: Sequence[Coordinate] = (),
        *,
        iterations: int = 6,
        further: int = 0,
    ) -> tuple[Point, Array]:
        """Gauss-Newton with a step control; returns the best point and the Jacobian (rows, z then coordinates) there.

        jacobian: of the tolerances (rows, number of them), taken near ``start``; with further columns, of the coordinates, where
        these are taken exactly there. further: iterations beyond ``iterations`` while each gains ``FAST`` of what is left.
        """
        m = len(start.z)
        best, nz, known = start, jacobian[:, :m].copy(), jacobian[:, m:]
        fresh, renewed = known.shape[1] == len(names), False
        for k in range(iterations + further):
            columns = known if fresh else self.effect_jacobian(best, names)
            tried = self._tried(best, np.concatenate([nz, columns], axis=1), names)
            _broyden(nz, tried.here, tried.whole, columns, names)
            least = max(LEAST_STEP, (SLOW if k < iterations - 1 else FAST) * best.over(WHITE))
            known, fresh = columns, tried.gain < LEAST_STEP
            if tried.gain > 0.0:
                best = tried.best
                if tried.columns is not None:
                    known, fresh = tried.columns, True
            elif tried.promised > least and not renewed:  # derivatives of elsewhere promised it
                nz, renewed = self.nuisance_jacobian(best), True
                continue
            if tried.gain < least:
                break
        columns = known if fresh else self.effect_jacobian(best, names)
        return best, np.concatenate([nz, columns], axis=1)

    def fit_nominal(self, effects: Mapping[str, float], names: Sequence[Coordinate], *, iterations: int = 4) -> Point:
        """The effects alone, fitted with every tolerance at its nominal value."""
        zero = np.zeros(len(self.nuisances))
        best = self.points([(zero, effects)])[0]
        if not names:
            return best
        columns = self.effect_jacobian(best, names)
        for _ in range(iterations):
            still = np.concatenate([np.zeros((len(best.w), len(zero))), columns], axis=1)
            tried = self._tried(best, still, names)
            if tried.gain <= 0.1:
                break
            best = tried.best
            columns = self.effect_jacobian(best, names) if tried.columns is None else tried.columns
        return best

    def made_nominal(self, at: Point, jacobian: Array, names: Sequence[Coordinate], which: Sequence[int]) -> Point:
        """The point where the tolerances ``which`` are nominal and the effects make up for them, by the derivatives at ``at``.

        jacobian: (rows, z then coordinates).
        """
        m, root = len(at.z), np.sqrt(weights(at))[:, None]
        step = np.zeros(jacobian.shape[1])
        step[list(which)] = -at.z[list(which)]
        lost = (root * jacobian[:, :m]) @ step[:m]
        step[m:] = -np.linalg.lstsq(root * jacobian[:, m:], lost, rcond=None)[0]
        return self.points([self._moved(at, step, names, 1.0)])[0]

    def _tried(self, at: Point, jacobian: Array, names: Sequence[Coordinate]) -> _Tried:
        """A step of Gauss and Newton, damped ones, and shares of it.

        A pass predicts ``LANES`` points with the same steps of the integrator, so that their nats can be compared to a tenth;
        between passes they differ by some. Where the step begins is predicted with the others, therefore, and so are points
        beside its end, for derivatives there.
        """
        step, *damped = gauss_newton(at, jacobian, names, self.limits, (0.0, *DAMPED))
        ends = [self._moved(at, step, names, size) for size in SIZES]
        ends[1:1] = [self._moved(at, shorter, names, 1.0) for shorter in damped]
        (z, effects), begin = ends[0], (at.z, at.effects)
        c = names[0] if len(names) == 1 and not names[0].delay else None
        values = _around(c, effects[c.name], True)[:2] if c else []
        beside = [(z, {**effects, c.name: there}) for there in values] if c else []
        first = LANES - 1 - len(beside)
        here, *points = self.points([begin, *ends[:first], *beside])
        whole, best, moved = points[0], min(points[:first], key=lambda p: p.loss), points[first:]
        gain, promised = here.loss - best.loss, 0.0
        if gain <= 0.0:
            promised = at.loss - rho((at.w + jacobian @ step)[at.used]) - 0.5 * float(z @ z)
            if promised > max(LEAST_STEP, SLOW * at.over(WHITE)):
                again, *points = self.points([begin, *ends[first:]])
                best = min(points, key=lambda p: p.loss)
                gain = again.loss - best.loss
        columns = None
        if c and best is whole:
            middle = c.inner(effects[c.name])
            one, other = ((p.w - whole.w) / (c.inner(v) - middle) for p, v in zip(moved, values, strict=True))
            if np.linalg.norm(one - other) < AGREE * np.linalg.norm(one + other) / 2.0:
                columns = (one + other)[:, None] / 2.0
        return _Tried(here, whole, best, gain, promised, columns)

    def _moved(
        self, at: Point, step: Array, names: Sequence[Coordinate], size: float
    ) -> tuple[Array, dict[str, float]]:
        m = len(at.z)
        effects = dict(at.effects)
        for c, d in zip(names, step[m:], strict=True):
            here = effects[c.name]
            if c.onset and here < 0.0:  # what began before the recording did
                continue
            there = here * float(np.exp(np.clip(size * d, -1.0, 1.0))) if c.positive else here + size * float(d)
            effects[c.name] = float(np.clip(there, c.low, c.high))
        return np.clip(at.z + size * step[:m], *self.limits), effects


def _around(c: Coordinate, here: float, several: bool) -> list[float]:
    """Values to either side of one and further away, inside the limits; where not ``several``, and of a delay, the last only."""
    for shares in (AROUND, AROUND_AT_END, tuple(-m for m in AROUND_AT_END)):
        values = [here * (1.0 + m * c.step) if c.positive else here + m * c.step for m in shares]
        if c.low <= min(values) and max(values) <= c.high:
            break
    if c.delay:
        return values[:1]
    return values if several else values[-1:]


def gauss_newton(
    at: Point, jacobian: Array, names: Sequence[Coordinate], limits: Array, dampings: Sequence[float] = (0.0,)
) -> list[Array]:
    """Steps of all unknowns (z, inner coordinates) from ``at``, one for each of ``dampings``.

    Those that would leave their limits stay there. jacobian: (rows, unknowns), limits: (2, number of tolerances).
    """
    m, root = len(at.z), np.sqrt(weights(at))
    scaled = jacobian * root[:, None]
    normal = scaled.T @ scaled
    gradient = scaled.T @ (root * at.w)
    precision = [1.0] * m + [c.precision for c in names]  # what nothing tells stays where it is
    normal[np.diag_indices_from(normal)] += precision
    gradient[:m] += at.z
    here = np.array([*at.z, *(at.effects[c.name] for c in names)])
    lowest = here <= np.array([*limits[0], *(c.low for c in names)])
    highest = here >= np.array([*limits[1], *(c.high for c in names)])
    diagonal = np.diag(np.diag(normal))
    return [inside(normal + damping * diagonal, gradient, lowest, highest) for damping in dampings]


def _broyden(nz: Array, old: Point, new: Point, columns: Array, names: Sequence[Coordinate]) -> None:
    """Rank-one update of the kept Jacobian with what the last step showed."""
    dz = new.z - old.z
    size = float(dz @ dz)
    if size < 1e-4:
        return
    rest = new.w - old.w - nz @ dz
    if names:
        moved = np.array([c.inner(max(new.effects[c.name], 1e-300 if c.positive else -np.inf))
                          - c.inner(max(old.effects[c.name], 1e-300 if c.positive else -np.inf)) for c in names])  # fmt: skip
        rest = rest - columns @ moved
    if float(rest @ rest) < float((new.w - old.w) @ (new.w - old.w)):
        nz += np.outer(rest, dz / size)
