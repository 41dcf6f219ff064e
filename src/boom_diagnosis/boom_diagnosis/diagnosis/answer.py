"""From the search to the answer: verdict, findings, proof, and what the report draws."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import sqrt
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from boom_diagnosis.diagnosis import regimes
from boom_diagnosis.diagnosis.bag_samples import Bag
from boom_diagnosis.diagnosis.document import (
    STAGES,
    SUBSYSTEMS,
    Alternative,
    BagResult,
    Channel,
    DiagnosisResult,
    Document,
    Estimate,
    Finding,
    Fit,
    LadderStep,
    RankingRow,
    Verdict,
)
from boom_diagnosis.diagnosis.experiment import propose
from boom_diagnosis.diagnosis.fitting import Point
from boom_diagnosis.diagnosis.found_machine import found_machine
from boom_diagnosis.diagnosis.freerun import Span, errors, free_run, median, noise_floor
from boom_diagnosis.diagnosis.hypotheses import NOTICED, problem_at
from boom_diagnosis.diagnosis.learning import Learned, learn
from boom_diagnosis.diagnosis.locating import LINKS, locate
from boom_diagnosis.diagnosis.weighing import (
    NEGLIGIBLE,
    Z90,
    Weighed,
    estimates,
    posterior,
    probabilities,
    unknown_probability,
)
from boom_diagnosis.validation import Prediction, plant_for
from boom_model.effects import EFFECTS
from boom_model.learned import LearnedTerm
from boom_model.machine import Machine
from boom_model.sensors import OUTPUT_UNITS, OUTPUTS
from boom_recording.recording import Recording

if TYPE_CHECKING:
    from boom_diagnosis.diagnosis.run import Case

Array = NDArray[np.float64]
NAN4 = (float("nan"),) * 4

NAMED_FROM = 0.55
"""Probability from which on a finding counts as identified, not as one of several."""
LEARNT_FROM, LEARNT_IN = 0.3, 2
"""Probability of unknown physics from which on a term is learnt, and in how many equations it is tried."""
MOVED = 1.0
"""Standard deviations a tolerance has to move to be listed."""


@dataclass(frozen=True)
class About:
    """What the document says about its own making."""

    seed: int
    version: str
    inputs_sha256: dict[str, str]
    command: str


@dataclass(frozen=True)
class _Tight:
    """The three stages seen by the observer that is right for a healthy machine, over all recordings."""

    nominal: list[Array]
    tolerances: list[Array]
    explained: list[Array]
    excess_before: float
    excess_after: float


def not_enough_excitation(recordings: Sequence[Recording], machine: Machine, about: About) -> DiagnosisResult:
    """The answer to recordings that do not move the boom."""
    text = (
        "Record at least 45 s of joystick work: full and half current in both directions, reversals, stops, "
        "and 1 s of rest at the beginning."
    )
    fit = Fit({}, {}, NAN4, ())
    document = Document(
        "not_enough_excitation",
        (),
        dict.fromkeys(SUBSYSTEMS, 0.0),
        fit,
        text,
        about.seed,
        about.inputs_sha256,
        about.version,
    )
    notes = tuple(f"{r.name}: the boom hardly moves, or a channel is missing" for r in recordings)
    return DiagnosisResult(
        document, machine, machine, (), (), (), "", (), (), (), "Nothing can be told from these recordings.",
        notes=notes, command=about.command,
    )  # fmt: skip


def assemble(case: Case, about: About, weak: Sequence[str]) -> DiagnosisResult:
    """The whole answer of a finished search."""
    first = case.rounds[0]
    tight = _tight(case)
    unknown = unknown_probability(tight.excess_before, tight.excess_after)
    ranked = _ranking(case, unknown)
    cells = [regimes.classify(bag) for bag in case.bags]
    equations, agreement, inputs = locate(
        case.machine, case.bags, case.select, case.nuisances, first.base.z, {}, case.healthy
    )
    rest_equations = equations
    learned: Learned | None = None
    if unknown > LEARNT_FROM:
        if case.taken:
            rest_equations, agreement, _ = locate(
                case.machine, case.bags, case.select, case.nuisances, case.last.z, case.last.effects, case.healthy
            )
        order = sorted(rest_equations, key=lambda e: -e.statistical)
        learned = learn(
            case.machine, case.bags, case.select, case.judged, case.nuisances, case.last,
            [e.key for e in order[:LEARNT_IN]], first.problem.predictor.looseness, case.proving,
        )  # fmt: skip
    findings = _findings(case, unknown, cells, tight)
    noticed = _noticed(case)
    verdict = _verdict(case, findings, unknown, noticed, tight)
    if verdict == "unknown_physics":
        findings = [_unknown_finding(case, unknown, cells, tight, rest_equations), *findings]
    if verdict == "no_mismatch":
        agreement = "No equation needs an unknown input: what remains is noise."
    moved = _moved(case, case.last) if verdict == "parameters_only" or case.taken else {}
    machines = _machines(case, verdict, learned)
    spans = _spans(case)
    runs = {label: [free_run(s.recording, _in(m, case, s)) for s in spans.all] for label, m in machines.items()}
    fit, ladder = _fit(case, machines, runs, spans)
    experiment = propose(case, ranked) if verdict in ("ambiguous", "unknown_physics", "identified") else None
    said = experiment.text if experiment else _nothing_more(verdict)
    document = Document(
        verdict, tuple(findings), _subsystems(case, unknown, ranked, verdict, findings), fit, said, about.seed,
        about.inputs_sha256, about.version,
    )  # fmt: skip
    bags = tuple(
        _bag_result(case, i, cells, inputs, tight, machines, runs, spans) for i in range(len(case.bags))
    ) + tuple(_proving_result(case, i, machines, runs, spans) for i in range(len(case.proving)))
    notes = [f"{name} is left out: the boom hardly moves in it, or a channel is missing" for name in weak]
    remaining = ""
    if tight.excess_after > NEGLIGIBLE and verdict not in ("no_mismatch", "parameters_only"):
        share = sqrt(max(tight.excess_after, 0.0) / max(tight.excess_before, tight.excess_after))
        remaining = f"{100 * share:.0f} % of the mismatch's size (one-step errors beyond a healthy machine's) stays unexplained."
    return DiagnosisResult(
        document, case.machine, machines["explained"], bags,
        regimes.table(cells, tight.nominal, tight.explained, case.healthy_squares), equations, agreement, tuple(ranked),
        ladder, (learned.curve,) if learned else (), remaining, moved, experiment, tuple(notes), about.command,
    )  # fmt: skip


# ------------------------------------------------------------------------------------------------------------- weighing


def _tight(case: Case) -> _Tight:
    """Innovations of nominal, tolerances only and explained, each seen by its own tight observer."""
    zero = np.zeros(len(case.nuisances))
    stages = []
    for z, values in ((zero, {}), (case.kept(0).z, {}), (case.last.z, case.last.effects)):
        problem = problem_at(case.machine, case.bags, case.select, case.nuisances, z, values, 1.0)
        stages.append(problem.points([(z, values)])[0])
    n = int(stages[0].used.sum())
    before = min(stages[1].loss - 0.5 * float(stages[1].z @ stages[1].z), stages[0].loss) / n - case.floor
    after = (stages[2].loss - 0.5 * float(stages[2].z @ stages[2].z)) / n - case.floor
    return _Tight(stages[0].parts, stages[1].parts, stages[2].parts, before, after)


def _noticed(case: Case) -> float:
    """What the tolerances gain over the nominal machine [nats], after paying for those that moved."""
    problem = case.rounds[0].problem
    nominal = problem.points([(np.zeros(len(case.nuisances)), {})])[0]
    base = case.rounds[0].base
    return nominal.loss - base.loss


def _ranking(case: Case, unknown: float) -> list[RankingRow]:
    """All hypotheses of the first round, and unknown physics."""
    weighed = case.weighed[0] if case.weighed else []
    p = probabilities(weighed, case.temperature)
    taken = bool(case.taken)
    rest = 1.0 - unknown if taken or unknown > 0.5 else 1.0
    rows = [
        RankingRow(
            _label(w.fitted.effect), w.fitted.effect, "sensors" if EFFECTS[w.fitted.effect].subsystem == "sensors" else "effect",
            EFFECTS[w.fitted.effect].subsystem, pi * rest, w.gain, w.held_out_gain,
            _short(estimates(w.fitted, case.temperature), w.fitted.effect), _inside(w),
        )
        for w, pi in zip(weighed, p, strict=False)
    ]  # fmt: skip
    rows.append(RankingRow("parameters within tolerance only", None, "parameters", "", p[-1] * rest, 0.0, 0.0, {}))
    rows.append(RankingRow("physics of no catalogue", None, "unknown", "", 1.0 - rest, 0.0, 0.0, {}))
    return sorted(rows, key=lambda r: -r.probability)


def _label(effect: str) -> str:
    return effect.replace("_", " ")


def _short(numbers: Mapping[str, Estimate], effect: str) -> dict[str, Estimate]:
    return {name.split(".")[2]: e for name, e in numbers.items() if name.split(".")[1] == effect}


def _inside(w: Weighed) -> bool:
    values = w.fitted.point.effects
    own = [c for c in w.fitted.coordinates if c.name.split(".")[1] == w.fitted.effect and not c.name.endswith("t_g")]
    return all(c.plausible[0] <= values[c.name] <= c.plausible[1] for c in own)


# ------------------------------------------------------------------------------------------------------------- findings


def _findings(case: Case, unknown: float, cells: list[NDArray[np.int64]], tight: _Tight) -> list[Finding]:
    result = []
    last = case.taken[-1].fitted if case.taken else None
    for k, w in enumerate(case.taken):
        assert last is not None
        weighed = case.weighed[k]
        p = probabilities(weighed, case.temperature)
        effect = w.fitted.effect
        own = weighed.index(w)
        confidence = min(0.99, p[own] * (1.0 - unknown))
        others = sorted(((pi, x.fitted.effect) for pi, x in zip(p, weighed, strict=False) if x is not w), reverse=True)
        alternatives = tuple(Alternative(e, round(pi * (1 - unknown), 4)) for pi, e in others[:3] if pi > 0.005)
        if unknown > 0.01:
            alternatives = (*alternatives, Alternative(None, round(unknown, 4)))
        before = case.rounds[k].base
        place = regimes.where(case.bags, cells, _gains(before, w.fitted.point))
        row = EFFECTS[effect]
        numbers = _short(estimates(last, max(1.0, case.temperature / 3.0)), effect)
        result.append(
            Finding(
                effect, row.subsystem, row.equation, round(confidence, 4), numbers, place.text, place.intervals,
                alternatives, _evidence(w, row.term, place.text),
            )
        )  # fmt: skip
    return sorted(result, key=lambda f: -next(w.gain for w in case.taken if w.fitted.effect == f.effect))


def _gains(before: Point, after: Point) -> list[Array]:
    return [0.5 * np.sum(np.minimum(b, 8.0) ** 2 - np.minimum(a, 8.0) ** 2, axis=1)
            for b, a in zip((np.abs(p) for p in before.parts), (np.abs(p) for p in after.parts), strict=True)]  # fmt: skip


def _evidence(w: Weighed, term: str, where: str) -> str:
    others = f"its log-likelihood rises by {w.gain:.0f} nats on the data fitted and by {w.held_out_gain:.0f} on data not used"
    return f"With {term} in the model {others}; no change of parameters within their tolerances does that; it shows {where}."


def _unknown_finding(
    case: Case, unknown: float, cells: list[NDArray[np.int64]], tight: _Tight, equations: Sequence[object]
) -> Finding:
    """What remains: located, not named."""
    rows = {e.key: e.statistical + e.chain for e in equations}  # type: ignore[attr-defined]
    key = max(rows, key=lambda k: rows[k])
    link = next(link for link in LINKS if link.key == key)
    rest = [0.5 * np.sum(np.minimum(np.abs(w), 8.0) ** 2 - case.healthy_squares, axis=1) for w in tight.explained]
    place = regimes.where(case.bags, cells, rest)
    tried = case.weighed[0][0].fitted.effect if case.weighed and case.weighed[0] else "none"
    return Finding(
        None, _home(case, link.subsystems), link.equation, round(min(0.99, unknown), 4), {}, place.text, place.intervals,
        tuple(Alternative(w.fitted.effect, round((1 - unknown) / 3, 4)) for w in (case.weighed[0][:2] if case.weighed else [])),
        f"No effect of the catalogue explains the mismatch at '{link.title}'; the nearest is {_label(tried)}.",
    )  # fmt: skip


def _home(case: Case, subsystems: Sequence[str]) -> str:
    """Of the subsystems at home in an equation, the one whose effects come nearest."""
    for weighed in case.weighed:
        for w in weighed:
            if EFFECTS[w.fitted.effect].subsystem in subsystems:
                return EFFECTS[w.fitted.effect].subsystem
    return subsystems[0]


def _verdict(case: Case, findings: Sequence[Finding], unknown: float, noticed: float, tight: _Tight) -> Verdict:
    if not findings:
        if unknown > 0.5 and tight.excess_before > 3 * NEGLIGIBLE:
            return "unknown_physics"
        return "parameters_only" if noticed > NOTICED + 0.5 * len(case.nuisances) else "no_mismatch"
    if unknown > 0.5:
        return "unknown_physics"
    if all(f.subsystem == "sensors" for f in findings):
        return "sensor_or_clock"
    return "identified" if findings[0].confidence >= NAMED_FROM else "ambiguous"


def _subsystems(
    case: Case, unknown: float, ranked: Sequence[RankingRow], verdict: Verdict, findings: Sequence[Finding]
) -> dict[str, float]:
    result = dict.fromkeys(SUBSYSTEMS, 0.0)
    for row in ranked:
        if row.effect is not None:
            result[row.subsystem] = min(0.99, result[row.subsystem] + row.probability)
    for f in findings:
        result[f.subsystem] = max(result[f.subsystem], f.confidence)
    return {name: round(p, 4) for name, p in result.items()}


def _moved(case: Case, point: Point) -> dict[str, Estimate]:
    """Tolerances that the recordings moved."""
    jacobian = case.taken[-1].fitted.jacobian if case.taken else case.rounds[0].jacobian
    covariance = posterior(point, jacobian, len(point.z))
    numbers = case.values(point.z, {})
    result = {}
    for i, nuisance in enumerate(case.nuisances):
        if abs(point.z[i]) < MOVED or nuisance.name not in numbers or nuisance.name.startswith("pose."):
            continue
        value = numbers[nuisance.name]
        spread = Z90 * sqrt(float(covariance[i, i])) * nuisance.sigma * abs(value)
        components = {c: p for p in case.machine.parameters.values() for c in p.specification.components}
        result[nuisance.name] = Estimate(
            value, components[nuisance.name].specification.unit, (value - spread, value + spread)
        )
    return result


def _nothing_more(verdict: Verdict) -> str:
    if verdict == "no_mismatch":
        return "Nothing: the model explains these recordings."
    return "A longer recording with full currents in both directions narrows the parameters that moved."


# ---------------------------------------------------------------------------------------------------- machines and runs


def _machines(case: Case, verdict: Verdict, learned: Learned | None) -> dict[str, Machine]:
    """Stage -> machine, and the steps of the ladder between them."""
    pose = plant_for(case.bags[0].recording, case.machine, "full").pose
    steps = {"nominal": case.machine}

    def at(point: Point, jacobian: Array, terms: tuple[LearnedTerm, ...] = ()) -> Machine:
        covariance = posterior(point, jacobian, len(point.z))
        numbers = case.values(point.z, point.effects)
        spreads = {
            n.name: Z90 * sqrt(float(covariance[i, i])) * n.sigma * abs(numbers.get(n.name, 0.0))
            for i, n in enumerate(case.nuisances)
        }
        return found_machine(case.machine, pose, numbers, spreads, terms)

    steps["parameters_only"] = at(case.kept(0), case.rounds[0].jacobian)
    for k, w in enumerate(case.taken[:-1]):
        steps[f"+ {', '.join(x.fitted.effect for x in case.taken[: k + 1])}"] = at(case.kept(k + 1), w.fitted.jacobian)
    if case.taken:
        steps["explained"] = at(case.last, case.taken[-1].fitted.jacobian)
        if learned:
            steps[f"+ {', '.join(w.fitted.effect for w in case.taken)}"] = steps["explained"]
    else:
        steps["explained"] = case.machine if verdict == "no_mismatch" else steps["parameters_only"]
    if learned:
        jacobian = case.taken[-1].fitted.jacobian if case.taken else case.rounds[0].jacobian
        steps["explained"] = at(learned.point, jacobian, (learned.term,))
    return steps


@dataclass(frozen=True)
class _Spans:
    """Parts of recordings that were fitted, that are judged, and all recordings in the order of the runs."""

    training: list[Span]
    judged: list[Span]
    all: list[Span]


def _in(machine: Machine, case: Case, span: Span) -> Machine:
    """The machine in a recording: a load that changes does so at that recording's own time."""
    held = any(bag.recording is span.recording for bag in case.proving)
    if case.onset is None or not held or "payload_change" not in machine.effects:
        return machine
    effects = {k: dict(v) for k, v in machine.effects.items()}
    effects["payload_change"]["t_g"] = case.onset
    return machine.with_effects(effects)


