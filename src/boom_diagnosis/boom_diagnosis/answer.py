"""From the search to the answer: verdict, findings, proof, and what the report draws."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from math import hypot, inf, sqrt
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from boom_diagnosis import regimes
from boom_diagnosis.assumptions import AT_FLOOR, FAR_FROM_FLOOR, MOST_CERTAIN, MOVED, NAMED_FROM, NEAR_FLOOR
from boom_diagnosis.bag_samples import Bag
from boom_diagnosis.document import (
    SUBSYSTEMS,
    Alternative,
    DiagnosisResult,
    Document,
    EquationEvidence,
    Estimate,
    Finding,
    Fit,
    RankingRow,
    Verdict,
)
from boom_diagnosis.experiment import propose
from boom_diagnosis.fitting import Point, rho
from boom_diagnosis.freerun import Errors, median
from boom_diagnosis.hypotheses import LOOSENESS, noticed
from boom_diagnosis.learning import Learned, learn
from boom_diagnosis.locating import BETWEEN, links, locate, places
from boom_diagnosis.must_keep import (
    allowed,
    as_far_by_chance,
    by_free_runs,
    far,
    far_channels,
    kept,
    shown,
    worse_channels,
    worse_on_the_whole,
)
from boom_diagnosis.nuisances import CLOCKS
from boom_diagnosis.odds import (
    UNTOLD,
    Odds,
    as_its_form,
    final_numbers,
    hypothesis_rows,
    is_told,
    odds_of,
    own_name,
    probability_of,
    ranking,
)
from boom_diagnosis.open_numbers import doubted_by_numbers, number_spread
from boom_diagnosis.own_loads import said_of_loads, told_by_recording
from boom_diagnosis.prediction import beyond, gained
from boom_diagnosis.proof import (
    as_noise_lets_it,
    bag_result,
    final_machine,
    free_runs,
    held_out,
    label_of,
    machines_of,
    noise_floors,
    proof_of,
    proving_result,
    spans_of,
)
from boom_diagnosis.search import Fitted
from boom_diagnosis.unsearched import About
from boom_diagnosis.weighing import NEGLIGIBLE, Z90, Weighed, estimates, of_effect, of_tolerances, unknown_probability
from boom_diagnosis.wrong_number import in_words
from boom_model.catalogue import CATALOGUE, EFFECTS
from boom_model.components import equation_of_motion
from boom_model.learned import LearnedTerm
from boom_model.machine import Machine
from boom_model.prior import prior_of
from boom_model.sensors import OUTPUTS

if TYPE_CHECKING:
    from boom_diagnosis.case import Case
    from boom_diagnosis.weighed_case import WeighedCase

Array = NDArray[np.float64]

LEARNT_FROM, LEARNT_IN = 0.3, 2
"""Probability of unknown physics from which on a term is learnt, and in how many equations it is tried."""
AT_THE_END, BEYOND = "at the end of the tolerance", "beyond the tolerance"
"""What a note says of numbers."""
DOUBTFUL = 0.1
"""Share of the excess that stays from which on the tolerances alone are fitted once more, by the observer that sees most."""


PLAINLY = (
    "the machine file that is handed out has parameters only: with what was found free runs over data not used err more "
    "on the whole"
)
_OF_THE_RATE = next(effect for effect in CATALOGUE if set(effect.terms) == {"measured_rate"})


@dataclass(frozen=True)
class _Tight:
    """What the observer that is right for a healthy machine sees at first and in the end, over all recordings."""

    nominal: list[Array]
    explained: list[Array]
    excess_before: float
    excess_after: float
    channels: list[tuple[float, float]]
    """Of each measured channel: excess before, with tolerances only, and after."""
    filed: float
    """Excess before with the file's number, where one is wrong: what was found explains that, too. So do ``channels``."""


