"""One round of the search: tolerances alone, every effect beside them, and what speaks for each.

How large the disturbances are that the observer assumes is itself estimated (likelihood): a loose observer follows a
machine that is far from the model; with a model that is right the tight one is the likeliest, and sees most.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from boom_diagnosis.diagnosis.bag_samples import Bag
from boom_diagnosis.diagnosis.coordinates import Coordinate, all_coordinates
from boom_diagnosis.diagnosis.fitting import Point, Problem
from boom_diagnosis.diagnosis.nuisances import Nuisance
from boom_diagnosis.diagnosis.prediction import Predictor, with_states
from boom_diagnosis.diagnosis.search import Candidate, Fitted, Scanner, possible_effects, refine
from boom_model.machine import Machine

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

LOOSENESS = (1.0, 4.0, 15.0)
"""Factors of the assumed disturbances that are tried; the likeliest is taken, and a machine that is like the model gets 1."""
REFINED, PROMISING = 4, 0.1
"""Effects that are fitted in a round at most, and the share of the nats that they must gain which the linear look must promise."""
WEIGHED, RIVAL = 3, 0.1
"""Effects that are weighed again where the best makes another observer likelier, and the share of its gain they must have."""

RELINEARISED, SETTLED = 3, 300.0
"""Fits of the tolerances with fresh derivatives at most, and the nats that the last one gained where they are good enough: a search
that gives up too early leaves a rest to whatever effect comes first."""
NOTICED = 12.0
"""Nats, and half a one for each tolerance, that tolerances must gain before they count as moved at all."""

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
    judged: Sequence[Flags] | None = None,
) -> Problem:
    """A problem whose observers' gains are those of this point."""
    plain = Problem(Predictor(machine, bags), nuisances, select)
    return Problem(Predictor(machine, bags, plain.values(z, values), looseness), nuisances, select, judged)


def run_round(
    machine: Machine,
    bags: Sequence[Bag],
    select: Sequence[Flags],
    nuisances: Sequence[Nuisance],
    z: Array,
    values: Mapping[str, float],
    progress: Progress,
    judged: Sequence[Flags] | None = None,
    tight: bool = False,
    least: float = 0.0,
) -> Round:
    """Fits the tolerances (with the effects in ``values``), looks at all others, fits the best, weighs them.

    tight: with the observer that is right for a healthy machine, whichever is likeliest. least: nats that an effect must gain.
    """
    accepted = tuple(effects_of(values))
    kept = tuple(all_coordinates(list(accepted)).values())

    def problem(at_z: Array, at_values: Mapping[str, float], looseness: float) -> Problem:
        return problem_at(machine, bags, select, nuisances, at_z, at_values, looseness, judged)

    def fit(
        p: Problem, at_z: Array, at_values: Mapping[str, float], names: Sequence[Coordinate]
    ) -> tuple[Point, Array]:
        point = p.points([(at_z, at_values)])[0]
        for _ in range(RELINEARISED):
            before = point.loss
            point, jacobian = p.fit(point, p.nuisance_jacobian(point), names, iterations=6)
            if before - point.loss < SETTLED or p.predictor.looseness == LOOSENESS[-1]:
                break
        return point, jacobian

    def likeliest(at_z: Array, at_values: Mapping[str, float]) -> Problem:
        tried = [problem(at_z, at_values, looseness) for looseness in (LOOSENESS[:1] if tight else LOOSENESS)]
        return max(tried, key=lambda p: p.likelihood(p.points([(at_z, at_values)])[0]))

    progress("tolerances", 0.0)
    if accepted or tight:  # near already
        searching = likeliest(z, values)
        base, jacobian = fit(searching, z, values, kept)
    else:
        searching = problem(z, values, LOOSENESS[-1])
        base, jacobian = fit(searching, z, values, kept)
        tighter = likeliest(base.z, base.effects)
        if tighter.predictor.looseness < LOOSENESS[-1]:
            searching = tighter
            base, jacobian = fit(searching, base.z, base.effects, kept)
        else:
            jacobian = np.concatenate([searching.nuisance_jacobian(base), jacobian[:, len(base.z) :]], axis=1)
    nominal = searching.fit_nominal(base.effects, kept)
    if nominal.loss - base.loss < NOTICED + 0.5 * len(base.z):
        base = nominal
    progress("effects", 0.3)
    scanner = Scanner(searching, base, jacobian)
    found = scanner.scan(possible_effects(machine.structure.has, accepted))
    scanned: dict[str, float] = {}
    grouped: dict[str, list[Candidate]] = {}
    for candidate in found:
        scanned[candidate.effect] = max(scanned.get(candidate.effect, 0.0), candidate.gain)
        grouped.setdefault(candidate.effect, []).append(candidate)
    progress("fitting effects", 0.5)
    promising = [e for e, tried in grouped.items() if tried[0].gain > PROMISING * least][:REFINED]
    fitted = [refine(scanner, jacobian, _starts(grouped[e]), kept) for e in promising]
    fitted.sort(key=lambda f: f.point.loss)
    if not fitted:
        return Round(accepted, base, jacobian, (), scanned, searching)
    progress("weighing effects", 0.8)
    best = fitted[0].point
    weighing = likeliest(best.z, best.effects)
    # an effect with states of its own is weighed by gains that correct them, too
    if weighing.predictor.looseness == searching.predictor.looseness and not with_states(best.effects):
        fitted = [_polished(searching, f, base, f.jacobian[:, : len(base.z)]) for f in fitted[:1]] + fitted[1:]
        return Round(accepted, base, jacobian, _sorted(fitted), scanned, searching)
    base, jacobian = fit(weighing, base.z, base.effects, kept)
    columns = jacobian[:, : len(base.z)]  # of the base; good enough for all but the best
    near = [f for f in fitted[:WEIGHED] if f.gain > RIVAL * fitted[0].gain]
    fitted = [_weighed(weighing, f, base, columns if k else None) for k, f in enumerate(near)]
    return Round(accepted, base, jacobian, _sorted(fitted), scanned, weighing)


def _starts(candidates: Sequence[Candidate]) -> list[Candidate]:
    """The best start, and the second where it promises nearly as much from elsewhere."""
    return list(candidates[:1]) + [c for c in candidates[1:2] if c.gain > 0.5 * candidates[0].gain]


def _weighed(problem: Problem, f: Fitted, base: Point, columns: Array | None) -> Fitted:
    """The same effect fitted again, with an observer of other gains."""
    start = problem.points([(f.point.z, f.point.effects)])[0]
    return _polished(problem, replace(f, point=start), base, columns)


def _polished(problem: Problem, f: Fitted, base: Point, columns: Array | None = None) -> Fitted:
    """Fitted on with a fresh Jacobian of the tolerances, or the one given."""
    if columns is None:
        columns = problem.nuisance_jacobian(f.point)
    point, jacobian = problem.fit(f.point, columns, f.coordinates, iterations=6)
    return replace(f, point=point, jacobian=jacobian, gain=base.loss - point.loss)


def _sorted(fitted: Sequence[Fitted]) -> tuple[Fitted, ...]:
    return tuple(sorted(fitted, key=lambda f: f.point.loss))
