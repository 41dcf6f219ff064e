"""The report of an identification: chapter 5 with the figures of the recordings given, in one HTML file without network."""

from __future__ import annotations

from datetime import datetime
from html import escape
from pathlib import Path

from boom_identification.identify import Identification
from boom_identification.validation import BagValidation, Validation
from boom_input.channels import PREDICTED
from boom_input.whole import write_whole
from boom_report import __version__, inputs
from boom_report.channels import number, short
from boom_report.identification import cylinder, pilot
from boom_report.page import chart, page
from boom_report.validation import figure, tables
from boom_report.validation.verdict import verdict

_WHOLE = "style='white-space:nowrap'"
_METHOD = (
    "Each number is given with its 90 % interval. Residuals that lie close together in time are alike; the intervals count "
    "stretches of data, not samples. An interval covers the noise of the recordings, not an error of the model's structure or "
    "of a catalogue value. What the recordings cannot tell stays as it was in the machine file and is listed with the reason."
)


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
    when = datetime.now().astimezone().strftime("%Y-%m-%d %H:%M %z")
    made = f"Machine {escape(result.machine.name)} · {when} · boom {__version__}"
    body = (
        f"<header><h1>{escape(heading)}</h1><p class=quiet>{made}"
        f"{f'<br><code>{escape(command)}</code>' if command else ''}</p></header>"
        f"<section class=card>{_summary(result)}</section>"
        f"{pilot.section(result)}{cylinder.sections(result)}"
        f"{_held_out(result)}{_validation(result)}"
        f"<section class=card><h2>About this report</h2><p>{escape(_METHOD)}</p>{_files(result, machine_source)}"
        f"{inputs.machine_section(result.identified)}</section>"
    )
    write_whole(path, page(heading, body))


def _summary(result: Identification) -> str:
    before = {
        name: value
        for p in result.machine.parameters.values()
        for name, value in zip(p.specification.components, p.value, strict=True)
    }
    rows = []
    for e in result.estimates:
        low, high = e.interval_90
        old = before.get(e.key)
        inside = old is not None and low <= old <= high
        change = "–" if not old else f"{100 * (e.value / old - 1):+.1f} %"
        rows.append(
            f"<tr><td {_WHOLE}><code>{escape(e.key)}</code></td><td class=n>{number(e.value, 4)}</td>"
            f"<td class=n>{number(low, 4)} .. {number(high, 4)}</td><td {_WHOLE}>{escape(e.unit)}</td>"
            f"<td class=n>{'–' if old is None else number(old, 4)}</td>"
            f"<td class='n{'' if inside else ' off'}'>{change}</td><td class=quiet {_WHOLE}>{escape(e.how)}</td></tr>"
        )
    table = (
        "<div class=scroll><table class=compact><thead><tr><th>parameter</th><th class=n>value</th>"
        "<th class=n>90 % interval</th><th>unit</th><th class=n>before</th><th class=n>change</th><th>from</th></tr></thead>"
        f"<tbody>{''.join(rows)}</tbody></table></div><p class=note>A change in red: the old number lies outside the "
        "interval.</p>"
    )
    unexcited = result.unexcited
    alert = f"<p class=warning>Not enough excitation for: {escape(', '.join(unexcited))}</p>" if unexcited else ""
    listed = "".join(
        f"<li><code>{escape(', '.join(keys))}</code>: {escape(why)}</li>" for why, keys in result.reasons().items()
    )
    lacking = f"<h3>Not determined</h3><ul>{listed}</ul>" if listed else ""
    return f"<h2>What was found</h2>{alert}{table if rows else '<p>No number could be told.</p>'}{lacking}"


def _held_out(result: Identification) -> str:
    document = result.refined.document() if result.refined else {}
    check = document.get("held_out")
    if not check:
        return ""
    head = "".join(f"<th class=n>{short(sensor)} before</th><th class=n>after</th>" for sensor in PREDICTED)
    rows = "".join(
        f"<tr><td {_WHOLE}>{escape(row['bag'])}</td>"
        + "".join(
            f"<td class=n>{100 * row[side][sensor.name]:.2f}</td>"
            for sensor in PREDICTED
            for side in ("before", "after")
        )
        + "</tr>"
        for row in check
    )
    starts, iterations = document["starts"], document["iterations"]
    return (
        "<section class=card><h2>All recordings at once: the held-out check</h2><p>The end of each recording was not seen by "
        "the search. Free runs over it, rms error over the standard deviation of the measured channel [%], with the numbers "
        f"before and after. The search took {starts} start{'s' * (starts > 1)} and {iterations} iterations; noise level "
        f"{number(document['noise_level'], 3)} (1: the model errs no more than the noise of currents and sensors explains).</p>"
        f"<div class=scroll><table class=compact><thead><tr><th>recording</th>{head}</tr></thead><tbody>{rows}</tbody></table>"
        "</div></section>"
    )


def _validation(result: Identification) -> str:
    if not result.validation:
        return ""
    validation = Validation(result.machine.name, list(result.validation))
    bags = "".join(_recording(bag, index + 1) for index, bag in enumerate(result.validation))
    return (
        "<section class=card><h2>Figs. 5.12 to 5.19: the identified machine over the recordings</h2>"
        "<p>Free runs of the full and of the reduced model with the numbers found. The recordings are those they were found "
        "from: the tables tell that the model can follow them, not how it does on others; <code>./boom validate OTHER "
        f"--machine FILE</code> tells that.</p>{tables.summary(validation)}</section>{bags}"
    )


def _recording(bag: BagValidation, index: int) -> str:
    said = verdict(bag)
    return (
        f"<section class='card recording' id='bag-{index}'><h2>{escape(bag.recording.name)} "
        f"<span class='pill {said.kind.replace(' ', '-')}'>{said.kind}</span></h2><p>{escape(said.sentence)}</p>"
        f"{tables.errors(bag)}{chart(figure.figure(bag))}</section>"
    )


def _files(result: Identification, machine_source: str | Path | None) -> str:
    rows = []
    bags = [(t.name, t.path) for t in result.inputs.traces] + [(r.name, r.path) for r in result.inputs.recordings]
    for name, path in bags:
        rows += [(name, file, checksum) for file, checksum in inputs.bag_files(path)]
    if machine_source is not None:
        rows.append((f"machine {result.machine.name}", *inputs.machine_file(machine_source)))
    return inputs.files_table(rows)