def assemble(
    case: Case, about: About, weak: Mapping[str, str], doubted: Callable[[Case], Case] = lambda case: case
) -> DiagnosisResult:
    """The whole answer of a finished search; ``doubted``: what becomes of one of which free runs took back all that was found."""
    first = case.rounds[0]
    tight = _tight(case)
    unknown = unknown_probability(tight.filed, tight.excess_after, tight.channels)
    spans = spans_of(case)
    stages = machines_of(case, "identified", None)
    if not case.taken:
        stages.pop("explained", None)  # the same as with parameters only
    done = [free_runs(m, case, spans) for m in stages.values()]
    floors = noise_floors([*stages.values()][-1], case, spans)
    driven = held_out(dict(zip(stages, done, strict=True)), spans)
    floor = median(floors)
    held_against = case.taken and (worse_channels(driven, floor) or far_channels(driven, floor, FAR_FROM_FLOOR))
    left_open = number_spread(case) if held_against else ()
    leaves = allowed(floor, left_open)
    unknown, spared = _doubts(case, unknown, driven, floor, leaves)
    if unknown > UNTOLD and as_noise_lets_it(done[-1], floors, spans):
        unknown = UNTOLD
    unproved_by = worse_channels(driven, leaves) or far_channels(driven, leaves, FAR_FROM_FLOOR) if case.taken else []
    odds = as_its_form(
        case, odds_of(case, unknown, proved=not unproved_by, spared=spared, far=far(driven, floor)), unproved_by
    )
    unseen = bool(case.taken) and (_unseen(tight, driven, floor) or _nothing_told(case, driven, floor))
    if unseen or (case.taken and spared > max(odds.effects[0].values())):
        case.disproved += case.taken[:1] if unseen else []
        return assemble(doubted(case.without_effects()), about, weak)
    cells = [regimes.classify(bag) for bag in case.bags]
    findings = _findings(case, odds, cells)
    ranked = ranking(case, odds, findings)
    verdict = _verdict(case, findings, unknown, odds.tolerances, _moving(case), tight)
    wrong = verdict not in ("no_mismatch", "parameters_only")
    z = case.kept(0).z if case.learned else first.base.z
    equations, agreement, inputs = locate(
        case.machine,
        case.bags,
        case.select,
        case.nuisances,
        z,
        {},
        case.healthy,
        doubted=wrong,
        others=[case.nominal.tolerances.z],
    )
    rest_equations = equations
    learned = case.learned
    if wrong and unknown > LEARNT_FROM and not learned:
        if case.taken:
            rest_equations, agreement, _ = locate(
                case.machine, case.bags, case.select, case.nuisances, case.last.z, case.last.effects, case.healthy
            )
        order = sorted(rest_equations, key=lambda e: -e.statistical)
        if order[0].key != BETWEEN.key:
            told = [e.key for e in order if e.key != BETWEEN.key]
            learned = learn(case.setting, case.trained[-1], told[:LEARNT_IN])
    proof = proof_of(case, verdict, learned, spans, done, floors if verdict != "no_mismatch" else ())
    learned, fit = proof.learned, replace(proof.fit, open_numbers=left_open)
    if verdict in ("no_mismatch", "parameters_only") and far_channels(fit.held_out, fit.noise_floor, FAR_FROM_FLOOR):
        fit = doubted_by_numbers(case, spans, fit)
    plain = case.learned if learned else None
    if verdict == "unknown_physics" and not (
        findings and findings[0].like and findings[0].confidence >= min(unknown, odds.unknown)
    ):
        rest_equations = equations
        findings = [_unknown_finding(case, odds, cells, tight, rest_equations, plain, fit), *findings]
    if verdict == "no_mismatch":
        agreement = "No equation needs an unknown input: what remains is noise."
    moved = _moved(case, verdict)
    ranked = [replace(r, parameters=_wrong(case, moved)) if r.kind == "parameters" else r for r in ranked]
    known = any(copy is not bag for copy, bag in zip(case.healthy, case.bags, strict=True))
    verdict, findings, unproved = kept(verdict, findings, fit, known)
    experiment = (
        propose(case, _rivals(case, ranked)) if verdict in ("ambiguous", "unknown_physics", "identified") else None
    )
    said = experiment.text if experiment else said_of_next(verdict)
    document = Document(
        verdict, tuple(findings), _subsystems(ranked, findings), fit, said, about.seed, about.inputs_sha256, about.version,
        tuple(ranked), hypotheses=hypothesis_rows(case, odds, _home(case, rest_equations)[0]),
    )  # fmt: skip
    bags = tuple(
        bag_result(case, i, cells, inputs, tight.nominal[i], proof.driven) for i in range(len(case.bags))
    ) + tuple(proving_result(case, i, proof.driven) for i in range(len(case.proving)))
    explained = plain.point.parts if plain else tight.explained
    left = plain.point.excess(case.floor) if plain else tight.excess_after
    named = verdict not in ("no_mismatch", "parameters_only")  # else one-step errors name nothing
    left_over = remaining(fit, tight.filed, left if named else 0.0)
    plainly = not learned and bool(case.taken) and worse_on_the_whole(driven, leaves)
    machine = _plain_machine(case) if plainly else _final_machine(case, verdict, learned)
    handed_out = told_by_recording(case, machine)
    return DiagnosisResult(
        document, case.machine, handed_out, bags,
        regimes.table(cells, case.select, tight.nominal, explained, case.healthy_squares), equations, agreement, proof.ladder,
        (learned.curve,) if learned else (), left_over, moved, experiment,
        (
            *_said_of_wrong(case, moved), *unproved, *_said_of_limits(case, verdict, moved),
            *([PLAINLY] if plainly else _said_of_less(case, machine)),
            *said_of_loads(case.machine, machine, handed_out), *proof.notes, *notes_of(case.bags, case.proving, weak),
            *_said_of_commands(case),
        ),
        command=about.command, wrong=case.wrong, or_wrong=tuple(names[0] for names, _ in case.or_wrong),
    )  # fmt: skip


