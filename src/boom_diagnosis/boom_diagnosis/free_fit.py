"""Numbers fitted to what a user looks at: free runs, from where the fit to one-step errors ended.

    minimised: sum over channels c of (m_c / 2) log(mean e_c^2) + |z|^2 / 2 + |s|^2 / 2

s: numbers that give an effect its shape, in standard deviations from the middle of their plausible range: free runs of a recording
often tell them only together with others.

e_c: error of the free run, m_c: seconds that are fitted, because what is wrong lasts about as long as a motion
(``DISCREPANCY_TIME``). Gauss and Newton, each channel weighted by its error where the step begins.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from boom_diagnosis.assumptions import NEAR_FLOOR, WORSE
from boom_diagnosis.bag_samples import PERIOD, Bag
from boom_diagnosis.case import Case
from boom_diagnosis.coordinates import Coordinate, all_coordinates, idle
from boom_diagnosis.disturbances import Values
from boom_diagnosis.fitting import Point, Problem
from boom_diagnosis.freerun import errors, free_run, noise_floor
from boom_diagnosis.hypotheses import LOOSENESS, effects_of, problem_at
from boom_diagnosis.prediction import Predictor
from boom_diagnosis.proof import machine_at, placed, spans_of, worsening, worst_channel
from boom_diagnosis.weighing import NEGLIGIBLE
from boom_model.catalogue import EFFECTS
from boom_model.learned import DISCREPANCY_TIME
from boom_model.machine import Machine
from boom_model.observer import KalmanGains
from boom_model.plant import Plant
from boom_model.sensors import OUTPUTS

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

TURNS, SETTLED = 20, 0.1
"""Steps at most, and nats that the last one gains."""


class FreeRunPredictor(Predictor):
    """Predicts without correcting; ``weights``: (NY,) per recording, of the errors."""

    def __init__(self, machine: Machine, bags: Sequence[Bag], weights: Sequence[Array]) -> None:
        super().__init__(machine, bags)
        self.weights = tuple(weights)

    def _gains(self, i: int, plant: Plant, values: Values) -> KalmanGains:
        del values  # nothing is corrected, whatever they are
        n, ny = len(self.bags[i].grid) - 1, len(OUTPUTS)
        whitening = np.broadcast_to(np.diag(self.weights[i]), (n, ny, ny))
        return KalmanGains(np.zeros((n, len(plant.state_names), ny)), whitening)


def fit_to_free_runs(case: Case) -> None:
    """The machines that are handed out and compared, fitted to free runs where these stay far from what noise leaves.

    What is found and parameters only are both fitted, because they are compared; but where what is found leaves nothing in
    one-step errors, these are its likelihood, and free runs near the noise's would only move its numbers. A fit counts where it
    improves free runs over data not used, and no channel of what is found gets worse than with parameters only by it.
    """
    alone = None if case.taken or case.learned else _alone(case)
    far = {k: far_from_noise(case, case.trained[k]) for k in dict.fromkeys((0, len(case.trained) - 1))}
    if not any(far.values()):
        return
    for k in far:
        if k and not far[k] and case.rest(case.last) < NEGLIGIBLE:
            continue
        before = case.trained[k]
        after = fitted_to_free_runs(case, before, case.bags, case.training)
        if worsening(case, before, after) >= 1.0 or (k and _unproves(case, before, after)):
            continue
        case.trained[k] = after
        if case.final and k == len(case.taken):
            start = replace(case.final.point, z=after.z, effects=after.effects)
            whole = fitted_to_free_runs(case, start, case.bags, case.select)
            case.final, case.sharpest = replace(case.final, point=whole), case.final.point
        elif alone:
            case.sharpest = case.kept(0)
            case.plain = after if case.proving else fitted_to_free_runs(case, alone, case.bags, case.select)


def _alone(case: Case) -> Point:
    """Parameters only, fitted to all: by the likeliest observer where free runs over what is fitted err less by its fit.

    Where nothing was found, the observer that sees most bends numbers to whatever is not of the model's form.
    """
    if case.likeliest and worsening(case, case.trained[0], case.likeliest[1], fitted=True) < 1.0:
        case.sharpest = case.kept(0)
        case.plain, case.trained[0] = case.likeliest
    return case.last


def _unproves(case: Case, before: Point, after: Point) -> bool:
    """Whether a channel errs more than with parameters only after a fit, and none before."""
    base = case.trained[0]
    return worst_channel(case, base, after) > WORSE >= worst_channel(case, base, before)


def far_from_noise(case: Case, at: Point) -> bool:
    """Whether free runs over what is fitted err far more than noise would."""
    machine = machine_at(case, at)
    for i, span in enumerate(spans_of(case).training):
        own = placed(machine, case, span)
        floor = np.array(noise_floor(span, own, case.seed + i))
        if not np.all(np.array(errors(span, free_run(span.recording, own))) <= NEAR_FLOOR * floor):
            return True
    return False


def fitted_to_free_runs(case: Case, at: Point, bags: Sequence[Bag], select: Sequence[Flags]) -> Point:
    """The best point that the steps reach, as the observer of a healthy machine sees it; select: samples of these recordings."""
    z, effects = at.z, dict(at.effects)
    names = tuple(
        c for c in all_coordinates(effects_of(effects), case.size) if not (c.onset or c.name in idle(effects))
    )  # one-step errors tell it sharply
    leading = {f"effects.{e}.{row.name}" for e in effects_of(effects) for row in EFFECTS[e].leading}
    shapes = tuple(c for c in names if c.positive and c.name not in leading and c.plausible[0] < c.plausible[1])
    for _ in range(TURNS):
        problem = _problem(case, bags, z, effects, select, shapes)
        begin = problem.points([(z, effects)])[0]
        end, _ = problem.fit(begin, problem.nuisance_jacobian(begin), names, iterations=1)
        if begin.loss - end.loss < SETTLED:
            break
        z, effects = end.z, end.effects
    return problem_at(case.machine, bags, select, case.nuisances, z, effects, LOOSENESS[0]).points([(z, effects)])[0]


def spread_of(measured: Array) -> Array:
    """(NY,) standard deviations of the channels (n, NY); 1 of one that was not measured, and has no errors."""
    known = [column[np.isfinite(column)] for column in measured.T]
    return np.array([np.std(column) if len(column) else 1.0 for column in known])


def _problem(
    case: Case,
    bags: Sequence[Bag],
    z: Array,
    effects: Mapping[str, float],
    select: Sequence[Flags],
    shapes: Sequence[Coordinate],
) -> Problem:
    """Free runs with the weights of their errors at a point."""
    spreads = [spread_of(bag.samples().measured) for bag in bags]
    plain = Problem(FreeRunPredictor(case.machine, bags, [1.0 / s for s in spreads]), case.nuisances, select)
    weights = []
    for part, spread, chosen in zip(plain.points([(z, effects)])[0].parts, spreads, select, strict=True):
        square = np.array([np.mean(e[s] ** 2) if s.any() else np.inf for e, s in zip(part.T, chosen.T, strict=True)])
        square = np.where(square > 0.0, square, np.inf)  # nothing is told by a channel without an error
        weights.append(np.sqrt(PERIOD / DISCREPANCY_TIME / square) / spread)
    return Problem(FreeRunPredictor(case.machine, bags, weights), case.nuisances, select, shapes=shapes)
