"""The ranking of all hypotheses, the ladder of models, and the table of what was found."""

from __future__ import annotations

import math
from collections.abc import Sequence

from markupsafe import Markup

from boom_diagnosis.document import DiagnosisResult, LadderStep
from boom_input.channels import PREDICTED
from boom_model.catalogue import SUBSYSTEM_NAMES, effect_name
from boom_report.diagnosis import words
from boom_report.templates import render

_KINDS = {
    "none": "no mismatch",
    "sensors": "sensors",
    "parameters": "parameters only",
    "effect": "effect",
    "unknown": "unknown",
}
_LISTED = 4  # names of recordings that are listed
_MOST = 14  # rows of the ranking that are shown at once; the rest is folded


def findings(result: DiagnosisResult) -> Markup:
    """HTML: what was found, each with numbers, regime, times, alternatives and evidence; empty without a finding."""
    return render(
        "boom_report/diagnosis/findings.html",
        findings=result.document.findings,
        effect_name=effect_name,
        subsystem_names=SUBSYSTEM_NAMES,
        words=words,
    )


def ranking(result: DiagnosisResult) -> Markup:
    """HTML: every hypothesis with probability, gain on data used and not used, and its numbers."""
    return render(
        "boom_report/diagnosis/ranking.html",
        title=words.ranking_title(result),
        rows=result.document.ranking,
        most=_MOST,
        kinds=_KINDS,
        subsystem_names=SUBSYSTEM_NAMES,
        words=words,
        width=_width,
    )


def _width(value: float) -> str:
    return f"{min(max(value, 0.0), 1.0) * 55:.0f}" if math.isfinite(value) else "0"


def ladder(result: DiagnosisResult) -> Markup:
    """HTML: held-out errors from the nominal model to the noise floor, channel by channel."""
    return render(
        "boom_report/diagnosis/ladder.html",
        steps=result.ladder,
        rungs=rungs(result),
        bags=_listed(result.document.fit.held_out_bags),
        channels=[c.label for c in PREDICTED],
        words=words,
    )


def _listed(names: Sequence[str]) -> str:
    """Names, but not dozens of them."""
    few = names if len(names) <= _LISTED else names[: _LISTED - 1]
    return ", ".join((*few, *([f"{len(names) - len(few)} more"] if len(few) < len(names) else []))) or "none"


def rungs(result: DiagnosisResult) -> Markup:
    """HTML: the bars of the ladder alone."""
    floor = LadderStep("noise floor", (), result.document.fit.noise_floor)
    steps = [*result.ladder, *([floor] if len(floor.held_out) == len(PREDICTED) else [])]
    there = [i for i in range(len(PREDICTED)) if any(math.isfinite(step.held_out[i]) for step in steps)]
    channels = [(PREDICTED[i].label.capitalize(), _bars(steps, i)) for i in there]  # none of what was not measured
    return render("boom_report/diagnosis/rungs.html", channels=channels)


def _bars(steps: list[LadderStep], index: int) -> list[tuple[str, str, float, str]]:
    """Label, kind, width [%] and number of each step, for one channel."""
    values = [step.held_out[index] for step in steps]
    known = [v for v in values if math.isfinite(v) and v > 0]
    low, high = (min(known) / 2, max(known)) if known else (1.0, 2.0)
    bars = []
    for k, (step, value) in enumerate(zip(steps, values, strict=True)):
        width = 100 * math.log(value / low) / math.log(high / low) if math.isfinite(value) and value > 0 else 0.0
        floor = step.label == "noise floor"
        last = k == len(steps) - 1 - (steps[-1].label == "noise floor")
        kind = " floor" if floor else " explained" if last and k > 0 else ""
        bars.append((step.label, kind, width, words.percent(value) if math.isfinite(value) else "stopped"))
    return bars
