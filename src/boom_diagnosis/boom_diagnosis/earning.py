"""What an effect must show to earn its place: gain on data used and not used, free runs over data not used."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from math import log, sqrt

import numpy as np

from boom_diagnosis.bag_samples import PERIOD
from boom_diagnosis.case import Array, Case, Flags
from boom_diagnosis.coordinates import Coordinate, all_coordinates
from boom_diagnosis.document import Estimate
from boom_diagnosis.fitting import Point, Problem
from boom_diagnosis.hypotheses import WEIGHED, Round, noticed, problem_at
from boom_diagnosis.locating import disturbed, links
from boom_diagnosis.must_keep import told
from boom_diagnosis.nuisances import TWIN_Z
from boom_diagnosis.onset import onset_of, steps_in
from boom_diagnosis.onset import own as own_numbers
from boom_diagnosis.parallel import in_parallel
from boom_diagnosis.prediction import CURRENT_NOISE
from boom_diagnosis.proof import worsening
from boom_diagnosis.search import Fitted, lasting
from boom_diagnosis.sizes import sized
from boom_diagnosis.weighing import (
    COLDEST,
    ENOUGH,
    NEGLIGIBLE,
    OTHER_FORM,
    TOO_SMALL,
    UNEXPLAINED_WEIGHT,
    Weighed,
    estimates,
    forgotten,
    occam,
    of_effect,
    possible,
    precision,
    predictive_loss,
    split_loss,
)
from boom_model.catalogue import EFFECTS
from boom_model.component_numbers import component_parameters
from boom_model.machine import Machine, Pose

WORSE, LATER, LATER_CLEAR = 1.1, 1.0, 1.5
"""Factor by which the free runs over data not used may err more with an effect than without, for the first one and for one beside
others or of a size that cannot be told: one that pays for what the numbers cannot take up, but is not there, makes the free run
worse. The last for one beside others that explains nearly all of a clear rest: errors of those before, in forms that are not the
machine's, may have cancelled."""
BEARABLE = ((0.6, 3.0), (0.3, 1.5), (0.0, WORSE))
"""Shares of all that the tolerances cannot take up, and factors by which a first effect that explains more may leave free runs
worse: another one that is not in the model yet may dominate them, and tolerances that bend for both may hide it there."""
MOST_OF_REST, NEARLY_ALL, CLEAR_REST = 0.6, 0.8, 0.05
"""Share of a rest that a further effect must explain not to be taken for what another's form leaves, the share from which on it may
leave free runs worse, and the least such rest [nats per innovation]."""
BEYOND, CLEARLY = 0.5, 10.0
"""Of a number's tolerance: an effect that is its being further off begins there, unless it gains so many times chance."""
SWALLOWED = 2.0
"""Standard deviations of the spool that a play swallows with the noise of measured currents (twice: 95 % of it)."""
CLEARLY_BETTER = 0.8
"""The same factor below which an effect has proved itself even where its one-step predictions of that data have not."""
NEXT_TO_NOTHING = 0.02
"""Share of a clear rest that the nominal numbers leave, below which moved ones are right, whatever free runs say."""
TRAINING = 3
"""Iterations of the fit to the data for training alone, from the fit to all."""


def take(case: Case) -> bool:
    """Takes the first effect of the last round that earns its place; whether there is one.

    What free runs over data not used disprove is no alternative any more; nor is what gains there alone, and on the data fitted
    costs more than chance. One that makes them worse is borne with only where no other explains most, too, and does not.
    """
    k = len(case.taken)
    weighed = case.weighed[k]
    while weighed and weighed[0].net > needed(case, weighed[0]):
        proved = _proved(case, k, weighed[0])
        if proved and not (proved[1] > WORSE and _borne_for_nothing(case, k)):
            case.taken.append(weighed[0])
            case.trained.append(proved[0])
            return True
        disproved = weighed.pop(0)
        if k == 0:
            case.disproved.append(disproved)
    return False


