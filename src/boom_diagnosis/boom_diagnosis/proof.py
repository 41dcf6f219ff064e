"""Machines of each stage, their free runs over what was fitted and what was held out, and each recording as the report draws it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from math import log
from types import MappingProxyType
from typing import TYPE_CHECKING, Protocol

import numpy as np
from numpy.typing import NDArray

from boom_diagnosis import regimes
from boom_diagnosis.assumptions import AT_FLOOR, FAR_FROM_FLOOR, NEAR_FLOOR
from boom_diagnosis.bag_samples import Bag
from boom_diagnosis.document import STAGES, BagResult, ChannelFit, Fit, LadderStep, Verdict
from boom_diagnosis.fitting import Z_STEP, Point
from boom_diagnosis.found_machine import found_machine
from boom_diagnosis.freerun import Elsewhere, Errors, Span, errors, free_run, median, noise_floor
from boom_diagnosis.learning import Learned
from boom_diagnosis.must_keep import worse_channels
from boom_diagnosis.nuisances import clocks_in
from boom_diagnosis.parallel import in_parallel
from boom_diagnosis.prediction import beyond
from boom_diagnosis.weighing import Z90
from boom_estimation.free_run import FreeRun
from boom_input.channels import PREDICTED, SENSORS
from boom_model.catalogue import EFFECTS
from boom_model.learned import LearnedTerm
from boom_model.machine import Machine, Pose
from boom_recording.recording import Recording

if TYPE_CHECKING:
    from boom_diagnosis.nuisances import Nuisance

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

ENDED = 10.0
"""Factor of the error that a free run which leaves the model's range counts as."""


class Proved(Protocol):
    """What was found in recordings, as far as its proof needs to know it; see ``case.Case``.

    named: the effects that were found. elsewhere: blocks of long recordings that only the proof looks at.
    trained: points with the first k of them, fitted to the data for training alone. learned: a term in their place.
    """

    machine: Machine
    pose: Pose
    others: Mapping[str, Pose]
    bags: list[Bag]
    proving: list[Bag]
    judged: list[Flags]
    elsewhere: tuple[Elsewhere, ...]
    nuisances: tuple[Nuisance, ...]
    seed: int
    own: dict[str, float]
    trained: list[Point]
    learned: Learned | None
    healthy_squares: Array

    @property
    def named(self) -> tuple[str, ...]:
        """Effects, what gains most first."""

    def values(self, z: Array, effects: Mapping[str, float]) -> dict[str, float]:
        """Components of the parameter vector."""

    def numbers(self, z: Array, effects: Mapping[str, float]) -> dict[str, float]:
        """The same with those of other poses."""

    def everywhere(self, at: Point) -> Array:
        """z at a point, with the numbers that recordings held out tell alone as they tell them."""


def label_of(effect: str) -> str:
    """An effect's id in words."""
    return effect.replace("_", " ")


def machines_of(case: Proved, verdict: Verdict, learned: Learned | None) -> dict[str, Machine]:
    """Stage -> machine fitted to the data for training alone, and the steps of the ladder between them."""

    def at(point: Point, terms: tuple[LearnedTerm, ...] = ()) -> Machine:
        return machine_at(case, point, {}, terms)

    steps = {"nominal": case.machine, "parameters_only": at(case.trained[0])}
    for k, point in enumerate(case.trained[1:], start=1):
        last = k == len(case.named) and not learned
        steps["explained" if last else f"+ {', '.join(case.named[:k])}"] = at(point)
    if learned:
        steps["explained"] = at(learned.point, (learned.term,))
    elif not case.named:
        steps["explained"] = case.machine if verdict == "no_mismatch" else steps["parameters_only"]
    return steps


def final_machine(case: Proved, point: Point, covariance: Array, terms: tuple[LearnedTerm, ...]) -> Machine:
    """The machine with everything that was found, fitted to all of the recordings; covariance: (count, count) of z.

    Half of the 90 % interval of a number v(z), of one that follows from others, too: Z90 sqrt(J C J'), J = dv/dz by differences.
    """
    z = case.everywhere(point)
    here = case.numbers(z, point.effects)
    names = list(here)
    moved = (case.numbers(z + Z_STEP * unit, point.effects) for unit in np.eye(len(z)))
    derivative = np.array([[there.get(n, here[n]) - here[n] for n in names] for there in moved]) / Z_STEP
    half = Z90 * np.sqrt(np.maximum(np.einsum("ik,ij,jk->k", derivative, covariance, derivative), 0.0))
    return machine_at(case, point, dict(zip(names, half.tolist(), strict=True)), terms)


