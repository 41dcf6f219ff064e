"""All numbers of a machine within their tolerances, fitted to recordings: the diagnosis' fit with no effect.

For ``./boom identify`` where the machine file is too far from the machine for a search that starts near it. The observer bears with
a machine that is far from right to begin with (``hypotheses.LOOSENESS``), and the end is fitted to free runs. A number that has its
tolerance is found within it; what the recordings do not tell stays where the tolerances leave it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from boom_checks.sampling import independent
from boom_diagnosis.bag_samples import Bag, prepare
from boom_diagnosis.case import Case
from boom_diagnosis.fitting import Z_STEP, Point, Problem
from boom_diagnosis.free_fit import fitted_to_free_runs
from boom_diagnosis.hypotheses import LOOSENESS, Fits
from boom_diagnosis.nuisances import tolerances
from boom_diagnosis.stretches import excited, is_long, stretches
from boom_diagnosis.weighing import posterior, scatter
from boom_estimation.free_run import plant_for
from boom_estimation.sensor_noise import with_measured_noise
from boom_estimation.uncertainty import NINETY
from boom_identification.estimate import Identified, NotDetermined
from boom_identification.foresight import NOTHING
from boom_identification.machine_output import machine_with
from boom_identification.refine import HELD_OUT, HeldOut, Refinement, free_run_errors
from boom_model.machine import Machine
from boom_recording.recording import Recording, part

Array = NDArray[np.float64]

MOVED = 0.1
"""Standard deviations from which a number counts as moved."""
HOW = "all at once, in tolerance"
Progress = Callable[[str], None]


def fit_tolerances(recordings: Sequence[Recording], machine: Machine, progress: Progress) -> Refinement:
    """Numbers of ``machine`` that have a tolerance, from recordings of it; the last part of each is held out.

    Of a long recording the minutes that tell most stand for it.

    Loads and moments of mass stay: they belong to the recording and the pose.

    Raises:
        MachineError: a pose or load that the machine cannot have.
    """
    measured = with_measured_noise(machine, recordings)
    whole = [independent(recording) for recording in recordings]
    chosen = stretches([_searched(r, measured) for r in whole], [], measured)
    prepared = [prepare(recording, measured) for recording in chosen.recordings]
    bags = [bag for bag in prepared if bag is not None and excited(bag)]
    if not bags:
        return Refinement(machine, (), ())
    case = _case(measured, bags)
    progress("all numbers within their tolerances, seen by a loose observer")
    fits = Fits(measured, bags, case.select, case.nuisances)
    guess = case.nominal.tolerances
    _, point, _ = fits.settled(fits.likeliest(guess.z, {}), guess, ())
    progress("free runs")
    point = fitted_to_free_runs(case, point, case.bags, case.select)
    tight = case.problem(point.z, {}, LOOSENESS[0])
    covariance = _covariance(point, tight.nuisance_jacobian(point))
    estimates = _estimates(case, tight, point.z, covariance)
    silent = np.sqrt(np.diag(covariance)) > NOTHING
    known = {e.key for e in estimates}
    missing = [
        NotDetermined(n.name, "not enough excitation in these recordings")
        for n, nothing in zip(case.nuisances, silent, strict=True)
        if nothing and n.name not in known
    ]
    fitted = machine_with(machine, estimates)
    names = [bag.recording.name for bag in bags]
    moving = {chosen.begins.get(name, (name, 0.0))[0] for name in names}
    told = [r for r in whole if r.name in moving]
    errors = [free_run_errors(told, m) for m in (machine, fitted)]
    check = tuple(HeldOut(r.name, first, second) for r, first, second in zip(told, *errors, strict=True))
    level = float(np.sqrt(np.mean(np.square(point.w[point.used]))))
    selected = tuple(names) if chosen.others else ()
    return Refinement(fitted, estimates, tuple(missing), (), check, level, 1, 1, selected)


def _searched(recording: Recording, machine: Machine) -> Recording:
    """The part of a long recording that may be fitted to; of a short one the end is left out later."""
    return part(recording, 0.0, recording.duration * (1.0 - HELD_OUT)) if is_long(recording, machine) else recording


def _case(machine: Machine, bags: list[Bag]) -> Case:
    """What is fitted: all but the last part of each recording, with the numbers that a machine file holds."""
    pose = plant_for(bags[0].recording, machine, "full").pose
    select = [bag.counted & (bag.time < (1.0 - HELD_OUT) * bag.recording.duration)[:, None] for bag in bags]
    own = tuple(n for n in tolerances(machine, pose) if not n.name.startswith("pose."))
    return Case(machine, pose, bags, [], select, select, [np.zeros_like(s) for s in select], own, 0)


def _covariance(point: Point, jacobian: Array) -> Array:
    """Of z: the posterior's, each number widened to how much stretches of the recordings disagree about it."""
    count = len(point.z)
    covariance = posterior(point, jacobian, count)
    wider = np.sqrt(np.maximum(np.diag(scatter(point, jacobian, count)) / np.diag(covariance), 1.0))
    return np.asarray(covariance * np.outer(wider, wider))


def _estimates(case: Case, problem: Problem, z: Array, covariance: Array) -> tuple[Identified, ...]:
    """Every number that the fit moved or told, also those that follow from others, with its interval.

    Spread of v(z), by differences: sqrt(diag(J C J')), J = dv/dz, C the covariance of z.
    """
    deviations = np.sqrt(np.diag(covariance))
    told = {n.name for n, zi, d in zip(case.nuisances, z, deviations, strict=True) if d <= NOTHING or abs(zi) > MOVED}
    units = {c: p.specification.unit for p in case.machine.parameters.values() for c in p.specification.components}
    nominal = case.machine.values(case.pose)
    moved = np.where([n.name in told for n in case.nuisances], z, 0.0)
    here = problem.values(moved, {})
    names = [name for name, value in here.items() if value != nominal.get(name, 0.0)]
    values = np.array([here[name] for name in names])
    rows = []
    for unit in np.eye(len(z)):
        there = problem.values(moved + Z_STEP * unit, {})
        rows.append([(there.get(name, nominal.get(name, 0.0)) - here[name]) / Z_STEP for name in names])
    derivative = np.array(rows).reshape(len(z), len(names))
    half = NINETY * np.sqrt(np.einsum("ik,ij,jk->k", derivative, covariance, derivative))
    return tuple(
        Identified(name, float(v), units.get(name, "-"), (float(v - h), float(v + h)), HOW)
        for name, v, h in zip(names, values, half, strict=True)
    )