def _borne_for_nothing(case: Case, k: int) -> bool:
    """Whether another effect of the last round explains most, too, and makes free runs no worse."""
    kept = dict(case.spared)
    others = [w for w in case.weighed[k][1:] if _share_explained(case, w) > BEARABLE[0][0]]
    proved = [_proved(case, k, w) for w in others]
    case.spared.clear()
    case.spared.update(kept)
    return any(found and found[1] <= LATER for found in proved)


def _proved(case: Case, k: int, best: Weighed) -> tuple[Point, float] | None:
    """The fit to the data for training of an effect beside ``k`` others that proves itself on data not used.

    With it the factor by which free runs over that data err more.
    """
    if best.gain <= -chance(case):
        return None
    fitted = best.fitted
    trained = settle(case, k + 1, case.rounds[k].problem, fitted.point, fitted.jacobian, fitted.coordinates)
    factor = worsening(case, case.trained[k], trained)
    if factor <= _bearable(case, best) and (best.held_out_gain > 0.0 or factor <= CLEARLY_BETTER):
        return trained, factor
    case.spared.pop(k + 1, None)
    return None


def _share_explained(case: Case, best: Weighed) -> float:
    """Share of what the last round begins with that an effect explains, of the recordings that are fitted."""
    return (best.gain if case.proving else best.net) / max(case.rounds[-1].base.over(case.floor), 1e-9)


def clear(case: Case, at: Point) -> bool:
    """Whether a point leaves a clear rest."""
    return at.over(case.floor) > CLEAR_REST * int(at.used.sum())


def _share_of_clear_rest(case: Case, best: Weighed) -> float:
    """Share of a clear rest that an effect explains; 0 where the rest is not clear."""
    return _share_explained(case, best) if clear(case, case.rounds[-1].base) else 0.0


def needed(case: Case, best: Weighed) -> float:
    """Nats that an effect must gain, held out, too; of one that explains most of a clear rest the effects before ask nothing."""
    held_out = TOO_SMALL * sum(int(bag.counted.sum()) for bag in case.proving)
    clearly = _share_of_clear_rest(case, best) > MOST_OF_REST
    asked = held_out + (chance(case) if clearly else _beside_others(case, case.rounds[-1].problem))
    sure = ENOUGH * temperature(case, best.fitted.point) / COLDEST  # as what it leaves unexplained lets anything be
    return max(asked, sure) if case.taken and not clearly else asked


def _bearable(case: Case, best: Weighed) -> float:
    """Factor by which free runs over data not used may err more with an effect than without."""
    if case.taken:
        return LATER_CLEAR if _share_of_clear_rest(case, best) > NEARLY_ALL else LATER
    effect, numbers = best.fitted.effect, numbers_of(case, best.fitted)
    if numbers and not told(effect, of_effect(numbers, effect), case.size):  # one that cannot be told from nothing
        return LATER
    share = _share_explained(case, best)
    return next((factor for least, factor in BEARABLE if share > least), WORSE)


def numbers_of(case: Case, fitted: Fitted) -> dict[str, Estimate]:
    """What is stated of all numbers of a fit's effects, dotted names."""
    return estimates(fitted, max(1.0, case.temperature / COLDEST), max((b.time[-1] for b in case.bags), default=np.inf))


def temperature(case: Case, at: Point) -> float:
    """By which losses are divided: what stays unexplained at a point makes all that is told less sure."""
    return COLDEST + UNEXPLAINED_WEIGHT * max(0.0, at.over(case.floor))


def given_up(case: Case) -> bool:
    """Gives the last effect up where it may do nothing and is not needed; whether that was so.

    Needed: something clear is left without it, and beside others free runs over data not used are clearly better with it: what is
    left may be the form of those.
    """
    if not case.taken:
        return False
    assert case.final is not None  # with all derivatives where the search ended
    k, last = len(case.taken) - 1, case.taken[-1]
    effect = last.fitted.effect
    if told(effect, of_effect(numbers_of(case, case.final), effect), case.size):
        return False
    if clear(case, case.rounds[k].base) and (
        k == 0 or worsening(case, case.trained[k], case.trained[k + 1]) <= CLEARLY_BETTER
    ):
        return False
    case.weighed[k].remove(last)
    if k == 0:
        case.disproved.append(last)
    del case.taken[k:], case.trained[k + 1 :], case.rounds[k + 1 :], case.weighed[k + 1 :]
    case.spared.pop(k + 1, None)
    case.final = None
    return True


