"""One round of the search: tolerances alone, every effect beside them, and what speaks for each.

Two observers serve: a loose one follows a machine that is far from the model, and a tight one, whose innovations are
white if the model is right, weighs the evidence.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from boom_diagnosis.diagnosis.bag_samples import Bag
from boom_diagnosis.diagnosis.coordinates import Coordinate, all_coordinates
from boom_diagnosis.diagnosis.fitting import Point, Problem, rho
from boom_diagnosis.diagnosis.nuisances import Nuisance
from boom_diagnosis.diagnosis.prediction import LOOSE, Predictor
from boom_diagnosis.diagnosis.search import Candidate, Fitted, Scanner, possible_effects, refine
from boom_model.machine import Machine

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

NEAR = 1.3
"""Mean loss per innovation above which the tight observer is too far from the recording to search with it."""
REFINED = 6
"""Effects that are fitted in a round."""
WEIGHED = 3
"""Effects that are weighed with the tight observer where the loose one found them."""

Effects = Mapping[str, Mapping[str, float]]
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
) -> Problem:
    """A problem whose observers' gains are those of this point."""
    plain = Problem(Predictor(machine, bags), nuisances, select)
    return Problem(Predictor(machine, bags, plain.values(z, values), looseness), nuisances, select)


def run_round(
    machine: Machine,
    bags: Sequence[Bag],
    select: Sequence[Flags],
    nuisances: Sequence[Nuisance],
    z: Array,
    values: Mapping[str, float],
    progress: Progress,
) -> Round:
    """Fits the tolerances (with the effects in ``values``), looks at all others, fits the best, weighs them."""
    accepted = tuple(effects_of(values))
    kept = tuple(all_coordinates(list(accepted)).values())

    def problem(at_z: Array, at_values: Mapping[str, float], looseness: float) -> Problem:
        return problem_at(machine, bags, select, nuisances, at_z, at_values, looseness)

    def fit(p: Problem, at_z: Array, at_values: Mapping[str, float], names: Sequence[Coordinate]) -> tuple[Point, Array]:
        start = p.points([(at_z, at_values)])[0]
        return p.fit(start, p.nuisance_jacobian(start), names, iterations=6)

    progress("tolerances", 0.0)
    loose = problem(z, values, LOOSE)
    base, jacobian = fit(loose, z, values, kept)
    tight = problem(base.z, base.effects, 1.0)
    probe = tight.points([(base.z, base.effects)])[0]
    searching = loose
    if probe.loss / len(probe.w) < NEAR:
        base, jacobian = fit(tight, base.z, base.effects, kept)
        searching = tight
    else:
        jacobian = np.concatenate([loose.nuisance_jacobian(base), jacobian[:, len(base.z) :]], axis=1)
    progress("effects", 0.3)
    scanner = Scanner(searching, base, jacobian)
    found = scanner.scan(possible_effects(machine.structure.has, accepted))
    scanned: dict[str, float] = {}
    grouped: dict[str, list[Candidate]] = {}
    for candidate in found:
        scanned[candidate.effect] = max(scanned.get(candidate.effect, 0.0), candidate.gain)
        grouped.setdefault(candidate.effect, []).append(candidate)
    progress("fitting effects", 0.5)
    fitted = [refine(scanner, jacobian, grouped[e][:2], kept) for e in list(grouped)[:REFINED]]
    fitted.sort(key=lambda f: f.point.loss)
    if searching is tight:
        fitted = [_polished(tight, f, base) for f in fitted[:1]] + fitted[1:]
        return Round(accepted, base, jacobian, _sorted(fitted), scanned, tight)
    progress("weighing effects", 0.8)
    best = fitted[0].point
    weighing = problem(best.z, best.effects, 1.0)
    base, jacobian = fit(weighing, base.z, base.effects, kept)
    fitted = [_weighed(weighing, f, base) for f in fitted[:WEIGHED]]
    return Round(accepted, base, jacobian, _sorted(fitted), scanned, weighing)


def _weighed(problem: Problem, f: Fitted, base: Point) -> Fitted:
    """The same effect fitted again, with an observer of other gains."""
    start = problem.points([(f.point.z, f.point.effects)])[0]
    return _polished(problem, replace(f, point=start), base)


def _polished(problem: Problem, f: Fitted, base: Point) -> Fitted:
    """Fitted on with a fresh Jacobian of the tolerances."""
    point, jacobian = problem.fit(f.point, problem.nuisance_jacobian(f.point), f.coordinates, iterations=6)
    return replace(f, point=point, jacobian=jacobian, gain=base.loss - point.loss)


def _sorted(fitted: Sequence[Fitted]) -> tuple[Fitted, ...]:
    return tuple(sorted(fitted, key=lambda f: f.point.loss))


def held_out_loss(point: Point, select: Sequence[Flags]) -> float:
    """Loss of the samples that were not fitted."""
    return float(sum(rho(w[s]) for w, s in zip(point.parts, select, strict=True)))
