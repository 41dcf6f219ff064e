"""The validation report: one HTML file that needs no network, for a screen, a phone and paper."""

from __future__ import annotations

from datetime import datetime
from pathlib import Path

from markupsafe import Markup

from boom_estimation.free_run import FreeRun
from boom_identification.validation import Validation
from boom_input.whole import write_whole
from boom_model.machine import Machine
from boom_recording.recording import Recording
from boom_report import __version__, events, inputs, terms
from boom_report.doubts import damage_lines
from boom_report.page import chart, page
from boom_report.templates import render
from boom_report.validation import figure, tables
from boom_report.validation.overview import overview
from boom_report.validation.verdict import verdict

_METHOD = (
    "Both models run freely: they see the measured currents and the initial state, nothing else, and are never "
    "corrected by the measurement. The current measured at its stamp acts until the next one. Predictions are taken "
    "at the stamps of the samples. The boom turns up for positive angles, 0 rad is horizontal; pressures are gauge."
)

WORDS = (
    "free run", "full model, reduced model", "noise limit", "hose pressure, rod pressure", "q2, q3, q4", "extend, retract",
    "MAE, rms, RMSE, MAXE", "gap or fault", "tolerance",
)  # fmt: skip


def write_report(
    validation: Validation,
    path: str | Path,
    *,
    title: str = "",
    command: str = "",
    machine: Machine | None = None,
    machine_source: str | Path | None = None,
    notes: tuple[str, ...] = (),
    sections: tuple[str, ...] = (),
) -> None:
    """Writes the report of a validation.

    Args:
        validation: what is reported.
        path: of the HTML file; its folder exists.
        title: heading; by default the names of the recordings.
        command: the command line that made it.
        machine: the machine that was run, for the table of its parameters.
        machine_source: name or path it was loaded from, for its checksum.
        notes: sentences that the reader should know, shown on top.
        sections: HTML of further sections, behind those of the recordings.

    Raises:
        OSError: the file cannot be written.
    """
    names = [bag.recording.name for bag in validation.bags]
    heading = title or f"Validation of {_shortened(names)}"
    body = render(
        "boom_report/validation/report.html",
        heading=heading,
        when=datetime.now().astimezone().strftime("%Y-%m-%d %H:%M %z"),
        version=__version__,
        command=command,
        validation=validation,
        tables=tables,
        notes=notes,
        verdict=verdict,
        samples=_samples,
        damage_lines=damage_lines,
        chart=chart,
        figure=figure.figure,
        picture=overview(validation),
        words=terms.section(*WORDS),
        not_run=_not_run,
        events=events.section,
        sections=[Markup(section) for section in sections],
        method=_METHOD,
        inputs=inputs.section(validation, machine, machine_source),
    )
    write_whole(path, page(heading, body))


def _samples(recording: Recording) -> int:
    return max((len(signal.time) for signal in recording.signals.values()), default=0)


def _not_run(prediction: FreeRun) -> str:
    return "not one step could be made" if prediction.stopped else "not run: there are no valid currents"


def _shortened(names: list[str]) -> str:
    if len(names) <= 3:
        return ", ".join(names) or "no recordings"
    return f"{len(names)} recordings"