def _spans(case: Case) -> _Spans:
    training, judged, everything = [], [], []
    for bag, select in zip(case.bags, case.judged, strict=True):
        r = bag.recording
        everything.append(Span(r, 0.0, r.duration))
        if case.proving:
            training.append(Span(r, 0.0, r.duration))
            continue
        held = bag.time[select.any(axis=1)]
        cut = float(held[0]) if len(held) else r.duration
        before = float(held[0]) > 0.5 * r.duration if len(held) else True
        training.append(Span(r, 0.0, cut) if before else Span(r, float(held[-1]), r.duration))
        judged.append(Span(r, cut, r.duration) if before else Span(r, 0.0, float(held[-1])))
    for bag in case.proving:
        judged.append(Span(bag.recording, 0.0, bag.recording.duration))
        everything.append(judged[-1])
    return _Spans(training, judged, everything)


def _fit(
    case: Case, machines: Mapping[str, Machine], runs: Mapping[str, list[Prediction]], spans: _Spans
) -> tuple[Fit, tuple[LadderStep, ...]]:
    names = [s.recording.name for s in spans.all]

    def table(label: str, part: list[Span]) -> tuple[float, ...]:
        return median([errors(s, runs[label][names.index(s.recording.name)]) for s in part])

    training = {label: table(label, spans.training) for label in machines}
    held = {label: table(label, spans.judged) for label in machines}
    floor = median(
        [noise_floor(s, _in(machines["explained"], case, s), case.seed + 11 + i) for i, s in enumerate(spans.judged)]
    )
    labels = {"nominal": "nominal", "parameters_only": "parameters only"}
    learnt = bool(machines["explained"].learned)
    if case.taken or learnt:
        names_ = [_label(w.fitted.effect) for w in case.taken] + (["term learnt from data"] if learnt else [])
        labels["explained"] = "+ " + ", ".join(names_)
    order = [k for k in machines if k != "explained"] + (["explained"] if case.taken or learnt else [])
    ladder = tuple(LadderStep(labels.get(k, k.replace("_", " ")), training[k], held[k]) for k in order)
    fit = Fit(
        {k: training[k] for k in STAGES}, {k: held[k] for k in STAGES}, floor,
        tuple(dict.fromkeys(s.recording.name for s in spans.judged)),
    )  # fmt: skip
    return fit, ladder


