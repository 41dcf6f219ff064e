"""A whole diagnosis: recordings and a machine in, the answer out. No files, no ROS."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from boom_checks.doubts import first_look
from boom_checks.sampling import independent
from boom_diagnosis import answer, weighed_answer
from boom_diagnosis.ahead import compiled_ahead
from boom_diagnosis.bag_samples import prepare
from boom_diagnosis.case import Case, case_of
from boom_diagnosis.document import DiagnosisResult
from boom_diagnosis.earning import given_up, take
from boom_diagnosis.fitting import Point, Problem
from boom_diagnosis.free_fit import fit_to_free_runs
from boom_diagnosis.hypotheses import POLISH
from boom_diagnosis.onset import near_onset, time_in
from boom_diagnosis.plainer import plainer
from boom_diagnosis.restarts import in_deepest_valley
from boom_diagnosis.rounds import rounds, share
from boom_diagnosis.search import Fitted
from boom_diagnosis.second_search import begun_elsewhere
from boom_diagnosis.straying import commanded_oftener, of_slow_log, strayed
from boom_diagnosis.stretches import Stretches, excited, stretches, tells_nothing
from boom_diagnosis.unsearched import About, not_enough_excitation, spoilt
from boom_diagnosis.weighed_case import searched, weighed_case_of
from boom_diagnosis.weighing import NEGLIGIBLE
from boom_diagnosis.wrong_number import with_wrong_number
from boom_estimation.currents import driven
from boom_estimation.sensor_noise import with_measured_noise
from boom_model.catalogue import EFFECTS
from boom_model.machine import Machine
from boom_recording.recording import Recording, told_apart

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]
Progress = Callable[[str, float], None]


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
    engine: str = "rounds",
) -> DiagnosisResult:
    """Finds what ``machine`` lacks to explain ``recordings`` and proves it on ``held_out``.

    held_out: recordings that nothing is fitted to; without them the last third of each recording is held out.
    progress: called with what is being done and the share of the work that is done.
    engine: "rounds", the search that adds effect after effect, or "likelihood", one likelihood for all hypotheses.

    Raises:
        MachineError: a pose or load that the machine cannot have.
    """
    named = told_apart([*recordings, *held_out])
    recordings, held_out = named[: len(recordings)], named[len(recordings) :]
    machine = with_measured_noise(machine, recordings)
    about = About(seed, version, dict(inputs_sha256 or {}), command)
    progress("doubting the recordings", 0.0)
    looks = tuple(first_look(recording, machine) for recording in (*recordings, *held_out))
    checks = tuple((look.name, check) for look in looks for check in look.checks)
    if any(check.spoils for _, check in checks):
        result = spoilt(machine, about, [check for _, check in checks])
    else:
        own, proving = ([independent(recording) for recording in given] for given in (recordings, held_out))
        parts = stretches(own, proving, machine, progress)
        result = parts.placed(_searched(parts, machine, progress, about, engine))
    return replace(result, looks=looks, document=replace(result.document, checks=checks))


def _searched(parts: Stretches, machine: Machine, progress: Progress, about: About, engine: str) -> DiagnosisResult:
    """The answer of recordings that nothing has to be repaired in."""
    prepared = [prepare(recording, machine) for recording in parts.recordings]
    silent = {r.name: tells_nothing(r, bag) for r, bag in zip(parts.recordings, prepared, strict=True)}
    weak = {name: why for name, why in silent.items() if why}
    bags = [bag for bag in prepared if bag is not None and not silent[bag.name]]
    if not bags:
        return not_enough_excitation(parts.recordings, machine, about, weak)
    proven = (prepare(recording, machine) for recording in parts.held_out)
    proving = [bag for bag in proven if bag is not None and excited(bag)]
    if engine == "likelihood":
        weighed = weighed_case_of(machine, bags, proving, about.seed)
        weighed.elsewhere = parts.elsewhere
        searched(weighed, progress)
        return weighed_answer.assemble(weighed, about, weak)
    with compiled_ahead(driven(machine, bags[0].recording)):
        case = case_of(machine, bags, proving, about.seed)
        case.elsewhere = parts.elsewhere
        case = search(case, progress)
    progress("locating", 0.8)
    return answer.assemble(case, about, weak, partial(_doubted, progress=share(progress, 0.8, 0.1)))


def search(case: Case, progress: Progress) -> Case:
    """Round after round: what explains most is taken, all is computed anew, until nothing earns its place; the case as it ends."""
    case = _explained_by_its_log(case, progress) or rounds(case, progress)
    if not case.learned and case.rest(case.last) > NEGLIGIBLE:
        first = case
        if slow := commanded_oftener(case):
            case = _better(case, rounds(slow, progress))
        if case is first and (bags := strayed(case)):
            case = _better(case, rounds(case.with_bags(*bags), progress))
    progress("doubting the machine file", 0.75)
    if other := with_wrong_number(case):
        case = rounds(other, progress)
    elif not case.learned:
        begun_elsewhere(case, share(progress, 0.76, 0.02))
    progress("free runs", 0.78)
    _finish(case)
    return case


def _explained_by_its_log(case: Case, progress: Progress) -> Case | None:
    """The case at its end, where what its log leaves open and the tolerances explain all; else None."""
    slow = of_slow_log(case)
    if slow is None:
        return None
    slow = rounds(slow, progress)
    return slow if not slow.taken and slow.rest(slow.last) <= NEGLIGIBLE else None


def _better(case: Case, again: Case) -> Case:
    """The search again with other currents, where it leaves less than the one before: it may have ended elsewhere."""
    return again if again.learned or again.rest(again.last) < case.rest(case.last) else case


def _doubted(case: Case, progress: Progress) -> Case:
    """A case of which free runs took back what was found, or that with the number free that is wrong in the machine file."""
    other = with_wrong_number(case)
    if other:
        rounds(other, progress)
    _finish(other or case)
    return other or case


def _finish(case: Case) -> None:
    """The last fit, with gains and derivatives of the point reached, then to free runs; what they do not tell is given up."""
    while True:
        if case.taken:
            case.final = _last_fit(case)
        if not given_up(case):
            fit_to_free_runs(case)
            if not given_up(case):  # free runs may leave so little of it that it may do nothing
                _tell_plainly(case)
                return
        take(case)


def _plainest(problem: Problem, at: Point, effects: Sequence[str]) -> Point:
    """The point with the plainest of the numbers that do the same, as they do where no load comes and goes."""
    taken, values = [EFFECTS[name] for name in effects], dict(at.effects)
    for effect in taken if not any(effect.load for effect in taken) else ():
        if effect.plainest:
            own = f"effects.{effect.id}."
            told = effect.plainest({row.name: values[own + row.name] for row in effect.parameters})
            values |= {own + name: value for name, value in told.items()}
    return problem.points([(at.z, values)])[0] if values != at.effects else at


def _tell_plainly(case: Case) -> None:
    """What was found as its plainest numbers, with derivatives taken there."""
    if case.final is None:
        return
    final, at = case.final, case.final.point
    problem = case.problem(at.z, at.effects, case.rounds[len(case.taken) - 1].problem.predictor.looseness)
    plain = _plainest(problem, at, case.named)
    if plain is not at:
        exact = problem.effect_jacobian(plain, final.coordinates, exact=True)
        jacobian = np.concatenate([final.jacobian[:, : len(at.z)], exact], axis=1)
        case.final = replace(final, point=plain, jacobian=jacobian)


def _last_fit(case: Case) -> Fitted:
    """Where a tolerance can do what an effect does, derivatives from two places would tell them apart."""
    k, fitted = len(case.taken), case.taken[-1].fitted
    at, names = case.last, fitted.coordinates
    problem = case.problem(at.z, at.effects, case.rounds[k - 1].problem.predictor.looseness)
    start = problem.points([(at.z, at.effects)])[0]
    if time_in(start.effects):  # found beside other numbers than those it has now
        start = near_onset(problem, start)
    columns = problem.nuisance_jacobian(start)
    jacobian = np.concatenate([columns, problem.effect_jacobian(start, names, exact=True)], axis=1)
    point = start
    if k not in case.spared:
        fits = [problem.fit(start, jacobian, names)]
        own = {name for w in case.taken for name in EFFECTS[w.fitted.effect].changes}
        which = [i for i, n in enumerate(case.nuisances) if n.name in own and start.z[i] != 0.0]
        if which:  # a number's being off is the effect's, as far as nothing tells them apart
            moved = problem.made_nominal(start, jacobian, names, which)
            fits.append(problem.fit(moved, columns, names))
        point, reached = min(fits, key=lambda fit: fit[0].loss)
        problem, point, reached = in_deepest_valley(case, (problem, point, reached), names)
        exact = problem.effect_jacobian(point, names, exact=True)
        jacobian = np.concatenate([reached[:, : len(at.z)], exact], axis=1)
        for effect in case.named:
            point, reached, kept = plainer(problem, point, jacobian, names, effect, iterations=POLISH)
            if len(kept) < len(names):
                exact = problem.effect_jacobian(point, kept, exact=True)
                names, jacobian = kept, np.concatenate([reached[:, : len(at.z)], exact], axis=1)
    return replace(fitted, point=point, coordinates=names, jacobian=jacobian)
