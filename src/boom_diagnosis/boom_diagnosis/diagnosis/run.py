"""A whole diagnosis: recordings and a machine in, the answer out. No files, no ROS."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from boom_diagnosis.diagnosis import answer
from boom_diagnosis.diagnosis.bag_samples import PERIOD, Bag, prepare
from boom_diagnosis.diagnosis.coordinates import Coordinate, all_coordinates
from boom_diagnosis.diagnosis.document import DiagnosisResult
from boom_diagnosis.diagnosis.fitting import WHITE, Point, Problem
from boom_diagnosis.diagnosis.healthy import simulated
from boom_diagnosis.diagnosis.hypotheses import (
    LOOSENESS,
    Nominal,
    Round,
    afresh,
    noticed,
    problem_at,
    rebased,
    run_round,
)
from boom_diagnosis.diagnosis.learning import Learned, Setting, learn_plainly
from boom_diagnosis.diagnosis.nuisances import Nuisance, tolerances
from boom_diagnosis.diagnosis.onset import TIME, onset
from boom_diagnosis.diagnosis.parallel import in_parallel
from boom_diagnosis.diagnosis.proof import worsening
from boom_diagnosis.diagnosis.search import Fitted
from boom_diagnosis.diagnosis.weighing import (
    COLDEST,
    ENOUGH,
    NEGLIGIBLE,
    OTHER_FORM,
    TOO_SMALL,
    UNEXPLAINED_WEIGHT,
    Weighed,
    occam,
    precision,
    predictive_loss,
    split_loss,
)
from boom_diagnosis.validation import plant_for
from boom_model.learned import PLACES
from boom_model.machine import Machine, Pose
from boom_recording.recording import Recording

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]
Progress = Callable[[str, float], None]

MOST_EFFECTS = 3
HELD_OUT_SHARE = 1.0 / 3.0
"""Of each recording, its end, where no recording is held out."""
WORSE, LATER = 1.1, 1.0
"""Factor by which the free runs over data not used may err more with an effect than without, for the first one and for one beside
others: one that pays for what the numbers cannot take up, but is not there, makes the free run worse."""
BEARABLE = ((0.6, 3.0), (0.3, 1.5), (0.0, WORSE))
"""Shares of all that the tolerances cannot take up, and factors by which a first effect that explains more may leave free runs
worse: another one that is not in the model yet may dominate them, and tolerances that bend for both may hide it there."""
MOST_OF_REST, CLEAR_REST = 0.6, 0.05
"""Share of a rest that a further effect must explain not to be taken for what another's form leaves, and the least such rest [nats
per innovation]."""
CLEARLY_BETTER = 0.8
"""The same factor below which an effect has proved itself even where its one-step predictions of that data have not."""
LITTLE = 0.25
"""Share of what the tolerances cannot take up that a first effect may leave without a second look at all others."""
OUTDONE = 0.1
"""Share of what the best effect leaves that a term which is plain to see may leave, for no further effect to be looked for."""
FIRST_LOOK = 0.6
"""Share of a round's time that is over before a second look, as the progress counts it."""
FAR = 1.0
"""Loss per innovation over that of a healthy machine from which on the likeliest observer is looked for again; below, the one
that is right for a healthy machine sees what is left best."""
RAN = 0.95
"""Share of a recording from which on a healthy copy counts as whole."""
TRAINING = 3
"""Iterations of the fit to the data for training alone, from the fit to all."""
LEAST_MOVING, LEAST_TRAVEL = 4.0, 0.1
"""s, rad: a recording that moves less says nothing about most of the machine."""


