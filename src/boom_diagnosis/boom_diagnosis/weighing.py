"""From fits to probabilities: what each hypothesis gains, what it costs, and how far the rest speaks for physics unknown.

A hypothesis gains the decrease of the loss it brings, on data used and not used [nats], and pays for the room that its
numbers had (Occam factor: width of the prior over width of the posterior). Losses are divided by a temperature, because
no model is exactly right: nats that no hypothesis explains make all of them less sure.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from math import exp, inf, isfinite, log, pi, sqrt

import numpy as np
from numpy.typing import NDArray

from boom_diagnosis.coordinates import Coordinate
from boom_diagnosis.document import Estimate
from boom_diagnosis.fitting import Point, huber_weights, rho, weights
from boom_diagnosis.onset import neutral
from boom_diagnosis.search import Fitted
from boom_diagnosis.sizes import THESIS, MachineSize, sized
from boom_model.catalogue import EFFECTS

Array = NDArray[np.float64]

ENOUGH = 12.0
"""Nats, net of costs, from which on an effect is named at all: twice what chance gave on simulated healthy recordings."""
TOO_SMALL = 0.004
"""Nats per innovation that an effect must gain beside: so much is taken up by an effect where two models of one machine differ
in what no file says (how oil cavitates, a check valve opens, a sensor filters): sound cranes of other hands left up to 0.003. It
is an effect of a twelfth of the noise."""
OTHER_FORM = 0.02
"""Share of what the effects before gained that a further one must gain: the catalogue's form of an effect is not the machine's,
and what it misses of a large effect looks like a small other one."""
COLDEST = 3.0
"""Temperature where nothing remains unexplained."""
UNEXPLAINED_WEIGHT = 0.1
"""Share of the unexplained nats that adds to the temperature."""
UNKNOWN_FROM, UNKNOWN_STEEPNESS = 0.78, 8.0
"""Share of the misfit's amplitude that remains where unknown physics becomes as likely as not, and how sharply."""
SLIGHT = 0.04
"""Loss per innovation over that of a healthy machine at which what nothing explains is as likely nothing unknown."""
CLEAR = 0.1
"""The same, of one channel, from which on it counts by itself."""
NEGLIGIBLE = 0.012
"""Loss per innovation over that of a healthy machine which counts as nothing: the observer's own shortcomings."""
Z90 = 1.645
FORM = 2.5
"""Factor of intervals that the recordings decide: a machine's effect never has exactly the catalogue's form. From blind trials
(docs/proof_method.md)."""
DERIVATIVES = 1e-3
NONE = 1e-3
"""Of the plausible range, so close to the number that says that something is not there is that."""
GRASP = 0.15
"""s. A load is not taken up in an instant: half the least width of the interval of its time."""
BLOCK = 800
"""Consecutive innovations, 2 s of four channels, that a wrong model makes wrong together."""


@dataclass(frozen=True)
class Weighed:
    """A hypothesis: gain on data used, on data not used, cost [nats]; log-odds against the tolerances alone."""

    fitted: Fitted
    gain: float
    held_out_gain: float
    cost: float

    @property
    def net(self) -> float:
        """Of gains and cost [nats]."""
        return self.gain + self.held_out_gain - self.cost


def precision(point: Point, jacobian: Array, count: int) -> Array:
    """Inverse covariance of (z, inner coordinates) from the rows used; the first ``count`` unknowns have unit priors."""
    normal = (jacobian * weights(point)[:, None]).T @ jacobian
    normal[np.arange(count), np.arange(count)] += 1.0
    return np.asarray(normal)


def predictive_loss(w: Array, jacobian: Array, known: Array) -> float:
    """Loss [nats] of data not used, whose numbers are known from elsewhere only as well as ``known`` (their precision) says.

    w: (rows,), jacobian: (rows, unknowns) at the fitted point; the unknowns may move within what is known of them.
    """
    weighted = jacobian * huber_weights(w)[:, None]
    both = known + weighted.T @ jacobian
    gradient = weighted.T @ w
    scale = _scale(both)
    scaled, moved = _unit(both, scale), gradient / scale
    spread = np.linalg.slogdet(scaled)[1] - np.linalg.slogdet(_unit(known, scale))[1]
    return rho(w) - 0.5 * float(moved @ np.linalg.solve(scaled, moved)) + 0.5 * float(spread)


