"""What is a recording's own: how late its log shows the currents, when a load came, or how heavy it was and from which stroke on.

A load that rests on the ground below a piston position is another one in every recording; when one is grasped, it is the same.
Moments of mass and the load are those of the pose and the load that the recording tells. All else is kept.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from boom_diagnosis.bag_samples import Bag
from boom_diagnosis.fitting import Point, Problem, weights
from boom_diagnosis.nuisances import CLOCK
from boom_model.catalogue import EFFECTS

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

COARSE, FINE = 2.0, (0.5, 0.1, 0.03)
"""s. Distances of the times that are tried: first over the recording, then about the best."""
NEAR = 1.0
"""s."""
CLOCKS = 9
"""Dead times of a log that are tried."""
STEPS = 4
"""Of Gauss and Newton for moments of mass."""
STROKES, CLOSER = 16, (4.0, 16.0)
"""Piston positions that are tried over the stroke of a recording, and how many times closer to each other about the best."""


def onset_of(effect: str) -> str:
    """Dotted name of the time at which an effect begins."""
    return f"effects.{effect}.{EFFECTS[effect].onset}"


def release_of(effect: str) -> str:
    """Dotted name of the time at which it ends."""
    return f"effects.{effect}.{EFFECTS[effect].release}"


def steps_in(effects: Mapping[str, float]) -> list[tuple[str, str]]:
    """Dotted names of mass and stroke of each load among these effects that rests on the ground below a stroke."""
    names = [
        (f"effects.{effect}.{mass}", f"effects.{effect}.{stroke}")
        for effect in dict.fromkeys(name.split(".")[1] for name in effects)
        for mass, stroke in EFFECTS[effect].steps
    ]
    return [(mass, stroke) for mass, stroke in names if effects.get(stroke, neutral(stroke)) != neutral(stroke)]


def neutral(name: str) -> float:
    """Value at which a number of an effect, by its dotted name, does nothing."""
    _, effect, parameter = name.split(".")
    return next(row.neutral for row in EFFECTS[effect].parameters if row.name == parameter)


def time_in(values: Iterable[str]) -> str:
    """Dotted name of the time at which an effect among these begins; empty where none does."""
    return next((name for name in values if name == onset_of(name.split(".")[1])), "")


def begins_within(effect: str, values: Mapping[str, float], bags: Sequence[Bag], chosen: Sequence[Flags]) -> bool:
    """Whether an effect with an onset, its numbers by dotted name, begins before the last of the samples chosen."""
    begin = values[onset_of(effect)]
    return any(begin < float(bag.time[c.any(axis=1)].max(initial=-np.inf)) for bag, c in zip(bags, chosen, strict=True))


def own(problem: Problem, z: Array, effects: Mapping[str, float]) -> dict[str, float]:
    """The numbers, by dotted name, that are the own ones of the recordings of ``problem``: of its log's clock, and of a load."""
    clock = _clock(problem, z, effects)
    beside = {**effects, **clock}
    if steps_in(effects):
        return clock | _lifted(problem, z, beside)
    return clock | (_held(problem, z, beside) if time_in(effects) else {})


def moments(problem: Problem, z: Array, effects: Mapping[str, float], which: Sequence[int]) -> Array:
    """z with the likeliest numbers ``which`` in the recordings of ``problem``, within their tolerances; the others stay."""
    own = list(which)
    best = problem.points([(z, effects)])[0]
    for _ in range(STEPS):
        columns, omega = problem.nuisance_jacobian(best, own), weights(best)[:, None]
        normal = columns.T @ (omega * columns) + np.eye(len(own))
        gradient = columns.T @ (omega[:, 0] * best.w) + best.z[own]
        moved = best.z.copy()
        moved[own] -= np.linalg.solve(normal, gradient)
        moved[own] = np.clip(moved[own], *problem.limits[:, own])
        point = problem.points([(moved, effects)])[0]
        if point.loss > best.loss - 0.1:
            break
        best = point
    return best.z