def machine_at(
    case: Proved, point: Point, spreads: Mapping[str, float] = MappingProxyType({}), terms: tuple[LearnedTerm, ...] = ()
) -> Machine:  # fmt: skip
    """The machine with the numbers of a point."""
    numbers = case.numbers(case.everywhere(point), point.effects)
    return found_machine(case.machine, case.pose, numbers, spreads, terms, case.others)


@dataclass(frozen=True)
class Spans:
    """Parts of recordings that were fitted, that are judged, all recordings in the order of the runs, and blocks elsewhere."""

    training: list[Span]
    judged: list[Span]
    all: list[Span]
    elsewhere: list[Span]


@dataclass(frozen=True)
class Driven:
    """A machine's free runs through all recordings, and the errors of those through blocks elsewhere, which are not kept."""

    runs: list[FreeRun]
    elsewhere: list[Errors]


def placed(machine: Machine, case: Proved, span: Span) -> Machine:
    """The machine in a recording: clock and load are that recording's own, and in a block the load changes at the same moment."""
    effects = {name: dict(values) for name, values in machine.effects.items()}
    if any(bag.recording is span.recording for bag in case.proving):
        for name, value in case.own.items():
            _, effect, parameter = name.split(".")
            if effect in effects or (machine is not case.machine and not EFFECTS[effect].load):
                effects.setdefault(effect, {})[parameter] = value
    later = next((b.later for b in case.elsewhere if b.recording is span.recording), None)
    for effect, values in effects.items() if later else ():
        for time in {EFFECTS[effect].onset, EFFECTS[effect].release} & values.keys():
            values[time] = max(0.0, values[time] - (later or 0.0))
    return machine if effects == machine.effects else machine.with_effects(effects)


def spans_of(case: Proved) -> Spans:
    """What was fitted and what is judged, recording by recording."""
    training, judged, everything = [], [], []
    at = case.learned.point if case.learned else case.trained[-1] if case.trained else None
    clocks = clocks_in(case.values(at.z, {})) if at else ()
    noise = case.machine.sensor_noise()
    logged = clocks, tuple(noise.deviation(sensor) for sensor in PREDICTED)
    for bag, select in zip(case.bags, case.judged, strict=True):
        r, strays = bag.recording, bag.currents.strays
        everything.append(Span(r, 0.0, r.duration, strays, *logged))
        if case.proving:
            training.append(everything[-1])
            continue
        held = bag.time[select.any(axis=1)]
        cut = float(held[0]) if len(held) else r.duration
        before = float(held[0]) > 0.5 * r.duration if len(held) else True
        middle = cut if before else float(held[-1])
        parts = Span(r, 0.0, middle, strays, *logged), Span(r, middle, r.duration, strays, *logged)
        training.append(parts[0 if before else 1])
        judged.append(parts[1 if before else 0])
    for bag in case.proving:
        judged.append(Span(bag.recording, 0.0, bag.recording.duration, bag.currents.strays, *logged))
        everything.append(judged[-1])
    strays = max(bag.currents.strays for bag in case.bags)
    others = [Span(b.recording, 0.0, b.recording.duration, strays, *logged) for b in case.elsewhere]
    return Spans(training, judged, everything, others)


def worsening(case: Proved, before: Point, after: Point, fitted: bool = False) -> float:
    """Factor by which free runs over data not used err more at ``after`` than at ``before``: geometric mean of the channels.

    A run that ends early counts as ``ENDED`` times one that does not. fitted: over the data for training instead.
    """
    spans = spans_of(case)
    ratio = _ratios(case, before, after, spans.training if fitted else spans.judged)
    known = ratio[np.isfinite(ratio)]
    return float(np.exp(np.mean(known))) if len(known) else 1.0


def worst_channel(case: Proved, before: Point, after: Point) -> float:
    """The same factor of the channel that is worst, each the median over the recordings."""
    ratio = _ratios(case, before, after, spans_of(case).judged)
    told = ratio[:, np.isfinite(ratio).any(axis=0)]
    return (
        float(np.exp(np.nanmax(np.nanmedian(np.where(np.isfinite(told), told, np.nan), axis=0)))) if told.size else 1.0
    )


