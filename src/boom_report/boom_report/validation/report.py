"""The validation report: one HTML file that needs no network, for a screen, a phone and paper."""

from __future__ import annotations

from datetime import datetime
from html import escape
from pathlib import Path

from boom_estimation.free_run import Prediction
from boom_identification.validation import BagValidation, Validation
from boom_input.whole import write_whole
from boom_model.machine import Machine
from boom_report import __version__, events, inputs
from boom_report.page import chart, page
from boom_report.validation import figure, tables
from boom_report.validation.verdict import verdict

_METHOD = (
    "Both models run freely: they see the measured currents and the initial state, nothing else, and are never "
    "corrected by the measurement. The current measured at its stamp acts until the next one. Predictions are taken "
    "at the stamps of the samples. The boom turns up for positive angles, 0 rad is horizontal; pressures are gauge."
)


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
    bags = "".join(_recording(bag, index + 1) for index, bag in enumerate(validation.bags))
    compared = (
        f"<section class=card><ul class=results>{_results(validation)}</ul>{_notes(notes)}</section>"
        f"<section class=card>{tables.summary(validation)}</section>{bags}"
        if validation.bags
        else _notes(notes)
    )
    body = (
        f"<header><h1>{escape(heading)}</h1><p class=quiet>{_made(validation, command)}</p></header>"
        f"{compared}{''.join(sections)}"
        f"<section class=card><h2>About this report</h2><p>{escape(_METHOD)}</p>"
        f"{inputs.section(validation, machine, machine_source)}</section>"
    )
    write_whole(path, page(heading, body))


def _made(validation: Validation, command: str) -> str:
    when = datetime.now().astimezone().strftime("%Y-%m-%d %H:%M %z")
    said = f"Machine {escape(validation.machine)} · {when} · boom {__version__}"
    return said + (f"<br><code>{escape(command)}</code>" if command else "")


def _results(validation: Validation) -> str:
    items = []
    for index, bag in enumerate(validation.bags):
        said = verdict(bag)
        items.append(
            f"<li><span class='pill {said.kind.replace(' ', '-')}'>{said.kind}</span>"
            f"<span><a href='#bag-{index + 1}'><b>{escape(bag.recording.name)}</b></a>: "
            f"{escape(said.sentence)}</span></li>"
        )
    return "".join(items)


def _notes(notes: tuple[str, ...]) -> str:
    return "".join(f"<p class=warning>{escape(note)}</p>" for note in notes)


def _recording(bag: BagValidation, index: int) -> str:
    recording, said = bag.recording, verdict(bag)
    c = recording.configuration
    samples = max((len(signal.time) for signal in recording.signals.values()), default=0)
    about = (
        f"{recording.duration:.1f} s, {samples} samples a channel · machine {c.machine or 'not named'} · q3 = "
        f"{c.outer_boom_angle:g} rad, "
        f"q4 = {c.telescope_length:g} m, load {tables.load_text(c.load_mass)} kg" + (f" · {c.note}" if c.note else "")
    )
    stopped = "".join(
        f"<p class=alert>The {p.label} model stopped: {escape(p.stopped)}. There is no prediction from there to "
        "the next run.</p>"
        for p in (bag.full, bag.reduced)
        if p.stopped
    )
    warnings = "".join(f"<p class=warning>Damaged file: {escape(warning)}</p>" for warning in recording.warnings)
    notes = "".join(f"<p class=note>Note: {escape(note)}.</p>" for note in recording.notes)
    runs = "".join(
        f"<li>{p.label} model, {escape(run)}</li>" for p in (bag.full, bag.reduced) for run in p.runs or (_not_run(p),)
    )
    return (
        f"<section class='card recording' id='bag-{index}'><h2>{escape(recording.name)} "
        f"<span class='pill {said.kind.replace(' ', '-')}'>{said.kind}</span></h2><p class=quiet>{escape(about)}</p>"
        f"<p>{escape(said.sentence)}</p>{stopped}{warnings}{tables.errors(bag)}"
        f"{chart(figure.figure(bag))}"
        f"<h3>Free runs and their initial states</h3><ul>{runs}</ul><h3>Gaps, losses and faults</h3>"
        f"{events.section(recording.events)}{notes}</section>"
    )


def _not_run(prediction: Prediction) -> str:
    return "not one step could be made" if prediction.stopped else "not run: there are no valid currents"


def _shortened(names: list[str]) -> str:
    if len(names) <= 3:
        return ", ".join(names) or "no recordings"
    return f"{len(names)} recordings"
