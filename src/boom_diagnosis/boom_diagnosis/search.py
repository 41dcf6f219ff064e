"""Which effects could explain what the tolerances do not: a linear look at all, then a fit of the best few.

Each effect is tried at one or more places (a run or two each). The difference that it makes, freed of what the tolerances can
imitate, is compared with the innovations: how much of them would it take away, at the best size?
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from math import sqrt

import numpy as np
from numpy.typing import NDArray

from boom_diagnosis.bag_samples import visited
from boom_diagnosis.coordinates import Coordinate, coordinates, has_valleys, starts
from boom_diagnosis.fitting import WHITE, Point, Problem, weights
from boom_diagnosis.onset import near_onset, neutral, onset_of, release_of, steps_in, time_in
from boom_diagnosis.plainer import TIMED, plainer
from boom_diagnosis.steps import bounded
from boom_model.catalogue import CATALOGUE, EFFECTS, Effect

Array = NDArray[np.float64]

STEPS, GLANCE = 5, 2
"""Of Gauss-Newton for an effect, and those after which one that is far behind another is left."""
FURTHER = 6
"""Steps beyond those while each still gains much: from the nominal machine it is far to a large effect."""
STARTS = (1.0, 0.5, 0.2, 0.05)
"""Shares of the linear look's size from which an effect is fitted."""
BEGUN = 2
"""Candidates of an effect that are fitted, those whose best start is the likeliest."""
PROBES = 16
"""Predicted at once."""
NEARER = 0.5
"""Share of a probe below which it is taken once more."""
LEAST_MISFIT = 50.0
"""Nats that there may always be to explain."""
ONSET_STEP = 10
"""Intervals between the times at which an effect that begins is looked for."""
MOMENTS = 400
"""Times, at most, of which one that begins and ends is looked for between any two."""


@dataclass(frozen=True)
class Candidate:
    """An effect with the values to start from and what it would gain [nats] by the linear look.

    probe: values at which the look was taken: of an effect that sets in at some size they may be the better start.
    """

    effect: str
    values: dict[str, float]
    gain: float
    probe: dict[str, float] | None = None


@dataclass(frozen=True)
class Fitted:
    """An effect fitted together with the tolerances.

    Attributes:
        gain: decrease of the loss against the tolerances alone [nats].
        jacobian: (rows, z then coordinates) at the point.
        starts: losses reached from each start. glanced: the best of them after ``GLANCE`` steps.
    """

    effect: str
    point: Point
    coordinates: tuple[Coordinate, ...]
    jacobian: Array
    gain: float
    starts: tuple[float, ...]
    glanced: float = -np.inf