def _doubts(
    case: Case, unknown: float, driven: Mapping[str, Sequence[float]], floor: Errors, leaves: Sequence[float]
) -> tuple[float, float]:
    """Probability of unknown physics, and what of it goes to parameters alone, by one step and by free runs (``driven``).

    leaves: errors that noise (``floor``) and open numbers allow.
    """
    if case.taken and worse_on_the_whole(driven, leaves):
        unknown = max(unknown, 1.0 - UNTOLD)
    if not 0.0 < unknown < 1.0:
        return unknown, 0.0
    weighed, spared = by_free_runs(unknown, driven, floor, leaves)
    return weighed, spared * as_far_by_chance(case.kept(0).z)


def _unseen(tight: _Tight, driven: Mapping[str, Sequence[float]], floor: Errors) -> bool:
    """Whether parameters alone leave no more than a healthy machine does, and free runs over data not used show nothing else.

    What only likelihood sees then is how two models of one machine differ, or sensors whose noise is not the file's.
    """
    return tight.excess_before < NEGLIGIBLE and not shown(driven, floor)


def _nothing_told(case: Case, driven: Mapping[str, Sequence[float]], floor: Errors) -> bool:
    """Whether nothing that was found is told from doing nothing, and no free run with parameters alone is far from the noise.

    Where they are near the noise: nothing is told from what sound machines have, too.
    """
    alone = {"explained": driven["parameters_only"]}
    near = not far_channels(alone, floor, NEAR_FLOOR)
    told = any(is_told(case, e, sound=near) for e in case.named)
    return not (told or far_channels(alone, floor, FAR_FROM_FLOOR))


def _rivals(case: Case, ranked: Sequence[RankingRow]) -> list[tuple[str, Point]]:
    """The likeliest hypotheses that were fitted, the best first."""
    fitted = {w.fitted.effect: w.fitted.point for w in case.weighed[0]} if case.weighed else {}
    named = [row for row in ranked if row.effect in fitted or row.kind == "parameters"][:3]
    return [(r.label, fitted[r.effect] if r.effect else case.rounds[0].base) for r in named]


