"""The report of an identification: chapter 5 with the figures of the recordings given, in one HTML file without network."""

from __future__ import annotations

from datetime import datetime
from pathlib import Path

from markupsafe import Markup

from boom_identification.identify import Identification
from boom_identification.validation import Validation
from boom_input.channels import PREDICTED
from boom_input.whole import write_whole
from boom_model.machine import Machine
from boom_report import __version__, inputs, terms
from boom_report.channels import short
from boom_report.identification import cylinder, pilot
from boom_report.identification.change import change
from boom_report.page import chart, page
from boom_report.templates import render
from boom_report.validation import figure, tables
from boom_report.validation.verdict import verdict

_METHOD = (
    "Each number is given with its 90 % interval. Residuals close together in time are correlated, so the intervals count "
    "stretches of data, not samples. An interval covers the noise of the recordings, not an error of the model's structure or "
    "of a data sheet value. Numbers that the recordings do not determine keep their value in the machine file and are listed "
    "with the reason."
)
_WORDS = ("90 % interval", "excitation", "held out", "free run", "full model, reduced model", "MAE, rms, RMSE, MAXE")


def write_identification_report(
    result: Identification, path: str | Path, *, command: str = "", machine_source: str | Path | None = None
) -> None:
    """Writes the report.

    Args:
        result: what is reported.
        path: of the HTML file; its folder exists.
        command: the command line that made it.
        machine_source: name or path of the machine file that it began with, for its checksum.

    Raises:
        OSError: the file cannot be written.
    """
    names = [t.name for t in result.inputs.traces] + [r.name for r in result.inputs.recordings]
    heading = f"Identification from {', '.join(names) if len(names) <= 3 else f'{len(names)} recordings'}"
    refined = result.refined.document() if result.refined else {"held_out": []}
    body = render(
        "boom_report/identification/report.html",
        heading=heading,
        when=datetime.now().astimezone().strftime("%Y-%m-%d %H:%M %z"),
        version=__version__,
        command=command,
        result=result,
        before=_values(result.machine),
        picture=change(result, _values(result.machine)),
        words=terms.section(
            "90 % interval", "excitation", "held out", "free run", "full model, reduced model", "MAE, rms, RMSE, MAXE"
        ),
        pilot=pilot.section,
        cylinder=cylinder.sections,
        refined=refined,
        channels=[(sensor.name, short(sensor)) for sensor in PREDICTED],
        summary=tables.summary(Validation(result.machine.name, list(result.validation))),
        verdict=verdict,
        errors=tables.errors,
        chart=chart,
        figure=figure.figure,
        method=_METHOD,
        files=_files(result, machine_source),
        machine=inputs.machine_section(result.identified),
    )
    write_whole(path, page(heading, body))


def _values(machine: Machine) -> dict[str, float]:
    """The numbers of a machine by key."""
    return {
        name: value
        for p in machine.parameters.values()
        for name, value in zip(p.specification.components, p.value, strict=True)
    }


def _files(result: Identification, machine_source: str | Path | None) -> Markup:
    rows = []
    bags = [(t.name, t.path) for t in result.inputs.traces] + [(r.name, r.path) for r in result.inputs.recordings]
    for name, path in bags:
        rows += [(name, file, checksum) for file, checksum in inputs.bag_files(path)]
    if machine_source is not None:
        rows.append((f"machine {result.machine.name}", *inputs.machine_file(machine_source)))
    return inputs.files_table(rows)
