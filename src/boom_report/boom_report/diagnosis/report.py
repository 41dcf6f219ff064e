"""The report of a diagnosis: one HTML file that needs no network; its first page stands alone on a sheet of A4."""

from __future__ import annotations

from datetime import datetime
from html import escape
from pathlib import Path

from boom_diagnosis.document import BagResult, DiagnosisResult, Fit
from boom_input.channels import PREDICTED
from boom_input.whole import write_whole
from boom_model.catalogue import SUBSYSTEM_NAMES, effect_name
from boom_report import __version__
from boom_report import events as report_events
from boom_report.diagnosis import next, ranking, where
from boom_report.diagnosis.figure import figure
from boom_report.diagnosis.scheme import scheme
from boom_report.diagnosis.words import (
    VERDICTS,
    headline,
    intervals_text,
    others_text,
    percent,
    probability,
    shown,
)
from boom_report.inputs import files_table, machine_section
from boom_report.page import chart, page

_METHOD = (
    "Doubts are raised in this order: clock and delay, sensors, parameters within and outside their tolerance, physics of the "
    "catalogue, physics of no catalogue; an earlier one that explains the data ends the search. Everything is judged on data "
    "that nothing was fitted to. Stretches with gaps, losses or stuck sensors are left out, not explained. The boom turns up "
    "for positive angles, 0 rad is horizontal; pressures are gauge."
)
_STYLES = ("report.css", "diagnosis/diagnosis.css")


def write_diagnosis_report(result: DiagnosisResult, path: str | Path) -> None:
    """Writes the report. An interruption leaves the file that was there before, never half a report.

    Args:
        result: what is reported.
        path: of the HTML file; its folder exists.

    Raises:
        OSError: the file cannot be written.
    """
    write_whole(path, html(result))


def html(result: DiagnosisResult) -> str:
    """The whole page."""
    heading = f"Diagnosis of {result.machine.name}: {VERDICTS[result.document.verdict]}"
    bags = "".join(_bag(bag, index + 1) for index, bag in enumerate(result.bags))
    body = (
        f"<div class=diagnosis><div class=sheet>{_summary(result)}{ranking.ladder(result)}</div>"
        f"{ranking.findings(result)}{where.section(result)}{bags}"
        f"{ranking.ranking(result)}{next.learned(result)}"
        f"{next.remaining(result)}{next.experiment(result)}{_about(result)}</div>"
    )
    return page(heading, body, _STYLES)


def _summary(result: DiagnosisResult) -> str:
    """The first page: headline, scheme, the facts in short."""
    document = result.document
    kind = document.verdict
    when = datetime.now().astimezone().strftime("%Y-%m-%d %H:%M %z")
    sure = ""
    if document.findings:
        p = document.findings[0].confidence
        sure = (
            f"<span class=sure>confidence<span class=meter><i style='width:{100 * min(max(p, 0), 1):.0f}%'></i></span>"
            f"<b>{probability(p)}</b></span>"
        )
    notes = "".join(f"<p class=warning>{escape(note)}</p>" for note in result.notes)
    facts = "".join(f"<div><dt>{head}</dt><dd>{text}</dd></div>" for head, text in _facts(result) if text)
    return (
        f"<header><h1>Diagnosis · machine {escape(result.machine.name)}</h1></header>"
        f"<section class='card summary'><div class=verdict><span class='pill {kind.replace('_', '-')}'>{VERDICTS[kind]}</span>"
        f"{sure}</div><p class=headline>{escape(headline(result))}</p>{notes}"
        f"<div class=first>{scheme(document.subsystems)}<dl class=facts>{facts}</dl></div>"
        f"<p class='quiet note'>{when} · boom {__version__} · seed {document.seed}"
        f"{f' · <code>{escape(result.command)}</code>' if result.command else ''}</p></section>"
    )