def forgotten(known: Array, untold: Mapping[int, float]) -> Array:
    """A precision of which nothing is known of some unknowns, as of what is another recording's own: they have their prior's.

    untold: unknown -> precision of its prior.
    """
    if not untold:
        return known
    own, prior = np.array(list(untold)), list(untold.values())
    kept = np.setdiff1d(np.arange(len(known)), own)
    scale = _scale(known)
    unit = _unit(known, scale)
    across = unit[np.ix_(kept, own)]
    left = unit[np.ix_(kept, kept)] - across @ np.linalg.solve(unit[np.ix_(own, own)], across.T)
    result = np.zeros_like(known)
    result[np.ix_(kept, kept)] = left * np.outer(scale[kept], scale[kept])
    result[own, own] = prior
    return result


def _scale(normal: Array) -> Array:
    """Roots of the diagonal of a precision."""
    return np.asarray(np.sqrt(np.maximum(np.diag(normal), 1e-12)))


def _unit(normal: Array, scale: Array) -> Array:
    """A precision in units of ``scale``, kept from being singular."""
    return np.asarray(normal / np.outer(scale, scale) + 1e-9 * np.eye(len(scale)))


def split_loss(w: Array, jacobian: Array, prior: Array, z: Array, used: NDArray[np.bool_]) -> tuple[float, float]:
    """Loss [nats] of the rows ``used`` where they alone are fitted, and what the others then cost, by Laplace's rule.

    -log p(others | used) = F(all) - F(used), F(S) = min loss of S + 1/2 log det of its Hessian; the minimum over the rows used is a
    Gauss-Newton step away from the point, which all rows were fitted to.

    w: (rows,), jacobian: (rows, unknowns) at the point, prior: (unknowns,) precision, z: (count,) the first unknowns.
    """
    weighted = jacobian * huber_weights(w)[:, None]
    part, rows = weighted[used], jacobian[used]
    some, every = part.T @ rows + np.diag(prior), weighted.T @ jacobian + np.diag(prior)
    scale = _scale(every)
    some, every = _unit(some, scale), _unit(every, scale)
    gradient = part.T @ w[used]
    gradient[: len(z)] += z
    gradient = gradient / scale
    own = 0.5 * float(z @ z)
    fitted = rho(w[used]) + own - 0.5 * float(gradient @ np.linalg.solve(some, gradient))
    room = 0.5 * float(np.linalg.slogdet(every)[1] - np.linalg.slogdet(some)[1])
    return fitted, rho(w) + own - fitted + room


def posterior(point: Point, jacobian: Array, count: int) -> Array:
    """Covariance of (z, inner coordinates) at a fitted point; the first ``count`` unknowns have unit priors."""
    normal = precision(point, jacobian, count)
    scale = _scale(normal)
    return np.asarray(np.linalg.inv(_unit(normal, scale)) / np.outer(scale, scale))


def scatter(point: Point, jacobian: Array, count: int) -> Array:
    """Covariance of (z, inner coordinates), from how much stretches of the recording disagree about them.

    H^-1 (sum over blocks of s s') H^-1: H the precision, s the score of a block of ``BLOCK`` innovations (White, Econometrica
    50, 1982; blocks for what is wrong together: Liang and Zeger, Biometrika 73, 1986). Where the model's form is right it is
    the posterior's but for the priors; where not, it is wider.
    """
    scores = (jacobian * (weights(point) * point.w)[:, None])[point.used]
    blocks = np.add.reduceat(scores, np.arange(0, len(scores), BLOCK), axis=0)
    blocks = blocks - blocks.mean(axis=0)
    normal = precision(point, jacobian, count)
    scale = _scale(normal)
    moved = np.linalg.solve(_unit(normal, scale), (blocks / scale).T) / scale[:, None]
    return np.asarray(moved @ moved.T) * len(blocks) / max(len(blocks) - 1, 1)


def occam(fitted: Fitted, new: Sequence[Coordinate]) -> float:
    """Cost of the numbers of the new effect [nats]: log(prior width / posterior width), never negative."""
    count = len(fitted.point.z)
    covariance = posterior(fitted.point, fitted.jacobian, count)
    cost = 0.0
    for c in new:
        k = count + fitted.coordinates.index(c)
        width = sqrt(2 * pi * max(float(covariance[k, k]), 1e-300))
        room = log(60.0) if c.onset else log(max(c.width, 1e-300))
        cost += max(0.0, room - log(width))
    return cost