def _final_machine(case: Case, verdict: Verdict, learned: Learned | None) -> Machine:
    if verdict == "no_mismatch":
        return case.machine
    covariance = _covariance(case, case.last, case.final)
    return final_machine(case, learned.point if learned else case.last, covariance, (learned.term,) if learned else ())


def _plain_machine(case: Case) -> Machine:
    """With parameters only: what was found makes free runs over data not used worse."""
    return final_machine(case, case.kept(0), _covariance(case, case.kept(0), None), ())


def _covariance(case: Case, at: Point, fitted: Fitted | None) -> Array:
    """Of the tolerances' z at a point; ``fitted``: with the effects that were taken, None where none was."""
    jacobian, names = (fitted.jacobian, fitted.coordinates) if fitted else (case.rounds[0].jacobian, ())
    return of_tolerances(at, jacobian, names, case.temperature, case.ended(at))


def _said_of_commands(case: Case) -> tuple[str, ...]:
    if not case.oftener:
        return ()
    between, held = "change between their samples", "hold from sample to sample"
    said, other = (between, held) if any(bag.currents.late for bag in case.bags) else (held, between)
    advice = ". Log the currents as often as they are commanded" if said == between else ""
    return (
        f"the currents {said}: commands every {1e3 * case.oftener:.0f} ms explain more than those that {other}; control.Ts of the "
        f"machine file says so now{advice}",
    )


def notes_of(bags: Sequence[Bag], proving: Sequence[Bag], weak: Mapping[str, str]) -> tuple[str, ...]:
    """What was left out, recording by recording with why, and what is damaged."""
    notes = [f"{name} is left out: {why}" for name, why in weak.items()]
    notes += [
        f"{bag.name}: samples of the currents stray from their stamps, by {1e3 * bag.currents.strays:.1f} ms (standard "
        "deviation), as where a log races the controller: that is counted as noise. Log them where they are commanded"
        for bag in (*bags, *proving) if bag.currents.strays
    ]  # fmt: skip
    for bag in bags:
        notes += [f"{bag.name}: {_untold(name)}" for name in OUTPUTS if name in bag.lacking]
        notes += [f"{bag.name}: {said}" for said in bag.left_out()]
    return (
        *notes,
        *(f"{bag.name}: {said}" for bag in (*bags, *proving) for said in (*bag.stuck(), *bag.recording.warnings)),
    )


def _untold(channel: str) -> str:
    """What a recording without a channel cannot tell."""
    only = [label_of(effect.id) for effect in CATALOGUE if set(effect.terms) == {f"measured_{channel}"}]
    effects = f", {' and '.join(only)} among it" if only else ""
    return f"the {channel.replace('_', ' ')} was not measured: what only it shows cannot be told{effects}"


def remaining(fit: Fit, before: float, after: float) -> str:
    """What the explanation leaves: of the one-step errors, and in free runs over data not used."""
    sentences = []
    if after > NEGLIGIBLE:
        share = sqrt(after / max(before, after))
        sentences.append(
            f"{100 * share:.0f} % of the mismatch's size (one-step errors beyond a healthy machine's) stays unexplained."
        )
    ratios = np.array(fit.held_out["explained"], dtype=float) / np.array(fit.noise_floor, dtype=float)
    over = [f"{name.replace('_', ' ')} {r:.1f}" for name, r in zip(OUTPUTS, ratios, strict=True) if r > AT_FLOOR]
    if over:
        sentences.append(
            f"Free runs over data not used err more than noise alone would: {', '.join(over)} times as much."
        )
    return " ".join(sentences)


# ------------------------------------------------------------------------------------------------------------- weighing


