"""A diagnosis in words: headline, names of effects and subsystems, numbers with interval and unit for people."""

from __future__ import annotations

import math
from dataclasses import dataclass

from boom_diagnosis.answer import AT_THE_END, BEYOND
from boom_diagnosis.assumptions import NEAR_FLOOR, SURE
from boom_diagnosis.document import DiagnosisResult, Estimate, Finding, Fit
from boom_diagnosis.must_keep import far_channels
from boom_diagnosis.wrong_number import in_words
from boom_input.channels import PREDICTED
from boom_model.catalogue import EFFECTS, SUBSYSTEM_NAMES, effect_name
from boom_model.machine import Machine
from boom_report.channels import number, probability

VERDICTS = {
    "identified": "identified",
    "ambiguous": "ambiguous",
    "unknown_physics": "unknown physics",
    "parameters_only": "parameters only",
    "sensor_or_clock": "sensor or clock",
    "no_mismatch": "no mismatch",
    "not_enough_excitation": "not enough excitation",
}

SCALES = {
    "Pa": (1e-5, "bar"),
    "m^2": (1e6, "mm^2"),
    "rad": (1e3, "mrad"),
    "rad/s": (1e3, "mrad/s"),
    "m^3/s": (6e4, "l/min"),
    "m^3/s/Pa": (6e4 * 1e7, "l/min at 100 bar"),
    "m^3/s/Pa^0.5": (6e4 * 1e5**0.5, "(l/min)/sqrt(bar)"),
    "m^3/s/Pa^1.5": (6e4 * 1e5**1.5, "(l/min)/sqrt(bar) per bar"),
    "Pa s/m^3": (1e-5 / 6e4, "bar/(l/min)"),
    "Pa s^2/m^6": (1e-5 * (100 / 6e4) ** 2, "bar at 100 l/min"),
    "rad/(N m)": (1e9, "nrad/(N m)"),
    "N m/rad": (1e-3, "kN m/rad"),
    "N m s/rad": (1e-3, "kN m s/rad"),
}
_INVERSES = {"s/m^3": "m^3/s", "1/s": "s"}
"""Units of numbers that are 0 where nothing acts, and of what people think of: a largest flow, a time constant."""
_SURE = (
    (0.95, "almost certainly", "almost certain"), (0.85, "very probably", "very probable"),
    (0.65, "probably", "probable"), (0.4, "possibly", "possible"), (0.0, "perhaps", "uncertain"),
)  # fmt: skip
_MINUS = "\N{MINUS SIGN}"


def what_it_is(finding: Finding) -> tuple[str, str]:
    """Subject and predicate of the sentence that states the effect of a finding, or the one that unknown physics is like."""
    effect = EFFECTS[finding.effect or finding.like or ""]
    first = finding.parameters.get(effect.parameters[0].name)
    less = first is not None and first.value < effect.parameters[0].neutral
    return effect.says_less if effect.says_less and less else effect.says


def is_sure(confidence: float) -> str:
    """How a statement of this probability is worded, as an adverb."""
    return next(adverb for least, adverb, _ in _SURE if confidence >= least)


@dataclass(frozen=True)
class Shown:
    """A number for people: value, interval and unit as text; inverse: what it is one over, behind the interval."""

    value: str
    interval: str
    unit: str
    inverse: str = ""

    @property
    def text(self) -> str:
        """Value and interval, e.g. 90.1 ms (90 % interval 84 to 97 ms)."""
        unit = f" {self.unit}" if self.unit else ""
        return f"{self.value}{unit} (90 % interval {self.interval}{unit}{self.inverse})"


def shown(estimate: Estimate) -> Shown:
    """An estimate in the unit that people use, with as many digits as its interval deserves."""
    low, high = estimate.interval_90
    scale, unit = _for_people(estimate)
    value, low, high = (v * scale for v in (estimate.value, low, high))
    width = high - low
    if not (math.isfinite(width) and math.isfinite(value)):
        return Shown(signed(value, 3), "not determined", unit)
    # two digits of the interval's width: more say nothing
    decimals = 1 - math.floor(math.log10(width)) if width > 0 else 3
    decimals = max(0, min(decimals, 6))

    def text(v: float) -> str:
        return f"{v:z.{decimals}f}".replace("-", _MINUS) if abs(v) < 1e6 else f"{v:.3g}"

    return Shown(text(value), f"{text(low)} to {text(high)}", unit, _inverse(estimate))


def _for_people(estimate: Estimate) -> tuple[float, str]:
    """Factor and name of the unit that people use for a number."""
    if estimate.unit == "s" and max(abs(estimate.value), abs(estimate.interval_90[1])) < 1.0:
        return 1e3, "ms"
    return SCALES.get(estimate.unit, (1.0, "" if estimate.unit == "-" else estimate.unit))