def trusted(point: Point, jacobian: Array, count: int, prior: Sequence[float], discount: float) -> Array:
    """Covariance of (z, inner coordinates) from no more than derivatives by differences can tell.

    discount: what the recordings tell is divided by it; what the tolerances say is not.

    The precision scaled to a unit diagonal loses ``DERIVATIVES`` in every principal direction: in one where the effect of moving
    all unknowns together is less than 3 % of what each does alone, the recordings say nothing, the priors (precision 1 for z,
    ``prior`` for coordinates) all.
    """
    normal = (jacobian * weights(point)[:, None]).T @ jacobian
    scale = _scale(normal)
    values, vectors = np.linalg.eigh(normal / np.outer(scale, scale))
    told = (vectors * np.maximum(values - DERIVATIVES, 0.0) / discount) @ vectors.T * np.outer(scale, scale)
    told += np.diag([1.0] * count + list(prior))
    scale = np.sqrt(np.diag(told))
    return np.asarray(np.linalg.inv(told / np.outer(scale, scale)) / np.outer(scale, scale))


def of_tolerances(
    point: Point, jacobian: Array, names: Sequence[Coordinate], temperature: float, ended: NDArray[np.bool_]
) -> Array:
    """Covariance (count, count) of z as the stated intervals have it: posterior or scatter, whichever is wider, up to the prior's.

    What the recordings tell counts ``FORM`` times less sharply, as of an effect's numbers, and less where much stays unexplained.
    Where a number has ``ended`` (count,) at its tolerance it is known no better than that: its interval reaches to the file's.

    jacobian: (rows, z then ``names``).
    """
    count = len(point.z)
    discount = max(1.0, temperature / COLDEST) * FORM**2
    covariance = trusted(point, jacobian, count, [c.precision for c in names], discount)[:count, :count]
    known = np.sqrt(np.diag(covariance))
    scattered = FORM * np.sqrt(np.maximum(np.diag(scatter(point, jacobian, count))[:count], 0.0))
    wider = np.minimum(np.maximum(scattered, known), np.maximum(known, 1.0))
    wider = np.where(ended, np.maximum(1.0, np.abs(point.z) / Z90), wider) / known
    return np.asarray(covariance * np.outer(wider, wider))


def estimates(fitted: Fitted, temperature: float, over: float = inf) -> dict[str, Estimate]:
    """Numbers of all its effects with 90 % intervals, dotted names: the wider of two, posterior and scatter.

    over: when the recordings end [s]: what comes or goes then does not.
    What the recordings tell counts ``FORM`` times less sharply, and to the ``form`` of a coordinate at best; how far a tolerance
    reaches stays.
    """
    variances, told = _variances(fitted, temperature), dict[str, float]()
    for effect in dict.fromkeys(c.name.split(".")[1] for c in fitted.coordinates):
        sizes = {f"effects.{effect}.{row.name}" for row in EFFECTS[effect].leading}
        shape = [c.name for c in fitted.coordinates if c.name.split(".")[1] == effect and c.name not in sizes]
        told |= {n: v for n, v in _variances(fitted, temperature, given=shape).items() if n in sizes} if shape else {}
    result, gone = {}, set[str]()
    for c in fitted.coordinates:
        value, (_, effect, name) = fitted.point.effects[c.name], c.name.split(".")
        of = next(row.of for row in EFFECTS[effect].parameters if row.name == name)
        if is_none(c.name, value) or (c.onset and not GRASP <= value < over - GRASP) or f"{effect}.{of}" in gone:
            gone.add(f"{effect}.{name}")  # what lies on the ground was there before, what hangs stays
            continue
        spread, known = (Z90 * sqrt(v.get(c.name, inf) + c.form**2) for v in (variances, told))
        if c.onset:
            spread = max(spread, GRASP)
        low, high = _interval(c, value, spread, known)
        result[c.name] = Estimate(value, c.unit, (max(low, min(c.low, value)), min(high, max(c.high, value))))
    return result


def of_effect(numbers: Mapping[str, Estimate], effect: str) -> dict[str, Estimate]:
    """Those of one effect, by their own names."""
    return {name.split(".")[2]: e for name, e in numbers.items() if name.split(".")[1] == effect}


def _variances(fitted: Fitted, temperature: float, given: Collection[str] = ()) -> dict[str, float]:
    """Of the numbers of its effects, dotted names, but for those that are given: the larger of posterior's and scatter's."""
    count = len(fitted.point.z)
    free = [c for c in fitted.coordinates if c.name not in given]
    columns = [*range(count), *(count + k for k, c in enumerate(fitted.coordinates) if c.name not in given)]
    jacobian, prior = fitted.jacobian[:, columns], [c.precision for c in free]
    posterior_of = np.diag(trusted(fitted.point, jacobian, count, prior, temperature * FORM**2))
    largest = np.maximum(posterior_of, np.diag(scatter(fitted.point, jacobian, count)) * FORM**2)[count:]
    return {c.name: max(float(v), 0.0) for c, v in zip(free, largest, strict=True)}