def _tight(case: Case) -> _Tight:
    """Innovations of nominal, tolerances only and explained, each seen by its own tight observer."""
    zero = np.zeros(len(case.nuisances))
    stages = []
    for z, values in ((zero, {}), (case.kept(0).z, {}), (case.last.z, case.last.effects)):
        problem = case.problem(z, values, LOOSENESS[0])
        stages.append(problem.points([(z, values)])[0])
    before, after = (point.excess(case.floor) for point in stages[1:])
    before = min(before, stages[0].excess(case.floor))
    last = case.rounds[-1]
    if len(case.rounds) > len(case.taken) > 0 and last.problem.predictor.looseness == LOOSENESS[0]:
        after = min(after, last.base.excess(case.floor))
    sharp = case.rounds[0].problem.predictor.looseness == LOOSENESS[0]
    if case.taken and not sharp and after > DOUBTFUL * before:  # the numbers are those that a loose observer asked for
        problem = case.problem(case.kept(0).z, {}, LOOSENESS[0])
        start = problem.points([(case.kept(0).z, {})])[0]
        before = min(before, problem.fit(start, problem.nuisance_jacobian(start))[0].excess(case.floor))
    left = stages[2]
    if case.sharpest:
        own = case.problem(case.sharpest.z, case.sharpest.effects, LOOSENESS[0])
        left = own.points([(case.sharpest.z, case.sharpest.effects)])[0]
        after = min(after, left.excess(case.floor))
    started, filed = by_channel(case, stages[1]), before
    if of_file := case.filed:
        at = of_file.problem(of_file.kept(0).z, {}, LOOSENESS[0]).points([(of_file.kept(0).z, {})])[0]
        started, filed = np.maximum(started, by_channel(of_file, at)).tolist(), max(before, at.excess(of_file.floor))
    channels = zip(started, by_channel(case, left), strict=True)
    return _Tight(stages[0].parts, stages[2].parts, before, after, list(channels), filed)


def by_channel(case: Case | WeighedCase, point: Point) -> list[float]:
    """Loss per innovation of each measured channel over that of a healthy machine."""
    chosen = [
        np.concatenate([part[s[:, k], k] for part, s in zip(point.parts, case.select, strict=True)])
        for k in range(len(OUTPUTS))
    ]
    return [rho(w) / max(len(w), 1) - 0.5 * float(m) for w, m in zip(chosen, case.healthy_squares, strict=True)]


def _moving(case: Case) -> float:
    """What the tolerances gain over the nominal machine [nats], their prior included."""
    problem = case.rounds[0].problem
    nominal = problem.points([(np.zeros(len(case.nuisances)), {})])[0]
    base = case.rounds[0].base
    return nominal.loss - base.loss


# ------------------------------------------------------------------------------------------------------------- findings


def _findings(case: Case, odds: Odds, cells: list[NDArray[np.int64]]) -> list[Finding]:
    result = []
    for k, w in enumerate(case.taken):
        effect = w.fitted.effect
        others = sorted(((p, e) for e, p in odds.effects[k].items() if e != effect), reverse=True)
        alternatives = (
            *(Alternative(own_name(e), p) for p, e in others[:3] if p > 0.005),
            Alternative(None, odds.unknown),
        )
        before = case.rounds[k].base
        place = regimes.where(cells, gained(before.parts, w.fitted.point.parts))
        row = EFFECTS[effect]
        numbers = of_effect(final_numbers(case), effect)
        result.append(
            Finding(
                own_name(effect), row.subsystem, row.equation, odds.effects[k][effect], numbers, place.text, place.intervals,
                alternatives, _evidence(w, row.term, place.text), effect if row.foreign else "",
            )
        )  # fmt: skip
    return result


def _evidence(w: Weighed, term: str, where: str) -> str:
    others = f"its log-likelihood rises by {w.gain:.0f} nats on the data fitted and by {w.held_out_gain:.0f} on data not used"
    return f"With {term} in the model {others}; no change of parameters within their tolerances does that; it shows {where}."