@dataclass
class Case:
    """What is diagnosed, and how far it has got.

    Attributes:
        pose: of the first recording.
        bags: fitted. proving: not fitted at all. select: samples that the search goes by, per bag of ``bags``.
        training, judged: two parts of them; what is proved is fitted to the first and judged on the second. Without recordings
            that are held out the second is the end of each recording, else it is empty.
        floor: loss per innovation of a healthy machine with the same currents. healthy: its recordings.
        rounds, weighed: what each round found, and its effects with what speaks for them. taken: those that earned their place.
        disproved: effects of the first round that gained enough, but made free runs over data not used worse.
        trained: points with the first k effects, fitted to ``training`` alone.
        spared: number of effects -> fit with nominal tolerances, where moving them gains nothing.
        final: all effects at the point that the machine file gets, with all derivatives taken there.
        learned: a term that is plain to see and explains far more than any effect.
        onset: when a load came in the recordings held out [s].
    """

    machine: Machine
    pose: Pose
    bags: list[Bag]
    proving: list[Bag]
    select: list[Flags]
    training: list[Flags]
    judged: list[Flags]
    nuisances: tuple[Nuisance, ...]
    seed: int
    floor: float = 0.0
    healthy: list[Bag] = field(default_factory=list)
    healthy_squares: Array = field(default_factory=lambda: np.ones(4))
    rounds: list[Round] = field(default_factory=list)
    weighed: list[list[Weighed]] = field(default_factory=list)
    taken: list[Weighed] = field(default_factory=list)
    trained: list[Point] = field(default_factory=list)
    disproved: list[Weighed] = field(default_factory=list)
    spared: dict[int, Point] = field(default_factory=dict)
    final: Fitted | None = None
    learned: Learned | None = None
    temperature: float = COLDEST
    onset: float | None = None

    def values(self, z: Array, effects: Mapping[str, float]) -> dict[str, float]:
        """Components of the parameter vector."""
        return self.rounds[0].problem.values(z, effects)

    def kept(self, k: int) -> Point:
        """The fit with the first ``k`` effects: with nominal tolerances where moving them gains nothing."""
        return self.spared.get(k) or (self.taken[k - 1].fitted.point if k else self.rounds[0].base)

    @property
    def setting(self) -> Setting:
        """What a term is learnt from."""
        looseness = self.rounds[0].problem.predictor.looseness
        return Setting(self.machine, self.bags, self.training, self.judged, self.nuisances, self.proving, looseness)

    @property
    def last(self) -> Point:
        """The fit with everything that was found."""
        return self.final.point if self.final else self.kept(len(self.taken))


def diagnose(
    recordings: Sequence[Recording],
    machine: Machine,
    *,
    held_out: Sequence[Recording] = (),
    seed: int = 0,
    progress: Progress = lambda text, share: None,
    version: str = "",
    inputs_sha256: Mapping[str, str] | None = None,
    command: str = "",
) -> DiagnosisResult:
    """Finds what ``machine`` lacks to explain ``recordings`` and proves it on ``held_out``.

    held_out: recordings that nothing is fitted to; without them the last third of each recording is held out.
    progress: called with what is being done and the share of the work that is done.

    Raises:
        MachineError: a pose or load that the machine cannot have.
    """
    about = answer.About(seed, version, dict(inputs_sha256 or {}), command)
    prepared = [prepare(recording) for recording in recordings]
    weak = [r.name for r, bag in zip(recordings, prepared, strict=True) if bag is None or not excited(bag)]
    bags = [bag for bag in prepared if bag is not None and excited(bag)]
    if not bags:
        return answer.not_enough_excitation(recordings, machine, about)
    proving = [bag for bag in (prepare(recording) for recording in held_out) if bag is not None and excited(bag)]
    case = _case(machine, bags, proving, seed)
    search(case, progress)
    progress("locating", 0.8)
    return answer.assemble(case, about, weak)


def excited(bag: Bag) -> bool:
    """Whether the boom moved long and far enough to tell anything."""
    angle = bag.samples().measured[:, 0]
    moving = float(bag.moving().sum()) * PERIOD
    known = angle[np.isfinite(angle)]
    return moving >= LEAST_MOVING and len(known) > 0 and float(np.ptp(known)) >= LEAST_TRAVEL


def search(case: Case, progress: Progress) -> None:
    """Round after round: what explains most is taken, everything is computed anew, until nothing earns its place."""
    _rounds(case, progress)
    _finish(case)


