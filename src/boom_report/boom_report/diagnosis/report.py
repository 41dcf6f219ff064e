"""The report of a diagnosis: one HTML file that needs no network; its first page stands alone on a sheet of A4."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import datetime
from pathlib import Path

from boom_diagnosis.document import DiagnosisResult, Fit
from boom_input.channels import PREDICTED
from boom_input.whole import write_whole
from boom_model.catalogue import SUBSYSTEM_NAMES, effect_name
from boom_recording.recording import Recording
from boom_report import __version__, doubts, terms
from boom_report import events as report_events
from boom_report.diagnosis import next, ranking, replay, where, words
from boom_report.diagnosis.figure import figure
from boom_report.inputs import files_table, machine_section
from boom_report.page import CHARTS, chart, page
from boom_report.scheme import scheme
from boom_report.templates import render
from boom_report.view.page import REPLAY, STYLES

_METHOD = (
    "Possible causes are tried in this order: clock and delay, sensors, parameters within and outside their tolerance, physics of "
    "the catalogue, unmodelled physics; an earlier one that explains the data ends the search. Everything is judged on data "
    "that nothing was fitted to. Stretches with gaps, losses or stuck sensors are left out, not explained. The boom turns up "
    "for positive angles, 0 rad is horizontal; pressures are gauge."
)
_WORDS = (
    "effect", "confidence", "held out", "noise floor", "tolerance", "free run", "sigma", "nat", "regime", "90 % interval",
    "hose pressure, rod pressure", "q2, q3, q4", "extend, retract",
)  # fmt: skip
_STYLES = ("report.css", "diagnosis/diagnosis.css", *STYLES)


def write_diagnosis_report(result: DiagnosisResult, path: str | Path, recordings: Sequence[Recording] = ()) -> None:
    """Writes the report. An interruption leaves the file that was there before, never half a report.

    Args:
        result: what is reported.
        path: of the HTML file; its folder exists.
        recordings: those of ``result.bags``, in their order, for the moving crane; without them it is left out.

    Raises:
        OSError: the file cannot be written.
    """
    write_whole(path, html(result, recordings))


def html(result: DiagnosisResult, recordings: Sequence[Recording] = ()) -> str:
    """The whole page."""
    moving = replay.section(result, recordings)
    verdict = words.VERDICTS[result.document.verdict]
    inputs = [("input", name, checksum) for name, checksum in result.document.inputs_sha256.items()]
    body = render(
        "boom_report/diagnosis/report.html",
        result=result,
        when=datetime.now().astimezone().strftime("%Y-%m-%d %H:%M %z"),
        version=__version__,
        words=words,
        scheme=scheme,
        effect_name=effect_name,
        subsystem_names=SUBSYSTEM_NAMES,
        channels=PREDICTED,
        proof=_proof(result.document.fit),
        ranking=ranking,
        where=where.section,
        moving=moving,
        chart=chart,
        figure=figure,
        events=report_events.section,
        doubts=doubts.section,
        next=next,
        method=_METHOD,
        glossary=terms.section(*_WORDS),
        files=files_table(inputs),
        machine=machine_section(result.explained),
    )
    return page(f"Diagnosis of {result.machine.name}: {verdict}", body, _STYLES, CHARTS + (REPLAY if moving else ()))


def _proof(fit: Fit) -> list[tuple[str, tuple[float, ...]]]:
    """Held-out errors by stage, as the headline calls them, and at the noise floor; none where nothing was held out."""
    if "nominal" not in fit.held_out:
        return []
    words = {"nominal": "file", "parameters_only": "parameters only", "explained": "explained"}
    there = [stage for stage in words if stage in fit.held_out]
    if fit.held_out.get("explained") == fit.held_out.get("parameters_only"):  # nothing was found beside them
        there = [stage for stage in there if stage != "explained"]
    columns = [(words[stage], fit.held_out[stage]) for stage in there[-2:]]
    if len(fit.noise_floor) == len(PREDICTED):
        columns.append(("noise floor", fit.noise_floor))
    return columns
