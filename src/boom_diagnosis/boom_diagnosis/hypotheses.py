"""One round of the search: tolerances alone, every effect beside them, and what speaks for each.

How large the disturbances are that the observer assumes is itself estimated (likelihood): a loose observer follows a
machine that is far from the model; with a model that is right the tight one is the likeliest, and sees most.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial

import numpy as np
from numpy.typing import NDArray

from boom_diagnosis.absorbed import off_themselves
from boom_diagnosis.bag_samples import Bag
from boom_diagnosis.coordinates import Coordinate, all_coordinates, has_valleys
from boom_diagnosis.fitting import LEAST_STEP, WHITE, Point, Problem, gauss_newton, strained
from boom_diagnosis.nuisances import Nuisance
from boom_diagnosis.parallel import in_parallel
from boom_diagnosis.prediction import Predictor, with_states
from boom_diagnosis.search import FURTHER, GLANCE, Candidate, Fitted, Scanner, possible_effects, refine, worth_a_fit
from boom_diagnosis.sizes import size_of
from boom_diagnosis.weighing import NEGLIGIBLE
from boom_model.catalogue import EFFECTS
from boom_model.components.main_valve_orifices import FORM_SPECIFICATIONS
from boom_model.machine import Machine

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

LOOSENESS = (1.0, 4.0, 15.0, 60.0, 240.0)
"""Factors of the assumed disturbances that are tried; the likeliest is taken, and a machine that is like the model gets 1."""
REFINED, LOOSELY, PROMISING = 4, 2, 0.25
"""Effects that are fitted in a round at most, those with the loosest observer, which sees little of them, and the share of the nats
that they must gain which the linear look must promise."""
AFRESH = 2
"""Effects that are fitted anew from the nominal machine where a mismatch remains."""
AT_ONCE, GLANCED, FOLLOWED = 3, 12, 3
"""The same where it is far off: a load may be there, come, or swing. Those that are glanced at where none of these stands out, and
those of them that are fitted on: what the linear look promises is little where the tolerances could imitate much, if all were
linear."""
FAR_OFF = 0.1
"""Loss per innovation over that of white noise from which on effects are first looked for from the nominal machine."""
OUTSTANDING = 0.3
"""Share of what the tolerances leave over white noise that such an effect may leave."""
RETUNED = 0.3
"""Share of the base's loss over that of a healthy machine that an effect must gain for all to be weighed by gains that suit it."""
STUCK = 4.0
"""Loss per innovation over that of white noise from which on derivatives of the nominal machine have led the tolerances nowhere."""
BEHIND = 0.3
"""Share of what the best effect gains below which another one, fitted a few steps, is not followed further."""
CLOSE = 0.9
"""Share of what the best effect gains from which on another one may overtake it once it is fitted as well."""
MARGINAL = 0.03
"""Share of what an effect gains that tolerances alone may gain where their fit counts as good enough beside it."""
POLISH = 6
"""Steps of Gauss-Newton for an effect that is weighed."""
WEIGHED, RIVAL = 3, 0.1
"""Effects that are weighed again where the best makes another observer likelier, and the share of its gain they must have."""

SEEN_BEFORE, TELLING = 0.5, 0.5
"""Of an effect with states of its own: the share of a misfit that it explains to the observer it was found with, from which on that
one may weigh it, and the share of this that an observer of its own must show to do so."""
RELINEARISED, SETTLED = 5, 50.0
"""Fits of the tolerances with fresh derivatives at most, and the nats that the last one gained where they are good enough: a search
that gives up too early leaves a rest to whatever effect comes first."""
FLAT = 0.015
"""Share of what tolerances leave over white noise which their fit with fresh derivatives must gain for one more to be worth its
time."""
STEEP = 0.1
"""Share of what an effect leaves over white noise that a fit with fresh derivatives must gain for one more to be worth its time."""
NOTICED, NOTICED_EACH = 12.0, 0.5
"""Nats, and more for each tolerance, that tolerances must gain before they count as moved at all."""

SHAPES = frozenset(spec.key for spec in FORM_SPECIFICATIONS)
"""Numbers of the machine that are no sizes."""

Progress = Callable[[str, float], None]