def _finish(case: Case) -> None:
    """The last fit, with gains and all derivatives of the point that was reached.

    Where a tolerance can do what an effect does, derivatives from two places would tell them apart.
    """
    if not case.taken:
        return
    k, fitted = len(case.taken), case.taken[-1].fitted
    at, names = case.last, fitted.coordinates
    problem = problem_at(
        case.machine, case.bags, case.select, case.nuisances, at.z, at.effects,
        case.rounds[k - 1].problem.predictor.looseness,
    )  # fmt: skip
    start = problem.points([(at.z, at.effects)])[0]
    columns = problem.nuisance_jacobian(start)
    if k in case.spared:
        point, jacobian = start, np.concatenate([columns, problem.effect_jacobian(start, names)], axis=1)
    else:
        point, jacobian = problem.fit(start, columns, names)
    case.final = replace(fitted, point=point, jacobian=jacobian)


def _rounds(case: Case, progress: Progress) -> None:
    near, alone, k = False, False, 0
    while k < MOST_EFFECTS:
        look = _share(progress, 0.8 * k / MOST_EFFECTS, 0.8 / MOST_EFFECTS)
        taken = _look(case, _share(look, 0.0, FIRST_LOOK), near)
        if k == 0 and not _satisfied(case):
            taken = _look_again(case, _share(look, FIRST_LOOK, 1.0 - FIRST_LOOK))
            if not _satisfied(case) and _plain(case):
                return
        if not taken:
            return
        if len(case.taken) == 2 and not alone:
            alone = True  # once: what takes its place may bring the other back
            _without_first(case)
        k = len(case.taken)
        left = rest(case, case.last.z, case.last.effects)
        if left < NEGLIGIBLE:
            return
        near = left < FAR


def _share(progress: Progress, begin: float, size: float) -> Progress:
    """Progress of a part that begins at a share of the whole and has a size of it."""
    return lambda text, share: progress(text, begin + size * share)


def _look(case: Case, progress: Progress, tight: bool) -> bool:
    """One round: whether an effect was found that earns its place."""
    z, values = (case.last.z, case.last.effects) if case.taken else (np.zeros(len(case.nuisances)), {})
    found = run_round(
        case.machine, case.bags, case.select, case.nuisances, z, values, progress, tight=tight, least=_least(case)
    )
    if case.taken and _dissatisfied(case, found):
        found = _beside_nominal(case, found)
    return _judge(case, found)


def _dissatisfied(case: Case, found: Round) -> bool:
    """Whether a round beside other effects begins with a clear rest, and its best effect leaves much of it."""
    rest = found.base.over(case.floor)
    best = found.fitted[0].gain if found.fitted else 0.0
    return rest > CLEAR_REST * int(found.base.used.sum()) and best < (1.0 - LITTLE) * rest


def _beside_nominal(case: Case, found: Round) -> Round:
    """The round with effects that are seen where the tolerances are nominal: those fitted may have bent to do what they do."""
    zero, names = np.zeros(len(case.nuisances)), tuple(all_coordinates(list(found.accepted)).values())
    loose = problem_at(case.machine, case.bags, case.select, case.nuisances, zero, found.base.effects, LOOSENESS[1])
    values = loose.fit_nominal(found.base.effects, names).effects
    problem = problem_at(case.machine, case.bags, case.select, case.nuisances, zero, values, LOOSENESS[1])
    return afresh(found, Nominal(problem, values), [f.effect for f in found.fitted[:1]], case.floor)


def _judge(case: Case, found: Round) -> bool:
    """Weighs what a round found, in the place of a round before that nothing was taken from; whether the best is taken."""
    k = len(case.taken)
    found = rebased(found)
    case.rounds[k:] = [found]
    if k == 0:
        if not case.healthy:
            _calibrate(case, found)
        case.trained[:] = [_settle(case, 0, found.problem, found.base, found.jacobian, ())]
    case.weighed[k:] = [_weigh(case, found) if found.fitted else []]
    taken = _take(case)
    best = case.weighed[k][0].fitted.point if case.weighed[k] else found.base
    case.temperature = COLDEST + UNEXPLAINED_WEIGHT * max(0.0, best.over(case.floor))
    return taken


def _satisfied(case: Case) -> bool:
    """Whether the first round leaves little of what the tolerances cannot take up."""
    before = rest(case, case.kept(0).z, {})
    left = rest(case, case.last.z, case.last.effects) if case.taken else before
    return left < NEGLIGIBLE or left < LITTLE * before