def in_file(machine: Machine, key: str, estimate: Estimate) -> str:
    """What the machine file says of a number, in the unit in which its estimate is shown; nothing of what it does not have."""
    scale, unit = _for_people(estimate)
    said = (
        f"{float(f'{value * scale:.4g}'):g}".replace("-", _MINUS) + f" {unit}".rstrip()
        for parameter in machine.parameters.values()
        for name, value in zip(parameter.specification.components, parameter.value, strict=True)
        if name == key
    )
    return next(said, "")


def _inverse(estimate: Estimate) -> str:
    """For instance ", 1 / (8.9 to 9.1 l/min)"; empty for a number that people think of as it is, or that may be none."""
    low, high = estimate.interval_90
    if estimate.unit not in _INVERSES or not low > 0.0:
        return ""
    said = shown(Estimate(1.0 / estimate.value, _INVERSES[estimate.unit], (1.0 / high, 1.0 / low)))
    return f", 1 / ({said.interval} {said.unit})"


def meaning(effect: str | None, name: str) -> str:
    """What a number of an effect is, behind its name; empty for a subsystem's finding."""
    rows = EFFECTS[effect].parameters if effect in EFFECTS else ()
    return next((f" {row.meaning}" for row in rows if row.name == name), "")


def finding_name(finding: Finding) -> str:
    """Name of a finding in a table; of unmodelled physics with what it acts like, where that is known."""
    return effect_name(finding.effect) + (f": {effect_name(finding.like)}" if finding.like else "")


def signed(value: float, digits: int = 3) -> str:
    """A number with a proper minus sign; an en dash where there is none."""
    return "\N{EN DASH}" if not math.isfinite(value) else number(value, digits).replace("-", _MINUS)


def percent(value: float) -> str:
    """A share of the signal in percent; an en dash where a run ended early."""
    return "\N{EN DASH}" if not math.isfinite(value) else f"{number(value * 100, 2)} %"


def others_text(finding: Finding) -> list[str]:
    """What the finding could be instead, each with its probability; not what the recordings disproved."""
    return [f"{effect_name(a.effect)} {probability(a.confidence)}" for a in finding.alternatives if a.confidence > 0]


def ranking_title(result: DiagnosisResult) -> str:
    """The heading of the ranking; beside a first finding a further one has a probability of its own."""
    several = sum(bool(finding.effect or finding.like) for finding in result.document.findings) > 1
    return "Ranking: what the first finding could be" if several else "Ranking of the hypotheses"


def intervals_text(intervals: tuple[tuple[float, float], ...], most: int = 4) -> str:
    """Times in words: "12.1 to 13.0 s, 15.0 to 15.8 s and 3 more"."""
    said = [f"{a:.1f} to {b:.1f} s" for a, b in intervals[:most]]
    more = f" and {len(intervals) - most} more" if len(intervals) > most else ""
    return ", ".join(said) + more


def best_channel(fit: Fit) -> tuple[str, float, float] | None:
    """(channel, parameters only, explained) held-out error of the channel that the explanation helped most; None without one."""
    before, explained = fit.held_out.get("parameters_only"), fit.held_out.get("explained")
    if before is None or explained is None:
        return None
    known = [(n, e, c) for c, n, e in zip(PREDICTED, before, explained, strict=True) if e > 0 and math.isfinite(n + e)]
    if not known:
        return None
    n, e, sensor = max(known, key=lambda row: row[0] / row[1])
    return sensor.label, n, e


def off_by_more(result: DiagnosisResult) -> str:
    """How many numbers the notes say to be further off than their tolerance, in words; empty where all are within."""
    said = [note.split(words)[0] + words for words in (AT_THE_END, BEYOND) for note in result.notes if words in note]
    return said[0] if said else ""


def _by_parameters(result: DiagnosisResult) -> str:
    """The headline where numbers of the machine file explain the difference."""
    used, off = result.tolerances_used, off_by_more(result)
    moved = ", ".join([name for name in used if name not in result.wrong][:3])
    if result.wrong:
        also = f", and parameters{'' if off else ' within their tolerance'} ({moved})" if moved else ""
        size = shown(used[result.wrong[0]]).text
        return f"{in_words(result.wrong, result.or_wrong)}: {size}. That explains the difference{also}: the physics is right."
    these = f" ({moved})" if moved else ""
    if off:
        which = "it" if off.startswith("1 ") else "these"
        return f"Parameters explain the difference{these}, but {off}: look {which} up before the physics is taken for right."
    said = f"Parameters within their tolerance explain the difference{these}: the physics is"
    p = max((row.probability for row in result.document.ranking if row.kind == "parameters"), default=1.0)
    return f"{said} right." if p >= SURE else f"{said} {is_sure(p)} right (confidence {probability(p)})."


