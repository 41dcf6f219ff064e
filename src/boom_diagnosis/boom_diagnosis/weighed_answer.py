"""From the hypotheses that were weighed to the answer: verdict, findings, proof, and what the report draws."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from boom_diagnosis import regimes
from boom_diagnosis.answer import moved_tolerances, notes_of, remaining, said_of_next
from boom_diagnosis.assumptions import MOST_CERTAIN, NAMED_FROM
from boom_diagnosis.document import (
    SUBSYSTEMS,
    Alternative,
    DiagnosisResult,
    Document,
    Finding,
    HypothesisRow,
    RankingRow,
    Verdict,
)
from boom_diagnosis.experiment import propose
from boom_diagnosis.hypotheses import noticed
from boom_diagnosis.learning import learn
from boom_diagnosis.locating import links, locate
from boom_diagnosis.must_keep import kept
from boom_diagnosis.own_loads import said_of_loads, told_by_recording
from boom_diagnosis.prediction import beyond, gained
from boom_diagnosis.proof import (
    bag_result,
    final_machine,
    label_of,
    proof_of,
    proving_result,
    spans_of,
)
from boom_diagnosis.unsearched import About
from boom_diagnosis.weighed_case import WeighedCase
from boom_diagnosis.weighed_numbers import estimates, own_numbers
from boom_estimation.posterior import HypothesisFit
from boom_estimation.search import Hypothesis, WeighedHypothesis
from boom_model.catalogue import EFFECTS

Array = NDArray[np.float64]

THIRD = 3
"""Alternatives that a finding lists, and hypotheses that the next experiment is to tell apart."""
LISTED = 0.005
"""Probability below which an alternative is not listed with a finding."""


@dataclass(frozen=True)
class Marginals:
    """What is how likely, as it is stated.

    Attributes:
        effects: effect -> that it acts. places: place -> that unknown physics acts there. unknown: that it acts anywhere.
        nothing: that the machine's own numbers are all.
    """

    effects: dict[str, float]
    places: dict[str, float]
    unknown: float
    nothing: float


def odds_of(weighed: Sequence[tuple[WeighedHypothesis, float]]) -> Marginals:
    """Marginal probabilities of what the hypotheses say."""
    effects, places = dict[str, float](), dict[str, float]()
    for w, p in weighed:
        for effect in w.hypothesis.effects:
            effects[effect] = effects.get(effect, 0.0) + p
        for place in w.hypothesis.unknown:
            places[place] = places.get(place, 0.0) + p
    unknown = sum(p for w, p in weighed if w.hypothesis.unknown)
    nothing = sum(p for w, p in weighed if not (w.hypothesis.unknown or w.hypothesis.effects))
    return Marginals(
        {e: _stated(p) for e, p in effects.items()},
        {e: _stated(p) for e, p in places.items()},
        _stated(unknown),
        _stated(nothing),
    )


def _stated(p: float) -> float:
    return round(min(MOST_CERTAIN, p), 4)


def assemble(case: WeighedCase, about: About, weak: Mapping[str, str]) -> DiagnosisResult:
    """The whole answer of a finished search."""
    odds = odds_of(case.weighed)
    cells = [regimes.classify(bag) for bag in case.bags]
    verdict = _verdict(case, odds)
    wrong = verdict not in ("no_mismatch", "parameters_only")
    z, effects = (case.last.z, case.last.effects) if verdict == "unknown_physics" else (case.base.z, {})
    equations, agreement, inputs = locate(
        case.machine, case.bags, case.select, case.nuisances, z, effects, case.healthy, doubted=wrong
    )
    if verdict == "unknown_physics":
        case.learned = learn(case.setting, case.trained[-1], sorted(odds.places, key=lambda k: -odds.places[k])[:2])
    if verdict == "no_mismatch":
        agreement = "No equation needs an unknown input: what remains is noise."
    proof = proof_of(case, verdict, case.learned, spans_of(case))
    learned, driven, fit = proof.learned, proof.driven, proof.fit
    findings = _findings(case, odds, cells)
    if verdict == "unknown_physics":
        findings.insert(0, _unknown_finding(case, odds, cells))
    verdict, findings, unproved = kept(verdict, findings, fit, case.twin)
    notes = [
        *unproved,
        *proof.notes,
        *notes_of(case.bags, case.proving, weak),
        *_said_of_limits(case.best.fit),
    ]
    ranked = _ranking(case)
    rivals = [(w.hypothesis, p) for w, p in case.weighed if not w.hypothesis.unknown][:THIRD]
    points = [(_label(h), case.point(found.fit)) for h, _ in rivals if (found := case.found(h.effects)) is not None]
    experiment = propose(case, points) if verdict in ("ambiguous", "unknown_physics", "identified") else None
    document = Document(
        verdict, tuple(findings), _subsystems(case, findings), fit,
        experiment.text if experiment else said_of_next(verdict), about.seed, about.inputs_sha256, about.version, tuple(ranked),
        hypotheses=_hypotheses(case),
    )  # fmt: skip
    nominal, explained = case.nominal.parts, (learned.point if learned else case.last).parts
    bags = tuple(bag_result(case, i, cells, inputs, nominal[i], driven) for i in range(len(case.bags))) + tuple(
        proving_result(case, i, driven) for i in range(len(case.proving))
    )
    before = min(case.base.excess(case.floor), case.nominal.excess(case.floor))
    after = learned.point.excess(case.floor) if learned else case.last.excess(case.floor)
    count = len(case.nuisances)
    covariance = case.best.fit.covariance[:count, :count]
    moved = moved_tolerances(case, case.last, np.sqrt(np.diag(covariance))) if verdict != "no_mismatch" else {}
    final = learned.point if learned else case.last
    terms = (learned.term,) if learned else ()
    machine = case.machine if verdict == "no_mismatch" else final_machine(case, final, covariance, terms)
    handed_out = told_by_recording(case, machine)
    notes += said_of_loads(case.machine, machine, handed_out)
    return DiagnosisResult(
        document, case.machine, handed_out, bags,
        regimes.table(cells, case.select, nominal, explained, case.healthy_squares), equations, agreement, proof.ladder,
        (learned.curve,) if learned else (), remaining(fit, before, after) if wrong else "",
        moved, experiment, tuple(notes),
        command=about.command,
    )  # fmt: skip


def _verdict(case: WeighedCase, odds: Marginals) -> Verdict:
    """What the likeliest hypothesis is."""
    best = case.best.hypothesis
    if best.unknown:
        return "unknown_physics"
    if not best.effects:
        return "parameters_only" if noticed(case.nominal.loss - case.base.loss, len(case.nuisances)) else "no_mismatch"
    if odds.effects[case.named[0]] < NAMED_FROM:
        return "ambiguous"
    return "sensor_or_clock" if all(EFFECTS[e].subsystem == "sensors" for e in best.effects) else "identified"


def _said_of_limits(at: HypothesisFit) -> list[str]:
    ended = [n.name for n, free in zip(at.problem.numbers, at.free, strict=False) if not free]
    if not ended:
        return []
    first = ", ".join(ended[:THIRD])
    return [f"{len(ended)} of {len(at.c)} numbers stand at their limit, which speaks against the explanation: {first}"]


# ------------------------------------------------------------------------------------------------------------- findings


def _findings(case: WeighedCase, odds: Marginals, cells: list[NDArray[np.int64]]) -> list[Finding]:
    numbers, result = estimates(case.best.fit), []
    for effect in case.named:
        others = [e for e in case.named if e != effect]
        without = case.found(others, case.best.hypothesis.unknown) or case.found(others) or case.found(())
        assert without is not None
        before = case.point(without.fit) if without.hypothesis.effects else case.base
        place = regimes.where(cells, gained(before.parts, case.last.parts))
        row, p = EFFECTS[effect], odds.effects[effect]
        gain = case.best.fit.log_likelihood - without.fit.log_likelihood
        said = (
            f"With {row.term} in the model its log-likelihood rises by {gain:.0f} nats; no change of parameters within their "
            f"tolerances does that; it shows {place.text}."
        )
        short = own_numbers(numbers, effect)
        result.append(
            Finding(
                effect,
                row.subsystem,
                row.equation,
                p,
                short,
                place.text,
                place.intervals,
                _alternatives(case, odds),
                said,
            )
        )
    return result


def _alternatives(case: WeighedCase, odds: Marginals) -> tuple[Alternative, ...]:
    others = sorted(((p, e) for e, p in odds.effects.items() if e not in case.named), reverse=True)[:THIRD]
    return (*(Alternative(e, p) for p, e in others if p > LISTED), Alternative(None, odds.unknown))


def _unknown_finding(case: WeighedCase, odds: Marginals, cells: list[NDArray[np.int64]]) -> Finding:
    """What remains: located, not named."""
    learned = case.learned
    key = learned.term.equation if learned else max(odds.places, key=lambda k: odds.places[k])
    link = next(link for link in links(case.machine) if link.key == key)
    rest = [beyond(w, s, case.healthy_squares) for w, s in zip(case.last.parts, case.select, strict=True)]
    place = regimes.where(cells, rest)
    near = sorted(((p, e) for e, p in odds.effects.items() if e not in case.named), reverse=True)[:2]
    nearest = f"; the nearest is {label_of(near[0][1])}" if near else ""
    said = f" Learnt from the data: {learned.curve.reading}." if learned else ""
    at_home = (EFFECTS[e].subsystem for _, e in near)
    home = next((s for s in at_home if s in link.subsystems), link.subsystems[0])
    return Finding(
        None, home, link.equation, odds.unknown, {}, place.text, place.intervals,
        tuple(Alternative(e, p) for p, e in near),
        f"No effect of the catalogue explains the mismatch at '{link.title}'{nearest}.{said}",
    )  # fmt: skip


def _subsystems(case: WeighedCase, findings: Sequence[Finding]) -> dict[str, float]:
    """That something is wrong in each: what the hypotheses say; of unknown physics the subsystem that its finding names."""
    result = dict.fromkeys(SUBSYSTEMS, 0.0)
    for w, p in case.weighed:
        for subsystem in {EFFECTS[e].subsystem for e in w.hypothesis.effects}:
            result[subsystem] += p
    for f in findings:
        if f.effect is None:
            result[f.subsystem] = max(result[f.subsystem], f.confidence)
    return {name: _stated(p) for name, p in result.items()}


# -------------------------------------------------------------------------------------------------------------- ranking


def _label(hypothesis: Hypothesis) -> str:
    parts = [
        *map(label_of, hypothesis.effects),
        *(f"unmodelled physics at {label_of(place)}" for place in hypothesis.unknown),
    ]
    return " + ".join(parts) or "parameters within tolerance only"


def _kind(hypothesis: Hypothesis) -> Literal["sensors", "parameters", "effect", "unknown"]:
    if hypothesis.unknown:
        return "unknown"
    if not hypothesis.effects:
        return "parameters"
    return "sensors" if all(EFFECTS[e].subsystem == "sensors" for e in hypothesis.effects) else "effect"


def _ranking(case: WeighedCase) -> list[RankingRow]:
    """All hypotheses that were weighed, the likeliest first."""
    nothing = case.found(())
    assert nothing is not None
    rows = []
    for w, p in case.weighed:
        effects, unknown = w.hypothesis.effects, w.hypothesis.unknown
        new = next((e for e in case.named if e in effects), effects[0] if effects else None)
        numbers = {".".join(n.split(".")[1:]): e for n, e in estimates(w.fit).items()}
        gain = w.fit.log_likelihood - nothing.fit.log_likelihood
        rows.append(
            RankingRow(
                _label(w.hypothesis), new if not unknown else None, _kind(w.hypothesis), EFFECTS[new].subsystem if new else "",
                round(p, 4), gain, w.score - nothing.score, numbers,
            )
        )  # fmt: skip
    return rows


def _hypotheses(case: WeighedCase) -> tuple[HypothesisRow, ...]:
    return tuple(
        HypothesisRow(
            w.hypothesis.effects,
            w.hypothesis.unknown,
            w.fit.log_likelihood,
            w.fit.log_likelihood - w.fit.evidence,
            w.log_prior,
            p,
        )
        for w, p in case.weighed
    )