def _look_again(case: Case, progress: Progress) -> bool:
    """The first round once more, with the observer that sees most, and with what the nominal machine shows.

    What the first look took stays where the second leaves more unexplained.
    """
    first = _kept_back(case)
    wanted = [case.taken[0].fitted.effect] if case.taken else []
    case.taken.clear()
    case.spared.clear()
    case.disproved.clear()
    found = case.rounds[0]
    if found.problem.predictor.looseness > LOOSENESS[0]:
        found = run_round(
            case.machine, case.bags, case.select, case.nuisances, found.base.z, {}, progress, tight=True,
            least=_least(case), refined=1,
        )  # fmt: skip
    zero = np.zeros(len(case.nuisances))
    nominal = Nominal(problem_at(case.machine, case.bags, case.select, case.nuisances, zero, {}, LOOSENESS[1]))
    found = afresh(found, nominal, [*wanted, *(f.effect for f in found.fitted[:1])], case.floor)
    taken = _judge(case, found)
    if not first.taken:
        return taken
    left, before = (rest(case, c.last.z, c.last.effects) for c in (case, first))
    if left <= before + NEGLIGIBLE:
        return taken
    _go_back(case, first)
    return True


def _kept_back(case: Case) -> Case:
    """A copy to go back to."""
    return replace(
        case, rounds=[*case.rounds], weighed=[*case.weighed], taken=[*case.taken], trained=[*case.trained],
        spared={**case.spared}, disproved=[*case.disproved],
    )  # fmt: skip


def _go_back(case: Case, before: Case) -> None:
    case.rounds, case.weighed, case.taken, case.trained = before.rounds, before.weighed, before.taken, before.trained
    case.spared, case.disproved = before.spared, before.disproved
    case.temperature, case.onset = before.temperature, before.onset


def _without_first(case: Case) -> None:
    """The second effect takes the first one's place where the first gains nothing beside it: it stood in for it."""
    second, found = case.taken[1].fitted, case.rounds[1].problem
    names = tuple(all_coordinates([second.effect]).values())
    values = {c.name: second.point.effects[c.name] for c in names}
    problem = problem_at(
        case.machine, case.bags, case.select, case.nuisances, second.point.z, values, found.predictor.looseness
    )
    zero = np.zeros(len(case.nuisances))
    start = min(problem.points([(second.point.z, values), (zero, values)]), key=lambda p: p.loss)
    point, jacobian = problem.fit(start, problem.nuisance_jacobian(start), names)
    both = problem.points([(second.point.z, second.point.effects)])[0]
    if point.loss - both.loss > _chance(case) + OTHER_FORM * case.taken[1].net:
        return
    before, first = _kept_back(case), case.rounds[0]
    base, columns = problem.fit(problem.points([(first.base.z, {})])[0], jacobian[:, : len(zero)])
    fitted = Fitted(second.effect, point, names, jacobian, base.loss - point.loss, (point.loss,))
    for part in (case.taken, case.spared, case.disproved):
        part.clear()
    if not _judge(case, replace(first, base=base, jacobian=columns, fitted=(fitted,), problem=problem)):
        _go_back(case, before)


def _plain(case: Case) -> bool:
    """Whether a term that is plain to see explains what no effect does; it is kept then, and no effect is."""
    learned = learn_plainly(case.setting, case.trained[0], list(PLACES))
    if not learned or learned.point.excess(case.floor) > OUTDONE * rest(case, case.last.z, case.last.effects):
        return False
    case.learned = learned
    case.taken.clear()
    case.spared = {k: v for k, v in case.spared.items() if k == 0}
    del case.trained[1:]
    return True


def _take(case: Case) -> bool:
    """Takes the first effect of the last round that earns its place; whether there is one.

    What free runs over data not used disprove is no alternative any more.
    """
    k = len(case.taken)
    weighed, problem = case.weighed[k], case.rounds[k].problem
    while weighed and weighed[0].net > _needed(case, weighed[0]):
        best = weighed[0]
        fitted = best.fitted
        trained = _settle(case, k + 1, problem, fitted.point, fitted.jacobian, fitted.coordinates)
        factor = worsening(case, case.trained[k], trained)
        if factor <= _bearable(case, best) and (best.held_out_gain > 0.0 or factor <= CLEARLY_BETTER):
            case.taken.append(best)
            case.trained.append(trained)
            return True
        case.spared.pop(k + 1, None)
        weighed.pop(0)
        if k == 0:
            case.disproved.append(best)
    return False