@dataclass(frozen=True)
class Round:
    """What one round found.

    Attributes:
        accepted: effects before this round.
        base: the fit without a further effect. jacobian: its Jacobian (rows, z then accepted coordinates).
        fitted: further effects, the best first. scanned: gain of the linear look, effect -> nats.
        problem: in which they were weighed.
    """

    accepted: tuple[str, ...]
    base: Point
    jacobian: Array
    fitted: tuple[Fitted, ...]
    scanned: Mapping[str, float]
    problem: Problem


def effects_of(values: Mapping[str, float]) -> dict[str, dict[str, float]]:
    """Dotted values -> effect id -> parameter -> value."""
    result: dict[str, dict[str, float]] = {}
    for name, value in values.items():
        if name.startswith("effects."):
            _, effect, parameter = name.split(".")
            result.setdefault(effect, {})[parameter] = value
    return result


def problem_at(
    machine: Machine,
    bags: Sequence[Bag],
    select: Sequence[Flags],
    nuisances: Sequence[Nuisance],
    z: Array,
    values: Mapping[str, float],
    looseness: float,
    judged: Sequence[Flags] | None = None,
) -> Problem:
    """A problem whose observers' gains are those of this point."""
    plain = Problem(Predictor(machine, bags), nuisances, select)
    return Problem(Predictor(machine, bags, plain.values(z, values), looseness), nuisances, select, judged)


@dataclass(frozen=True)
class Fits:
    """Fits of the tolerances, and of numbers of effects beside them, with the observer that is likeliest.

    tight: with the one that is right for a healthy machine, whichever is likeliest.
    """

    machine: Machine
    bags: Sequence[Bag]
    select: Sequence[Flags]
    nuisances: Sequence[Nuisance]
    tight: bool = False

    def likeliest(self, z: Array, values: Mapping[str, float]) -> Problem:
        """The problem with the observer's gains of this point that make it likeliest."""
        tried = [
            problem_at(self.machine, self.bags, self.select, self.nuisances, z, values, looseness)
            for looseness in (LOOSENESS[:1] if self.tight else LOOSENESS)
        ]
        return max(tried, key=lambda p: p.likelihood_at(z, values))

    def fit(
        self, p: Problem, z: Array, values: Mapping[str, float], names: Sequence[Coordinate], enough: float = SETTLED
    ) -> tuple[Point, Array]:
        """From a point, with fresh derivatives while each fit gains ``enough`` [nats] and ``FLAT`` of what is left."""
        point = p.points([(z, values)])[0]
        for _ in range(RELINEARISED):
            before = point.loss
            point, jacobian = p.fit(point, p.nuisance_jacobian(point), names, iterations=6)
            if before - point.loss < max(enough, FLAT * point.over(WHITE)) or p.predictor.looseness == LOOSENESS[-1]:
                break
        return point, jacobian

    def settled(self, p: Problem, at: Point, names: Sequence[Coordinate]) -> tuple[Problem, Point, Array]:
        """The fit from a first guess; what was loose for that hides what is left."""
        point, jacobian = self.fit(p, at.z, at.effects, names)
        while (again := self.likeliest(point.z, point.effects)).predictor.looseness < p.predictor.looseness:
            p = again
            point, jacobian = self.fit(p, point.z, point.effects, names)
        return p, point, jacobian

    def healthy(self, at: Point, jacobian: Array) -> bool:
        """Whether tolerances end where those of a healthy machine may: not strained, and the tight observer sees little left."""
        tight = problem_at(self.machine, self.bags, self.select, self.nuisances, at.z, at.effects, LOOSENESS[0])
        if tight.points([(at.z, at.effects)])[0].excess(WHITE) > FAR_OFF:
            return False
        return not strained(at, jacobian)


def noticed(gain: float, count: int) -> bool:
    """Whether ``count`` tolerances that gain so much [nats] over their nominal values count as moved at all."""
    return gain >= NOTICED + NOTICED_EACH * count