def _unknown_finding(
    case: Case, odds: Odds, cells: list[NDArray[np.int64]], tight: _Tight, equations: Sequence[EquationEvidence],
    learned: Learned | None, fit: Fit,
) -> Finding:  # fmt: skip
    """What remains: located, not named; in the equation whose term explains it, else where it is likeliest (:func:`_home`).

    Where the rate alone is off, and angle and pressures are not, the boom moves as the model says: it is the sensor.
    """
    key, home = _home(case, equations)
    if learned:
        key, home = learned.term.equation, _touched(case.machine, learned.term)
    link = next(link for link in places(case.machine) if link.key == key)
    rest = [beyond(w, s, case.healthy_squares) for w, s in zip(tight.explained, case.select, strict=True)]
    place = regimes.where(cells, rest)
    near = _near(case)
    nearest = f"; the nearest is {label_of(near[0].fitted.effect)}" if near else " or comes near"
    unlike = max(case.impossible, key=lambda f: f.gain, default=None)
    if unlike and (not near or unlike.gain > near[0].fitted.gain):
        numbers = ", ".join(
            f"{name} {e.value:.3g} {e.unit}".rstrip(" -")
            for name, e in of_effect(estimates(unlike, 1.0), unlike.effect).items()
        )
        nearest = f"; the nearest is {label_of(unlike.effect)}, but as no boom can have it ({numbers})"
    said = f" Learnt from the data: {learned.curve.reading}." if learned else ""
    equation = "5.39a" if home in ("load", "structure") and key != BETWEEN.key else link.equation
    where = f"at '{link.title}'"
    if not learned and rate_alone(fit):
        home, equation, where = "sensors", _OF_THE_RATE.equation, "of the rate, which angle and pressures do not show"
    return Finding(
        None, home, equation, odds.unknown, {}, place.text, place.intervals,
        tuple(Alternative(own_name(w.fitted.effect), probability_of(odds, w.fitted.effect)) for w in near[:2]),
        f"No effect of the catalogue explains the mismatch {where}{nearest}.{said}",
    )  # fmt: skip


def rate_alone(fit: Fit) -> bool:
    """Whether parameters alone run through data not used as noise lets them, but for the rate."""
    error, floor = np.array(fit.held_out["parameters_only"], dtype=float), np.array(fit.noise_floor, dtype=float)
    off = error > AT_FLOOR * floor
    rate = OUTPUTS.index("rate")
    return bool(off[rate] and off.sum() == 1 and np.isfinite(error).all() and np.isfinite(floor).all())


def _near(case: Case) -> list[Weighed]:
    """What comes near as the first effect: the one taken, then what gained most, whether it was disproved or not."""
    others = sorted([*(case.weighed[0] if case.weighed else []), *case.disproved], key=lambda w: -w.net)
    return list({w.fitted.effect: w for w in (*case.taken[:1], *others)}.values())


def _touched(machine: Machine, term: LearnedTerm) -> str:
    """The subsystem of a term that explains all: of a torque the load, which something touches, or friction; of a flow a valve."""
    main = max(zip(term.basis, term.coefficients, strict=True), key=lambda t: abs(t[1]))[0]
    if term.equation == "torque":
        return "friction" if "rate" in main else "load"
    own = next(link.subsystems for link in links(machine) if link.key == term.equation)
    return "main_valve" if "main_valve" in own else own[0]


def _home(case: Case, equations: Sequence[EquationEvidence]) -> tuple[str, str]:
    """Equation and subsystem in which what no effect explains is likeliest.

    Where both ways of locating point to, on their mean, as far as the chain breaks anywhere, and the share that the subsystem's
    best effect explains of what the tolerances leave: another form of what explains part is likelier than something else beside it.
    """
    first, shares = case.rounds[0], dict[str, float]()
    over = max(first.base.over(case.floor), 1.0)
    for f in (*first.fitted, *(w.fitted for w in case.disproved)):
        where = EFFECTS[f.effect].subsystem
        shares[where] = max(shares.get(where, 0.0), min(1.0, f.gain / over))
    said = 1.0 + sum(e.chain for e in equations)
    placed = {
        (e.key, s): (e.statistical + e.chain) / said + shares.get(s, 0.0) for e in equations for s in e.subsystems
    }
    return max(placed, key=lambda p: placed[p])