def _share_explained(case: Case, best: Weighed) -> float:
    """Share of what the last round begins with that an effect explains, of the recordings that are fitted."""
    return (best.gain if case.proving else best.net) / max(case.rounds[-1].base.over(case.floor), 1e-9)


def _needed(case: Case, best: Weighed) -> float:
    """Nats that an effect must gain; of one that explains most of a clear rest the effects before ask nothing."""
    base = case.rounds[-1].base
    clear = base.over(case.floor) > CLEAR_REST * int(base.used.sum())
    return _chance(case) if clear and _share_explained(case, best) > MOST_OF_REST else _least(case)


def _bearable(case: Case, best: Weighed) -> float:
    """Factor by which free runs over data not used may err more with an effect than without."""
    if case.taken:
        return LATER
    share = _share_explained(case, best)
    return next((factor for least, factor in BEARABLE if share > least), WORSE)


def _settle(case: Case, k: int, problem: Problem, point: Point, jacobian: Array, names: Sequence[Coordinate]) -> Point:
    """The fit to ``training`` alone, from ``point``, the one to all samples.

    The nominal numbers are kept, here and there, where moving the tolerances gains nothing, or makes free runs over data not used
    worse.
    """
    case.spared.pop(k, None)
    part = problem if case.proving else Problem(problem.predictor, case.nuisances, case.training)

    def moved() -> Point:
        if part is problem:
            return point
        start = part.points([(point.z, point.effects)])[0]
        columns = jacobian[_training(case)][:, : len(point.z)]
        return part.fit(start, columns, names, iterations=TRAINING)[0]

    wanted: list[Callable[[], Point]] = [moved]
    wanted += [partial(p.fit_nominal, point.effects, names) for p in dict.fromkeys((problem, part))]
    fitted = in_parallel(lambda fit: fit(), wanted)
    trained, nominal, own = fitted[0], fitted[1], fitted[-1]
    if noticed(nominal.loss - point.loss, len(point.z)) and worsening(case, own, trained) <= WORSE:
        return trained
    case.spared[k] = nominal
    return own


def _training(case: Case) -> Flags:
    """Of all samples that the search goes by, in a row: whether they are for training."""
    return np.concatenate([t[s] for t, s in zip(case.training, case.select, strict=True)])


def rest(case: Case, z: Array, values: Mapping[str, float]) -> float:
    """Loss per innovation [nats] over that of a healthy machine, seen by the observer that is right for one."""
    problem = problem_at(case.machine, case.bags, case.select, case.nuisances, z, values, LOOSENESS[0])
    return problem.points([(z, values)])[0].excess(case.floor)


def _case(machine: Machine, bags: list[Bag], proving: list[Bag], seed: int) -> Case:
    pose = plant_for(bags[0].recording, machine, "full").pose
    select = [bag.counted.copy() for bag in bags]
    later = [
        np.zeros_like(bag.time, dtype=bool) if proving else bag.time >= (1.0 - HELD_OUT_SHARE) * bag.recording.duration
        for bag in bags
    ]
    training = [s & ~end[:, None] for s, end in zip(select, later, strict=True)]
    judged = [s & end[:, None] for s, end in zip(select, later, strict=True)]
    return Case(machine, pose, bags, proving, select, training, judged, tolerances(machine, pose), seed)