def _ratios(case: Proved, before: Point, after: Point, spans: Sequence[Span]) -> Array:
    """(recordings, NY) logarithms of these factors; NaN of what is not told. Errors that noise makes count as one size."""

    def erring(point: Point) -> Array:
        machine = machine_at(case, point)
        return np.array([errors(span, free_run(span.recording, placed(machine, case, span))) for span in spans])

    def noise(point: Point) -> Array:
        machine = machine_at(case, point)
        return np.array([noise_floor(span, placed(machine, case, span), case.seed) for span in spans])

    first, second, floor = in_parallel(lambda run: run[0](run[1]), ((erring, before), (erring, after), (noise, after)))
    made, known = AT_FLOOR * np.nan_to_num(floor), np.isfinite(first) & np.isfinite(second)
    ratio = np.full(first.shape, np.nan)
    ratio[known] = np.log(np.maximum(second, made) / np.maximum(first, made))[known]
    ratio[np.isfinite(first) & ~np.isfinite(second)] = log(ENDED)
    ratio[~np.isfinite(first) & np.isfinite(second)] = -log(ENDED)
    return ratio


def free_runs(machine: Machine, case: Proved, spans: Spans) -> Driven:
    """Of a machine through all recordings and all blocks elsewhere."""

    def run(span: Span) -> FreeRun:
        return free_run(span.recording, placed(machine, case, span))

    return Driven([run(s) for s in spans.all], in_parallel(lambda s: errors(s, run(s)), spans.elsewhere))


def held_out(driven: Mapping[str, Driven], spans: Spans) -> dict[str, tuple[float, ...]]:
    """Errors of every stage's free runs over data not used, median over recordings and blocks elsewhere."""
    return {label: median([*_errors(d.runs, spans.judged, spans), *d.elsewhere]) for label, d in driven.items()}


def _errors(runs: Sequence[FreeRun], part: Sequence[Span], spans: Spans) -> list[Errors]:
    driven = {id(s.recording): run for s, run in zip(spans.all, runs, strict=True)}  # several may bear one name
    return [errors(s, driven[id(s.recording)]) for s in part]


def noise_floors(machine: Machine, case: Proved, spans: Spans) -> list[Errors]:
    """What noise alone leaves in free runs of a machine over each part that is judged, and over each block elsewhere."""
    proving = [*spans.judged, *spans.elsewhere]
    return in_parallel(
        lambda k: noise_floor(proving[k], placed(machine, case, proving[k]), case.seed + 11 + k), range(len(proving))
    )


def as_noise_lets_it(driven: Driven, floors: Sequence[Errors], spans: Spans) -> bool:
    """Whether a machine runs freely through data not used with the errors that noise alone leaves; floors: see `noise_floors`.

    One-step errors alone then tell of no physics. Where currents stray it may err more: steps that come early or late leave errors
    that no two logs have alike.
    """
    rows = [*_errors(driven.runs, spans.judged, spans), *driven.elsewhere]
    for span, error, floor in zip([*spans.judged, *spans.elsewhere], rows, floors, strict=True):
        told = np.isfinite(floor)
        most = (NEAR_FLOOR if span.strays else AT_FLOOR) * np.array(floor)
        if not told.any() or not np.all(np.array(error)[told] <= most[told]):
            return False
    return bool(floors)


def fit_and_ladder(
    case: Proved, machines: Mapping[str, Machine], driven: Mapping[str, Driven], spans: Spans, floors: Sequence[Errors] = ()
) -> tuple[Fit, tuple[LadderStep, ...]]:  # fmt: skip
    """Errors of the free runs of every stage, median over the recordings; the ladder of stages.

    floors: see `noise_floors`, of the explained machine; found here where there are none.
    """
    training = {label: median(_errors(driven[label].runs, spans.training, spans)) for label in machines}
    held, proving = held_out(driven, spans), [*spans.judged, *spans.elsewhere]
    floors = floors or noise_floors(machines["explained"], case, spans)
    floor = median(floors)
    labels = {"nominal": "nominal", "parameters_only": "parameters only"}
    learnt = bool(machines["explained"].learned)
    if case.named or learnt:
        names_ = [label_of(effect) for effect in case.named] + (["term learnt from data"] if learnt else [])
        labels["explained"] = "+ " + ", ".join(names_)
    order = [k for k in machines if k != "explained"] + (["explained"] if case.named or learnt else [])
    ladder = tuple(LadderStep(labels.get(k, k.replace("_", " ")), training[k], held[k]) for k in order)
    fit = Fit(
        {k: training[k] for k in STAGES}, {k: held[k] for k in STAGES}, floor,
        tuple(dict.fromkeys(s.recording.name for s in proving)),
        tuple(
            s.recording.name for s, error, least in
            zip(spans.elsewhere, driven["explained"].elsewhere, floors[len(spans.judged) :], strict=True)
            if not np.all(np.array(error) <= FAR_FROM_FLOOR * np.array(least))
        ),
    )  # fmt: skip
    return fit, ladder