def headline(result: DiagnosisResult) -> str:
    """One sentence with number, interval and confidence, worded as carefully as the confidence asks."""
    document = result.document
    kind = document.verdict
    if document.spoilt is not None:
        name, check = document.spoilt
        return f"{name}, {check.topic}: {check.sentence}"
    if kind == "no_mismatch":
        return f"The model of {result.machine.name} explains {_these(result)}: what differs is within sensor noise."
    if kind == "not_enough_excitation":
        return f"No diagnosis: {_these(result)} do not tell enough to separate the causes, as the notes say."
    unproved = next((note for note in result.notes if note.startswith("unproved")), "")
    if not document.findings and unproved:
        return f"{unproved[0].upper()}{unproved[1:]}."
    if not document.findings and kind == "ambiguous":
        alike = [f"{row.label} {row.probability:.2f}" for row in document.ranking if row.probability >= RIVAL]
        return f"None of what could explain the difference stands out: {', '.join(alike)}."
    if not document.findings:
        return _by_parameters(result)
    first = document.findings[0]
    more = len(document.findings) - 1
    also = f" {_count(more)} further {'finding' if more == 1 else 'findings'} below." if more else ""
    rival = max((row.probability for row in document.ranking if row.kind == "parameters"), default=0.0)
    said = statement(first, "identified" if unproved and first.confidence >= HALF else kind, rival)
    if result.learned:
        said = f"{said} Learnt from the data: {result.learned[0].reading}."
    return f"{said}{f' {unproved[0].upper()}{unproved[1:]}.' if unproved else _proof(result)}{also}"


HALF = 0.5
"""Probability from which on a finding is stated by itself, unproved or not."""
RIVAL = 0.05
"""Probability from which on the headline names what else it could be."""


def statement(finding: Finding, kind: str = "identified", parameters_only: float = 0.0) -> str:
    """What was found, as a sentence with number, interval, regime and confidence; ``parameters_only``: that rival's probability."""
    sure, p = is_sure(finding.confidence), probability(finding.confidence)
    subsystem = SUBSYSTEM_NAMES[finding.subsystem]
    where = f", seen: {finding.regime}" if finding.regime else ""
    numbers = ", ".join(f"{name} = {shown(e).text}" for name, e in finding.parameters.items())
    if finding.effect is None:
        adjective = next(word for least, _, word in _SURE if finding.confidence >= least)
        said = ""
        if finding.like:
            said = f": {' '.join(what_it_is(finding))}, {numbers}"
        return (
            f"Unmodelled physics acts on the {subsystem} (equation {finding.equation}){said}{where}; this is "
            f"{adjective} (confidence {p})."
        )
    if kind == "ambiguous":
        rivals = [(a.confidence, effect_name(a.effect)) for a in finding.alternatives]
        rivals += [(parameters_only, "parameters within tolerance only")]
        ranked = sorted(rivals, key=lambda rival: -rival[0])
        others = [name for p, name in ranked if p >= RIVAL] or [name for _, name in ranked[:1]]
        name = finding_name(finding)
        either = f"{name} or {' or '.join(others)}" if others else name
        return f"It cannot be told apart from these recordings: {either}{where}. The first has a confidence of {p}."
    if finding.effect not in EFFECTS:
        return f"{sure.capitalize()} the {subsystem}: {finding.effect}{f', {numbers}' if numbers else ''} (confidence {p})."
    subject, does = what_it_is(finding)
    return f"{sure.capitalize()} {subject} {does}{f': {numbers}' if numbers else ''}{where} (confidence {p})."


def _proof(result: DiagnosisResult) -> str:
    """What the explanation improves in free runs over data not used, and what it leaves, in one sentence."""
    fit, findings = result.document.fit, result.document.findings
    best, said = best_channel(fit), ""
    if best is not None and best[1] > best[2]:
        name, before, explained = best
        what = "it" if findings[0].effect is not None or findings[0].like or result.learned else "what else was found"
        said = (
            f" With {what} the {name}'s held-out error falls from {percent(before)} with parameters only to "
            f"{percent(explained)} of the signal"
        )
    left = far_channels(fit.held_out, fit.noise_floor, NEAR_FLOOR) if "explained" in fit.held_out else []
    if left:
        word = ", but free runs" if said else " Free runs over data not used"
        said += f"{word} still err more than noise alone would: {', '.join(left)}"
    return said and f"{said}."


def _these(result: DiagnosisResult) -> str:
    return "the recordings" if len(result.bags) != 1 else "the recording"


def _count(n: int) -> str:
    return {1: "One", 2: "Two", 3: "Three"}.get(n, str(n))