def _calibrate(case: Case, first: Round) -> None:
    """The loss of a healthy machine with the same currents; that of white noise where none gets far with them.

    With the tolerances as fitted, or nominal where that machine gets further.
    """
    tried = []
    for values in (first.problem.values(first.base.z, {}), dict[str, float]()):
        made = [simulated(bag, case.machine, values, case.seed + 1 + i) for i, bag in enumerate(case.bags)]
        reached = [len(copy.grid) / len(bag.grid) if copy else 0.0 for copy, bag in zip(made, case.bags, strict=True)]
        tried.append((min(reached), values, made))
        if tried[0][0] > RAN:
            break
    _, values, copies = max(tried, key=lambda t: t[0])
    case.healthy = [copy or bag for copy, bag in zip(copies, case.bags, strict=True)]
    known = [copy for copy in copies if copy is not None]
    if not known:
        case.floor = WHITE
        return
    select = [bag.counted for bag in known]
    problem = problem_at(case.machine, known, select, case.nuisances, np.zeros(len(case.nuisances)), {}, 1.0)
    exact = problem.predictor.predict([values])[0]
    rows = np.concatenate([r.whitened[s.all(axis=1)] for r, s in zip(exact, select, strict=True)])
    case.healthy_squares = np.mean(rows**2, axis=0)
    case.floor = float(0.5 * np.mean(case.healthy_squares))


def _weigh(case: Case, found: Round) -> list[Weighed]:
    """Gains on data used and not used; the best first."""
    accepted = set(found.accepted)
    found = replace(found, fitted=tuple(f for f in found.fitted if not _always_there(case, f, found.fitted)))
    hypotheses = [(found.base, found.jacobian), *((f.point, f.jacobian) for f in found.fitted)]
    names = [_coordinates(found), *(f.coordinates for f in found.fitted)]
    losses = _held_out(case, found, hypotheses, names) if case.proving else _split(case, hypotheses, names)
    weighed = []
    for f, loss in zip(found.fitted, losses[1:], strict=True):
        new = [c for c in f.coordinates if c.name.split(".")[1] not in accepted]
        weighed.append(Weighed(f, losses[0][0] - loss[0], losses[0][1] - loss[1], occam(f, new)))
    return sorted(weighed, key=lambda w: -w.net)


def _always_there(case: Case, f: Fitted, others: Sequence[Fitted]) -> bool:
    """Whether an effect is a load that comes before the boom has moved, and one that was there all along is fitted, too."""
    if TIME not in f.point.effects or all(other.effect != "payload" for other in others):
        return False
    return f.point.effects[TIME] < min(float(bag.time[bag.moving()][0]) for bag in case.bags)


def _coordinates(found: Round) -> tuple[Coordinate, ...]:
    return tuple(all_coordinates(list(found.accepted)).values())


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


def _held_out(
    case: Case, found: Round, hypotheses: Sequence[tuple[Point, Array]], names: Sequence[Sequence[Coordinate]]
) -> list[tuple[float, float]]:
    """Loss of each hypothesis on the data used and on recordings not used [nats]; its numbers are known as the data used tell."""
    count = len(case.nuisances)
    known = [precision(point, jacobian, count) for point, jacobian in hypotheses]
    best = found.fitted[0].point
    others = problem_at(
        case.machine, case.proving, [bag.counted for bag in case.proving], case.nuisances, best.z, best.effects,
        found.problem.predictor.looseness,
    )  # fmt: skip
    effects = [_own_onset(others, p) for p, _ in hypotheses]
    case.onset = effects[1].get(TIME, case.onset)
    points = others.points([(p.z, e) for (p, _), e in zip(hypotheses, effects, strict=True)])
    tolerances = others.nuisance_jacobian(points[1])
    losses = []
    for (fitted, _), point, own, k in zip(hypotheses, points, names, known, strict=True):
        columns = others.effect_jacobian(point, own) if own else np.zeros((len(point.w), 0))
        held = predictive_loss(point.w, np.concatenate([tolerances, columns], axis=1), k)
        losses.append((fitted.loss, held))
    return losses


def _own_onset(problem: Problem, point: Point) -> dict[str, float]:
    """Effects of a point as they are in the recordings held out: when a load came is their own."""
    effects = dict(point.effects)
    if TIME in effects:
        effects[TIME] = onset(problem, point.z, effects)
    return effects


def _least(case: Case) -> float:
    """Nats that an effect must gain, net: more than what the form of the effects before leaves of them, too."""
    return _chance(case) + OTHER_FORM * sum(w.net for w in case.taken)


def _chance(case: Case) -> float:
    """Nats that an effect must gain, net: more than chance and than what two models of one machine differ by."""
    return ENOUGH + TOO_SMALL * sum(int(s.sum()) for s in case.select)