def _verdict(
    case: Case, findings: Sequence[Finding], unknown: float, tolerances: float, moved: float, tight: _Tight
) -> Verdict:
    if not findings:
        if unknown > 0.5 and tight.excess_before > 3 * NEGLIGIBLE:
            return "unknown_physics"
        if tolerances < 0.5:  # nothing earned its place, and what did not is together likelier than nothing
            return "ambiguous"
        return "parameters_only" if noticed(moved, len(case.nuisances)) else "no_mismatch"
    if unknown > findings[0].confidence or (findings[0].like and findings[0].confidence >= NAMED_FROM):
        return "unknown_physics"
    if all(f.subsystem == "sensors" for f in findings):
        return "sensor_or_clock"
    return "identified" if findings[0].confidence >= NAMED_FROM else "ambiguous"


def _subsystems(ranked: Sequence[RankingRow], findings: Sequence[Finding]) -> dict[str, float]:
    result = dict.fromkeys(SUBSYSTEMS, 0.0)
    for row in ranked:
        if row.effect is not None:
            result[row.subsystem] = min(MOST_CERTAIN, result[row.subsystem] + row.probability)
    for f in findings:
        result[f.subsystem] = max(result[f.subsystem], f.confidence)
    return {name: round(p, 4) for name, p in result.items()}


def _said_of_limits(case: Case, verdict: Verdict, moved: Mapping[str, Estimate]) -> list[str]:
    """Which numbers stand at the end of what a fit may move; of parameters alone also which the file does not allow so far off."""
    rows = [(n.label or n.name, n, float(z)) for n, z in zip(case.nuisances, case.last.z, strict=True)]
    ended = [name for name, n, z in rows if n.ended(z)]
    beyond = [name for name, n, z in rows if n.beyond(z) and not (n.ended(z) or n.components == case.wrong)]
    explained = case.taken or case.wrong or verdict == "parameters_only"
    means = "which speaks against the explanation" if explained else "as they make up for what is missing"
    said = []

    def of_all(names: list[str], where: str) -> str:
        return f"{len(names)} of {len(case.nuisances)} numbers {'is' if len(names) == 1 else 'are'} {where}"

    if ended and moved:
        said.append(f"{of_all(ended, AT_THE_END)}, {means}: {', '.join(ended)}")
    if beyond and verdict == "parameters_only":
        said.append(f"{of_all(beyond, BEYOND)}, look {'it' if len(beyond) == 1 else 'these'} up: {', '.join(beyond)}")
    return said


def _said_of_wrong(case: Case, moved: Mapping[str, Estimate]) -> list[str]:
    """That a number of the machine file is wrong."""
    file = case.machine.values(case.pose)
    instead = [f"{names[0]} {factor * file[names[0]]:.4g} for {file[names[0]]:.4g}" for names, factor in case.or_wrong]
    as_well = f"; as well explained by {' or '.join(instead)} in its place" if instead else ""
    return [
        f"{in_words(case.wrong)}: {found.value:.4g}{unit} by the recordings, "
        f"{file[key]:.4g}{unit} in the file, far outside its tolerance: look it up{as_well}"
        for key, found in _wrong(case, moved).items()
        for unit in ["" if found.unit == "-" else f" {found.unit}"]
    ]


def _wrong(case: Case, moved: Mapping[str, Estimate]) -> dict[str, Estimate]:
    """The number that is wrong in the machine file, if one is."""
    return {key: estimate for key, estimate in moved.items() if key in case.wrong[:1]}