def run_round(
    machine: Machine,
    bags: Sequence[Bag],
    select: Sequence[Flags],
    nuisances: Sequence[Nuisance],
    z: Array,
    values: Mapping[str, float],
    progress: Progress,
    nominal: Nominal | None = None,
    tight: bool = False,
    least: Callable[[Problem, Point], float] = lambda _, __: 0.0,
) -> Round:
    """Fits the tolerances (with the effects in ``values``), looks at all others, fits the best, weighs them.

    nominal: what is seen from the nominal machine, where the search is to begin there and not at ``z`` and ``values``.
    tight: with the observer that is right for a healthy machine, whichever is likeliest. least: nats that an effect must gain
    in the eyes of a problem's observer.
    """
    accepted = tuple(effects_of(values))
    kept = all_coordinates(accepted, size_of(machine))
    fits = Fits(machine, bags, select, nuisances, tight)

    progress("tolerances", 0.0)
    if nominal is None:  # near already
        searching = fits.likeliest(z, values)
        base, jacobian = fits.fit(searching, z, values, kept)
    else:
        base = nominal.tolerances
        searching = fits.likeliest(base.z, base.effects)
        far = searching.points([(base.z, base.effects)])[0].excess(WHITE) > FAR_OFF
        searching, base, jacobian = fits.settled(searching, base, kept)
        if fits.healthy(base, jacobian):  # likely all that there is to tell: to the end
            base, jacobian = fits.fit(searching, base.z, base.effects, kept, enough=LEAST_STEP)
        elif far:
            progress("effects", 0.2)
            outstanding = _at_once(nominal, fits)
            if outstanding:
                return outstanding
    unmoved = searching.fit_nominal(base.effects, kept)
    if not noticed(unmoved.loss - base.loss, len(base.z)):
        base = unmoved
    progress("effects", 0.3)
    scanner = Scanner(searching, base, jacobian)
    found = scanner.scan(possible_effects(machine.structure.has, accepted))
    scanned: dict[str, float] = {}
    grouped: dict[str, list[Candidate]] = {}
    for candidate in found:
        scanned[candidate.effect] = max(scanned.get(candidate.effect, 0.0), candidate.gain)
        grouped.setdefault(candidate.effect, []).append(candidate)
    progress("fitting effects", 0.5)
    most = LOOSELY if searching.predictor.looseness == LOOSENESS[-1] else REFINED
    needed = least(searching, base)
    gains = {effect: tried[0].gain for effect, tried in grouped.items()}
    # those level with the last one are as likely
    enough = max(PROMISING * needed, CLOSE * ([0.0] * most + sorted(gains.values()))[-most])
    promising = [effect for effect, gain in gains.items() if gain > enough]
    twins = [EFFECTS[effect].lasting for effect in promising]  # they may be one and the same
    promising = list(dict.fromkeys([*promising, *(twin for twin in twins if twin in grouped)]))

    def tried(effect: str, at_least: float, level: float) -> Fitted:
        return refine(scanner, jacobian, worth_a_fit(grouped[effect]), kept, at_least=at_least, level=level)

    fitted = list[Fitted]()
    for part in (promising[:2], promising[2:], None):
        enough, level = max(((BEHIND * f.gain, f.glanced) for f in fitted), default=(0.0, -np.inf))
        if part is None:  # what the linear look promises is little where the tolerances have bent
            far = base.excess(WHITE) > FAR_OFF and enough < BEHIND * (1.0 - OUTSTANDING) * base.over(WHITE)
            part = [effect for effect in gains if effect not in promising][: GLANCED if far else 0]
        fitted += in_parallel(partial(tried, at_least=enough, level=level), part)
    fitted = list(_sorted(fitted))
    if not fitted:
        return Round(accepted, base, jacobian, (), scanned, searching)
    progress("weighing effects", 0.8)
    best = fitted[0].point
    weighing = fits.likeliest(best.z, best.effects)
    same = weighing.predictor.looseness == searching.predictor.looseness
    if same:
        fitted[0] = _polished(searching, fitted[0], base, fitted[0].jacobian)
    searched = Round(accepted, base, jacobian, _sorted(fitted), scanned, searching)
    # an effect with states of its own is weighed by gains that correct them, too
    if same and not with_states(best.effects):
        return searched
    without, beside = weighing.points([(base.z, base.effects), (best.z, best.effects)])
    enough = max(SETTLED, MARGINAL * (without.loss - beside.loss))
    base, jacobian = fits.fit(weighing, base.z, base.effects, kept, enough=enough)
    near = [f for f in fitted[:WEIGHED] if f.gain > RIVAL * fitted[0].gain]
    weighed = Round(accepted, base, jacobian, _all_weighed(weighing, near, base, jacobian), scanned, weighing)
    if not weighed.fitted:  # an observer that an effect asks for, and that sees nothing of it, has no say
        return searched
    return _telling(searched, weighed) if same else weighed