def settle(case: Case, k: int, problem: Problem, point: Point, jacobian: Array, names: Sequence[Coordinate]) -> Point:
    """The fit to ``training`` alone, from ``point``, the one to all samples.

    The nominal numbers are kept, here and there, where moving the tolerances gains nothing, or makes free runs over data not used
    worse and leaves more than ``NEXT_TO_NOTHING``.
    """
    case.spared.pop(k, None)
    part = problem if case.proving else Problem(problem.predictor, case.nuisances, case.training)

    def moved() -> list[Point]:
        if part is problem:
            return [point]
        start = part.points([(point.z, point.effects)])[0]
        columns = jacobian[_training(case)][:, : len(point.z)]
        return [part.fit(start, columns, names, iterations=TRAINING)[0]]

    def still() -> list[Point]:
        everywhere = problem.fit_nominal(point.effects, names)
        return [everywhere, part.fit_nominal(everywhere.effects, names) if part is not problem else everywhere]

    (trained,), (nominal, own) = in_parallel(lambda fit: fit(), [moved, still])
    plain = clear(case, nominal) and point.over(case.floor) < NEXT_TO_NOTHING * nominal.over(case.floor)
    if noticed(nominal.loss - point.loss, len(point.z)) and (plain or worsening(case, own, trained) <= WORSE):
        return trained
    case.spared[k] = nominal
    return own


def _training(case: Case) -> Flags:
    """Of all samples that the search goes by, in a row: whether they are for training."""
    return np.concatenate([t[s] for t, s in zip(case.training, case.select, strict=True)])


def weigh(case: Case, found: Round) -> list[Weighed]:
    """Gains on data used and not used; the best first."""
    accepted = set(found.accepted)
    able, impossible = list[Fitted](), list[Fitted]()
    for f in _lasting(case, found):
        discount, whole = temperature(case, f.point) / COLDEST, f.point.excess(case.floor) < NEGLIGIBLE
        (able if possible(f, case.pose.load, case.size, discount, whole) else impossible).append(f)
    if not accepted:
        case.impossible = [f for f in impossible if not _follows(case, found, f)]
    counted = [f for f in able if not (_hardly_beyond(case, f) or _filters_noise(case, f) or _follows(case, found, f))]
    if not counted:
        return []
    found = replace(found, fitted=tuple(counted))
    bases = [(found.base, found.jacobian), *(_valleys(found) if case.proving else ())]
    hypotheses = [*bases, *((f.point, f.jacobian) for f in found.fitted)]
    names = [*(all_coordinates(found.accepted, case.size) for _ in bases), *(f.coordinates for f in found.fitted)]
    losses = _held_out(case, found, hypotheses, names) if case.proving else _split(case, hypotheses, names)
    base, losses = min(losses[: len(bases)], key=sum), losses[len(bases) :]
    weighed = []
    for f, loss in zip(found.fitted, losses, strict=True):
        new = [c for c in f.coordinates if c.name.split(".")[1] not in accepted]
        weighed.append(Weighed(f, base[0] - loss[0], base[1] - loss[1], occam(f, new)))
    return sorted(weighed, key=lambda w: -w.net)


def _valleys(found: Round) -> list[tuple[Point, Array]]:
    """The base from where the best effects' fits ended, without them.

    Several sets of numbers may explain the recordings fitted as well, and one of them those held out by far better: that needs no
    effect.
    """
    names, count = all_coordinates(found.accepted, found.problem.size), len(found.base.z)
    wanted = [(f.point.z, {c.name: f.point.effects[c.name] for c in names}) for f in found.fitted[:WEIGHED]]
    starts = found.problem.points(wanted)
    return in_parallel(lambda start: found.problem.fit(start, found.jacobian[:, :count], names), starts)