def _said_of_less(case: Case, machine: Machine) -> list[str]:
    """Effects of which the machine that is handed out has less than was found: no file can hold them."""
    less = []
    for effect in case.named:
        held = machine.effects.get(effect, {row.name: row.neutral for row in EFFECTS[effect].parameters})
        wanted = [case.last.effects[f"effects.{effect}.{name}"] for name in held]
        if not np.allclose(list(held.values()), wanted, rtol=1e-3, atol=0.0):
            less.append(label_of(effect))
    said = (
        "the machine file that is handed out has less of what was found, as none can hold it, which speaks against it"
    )
    return [f"{said}: {', '.join(less)}"] if less else []


def _moved(case: Case, verdict: Verdict) -> dict[str, Estimate]:
    """Numbers that the last fit moved: those of the machine that is handed out."""
    if verdict == "no_mismatch":
        return {}
    covariance = _covariance(case, case.last, case.taken[-1].fitted if case.taken else None)
    return moved_tolerances(case, case.last, np.sqrt(np.diag(covariance)), case.wrong)


def moved_tolerances(
    case: Case | WeighedCase, point: Point, deviations: Array, wrong: Sequence[str] = ()
) -> dict[str, Estimate]:
    """Tolerances that the recordings moved, and the first of what is ``wrong`` in the machine file; deviations: of z."""
    numbers, nominal = case.values(point.z, {}), case.machine.values(case.pose)
    units = {c: p.specification.unit for p in case.machine.parameters.values() for c in p.specification.components}
    limits = {
        c: (p.specification.minimum, p.specification.maximum)
        for p in case.machine.parameters.values() for c in p.specification.components
    }  # fmt: skip
    units |= {f"effects.{effect.id}.{row.name}": row.unit for effect in CATALOGUE for row in effect.parameters}
    units |= {n.name: "s" for n in case.nuisances if n.name.startswith(CLOCKS)}
    units |= {row.key: row.unit for row in equation_of_motion.SPECIFICATIONS}
    result = {}
    free = np.array([nuisance.name in wrong[:1] for nuisance in case.nuisances])
    for i in np.lexsort((-np.abs(point.z), ~free)):  # what is wrong comes first, then what moved most
        nuisance = case.nuisances[i]
        told = free[i]
        if (
            not told and (abs(point.z[i]) < MOVED or nuisance.name.startswith("pose."))
        ) or nuisance.name not in numbers:
            continue
        value = numbers[nuisance.name]
        spread = Z90 * float(deviations[i]) * nuisance.deviation(nominal.get(nuisance.name, 0.0), float(point.z[i]))
        unit = units.get(nuisance.name, "-")
        if told:  # no better than one that was looked up, and others make up for a wrong one in some other way, too
            spread = hypot(spread, Z90 * _looked_up(case, nuisance.name, value))
        low, high = limits.get(nuisance.name, (-inf, inf))
        result[nuisance.name if told else nuisance.label or nuisance.name] = Estimate(
            value, unit, (max(value - spread, min(low, value)), min(value + spread, max(high, value)))
        )
    return result


def _looked_up(case: Case | WeighedCase, name: str, value: float) -> float:
    """Standard deviation of a number of the machine file that is right."""
    prior = prior_of(case.machine, name, case.pose)
    return prior.sigma * (abs(value) if prior.kind == "log_normal" else 1.0)


def said_of_next(verdict: Verdict) -> str:
    """What to record where there is nothing to tell apart."""
    if verdict == "no_mismatch":
        return "Nothing: the model explains these recordings."
    if verdict == "unknown_physics":
        return "Record the motions in which it shows again, slower and faster, with rests between: a term is learnt from that."
    if verdict == "ambiguous":  # those that were fitted show nothing
        return (
            "Nothing yet: fit the recordings that were held out, and hold out those that were fitted. What only the former show "
            "is found there."
        )
    return "A longer recording with full currents in both directions narrows the parameters that moved."