@dataclass(frozen=True)
class Proof:
    """Free runs of the machines of each stage over all data.

    Attributes:
        learned: the term that is kept; one that makes free runs over data not used worse is not, and ``notes`` say so.
        driven: stage -> its free runs. ladder: held-out errors stage by stage.
    """

    learned: Learned | None
    driven: Mapping[str, Driven]
    fit: Fit
    ladder: tuple[LadderStep, ...]
    notes: tuple[str, ...]


def proof_of(
    case: Proved, verdict: Verdict, learned: Learned | None, spans: Spans, done: Sequence[Driven] = (),
    floors: Sequence[Errors] = (),
) -> Proof:  # fmt: skip
    """Free runs of every stage; ``done``: those of the first ones, as far as they were made before, and the last one's floors."""
    machines = machines_of(case, verdict, learned)
    driven = {
        label: done[k] if k < len(done) else free_runs(m, case, spans) for k, (label, m) in enumerate(machines.items())
    }
    fit, ladder = fit_and_ladder(case, machines, driven, spans, () if learned else floors)
    if learned:
        worse = worse_channels(fit.held_out, fit.noise_floor)
        before, after = (np.array(fit.held_out[k]) for k in ("parameters_only", "explained"))
        if worse or not np.nansum(np.log(after / before)) < 0.0:
            told = f": {', '.join(worse)}" if worse else ""
            note = f"a term learnt for {learned.term.equation} is not kept: free runs over data not used are no better{told}"
            proof = proof_of(case, verdict, None, spans, list(driven.values())[:-1], floors)
            return replace(proof, notes=(note, *proof.notes))
    return Proof(learned, driven, fit, ladder, said_of_blocks(case, fit))


def said_of_blocks(case: Proved, fit: Fit) -> tuple[str, ...]:
    """How many blocks of long recordings were held out, and which of them stay unexplained, in words."""
    if not case.elsewhere:
        return ()
    left = f"; far from noise in {len(fit.far)} of them, first: {fit.far[0]}" if fit.far else ""
    count = len(fit.held_out_bags)
    return (f"held-out errors are medians over {count} blocks of a minute that nothing was fitted to{left}",)


def _channels(recording: Recording, machine: Machine, i: int, driven: Mapping[str, Driven]) -> dict[str, ChannelFit]:
    noise = machine.sensor_noise()
    result = {}
    for sensor in SENSORS:
        signal = recording.signals.get(sensor.name)
        if signal is None:
            continue
        stages = {stage: driven[stage].runs[i].values[sensor.name] for stage in STAGES} if sensor.predicted else {}
        result[sensor.name] = ChannelFit(
            sensor.name, sensor.unit, signal.time, signal.values, signal.valid, noise.deviation(sensor), stages
        )
    return result


def bag_result(
    case: Proved, i: int, cells: list[NDArray[np.int64]], inputs: list[dict[str, Array]], nominal: Array,
    driven: Mapping[str, Driven],
) -> BagResult:  # fmt: skip
    """A recording that was fitted. nominal: (n, NY) its whitened innovations under the nominal machine."""
    bag = case.bags[i]
    rest = beyond(nominal, bag.counted, case.healthy_squares)
    width = 50
    sums = np.convolve(rest, np.ones(width) / width, mode="same")
    windows = regimes.windows(np.where(sums > 1.0, rest, 0.0), share=0.9, longest=12) if (sums > 1.0).any() else ()
    cut = None
    if not case.proving:
        held = bag.time[case.judged[i].any(axis=1)]
        cut = float(held[0]) if len(held) and held[0] > 0.5 * bag.recording.duration else None
    return BagResult(
        bag.name, False, cut, bag.recording.duration, tuple(bag.recording.events),
        _channels(bag.recording, case.machine, i, driven), windows, bag.time, inputs[i], cells[i],
    )  # fmt: skip


def proving_result(case: Proved, i: int, driven: Mapping[str, Driven]) -> BagResult:
    """A recording that nothing was fitted to."""
    bag: Bag = case.proving[i]
    k = len(case.bags) + i
    return BagResult(
        bag.name, True, None, bag.recording.duration, tuple(bag.recording.events),
        _channels(bag.recording, case.machine, k, driven), (), bag.time, {}, regimes.classify(bag),
    )  # fmt: skip