def _lasting(case: Case, found: Round) -> list[Fitted]:
    """What was fitted; a load that comes before the boom has moved was there all along, and is fitted so where it was not yet."""
    early = [f for f in found.fitted if _early(case, f)]
    if not early or (twin := EFFECTS[early[0].effect].lasting) in found.accepted:
        return list(found.fitted)
    others = [f for f in found.fitted if not _early(case, f)]
    if any(f.effect == twin for f in others):
        return others
    point, names = early[0].point, all_coordinates([*found.accepted, twin], case.size)
    values = {**point.effects, **lasting(early[0].effect, point.effects)}
    start = found.problem.points([(point.z, {c.name: values[c.name] for c in names})])[0]
    fitted, jacobian = found.problem.fit(start, early[0].jacobian[:, : len(point.z)], names)
    return [*others, Fitted(twin, fitted, names, jacobian, found.base.loss - fitted.loss, (fitted.loss,))]


def _early(case: Case, f: Fitted) -> bool:
    """Whether an effect is a load that comes before the boom has moved."""
    if not EFFECTS[f.effect].lasting:
        return False
    here = f.point.effects
    lifted = [here[stroke] for _, stroke in steps_in(here)]
    if lifted and max(lifted) > min(float(bag.strokes(case.machine).min()) for bag in case.bags):
        return False
    return here[onset_of(f.effect)] < min(float(bag.time[bag.moving()][0]) for bag in case.bags)


def _hardly_beyond(case: Case, f: Fitted) -> bool:
    """Whether an effect is what sound machines have, too, or numbers' being further off than their tolerance by next to nothing."""
    effect = sized(EFFECTS[f.effect], case.size)
    here = {row: f.point.effects.get(f"effects.{f.effect}.{row.name}", row.neutral) for row in effect.sizes}
    if all(abs(size) <= row.ordinary for row, size in here.items()):
        return True
    another = any(abs(size - row.neutral) >= row.low for row, size in here.items() if row.neutral != 1.0)
    if not effect.changes or effect.parameters[0].neutral != 1.0 or another or f.gain > CLEARLY * chance(case):
        return False
    known = [n.sigma for n in case.nuisances if n.name in effect.changes]
    away = [abs(log(size)) for row, size in here.items() if row.neutral == 1.0]
    return max(away) < BEYOND * TWIN_Z * min(known, default=0.0)


def _follows(case: Case, found: Round, f: Fitted) -> bool:
    """Whether an effect with a state that the observer corrects is no likelier than disturbances: bristles follow any torque."""
    effect = EFFECTS[f.effect]
    if not any(state.corrected for state in effect.states):
        return False
    at, loose = found.base, found.problem.predictor.looseness
    own = case.problem(f.point.z, f.point.effects, loose).likelihood_at(f.point.z, f.point.effects)
    among = [link for link in links(case.machine) if effect.subsystem in link.subsystems]
    return own <= disturbed(case.problem(at.z, at.effects, loose), at, among)


def _filters_noise(case: Case, f: Fitted) -> bool:
    """Whether an effect is a play that lets no more than the noise of measured currents not pass."""
    plays = [row.name for row in EFFECTS[f.effect].parameters if row.swallows]
    least = SWALLOWED * spool_noise(case.machine, case.pose) if plays else 0.0
    return any(f.point.effects[f"effects.{f.effect}.{name}"] < least for name in plays)


def spool_noise(machine: Machine, pose: Pose) -> float:
    """Standard deviation over full stroke of what the noise of measured currents makes of a spool at half of it.

    sigma_x = sigma_i dx/di sqrt(T_s / (2 tau)): noise held for T_s behind a lag of tau.
    """
    p, e = component_parameters(machine, pose)
    spool, pilot, stroke = machine.structure.spool, machine.structure.pilot_valves, p.main_valve_spool.s_max
    currents = [spool.current(x * stroke, p, pilot) for x in (0.49, 0.51)]
    return float(
        CURRENT_NOISE * 0.02 / (currents[1] - currents[0]) * sqrt(PERIOD / (2.0 * spool.settling(p, e, pilot)))
    )