def _telling(before: Round, after: Round) -> Round:
    """The round after its observer got the gains of its best effect; the one before where only that one shows what the effect does.

    Gains that correct states which nobody measures may follow a machine without these states as well.
    """
    seen = _share_gained(before)
    return before if seen > SEEN_BEFORE and _share_gained(after) < TELLING * seen else after


def _share_gained(found: Round) -> float:
    """Share that the best effect gains of what the base leaves over white noise, ``FAR_OFF`` per innovation at least."""
    best = found.fitted[0].gain if found.fitted else 0.0
    return best / max(found.base.over(WHITE), FAR_OFF * int(found.base.used.sum()))


class Nominal:
    """What is seen from the nominal machine: derivatives, the tolerances fitted from there, the linear look at effects.

    problem: observers of the nominal machine that bear with one that is far from right. values: effects that it has already.
    wrong: of the numbers, those that are known to be wrong. What was looked for once is known from then on.
    """

    def __init__(self, problem: Problem, values: Mapping[str, float] | None = None, wrong: Sequence[int] = ()) -> None:
        self.problem, self._wrong = problem, list(wrong)
        self.kept = all_coordinates(effects_of(values or {}), problem.size)
        self.at = problem.points([(np.zeros(len(problem.nuisances)), values or {})])[0]
        self.jacobian = problem.nuisance_jacobian(self.at)
        if self.kept:
            self.jacobian = np.concatenate([self.jacobian, problem.effect_jacobian(self.at, self.kept)], axis=1)
        self._scanner = Scanner(problem, self.at, self.jacobian)
        self._fitted: dict[str, Fitted] = {}
        self._glanced: dict[str, float] = {}

    @cached_property
    def tolerances(self) -> Point:
        """The fit without any further effect; what is wrong in the file comes first, as all others may be right.

        Sizes come before shapes: forms of edges make up for areas that are far off, in valleys that no fit leaves.
        """
        start, jacobian = self.at, self.jacobian.copy()
        if self._wrong:
            alone = np.zeros_like(jacobian)
            alone[:, self._wrong] = jacobian[:, self._wrong]
            start, _ = self.problem.fit(start, alone, self.kept, further=FURTHER)
            jacobian = self.problem.nuisance_jacobian(start)
        shapes = [k for k, n in enumerate(self.problem.nuisances) if n.name in SHAPES]
        jacobian[:, shapes] = 0.0
        point, _ = self.problem.fit(start, jacobian, self.kept, further=FURTHER)
        if shapes or point.excess(WHITE) > STUCK:
            point, _ = self.problem.fit(point, self.problem.nuisance_jacobian(point), self.kept)
        return point

    @cached_property
    def seen(self) -> dict[str, list[Candidate]]:
        """Of each effect that the machine does not have already all starts; the most promising effects and starts first."""
        seen: dict[str, list[Candidate]] = {}
        has = self.problem.predictor.machine.structure.has
        for candidate in self._scanner.scan(possible_effects(has, tuple(effects_of(self.at.effects)))):
            seen.setdefault(candidate.effect, []).append(candidate)
        return seen

    def _refined(self, effect: str, at_least: float, level: float = -np.inf) -> Fitted:
        start = self.seen[effect]
        start = start if has_valleys(EFFECTS[effect]) else start[:1]
        return refine(self._scanner, self.jacobian, start, self.kept, at_least=at_least, level=level)

    def gain(self, fitted: Fitted) -> float:
        """Of an effect over the tolerances [nats]."""
        return self.tolerances.loss - fitted.point.loss

    def fitted(self, effects: Sequence[str]) -> list[Fitted]:
        """Effects fitted from the nominal machine, in this order; those that soon fall far behind the first one not to the end."""

        def fitted(effect: str, at_least: float = 0.0, level: float = -np.inf) -> Fitted:
            if effect not in self._fitted:
                self._fitted[effect] = self._refined(effect, at_least, level)
            return self._fitted[effect]

        first = [fitted(effect) for effect in effects[:1]]
        gain = max((self.gain(f) for f in first), default=0.0)
        large = gain > BEHIND * self.tolerances.over(WHITE)
        needed = self.at.loss - self.tolerances.loss + BEHIND * gain if large else 0.0
        level = min((f.glanced for f in first), default=-np.inf)
        return first + in_parallel(lambda effect: fitted(effect, needed, level), effects[1:])

    def glance(self, most: int) -> None:
        """A few steps for the ``most`` effects that the linear look finds most promising; the best of them are fitted on."""
        waiting = [effect for effect in list(self.seen)[:most] if effect not in self._fitted]
        anew = [effect for effect in waiting if effect not in self._glanced]
        looked = in_parallel(lambda effect: self._refined(effect, at_least=np.inf), anew)
        self._glanced |= {f.effect: f.glanced for f in looked}
        ahead = sorted(waiting, key=self._glanced.__getitem__)[:FOLLOWED]
        self.fitted([*(f.effect for f in self.best[:1]), *ahead])

    @property
    def best(self) -> list[Fitted]:
        """All that were fitted, the best first."""
        return sorted(self._fitted.values(), key=lambda f: f.point.loss)


