"""What a log makes of the currents, which looks like physics that is missing; the innovations' likelihood tells it.

Either must gain more than chance, which grows with what it leaves unexplained (``earning.temperature``), as everything does here:
where nothing explains the recording a freer observer gains as well.

A logger that races the controller writes now this command, now the one before it. In the gains of the observer that is noise of
the currents where they change, (du/dt) sigma_t.

One that is slower than the controller, or than the currents themselves, leaves open what they were in between, though the machine
file's T_s may be the logger's. They are on lines between its samples then (``currents``), as of a controller with a T_s of its own.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from boom_diagnosis.bag_samples import Bag, prepare
from boom_diagnosis.case import Case, Flags, case_of
from boom_diagnosis.earning import chance, temperature
from boom_diagnosis.fitting import Point, Problem
from boom_diagnosis.hypotheses import FAR_OFF, LOOSENESS, problem_at
from boom_diagnosis.locating import disturbed, links
from boom_diagnosis.nuisances import CLOCK
from boom_diagnosis.weighing import COLDEST, ENOUGH
from boom_model.machine import Machine

Array = NDArray[np.float64]

OFTENER = (0.5, 0.25)
"""Of the time between two samples: T_s of a controller that commands more often than its log says."""
SHARES = (0.25, 0.125, 0.5)
"""Of the time between two samples: standard deviations that are tried. One sample late in half of all cases is the most."""


def commanded_oftener(case: Case) -> Case | None:
    """The case from its beginning as one whose currents change between their samples, where that is likelier; else None.

    Where the file's T_s says that they do, as one whose currents hold until the next sample, as those of a slower controller.

    It must gain more than chance whatever disturbs the machine, which both may see: the log's shortcoming beside physics.
    """
    at, seen = case.last, links(case.machine)

    def likeliest(problem: Problem, z: Array) -> tuple[float, float]:
        point = problem.points([(z, at.effects)])[0]
        return max(problem.likelihood_at(z, at.effects), disturbed(problem, point, seen)), _enough(case, point)

    best, most = None, likeliest(case.problem(at.z, at.effects, LOOSENESS[0]), at.z)[0]
    z = _on_stamps(case, at.z)
    for tried in _commanded_otherwise(case):
        problem = problem_at(tried.machine, tried.bags, case.select, case.nuisances, z, at.effects, LOOSENESS[0])
        reached, needed = likeliest(problem, z)
        if reached > most + (0.0 if best else needed):
            best, most = tried, reached
    return best


def of_slow_log(case: Case) -> Case | None:
    """The case from its beginning, where what the currents did between their samples is all that tolerances leave; else None.

    Looked at before any effect: each would first be tried on what is the log's.
    """
    at = case.nominal.tolerances
    if case.rest(at) <= FAR_OFF:
        return None

    def likelihood(tried: Case) -> float:
        z = _on_stamps(case, at.z) if tried is not case else at.z
        return tried.problem(z, at.effects, LOOSENESS[0]).likelihood_at(z, at.effects)

    best = max([case, *_commanded_otherwise(case)], key=likelihood)
    return best if best is not case and best.rest(best.nominal.tolerances) <= FAR_OFF else None


def _commanded_otherwise(case: Case) -> list[Case]:
    """The case from its beginning with each other T_s that its log lets be."""
    period = max(float(np.median(np.diff(bag.currents.sampled_at))) for bag in case.bags)
    result = []
    for share in (1.0,) if any(bag.currents.late for bag in case.bags) else OFTENER:
        machine = _commanding_every(share * period, case.machine)
        bags = [prepared for bag in case.bags if (prepared := prepare(bag.recording, machine))]
        proving = [prepared for bag in case.proving if (prepared := prepare(bag.recording, machine))]
        tried = case_of(machine, bags, proving, case.seed)
        tried.elsewhere, tried.oftener = case.elsewhere, share * period
        result.append(tried)
    return result


def _on_stamps(case: Case, z: Array) -> Array:
    """z with no offset of the currents' clock: lines stand half a sample earlier by themselves."""
    return np.where([n.label == CLOCK for n in case.nuisances], 0.0, z)


def _enough(case: Case, at: Point) -> float:
    """Nats that another view of the recordings must gain, which leaves what is left at a point."""
    return chance(case) + ENOUGH * (temperature(case, at) / COLDEST - 1.0)


def _commanding_every(period: float, machine: Machine) -> Machine:
    """With another T_s [s], and the noise of its pressures as it was."""
    said = {"Ts": period}
    if "p_noise_psd" in machine.sensors:
        said["p_noise_psd"] = machine.sensors["p_noise_psd"] * period / machine.sample_time
    return machine.with_sensors(said)


def strayed(case: Case) -> tuple[list[Bag], list[Bag]] | None:
    """The recordings, fitted and held out, as ones that stray, where that is likelier than all that was found; else None.

    It must gain more than chance over the best that a disturbance anywhere in the machine gains: what strays is the log's, and
    where the machine is astray, too, it is physics.
    """
    at = case.last
    fitted = [_likeliest(case, bag, select, at, {}) for bag, select in zip(case.bags, case.select, strict=True)]
    bags = [bag for bag, _ in fitted]
    strays = problem_at(case.machine, bags, case.select, case.nuisances, at.z, at.effects, LOOSENESS[0])
    gained = sum(gain for _, gain in fitted) - _enough(case, strays.points([(at.z, at.effects)])[0])
    base = case.problem(at.z, at.effects, LOOSENESS[0])
    if gained < 0.0 or gained < disturbed(base, at, links(case.machine)) - base.likelihood_at(at.z, at.effects):
        return None
    return bags, [_likeliest(case, bag, bag.counted, at, case.own_beside(at))[0] for bag in case.proving]


def _likeliest(case: Case, bag: Bag, select: Flags, at: Point, own: Mapping[str, float]) -> tuple[Bag, float]:
    """The recording as it strays likeliest at a point, seen by the observer of a healthy machine, and what that gains [nats].

    own: numbers that are the recording's own.
    """
    effects = {**at.effects, **own}

    def likelihood(tried: Bag) -> float:
        problem = problem_at(case.machine, [tried], [select], case.nuisances, at.z, effects, LOOSENESS[0])
        return problem.likelihood_at(at.z, effects)

    before, period = likelihood(bag), float(np.median(np.diff(bag.currents.sampled_at)))
    best, most = bag, 0.0
    for share in SHARES:
        tried = bag.straying(share * period)
        gain = likelihood(tried) - before
        if gain > most:
            best, most = tried, gain
        elif best is bag:  # the middle one gains nothing
            break
    return best, most