def _clock(problem: Problem, z: Array, effects: Mapping[str, float]) -> dict[str, float]:
    """The likeliest dead time [s] of the commands against their log: a log's own is anywhere within its range."""
    clock = next((n for n in problem.nuisances if n.label == CLOCK), None)
    if clock is None:
        return {}
    low, high = clock.ends
    if clock.name in effects:  # a dead time of the machine, and the clock of the recording that it was found in
        low, high = effects[clock.name] - (high - low), effects[clock.name] + (high - low)
    apart = (high - low) / (CLOCKS - 1)
    best = None
    for tried in (np.linspace(low, high, CLOCKS), apart * np.arange(-3, 4) / 4.0):
        times = tried if best is None else np.clip(best.effects[clock.name] + tried, low, high)
        points = problem.points([(z, {**effects, clock.name: float(t)}) for t in times])
        best = min([*points, *([best] if best else [])], key=lambda point: point.loss)
    assert best is not None
    return {clock.name: best.effects[clock.name]}


def _lifted(problem: Problem, z: Array, effects: Mapping[str, float]) -> dict[str, float]:
    """The likeliest masses [kg] and strokes [m] of a load, one step after the other, twice.

    At each stroke the mass by a step of Gauss and Newton.
    """
    p, steps = problem.predictor, steps_in(effects)
    strokes = np.concatenate([bag.strokes(p.machine) for bag in p.bags])
    low, apart = float(strokes.min()), float(np.ptp(strokes)) / STROKES
    best = problem.points([(z, {**effects, **{mass: 0.0 for mass, _ in steps}})])[0]
    for mass, stroke in steps * min(len(steps), 2):
        size = effects[mass]
        without = problem.points([(z, {**best.effects, mass: 0.0})])[0]
        for closer in (0.0, *CLOSER):
            near = best.effects[stroke] + apart / max(closer, 1.0) * np.arange(-3, 4)
            tried = near if closer else low + apart * np.arange(STROKES)
            beside = problem.points([(z, {**best.effects, mass: size, stroke: float(s)}) for s in tried])
            masses = [size * _share(without, point) for point in beside]
            wanted = [(z, {**best.effects, stroke: float(s), mass: m}) for s, m in zip(tried, masses, strict=True)]
            best = min([best, *problem.points(wanted)], key=lambda point: point.loss)
    return {name: best.effects[name] for step in steps for name in step}


def _share(without: Point, beside: Point) -> float:
    """Of what was changed between two points, the share that serves best."""
    change, omega = beside.w - without.w, weights(without)
    return -float(change @ (omega * without.w)) / max(float(change @ (omega * change)), 1e-9)


def _held(problem: Problem, z: Array, effects: Mapping[str, float]) -> dict[str, float]:
    """The likeliest times [s] at which a load comes, and goes where one goes, in the recording of ``problem``.

    One may come as the other has not gone yet, and none go there.
    """
    begin = time_in(effects)
    end = release_of(begin.split(".")[1])
    never = neutral(end)
    times = {begin: _when(problem, z, {**effects, end: never}, begin)}
    if effects[end] == never:
        return times
    for name in (end, begin):
        times[name] = _when(problem, z, {**effects, end: never, **times}, name)
    without, beside = problem.points([(z, {**effects, **times, end: never}), (z, {**effects, **times})])
    return {**times, end: never} if without.loss <= beside.loss else times


def _when(problem: Problem, z: Array, effects: Mapping[str, float], name: str) -> float:
    """The likeliest value [s] of one of these times."""
    lasting = max(bag.recording.duration for bag in problem.predictor.bags)
    best = _best(problem, z, effects, name, np.arange(COARSE / 2, lasting, COARSE))
    span = COARSE
    for step in FINE:
        best = _best(problem, z, effects, name, np.arange(max(0.0, best - span), best + span, step))
        span = 2 * step
    return best


def near_onset(problem: Problem, at: Point) -> Point:
    """``at`` with the likeliest time of the load's change within ``NEAR`` of its own, and of its going again, where it goes."""
    begin = time_in(at.effects)
    end = release_of(begin.split(".")[1])
    for name in (begin, end) if at.effects[end] != neutral(end) else (begin,):
        near = at.effects[name] + np.arange(-NEAR, NEAR + 1e-9, FINE[1])
        moved = [(at.z, {**at.effects, name: max(0.0, float(t))}) for t in near]
        at = min([at, *problem.points(moved)], key=lambda p: p.loss)
    return at


def _best(problem: Problem, z: Array, effects: Mapping[str, float], name: str, times: Array) -> float:
    points = problem.points([(z, {**effects, name: float(t)}) for t in times])
    return float(times[int(np.argmin([p.loss for p in points]))])