def rebased(found: Round) -> Round:
    """The round with a better base, where the tolerances of an effect's fit serve better without the effect, too.

    What an effect gains would else be what the search for the base missed. The tolerances stay where they are, or go where they
    make up for the effect; where the effect is a number's being off, within its tolerance the number is off itself.
    """
    if not found.fitted:
        return found
    kept, problem = all_coordinates(found.accepted, found.problem.size), found.problem
    wanted = []
    for f in found.fitted:
        values = {c.name: f.point.effects[c.name] for c in kept}
        off = [np.clip(z, *problem.limits) for z in off_themselves(problem, f)]
        wanted += [(z, values) for z in (f.point.z, _made_up(problem, f), *off)]
    without = min(problem.points(wanted), key=lambda p: p.loss)
    if without.loss >= found.base.loss + found.fitted[0].gain:
        return found
    base, jacobian = problem.fit(without, found.jacobian[:, : len(without.z)], kept)
    if base.loss >= found.base.loss:
        return found
    fitted = _sorted([replace(f, gain=base.loss - f.point.loss) for f in found.fitted])
    return replace(found, base=base, jacobian=jacobian, fitted=fitted)


def _made_up(problem: Problem, f: Fitted) -> Array:
    """z that makes up best for an effect's vanishing, by the derivatives at its fit: a step of Gauss and Newton."""
    count, w = len(f.point.z), f.point.w.copy()
    neutral = {f"effects.{f.effect}.{row.name}": row.neutral for row in EFFECTS[f.effect].leading}
    for c, column in zip(f.coordinates, f.jacobian.T[count:], strict=True):
        if c.name in neutral:
            here, there = f.point.effects[c.name], neutral[c.name]
            # of what vanishes at 0 the logarithm is far from linear: x dw/dx is dw/d(log x)
            w += column * (-1.0 if c.positive and there == 0.0 else c.inner(there) - c.inner(here))
    (step,) = gauss_newton(replace(f.point, w=w), f.jacobian[:, :count], (), problem.limits)
    return np.asarray(np.clip(f.point.z + step, *problem.limits))


def _at_once(first: Nominal, fits: Fits) -> Round | None:
    """The round where an effect is so large that it stands out from the nominal machine, else None.

    The tolerances alone, fitted to such a machine, end far from anything, and the search with them.
    """
    base = first.tolerances
    first.fitted(list(first.seen)[:AT_ONCE])
    if first.best[0].point.excess(WHITE) > FAR_OFF:
        first.glance(GLANCED)
    tried = first.best
    best = tried[0].point
    if best.excess(WHITE) > OUTSTANDING * base.excess(WHITE):
        return None
    weighing = fits.likeliest(best.z, best.effects)
    start = weighing.points([(best.z, best.effects)])[0]
    gained = weighing.points([(base.z, {})])[0].loss - start.loss
    base, jacobian = fits.fit(weighing, base.z, {}, (), enough=max(SETTLED, MARGINAL * gained))
    near = [f for f in tried if first.gain(f) >= BEHIND * first.gain(tried[0])]
    fitted = _all_weighed(weighing, near, base, jacobian)
    return Round((), base, jacobian, fitted, {e: own[0].gain for e, own in first.seen.items()}, weighing)