# ----------------------------------------------------------------------------------------------------------- recordings


def _channels(
    recording: Recording, machine: Machine, i: int, runs: Mapping[str, list[Prediction]]
) -> dict[str, Channel]:
    sensors = machine.sensor_noise()
    pressure = float(np.hypot(sensors.pressure_sigma, sensors.pressure_quantum / sqrt(12.0)))
    noise = (sensors.angle_quantum / sqrt(12.0), sensors.rate_sigma, pressure, pressure)
    result = {}
    for name, unit, sigma in zip(OUTPUTS, OUTPUT_UNITS, noise, strict=True):
        signal = recording.signals[name]
        stages = {stage: runs[stage][i].values[name] for stage in STAGES}
        result[name] = Channel(name, unit, signal.time, signal.values, signal.valid, sigma, stages)
    return result


def _bag_result(
    case: Case, i: int, cells: list[NDArray[np.int64]], inputs: list[dict[str, Array]], tight: _Tight,
    machines: Mapping[str, Machine], runs: Mapping[str, list[Prediction]], spans: _Spans,
) -> BagResult:  # fmt: skip
    bag = case.bags[i]
    rest = 0.5 * np.sum(np.minimum(np.abs(tight.nominal[i]), 8.0) ** 2 - case.healthy_squares, axis=1)
    width = 50
    sums = np.convolve(rest, np.ones(width) / width, mode="same")
    windows = regimes.windows(np.where(sums > 1.0, rest, 0.0), share=0.9, longest=12) if (sums > 1.0).any() else ()
    cut = None
    if not case.proving:
        held = bag.time[case.judged[i].any(axis=1)]
        cut = float(held[0]) if len(held) and held[0] > 0.5 * bag.recording.duration else None
    return BagResult(
        bag.name, False, cut, bag.recording.duration, tuple(bag.recording.events),
        _channels(bag.recording, case.machine, i, runs), windows, bag.time, inputs[i], cells[i],
    )  # fmt: skip


def _proving_result(
    case: Case, i: int, machines: Mapping[str, Machine], runs: Mapping[str, list[Prediction]], spans: _Spans
) -> BagResult:
    bag: Bag = case.proving[i]
    k = len(case.bags) + i
    return BagResult(
        bag.name, True, None, bag.recording.duration, tuple(bag.recording.events),
        _channels(bag.recording, case.machine, k, runs), (), bag.time, {}, regimes.classify(bag),
    )  # fmt: skip