class Scanner:
    """The linear look: innovations of a fitted point, with its tolerances (and accepted effects) projected out.

    A tolerance that would have to leave its limits stands at the limit, and imitates nothing.
    """

    def __init__(self, problem: Problem, at: Point, jacobian: Array) -> None:
        self.problem, self.at = problem, at
        self.load = max(problem.predictor.plant(i, frozenset()).pose.load for i in range(len(problem.predictor.bags)))
        self.omega = weights(at)
        count = len(at.z)
        size = np.maximum(np.sqrt(np.sum(jacobian * jacobian, axis=0)), 1e-9)
        size[:count] = 1.0
        scaled = jacobian / size
        prior = np.full(jacobian.shape[1], 1e-9)
        prior[:count] = 1.0
        weighted = scaled * self.omega[:, None]
        normal = weighted.T @ scaled + np.diag(prior)
        score = weighted.T @ at.w
        score[:count] += at.z
        unlimited = np.full(len(prior) - count, np.inf)
        low, high = (
            np.concatenate([ends - at.z, sign * unlimited]) for ends, sign in zip(problem.limits, (-1, 1), strict=True)
        )
        moved, self._free = bounded(normal, score, np.minimum(low, 0.0), np.maximum(high, 0.0))
        free = self._free
        self._moved = np.where(free, 0.0, moved)
        self._weighted, self._factor = weighted[:, free], np.linalg.inv(normal[np.ix_(free, free)])
        self._w = at.w + scaled @ self._moved
        self._score = (score + normal @ self._moved)[free]

    def gain(self, columns: Array) -> tuple[float, Array]:
        """Decrease of the loss [nats] by moving along columns (rows, k) from the point, and the sizes (k,)."""
        cross = self._weighted.T @ columns
        projected = (columns * self.omega[:, None]).T @ columns - cross.T @ self._factor @ cross
        score = columns.T @ (self.omega * self._w) - cross.T @ self._factor @ self._score
        scale = np.sqrt(np.maximum(np.diag(projected), 1e-12))
        size = -np.linalg.lstsq(projected / np.outer(scale, scale), score / scale, rcond=1e-9)[0] / scale
        return float(-0.5 * score @ size), size

    def scan(self, wanted: Sequence[str]) -> list[Candidate]:
        """Candidates of these effects, the best first.

        A probe that changes the innovations by far more than what is to be explained says little about small ones; it is taken once
        more, in proportion.
        """
        duration = max(bag.recording.duration for bag in self.problem.predictor.bags)
        size, angles = self.problem.size, visited(self.problem.predictor.bags)
        points = {effect: starts(EFFECTS[effect], duration, size, angles, self.load) for effect in wanted}
        tried = side_by_side([(effect, start) for effect in wanted for start in points[effect]])
        seen = self._probed(tried)
        misfit = max(self.at.over(WHITE), LEAST_MISFIT)
        shares = [sqrt(2.0 * misfit) / max(size, 1e-9) for _, size in seen]
        large = [k for k, share in enumerate(shares) if share < NEARER and not _as_it_is(EFFECTS[tried[k][0]])]
        nearer = self._probed([(tried[k][0], _scaled(*tried[k], shares[k])) for k in large])
        best = [candidate for candidate, _ in seen]
        for k, (candidate, _) in zip(large, nearer, strict=True):
            best[k] = max(best[k], candidate, key=lambda c: c.gain)
        return sorted(self._joined(best), key=lambda c: -c.gain)

    def _probed(self, tried: Sequence[tuple[str, dict[str, float]]]) -> list[tuple[Candidate, float]]:
        """The candidate that each probe gives, and the norm of what it changes in the innovations."""
        found = []
        for k in range(0, len(tried), PROBES):
            part = tried[k : k + PROBES]
            points = self.problem.points([(self.at.z, {**self.at.effects, **self._probe(*t)}) for t in part])
            for (effect, start), point in zip(part, points, strict=True):
                column = point.w - self.at.w
                timed = EFFECTS[effect].onset
                candidate = self._onset(effect, start, column) if timed else self._candidate(effect, start, column)
                found.append((candidate, float(np.linalg.norm(column))))
        return found

    def _probe(self, effect: str, start: dict[str, float]) -> dict[str, float]:
        """What is predicted: of a load that comes, one that has always been there."""
        return lasting(effect, start) if EFFECTS[effect].lasting else start

    def _candidate(self, effect: str, start: dict[str, float], column: Array) -> Candidate:
        gain, size = self.gain(column[:, None])
        leading = _leading(effect, start)
        nothing = neutral(leading.name)
        value = nothing + float(size[0]) * (start[leading.name] - nothing)
        low = max(leading.low, -self.load) if EFFECTS[effect].load else leading.low
        clipped = float(np.clip(value, low, leading.high))
        share = (clipped - nothing) / (start[leading.name] - nothing)
        if abs(share) <= 0.02 < abs(size[0]):  # it would have to leave its limits
            gain = 0.0
        elif clipped != value:  # the parabola at the limit
            gain *= max(0.0, 1.0 - (1.0 - share / float(size[0])) ** 2)
        return Candidate(
            effect, {**start, leading.name: clipped if abs(share) > 0.02 else start[leading.name]}, gain, start
        )

    def _joined(self, found: list[Candidate]) -> list[Candidate]:
        """Effects of independent numbers: what they gain together, from the sum of their single gains."""
        result = [c for c in found if not EFFECTS[c.effect].independent]
        grouped: dict[str, list[Candidate]] = {}
        for c in found:
            if EFFECTS[c.effect].independent:
                grouped.setdefault(c.effect, []).append(c)
        for effect, own in grouped.items():
            values = {
                name: next((c.values[name] for c in own if c.values[name] != neutral(name)), neutral(name))
                for name in own[0].values
            }
            result.append(Candidate(effect, values, sum(c.gain for c in own)))
        return result

    def _onset(self, effect: str, start: dict[str, float], column: Array) -> Candidate:
        """A mass that comes at t_g, or above s_g: there, ``column``, what a lasting one changes."""
        mass, place = coordinates(EFFECTS[effect])[0].name, onset_of(effect)
        bags = self.problem.predictor.bags
        for own, stroke in steps_in(start):
            mass, place = own, stroke
        lifted = place != onset_of(effect)
        where = [bag.strokes(self.problem.predictor.machine) if lifted else bag.time for bag in bags]
        high = coordinates(EFFECTS[effect], self.problem.size)[0].high
        size, at, gain = self._beyond(where, column, start[mass], high)
        found = {**start, mass: size, place: at}
        if not lifted:
            held, begin, end, more = self._between(where, column, start[mass], high)
            if more > gain + TIMED:
                found, gain = {**start, mass: held, place: begin, release_of(effect): end}, more
        return Candidate(effect, found, gain)

    def _beyond(self, where: Sequence[Array], column: Array, mass: float, high: float) -> tuple[float, float, float]:
        """Best size, place and gain of what changes the innovations as ``mass`` does, ``column``, beyond a place and not before.

        where: of each recording (n,) places, times or strokes. high: largest size. The observer forgets in a second.
        """
        t, g, power, c = self._sums(where, column, 4 * ONSET_STEP)
        projected = power - np.einsum("ij,jk,ik->i", c, self._factor, c)
        masses, gains = self._sized(g, projected, mass, high)
        k = int(np.argmax(gains))
        return float(masses[k]), float(t[k]), float(gains[k])

    def _between(
        self, where: Sequence[Array], column: Array, mass: float, high: float
    ) -> tuple[float, float, float, float]:
        """Best size, beginning, end and gain of what does so between two times."""
        rows = sum(len(t) * s.shape[1] for t, s in zip(where, self.problem.rows, strict=True))
        t, g, power, c = self._sums(where, column, max(4 * ONSET_STEP, rows // MOMENTS))
        mixed = c @ self._factor @ c.T
        own = power - np.diag(mixed)
        projected = np.tril(own - own[:, None] - 2.0 * (np.diag(mixed)[:, None] - mixed), -1)
        masses, gains = self._sized(g - g[:, None], projected, mass, high)
        end, begin = np.unravel_index(int(np.argmax(gains)), gains.shape)
        return float(masses[end, begin]), float(t[begin]), float(t[end]), float(gains[end, begin])

    def _sums(self, where: Sequence[Array], column: Array, apart: int) -> tuple[Array, Array, Array, Array]:
        """Places, every ``apart`` rows, and over all rows beyond each: score, power and (., free) product with the tolerances."""
        places = np.concatenate(
            [np.broadcast_to(v[:, None], s.shape)[s] for v, s in zip(where, self.problem.rows, strict=True)]
        )
        order = np.argsort(places, kind="stable")
        t, s, w = places[order], column[order], (self.omega * self._w)[order]
        omega, nw = self.omega[order], self._weighted[order]
        # sums over all samples beyond a place
        score = np.cumsum((s * w)[::-1])[::-1]
        power = np.cumsum((omega * s * s)[::-1])[::-1]
        cross = np.cumsum((nw * s[:, None])[::-1], axis=0)[::-1]
        pick = np.arange(0, len(t), apart)
        c = cross[pick]
        return t[pick], score[pick] - c @ self._factor @ self._score, power[pick], c

    def _sized(self, g: Array, projected: Array, mass: float, high: float) -> tuple[Array, Array]:
        """Best sizes and their gains; none beyond what may hang there."""
        masses = -mass * g / np.maximum(projected, 1e-9)
        outside = (masses < -self.load) | (masses > high)
        return masses, np.where(outside, 0.0, 0.5 * g * g / np.maximum(projected, 1e-9))

    def next_step(self, effect: str, values: dict[str, float]) -> dict[str, float]:
        """A load that leaves the ground, ``values`` by dotted name, with one step more where it has one left; else none."""
        used = steps_in(values)
        left = [(f"effects.{effect}.{mass}", f"effects.{effect}.{stroke}") for mass, stroke in EFFECTS[effect].steps]
        left = [step for step in left if step not in used]
        if not used or not left:
            return {}
        (mass, stroke), first = left[0], used[0][0]
        here = self.problem.points([(self.at.z, {**self.at.effects, **lasting(effect, values)})])[0]
        where = [bag.strokes(self.problem.predictor.machine) for bag in self.problem.predictor.bags]
        size, at, _ = self._beyond(
            where, here.w - self.at.w, values[first], coordinates(EFFECTS[effect], self.problem.size)[0].high
        )
        return {mass: size, stroke: at}

    def follow(self, columns: Array, size: Array) -> Array:
        """z that the tolerances would take if the innovations changed by columns @ size."""
        moved = self._moved.copy()
        moved[self._free] -= self._factor @ (self._score + self._weighted.T @ (columns @ size))
        return np.asarray(np.clip(self.at.z + moved[: len(self.at.z)], *self.problem.limits))


def refine(
    scanner: Scanner,
    jacobian: Array,
    candidates: Sequence[Candidate],
    kept: Sequence[Coordinate] = (),
    *,
    at_least: float = 0.0,
    level: float = -np.inf,
) -> Fitted:
    """Fits one effect (and the numbers ``kept`` of those accepted before) from its candidates and keeps the best.

    Of several candidates one that is behind another after ``GLANCE`` steps is not followed further.
    at_least, level: nats that a start must have gained after ``GLANCE`` steps to be followed further, or the loss it must have
    reached then, that of the best so far.
    """
    problem, at = scanner.problem, scanner.at
    names = (*kept, *coordinates(EFFECTS[candidates[0].effect], problem.size))
    count = len(at.z)
    reached: list[tuple[Point, Array]] = []
    glanced = np.inf
    begun = [(_start(scanner, candidate), candidate) for candidate in candidates]
    for start, candidate in sorted(begun, key=lambda b: b[0].loss)[:BEGUN]:
        before, own = problem.fit(start, jacobian[:, :count], names, iterations=1)
        point, own = problem.fit(before, own, names, iterations=GLANCE - 1)
        leading, glanced = point.loss < glanced, min(glanced, point.loss)
        # another step may gain as much as the last
        enough = at.loss - point.loss + (before.loss - point.loss) > at_least or point.loss <= level
        if leading and enough:
            point, own = problem.fit(point, own, names, iterations=STEPS - GLANCE, further=FURTHER)
            if time_in(candidate.values) and at.loss - point.loss > TIMED:
                point, own = _placed(problem, point, own, names)
        reached.append((point, own))
    point, final = min(reached, key=lambda r: r[0].loss)
    losses = tuple(r[0].loss for r in reached)
    effect = candidates[0].effect
    point, final, names = plainer(problem, point, final, names, effect, iterations=STEPS)
    return Fitted(effect, point, names, final, at.loss - point.loss, losses, glanced)


def _placed(problem: Problem, point: Point, jacobian: Array, names: Sequence[Coordinate]) -> tuple[Point, Array]:
    """A load fitted on: from the likeliest times near by, as its loss has many valleys; one by stroke with another step."""
    count, effect = len(point.z), time_in(point.effects).split(".")[1]
    if not steps_in(point.effects):
        return problem.fit(near_onset(problem, point), jacobian[:, :count], names, iterations=STEPS)
    step = Scanner(problem, point, jacobian).next_step(effect, point.effects)

    def fitted(z: Array, values: dict[str, float]) -> tuple[Point, Array]:
        start = problem.points([(z, {**point.effects, **values})])[0]
        return problem.fit(start, jacobian[:, :count], names, iterations=STEPS, further=FURTHER)

    more, steps = fitted(point.z, step), steps_in(point.effects | step)
    first = {steps[0][0]: sum(more[0].effects[mass] for mass, _ in steps)}
    first |= {name: neutral(name) for other in steps[1:] for name in other}
    again = fitted(more[0].z, more[0].effects | first)  # one step may get further now
    one = min((point, jacobian), again, key=lambda found: found[0].loss)
    return more if one[0].loss - more[0].loss > TIMED else one


def _start(scanner: Scanner, candidate: Candidate) -> Point:
    """The best of a few points on the way to the candidate, with the tolerances where they are and where they follow."""
    at = scanner.at
    leading = {name for name, value in candidate.values.items() if value != neutral(name)}
    if not EFFECTS[candidate.effect].independent:
        entry = EFFECTS[candidate.effect]
        shape = [row for row in entry.parameters if not (row.acts or row in entry.leading)]
        leading -= {f"effects.{candidate.effect}.{row.name}" for row in shape}
    wanted = []
    for share in STARTS:
        values = {
            n: (neutral(n) + share * (v - neutral(n)) if n in leading else v) for n, v in candidate.values.items()
        }
        wanted.append((at.z, {**at.effects, **values}))
    if candidate.probe:
        probes = [_scaled(candidate.effect, candidate.probe, share) for share in EFFECTS[candidate.effect].sets_in]
        wanted += [(at.z, {**at.effects, **probe}) for probe in probes]
    points = scanner.problem.points(wanted)
    followed = scanner.problem.points(
        [
            (scanner.follow((p.w - at.w)[:, None], np.ones(1)), p.effects)
            for p in sorted(points, key=lambda p: p.loss)[:2]
        ]
        + [(np.zeros_like(at.z), points[0].effects)]
    )
    return min(points + followed, key=lambda p: p.loss)


def worth_a_fit(candidates: Sequence[Candidate]) -> list[Candidate]:
    """Of one effect, the best first: all where its numbers trade off, else the best, and the next if it promises nearly as much.

    What the linear look promises from the nominal machine says little about valleys far from there.
    """
    if has_valleys(EFFECTS[candidates[0].effect]):
        return list(candidates)
    return list(candidates[:1]) + [c for c in candidates[1:2] if c.gain > 0.5 * candidates[0].gain]


def lasting(effect: str, values: Mapping[str, float]) -> dict[str, float]:
    """The load that has always been there, of one that comes; values by dotted name."""
    twin = EFFECTS[EFFECTS[effect].lasting]
    return {f"effects.{twin.id}.{row.name}": values[f"effects.{effect}.{row.name}"] for row in twin.parameters}


def possible_effects(has: Callable[[str], bool], without: Sequence[str] = ()) -> list[str]:
    """Effects that a machine can have and does not have yet."""
    return [effect.id for effect in CATALOGUE if has(effect.needs) and effect.id not in without]


def side_by_side(tried: Sequence[tuple[str, dict[str, float]]]) -> list[tuple[str, dict[str, float]]]:
    """Probes in the order in which they are predicted: those of one plant go side by side."""
    return sorted(tried, key=lambda t: [min(state.name, state.symbol) for state in EFFECTS[t[0]].states])


def _as_it_is(effect: Effect) -> bool:
    """Whether its probes are taken once only.

    What sets in at some size does nothing in proportion, and a delay moves samples between intervals.
    """
    return bool(effect.delays or len(effect.sets_in) > 1)


def _leading(effect: str, start: Mapping[str, float]) -> Coordinate:
    """The number of an effect that a probe moves in proportion."""
    own = coordinates(EFFECTS[effect])
    moved = [c for c in own if start[c.name] != neutral(c.name)]
    return moved[0] if moved else own[0]


def _scaled(effect: str, start: dict[str, float], share: float) -> dict[str, float]:
    name = _leading(effect, start).name
    return {**start, name: neutral(name) + share * (start[name] - neutral(name))}