def afresh(found: Round, first: Nominal, wanted: Sequence[str], floor: float) -> Round:
    """The round with some effects fitted anew from the nominal machine.

    Tolerances that have bent far enough to stand in for an effect leave it nothing to gain where they are.

    wanted: effects to fit, beside those that the linear look at the nominal machine finds most promising. floor: loss per
    innovation of a healthy machine.
    """
    count = int(found.base.used.sum())
    left = found.base.over(floor) - max((f.gain for f in found.fitted), default=0.0)
    least = min(max(OUTSTANDING * found.base.over(floor), NEGLIGIBLE * count), FAR_OFF * count)
    if left > least:
        first.glance(GLANCED)
    glanced = [f.effect for f in first.best[:AFRESH]]
    effects = list(dict.fromkeys([*glanced, *list(first.seen)[:AFRESH], *(e for e in wanted if e in first.seen)]))
    anew = first.fitted(effects)
    most = max(first.gain(f) for f in anew)
    fitted = {f.effect: f for f in found.fitted}
    promising = [f for f in anew if first.gain(f) >= max(BEHIND * most, LEAST_STEP)]
    for near in in_parallel(lambda f: _weighed(found.problem, f, found.base), promising):
        if near.effect not in fitted or near.point.loss < fitted[near.effect].point.loss:
            fitted[near.effect] = near
    best = _sorted(list(fitted.values()))
    if not best or best[0].gain < RETUNED * found.base.over(floor):
        return replace(found, fitted=best)
    p, point = found.problem.predictor, best[0].point
    retuned = problem_at(
        p.machine, p.bags, found.problem.select, first.problem.nuisances, point.z, point.effects, p.looseness
    )
    start = retuned.points([(found.base.z, found.base.effects)])[0]
    base, jacobian = retuned.fit(start, retuned.nuisance_jacobian(start), all_coordinates(found.accepted, retuned.size))
    rivals = [f for f in best[:WEIGHED] if f.gain > RIVAL * best[0].gain]
    again = _all_weighed(retuned, rivals, base, jacobian)
    after = replace(found, base=base, jacobian=jacobian, fitted=again, problem=retuned)
    return _telling(replace(found, fitted=best), after) if with_states(point.effects) else after


def _weighed(problem: Problem, f: Fitted, base: Point, columns: Array | None = None, at_least: float = 0.0) -> Fitted:
    """The same effect fitted again, with an observer of other gains; ``columns``, ``at_least`` as in :func:`_polished`."""
    return _polished(problem, _seen(problem, f), base, columns, at_least)


def _all_weighed(problem: Problem, best_first: Sequence[Fitted], base: Point, jacobian: Array) -> tuple[Fitted, ...]:
    """Several effects fitted again; derivatives of the tolerances at the base are good enough for those behind the best."""
    columns = jacobian[:, : len(base.z)]
    most = max((f.gain for f in best_first), default=0.0)
    rivals = [f for f in best_first if f.gain >= CLOSE * most]
    best = in_parallel(lambda f: _settled(problem, f, base), rivals)
    behind = max((BEHIND * f.gain for f in best), default=0.0)
    others = best_first[len(rivals) :]
    return _sorted(best + in_parallel(lambda f: _weighed(problem, f, base, columns, behind), others))


def _seen(problem: Problem, f: Fitted) -> Fitted:
    """The same point as an observer of other gains sees it; gain and derivatives are still those before."""
    return replace(f, point=problem.points([(f.point.z, f.point.effects)])[0])


def _settled(problem: Problem, f: Fitted, base: Point) -> Fitted:
    """The same, with fresh derivatives as long as they gain ``STEEP`` of what is left."""
    near = _seen(problem, f)
    for _ in range(RELINEARISED):
        before, near = near.point, _polished(problem, near, base, None)
        if before.loss - near.point.loss < max(SETTLED, STEEP * near.point.over(WHITE)):
            break
    return near


def _polished(problem: Problem, f: Fitted, base: Point, jacobian: Array | None, at_least: float = 0.0) -> Fitted:
    """Fitted on.

    jacobian: as :meth:`Problem.fit` wants it, None where it is to be taken here. at_least: nats that it must have gained over
    ``base`` after ``GLANCE`` steps to be followed further.
    """
    if jacobian is None:
        jacobian = problem.nuisance_jacobian(f.point)
    point, jacobian = problem.fit(f.point, jacobian, f.coordinates, iterations=GLANCE)
    if base.loss - point.loss > at_least and f.point.loss - point.loss > LEAST_STEP:
        point, jacobian = problem.fit(point, jacobian, f.coordinates, iterations=POLISH - GLANCE)
    return replace(f, point=point, jacobian=jacobian, gain=base.loss - point.loss)


def _sorted(fitted: Sequence[Fitted]) -> tuple[Fitted, ...]:
    """Those that gain anything, the best first."""
    return tuple(sorted((f for f in fitted if f.gain > 0.0), key=lambda f: f.point.loss))