def _interval(c: Coordinate, value: float, spread: float, known: float) -> tuple[float, float]:
    """Of a number with a ``spread`` in its inner coordinate, ``known`` where the effect's shape is given.

    A size that is told given the shape, and only together with it may be nothing, is away from nothing by a factor.
    """
    here, nothing = c.inner(value), _nothing(c)
    away = here - nothing
    if isfinite(away) and known < abs(away) <= spread:
        factor = exp(min(spread / abs(away), 5.0))
        low, high = sorted((nothing + away / factor, nothing + away * factor))
    else:
        low, high = here - spread, here + spread
    return (exp(max(low, here - 5.0)), exp(min(high, here + 5.0))) if c.positive else (low, high)


def _nothing(c: Coordinate) -> float:
    """The inner coordinate of a number at which it does nothing; minus infinity where that is the logarithm of zero."""
    value = neutral(c.name)
    return c.inner(value) if value > 0.0 or not c.positive else -inf


def is_none(name: str, value: float) -> bool:
    """Whether a number says that something is not there: neutral, where what is plausible is elsewhere."""
    effect, parameter = name.split(".")[1:]
    row = next(row for row in EFFECTS[effect].parameters if row.name == parameter)
    elsewhere = not row.low <= row.neutral <= row.high
    near = (
        row.low if row.positive else row.high - row.low
    )  # what is sought by its logarithm may be small beside its range
    return elsewhere and abs(value - row.neutral) < NONE * near


def probabilities(nets: Sequence[float], temperature: float) -> list[float]:
    """Of each hypothesis by its gain [nats], and last that none is needed; all equally likely before."""
    scores = np.array([net / temperature for net in nets] + [0.0])
    scores -= scores.max()
    p = np.exp(scores)
    return [float(v) for v in p / p.sum()]


def unknown_probability(before: float, after: float, channels: Sequence[tuple[float, float]] = ()) -> float:
    """That unmodelled physics acts, from the loss per innovation over that of a healthy machine.

    p = s^8 / (s^8 + u^8) b / (b + SLIGHT), s = sqrt(after / before), b = before: what little is wrong may as well be a
    catalogue's effect in a form that is not the catalogue's. u = 0.78.

    channels: before and after of each measured channel. An effect that explains some channels and leaves two others, clearly off,
    as they were has another one beside it or stands in for it: the second of those that are explained least counts, of channels
    where more than CLEAR is left (one alone may be the effect's form).
    """
    left = sorted((_unexplained(b, a) for b, a in channels if a > CLEAR), reverse=True)
    whole = [_unexplained(before, after)] if after > NEGLIGIBLE else []
    return max([0.02, *whole, *left[1:2]])


def _unexplained(before: float, after: float) -> float:
    share = sqrt(max(after, 0.0) / max(before, after, 1e-12))
    return float(before / (before + SLIGHT) / (1.0 + (UNKNOWN_FROM / max(share, 1e-6)) ** UNKNOWN_STEEPNESS))


def possible(
    fitted: Fitted, load: float, size: MachineSize = THESIS, discount: float = 1.0, whole: bool = False
) -> bool:
    """Whether a boom of this size, with a ``load`` [kg] told, can have an effect as fitted; else it stands in for something else.

    discount: of what the recordings tell, by what stays unexplained beside the effect. whole: nothing does; what explains all
    stands in for nothing where the limit is a usual one (``surely``).

    A load that lifts is none; of others the catalogue says what a machine can have. An effect whose size is as large as any that is
    looked for, far beyond what is plausible, would have to be larger still; but what is touched may be as hard as it will, and a
    cushion takes all of the passage at most.
    """
    effect, own = sized(EFFECTS[fitted.effect], size), f"effects.{fitted.effect}."
    first = effect.parameters[0]
    hung = fitted.point.effects.get(own + first.name, first.neutral)
    if effect.load and hung < -load:
        return False
    limits = {own + row.name: row.maximum for row in effect.leading}
    if not (effect.foreign or effect.load) and any(
        fitted.point.effects[c.name] >= c.high and c.high < limits.get(c.name, -inf) for c in fitted.coordinates
    ):
        return False
    intervals = estimates(fitted, discount) if any(row.surely for row in effect.parameters) else {}
    for row in (row for row in effect.parameters if not (row.surely and whole)):
        value, told = fitted.point.effects.get(own + row.name, row.neutral), intervals.get(own + row.name)
        low, high = told.interval_90 if told and row.surely else (value, value)  # none is told of what is not there
        least, most = row.possible_less if hung < 0.0 and row.possible_less else row.possible
        if high < least or low > most:
            return False
    return True