def _split(
    case: Case, hypotheses: Sequence[tuple[Point, Array]], names: Sequence[Sequence[Coordinate]]
) -> list[tuple[float, float]]:
    """Loss of each hypothesis on the data for training, and on the data held out [nats]."""
    used = _training(case)
    result = []
    for (point, jacobian), own in zip(hypotheses, names, strict=True):
        prior = np.array([1.0] * len(point.z) + [c.precision for c in own])
        result.append(split_loss(point.w, jacobian, prior, point.z, used))
    return result


def placed_by_itself(case: Case, found: Round) -> dict[str, float]:
    """What is the own of the recordings held out, without effects."""
    others = _proving(case, found.base, found.problem.predictor.looseness)
    return own_numbers(others, found.base.z, found.base.effects)


def _proving(case: Case, at: Point, looseness: float) -> Problem:
    """The recordings held out, with the gains of a point."""
    select = [bag.counted for bag in case.proving]
    return problem_at(case.machine, case.proving, select, case.nuisances, at.z, at.effects, looseness)


def _held_out(
    case: Case, found: Round, hypotheses: Sequence[tuple[Point, Array]], names: Sequence[Sequence[Coordinate]]
) -> list[tuple[float, float]]:
    """Loss of each hypothesis on the data used and on recordings not used [nats]; its numbers are known as the data used tell."""
    count = len(case.nuisances)
    known = [precision(point, jacobian, count) for point, jacobian in hypotheses]
    others = _proving(case, found.fitted[0].point, found.problem.predictor.looseness)
    owned = [own_numbers(others, p.z, p.effects) for p, _ in hypotheses]
    effects = [{**p.effects, **own} for (p, _), own in zip(hypotheses, owned, strict=True)]
    first = len(hypotheses) - len(found.fitted)  # of the effects
    case.own = owned[first] or case.own
    points = others.points([(p.z, e) for (p, _), e in zip(hypotheses, effects, strict=True)])
    tolerances = others.nuisance_jacobian(points[first])
    losses = []
    for (fitted, _), point, searched, k, own in zip(hypotheses, points, names, known, owned, strict=True):
        columns = others.effect_jacobian(point, searched) if searched else np.zeros((len(point.w), 0))
        untold = {i: 1.0 for i, n in enumerate(case.nuisances) if n.name in own}
        untold |= {count + i: c.precision for i, c in enumerate(searched) if c.name in own}
        held = predictive_loss(point.w, np.concatenate([tolerances, columns], axis=1), forgotten(k, untold))
        losses.append((fitted.loss, held))
    return losses


def least(case: Case, problem: Problem, base: Point) -> float:
    """Nats that some effect must gain from ``base``, net: it asks less where it explains most of a clear rest."""
    most = MOST_OF_REST * base.over(case.floor) if clear(case, base) else np.inf
    return max(chance(case), min(most, _beside_others(case, problem)))


def _beside_others(case: Case, problem: Problem) -> float:
    """The same where it explains less: more than what the form of the effects before leaves of them, too."""
    return chance(case) + OTHER_FORM * _gained_before(case, problem)


def _gained_before(case: Case, problem: Problem) -> float:
    """Nats, net, of the effects that were taken, as the observer of ``problem`` counts: a loose one sees less of everything."""
    gained = sum(w.net for w in case.taken)
    before = case.rounds[len(case.taken) - 1].problem if case.taken else problem
    if problem is before or problem.predictor.looseness == before.predictor.looseness:
        return gained
    without, beside = problem.points([(at.z, at.effects) for at in (case.kept(0), case.last)])
    share = (without.loss - beside.loss) / max(sum(w.gain for w in case.taken), 1e-9)
    return gained * min(max(share, 0.0), 1.0)


def chance(case: Case) -> float:
    """Nats that an effect must gain, net: more than chance and than what two models of one machine differ by."""
    return ENOUGH + TOO_SMALL * sum(int(s.sum()) for s in case.select)