def _facts(result: DiagnosisResult) -> list[tuple[str, str]]:
    document = result.document
    facts: list[tuple[str, str]] = []
    for finding in document.findings[:2]:
        numbers = "<br>".join(
            f"<big>{escape(shown(e).value)} {escape(shown(e).unit)}</big> <span class=quiet><code>{escape(name)}</code>, 90 % "
            f"interval {escape(shown(e).interval)}</span>"
            for name, e in list(finding.parameters.items())[:4]
        )
        facts.append((escape(effect_name(finding.effect)), numbers or escape(finding.evidence)))
        place = SUBSYSTEM_NAMES.get(finding.subsystem, escape(finding.subsystem))
        facts.append(("where", f"{place}, equation ({escape(finding.equation)})"))
        times = escape(intervals_text(finding.intervals_s, 3))
        facts.append(("when", escape(finding.regime) + (f" ({times})" if times else "")))
        facts.append(("or else", ", ".join(escape(other) for other in others_text(finding)[:3])))
    if not document.findings and result.tolerances_used:
        moved = "<br>".join(
            f"<code>{escape(k)}</code> = {escape(shown(e).text)}" for k, e in list(result.tolerances_used.items())[:6]
        )
        facts.append(("within tolerance", moved))
    fit = document.fit
    if "nominal" in fit.held_out:
        facts.append(("proof", _proof(fit)))
    facts.append(("located", escape(result.agreement)))
    facts.append(("remains", escape(result.remaining or "nothing beyond the noise of the sensors")))
    facts.append(("record next", escape(document.next_experiment)))
    return facts


def _proof(fit: Fit) -> str:
    """Held-out errors before, after and at the noise floor, as a table."""
    columns = [("before" if "explained" in fit.held_out else "model", fit.held_out["nominal"])]
    if "explained" in fit.held_out:
        columns.append(("after", fit.held_out["explained"]))
    if len(fit.noise_floor) == len(PREDICTED):
        columns.append(("noise floor", fit.noise_floor))
    heads = "".join(f"<th class=n>{head}</th>" for head, _ in columns)
    rows = "".join(
        f"<tr><td>{sensor.label}</td>{''.join(f'<td class=n>{percent(values[i])}</td>' for _, values in columns)}</tr>"
        for i, sensor in enumerate(PREDICTED)
    )
    return f"<table class=proof><thead><tr><th>held-out error</th>{heads}</tr></thead><tbody>{rows}</tbody></table>"


def _bag(bag: BagResult, index: int) -> str:
    held = (
        "held out: nothing was fitted to it" if bag.held_out
        else f"held out from {bag.held_out_from:.1f} s on" if bag.held_out_from is not None else "used for fitting"
    )  # fmt: skip
    events = f"<h3>Gaps, losses and faults</h3>{report_events.section(bag.events)}" if bag.events else ""
    return (
        f"<section class='card recording' id='bag-{index}'><h2>{escape(bag.name)} <span class=tag>{held}</span></h2>"
        f"<p class=quiet>Measured, before and after: free runs on the recorded currents, {bag.duration:.1f} s.</p>"
        f"{chart(figure(bag))}{events}</section>"
    )


def _about(result: DiagnosisResult) -> str:
    rows = [("input", name, checksum) for name, checksum in result.document.inputs_sha256.items()]
    moved = "".join(
        f"<tr><td><code>{escape(key)}</code></td><td>{escape(shown(e).text)}</td></tr>"
        for key, e in result.tolerances_used.items()
    )
    tolerance = (
        "<h3>Parameters that moved within their tolerance</h3><div class=scroll><table class=compact><thead><tr><th>key</th>"
        f"<th>estimate</th></tr></thead><tbody>{moved}</tbody></table></div>"
        if moved
        else ""
    )
    return (
        f"<section class=card><h2>About this report</h2><p>{escape(_METHOD)}</p>{tolerance}{files_table(rows)}"
        f"{machine_section(result.explained)}</section>"
    )
