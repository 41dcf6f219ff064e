"""The ranking of all hypotheses, the ladder of models, and the table of what was found."""

from __future__ import annotations

import math
from collections.abc import Mapping
from html import escape

from boom_diagnosis.document import DiagnosisResult, Estimate, LadderStep, RankingRow
from boom_input.channels import PREDICTED
from boom_model.catalogue import SUBSYSTEM_NAMES, effect_name
from boom_report.diagnosis.words import (
    intervals_text,
    others_text,
    percent,
    probability,
    ranking_title,
    shown,
    signed,
)

_KINDS = {
    "none": "no mismatch",
    "sensors": "sensors",
    "parameters": "parameters only",
    "effect": "effect",
    "unknown": "unknown",
}
_MOST = 14  # rows of the ranking that are shown at once; the rest is folded


def findings(result: DiagnosisResult) -> str:
    """HTML: what was found, each with numbers, regime, times, alternatives and evidence; empty without a finding."""
    cards = []
    for index, finding in enumerate(result.document.findings):
        numbers = _estimates(finding.parameters)
        others = ", ".join(escape(other) for other in others_text(finding))
        place = SUBSYSTEM_NAMES.get(finding.subsystem, escape(finding.subsystem))
        times = escape(intervals_text(finding.intervals_s))
        rows = [
            ("where", f"{place}, equation ({escape(finding.equation)})"),
            ("how much", numbers),
            ("when", escape(finding.regime) + (f"; {times}" if times else "")),
            ("how sure", f"{probability(finding.confidence)}{f'; instead it could be: {others}' if others else ''}"),
            ("evidence", escape(finding.evidence)),
        ]  # fmt: skip
        listed = "".join(f"<div><dt>{head}</dt><dd>{text}</dd></div>" for head, text in rows if text)
        cards.append(
            f"<h3>{index + 1}. {escape(effect_name(finding.effect).capitalize())}</h3><dl class=facts>{listed}</dl>"
        )
    return f"<section class=card><h2>What was found</h2>{''.join(cards)}</section>" if cards else ""


def ranking(result: DiagnosisResult) -> str:
    """HTML: every hypothesis with probability, gain on data used and not used, and its numbers."""
    if not result.document.ranking:
        return ""
    rows = [_row(row, index == 0) for index, row in enumerate(result.document.ranking)]
    head = (
        "<thead><tr><th>hypothesis</th><th>kind</th><th>probability</th><th class=n>gain held out<br>[nats]</th>"
        "<th class=n>gain fitted<br>[nats]</th><th>estimate, 90 % interval</th></tr></thead>"
    )
    more = ""
    if len(rows) > _MOST:
        more = (
            f"<details><summary>{len(rows) - _MOST} less probable hypotheses</summary><div class=scroll><table>{head}"
            f"<tbody>{''.join(rows[_MOST:])}</tbody></table></div></details>"
        )
    return (
        f"<section class=card><h2>{ranking_title(result)}</h2><div class=scroll><table>{head}<tbody>"
        f"{''.join(rows[:_MOST])}</tbody></table></div>{more}<p class=note>Gain: how much more probable the data are under "
        "the hypothesis than under parameters within their tolerance, as a logarithm (1 nat is a factor of 2.7). The gain "
        "on held-out data decides; probabilities are calibrated on simulated machines.</p></section>"
    )


def _row(row: RankingRow, first: bool) -> str:
    outside = "" if row.inside else " <span class=tag>outside its plausible range</span>"
    note = f"<br><span class=quiet>{escape(row.note)}</span>" if row.note else ""
    subsystem = (
        f"<br><span class=quiet>{SUBSYSTEM_NAMES[row.subsystem]}</span>" if row.subsystem in SUBSYSTEM_NAMES else ""
    )
    return (
        f"<tr{' class=first-row' if first else ''}><td>{escape(row.label)}{subsystem}{note}</td>"
        f"<td><span class=tag>{_KINDS[row.kind]}</span></td>"
        f"<td class=cellbar><i class='bar{'' if first else ' other'}' style='width:{_width(row.probability)}%'></i> "
        f"{probability(row.probability)}</td><td class=n>{signed(row.held_out_gain)}</td><td class=n>{signed(row.gain)}</td>"
        f"<td>{_estimates(row.parameters)}{outside}</td></tr>"
    )


def _width(value: float) -> str:
    return f"{min(max(value, 0.0), 1.0) * 55:.0f}" if math.isfinite(value) else "0"


def _estimates(parameters: Mapping[str, Estimate]) -> str:
    return "<br>".join(f"<code>{escape(name)}</code> = {escape(shown(e).text)}" for name, e in parameters.items())


def ladder(result: DiagnosisResult) -> str:
    """HTML: held-out errors from the nominal model to the noise floor, channel by channel."""
    if not result.ladder:
        return ""
    bags = ", ".join(result.document.fit.held_out_bags) or "none"
    return (
        f"<section class=card><h2>The ladder: each step on data it has not seen</h2>{rungs(result)}"
        "<p class=note>Root mean square error "
        "of free runs over the standard deviation of the measured channel, logarithmic bars; held out: "
        f"{escape(bags)}. A free run sees the currents and the initial state only.</p>{_table(result)}</section>"
    )


def rungs(result: DiagnosisResult) -> str:
    """HTML: the bars of the ladder alone."""
    floor = LadderStep("noise floor", (), result.document.fit.noise_floor)
    steps = [*result.ladder, *([floor] if len(floor.held_out) == len(PREDICTED) else [])]
    return f"<div class=ladder>{''.join(_channel(steps, i) for i in range(len(PREDICTED)))}</div>"


def _channel(steps: list[LadderStep], index: int) -> str:
    values = [step.held_out[index] for step in steps]
    known = [v for v in values if math.isfinite(v) and v > 0]
    low, high = (min(known) / 2, max(known)) if known else (1.0, 2.0)
    bars = []
    for k, (step, value) in enumerate(zip(steps, values, strict=True)):
        width = 100 * math.log(value / low) / math.log(high / low) if math.isfinite(value) and value > 0 else 0.0
        floor = step.label == "noise floor"
        last = k == len(steps) - 1 - (steps[-1].label == "noise floor")
        kind = " floor" if floor else " explained" if last and k > 0 else ""
        shown_as = percent(value) if math.isfinite(value) else "stopped"
        bars.append(
            f"<div class='rung{kind}'><span>{escape(step.label)}</span><span class=track><i style='width:{width:.0f}%'></i></span>"
            f"<span>{shown_as}</span></div>"
        )
    return f"<div><h3>{PREDICTED[index].label.capitalize()}</h3>{''.join(bars)}</div>"


def _table(result: DiagnosisResult) -> str:
    heads = "".join(
        f"<th class=n>{sensor.label}<br>{used}</th>" for used in ("fitted", "held out") for sensor in PREDICTED
    )
    rows = "".join(
        f"<tr><td>{escape(step.label)}</td>{''.join(f'<td class=n>{percent(v)}</td>' for v in step.training)}"
        f"{''.join(f'<td class=n>{percent(v)}</td>' for v in step.held_out)}</tr>"
        for step in result.ladder
    )
    return (
        "<details><summary>The same numbers as a table, with the data that were fitted</summary><div class=scroll><table>"
        f"<thead><tr><th>model</th>{heads}</tr></thead>"
        f"<tbody>{rows}</tbody></table></div></details>"
    )
