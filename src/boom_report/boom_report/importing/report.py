"""The page of an import: the proposed or given mapping as a table, and a small plot of each signal and of what is left."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from boom_import import units
from boom_import.assembly import Proposal
from boom_import.conversion import to_si
from boom_import.mapping import ASK, SignalMap
from boom_import.source import Column, Source
from boom_input.channels import BY_NAME, Unit
from boom_input.shown import quoted
from boom_input.whole import write_whole
from boom_report import __version__, terms
from boom_report.channel_panels import title
from boom_report.page import chart, page
from boom_report.palette import INK, MEASURED, RED
from boom_report.panels import Json, Panels, line
from boom_report.templates import render

_UNITS = {"Pa": Unit("bar", 1e-5), "A": Unit("mA", 1e3)}
_HEIGHT, _GAP = 90, 34
_MOST_UNUSED = 24
_SHOWN = 0.02


def write_import_page(path: Path, source: Source, proposal: Proposal, command: str) -> None:
    """Write the page.

    Args:
        path: of the HTML file.
        source: the columns.
        proposal: the mapping with its reasons.
        command: the command line.

    Raises:
        OSError: it cannot be written.
    """
    used = {entry.column for entry in proposal.mapping.signals.values() if isinstance(entry, SignalMap)}
    unused = [column for column in source.columns if column.key not in used]
    heading = f"Import of {source.path.name}"
    body = render(
        "boom_report/importing/report.html",
        heading=heading, source=source, proposal=proposal, rows=rows(source, proposal), command=command, version=__version__,
        words=terms.section("signal, column", "gauge, absolute", "extend, retract", "hose pressure, rod pressure"),
        chart=chart(figure(source, proposal)), unused=[c.key for c in unused],
        rest=chart(_rest(source, unused[:_MOST_UNUSED])) if unused else "", shown=min(len(unused), _MOST_UNUSED),
    )  # fmt: skip
    write_whole(path, page(heading, body))


def rows(source: Source, proposal: Proposal) -> list[tuple[str, ...]]:
    """For each signal: name, column, unit, sign, gauge or absolute, range, probability, and why or what is open."""
    columns = source.by_key()
    result: list[tuple[str, ...]] = []
    for signal, given in proposal.mapping.signals.items():
        sure = None if given == ASK else proposal.probability.get(signal)
        percent = "" if sure is None else f"{min(100 * sure, 99.9):.1f} %"
        why = "to be decided" if signal in proposal.questions else proposal.why.get(signal, "")
        if isinstance(given, str):
            result.append((signal, given, "", "", "", "", percent, why))
            continue
        sign = "−" if given.sign < 0 and not given.part else "+"
        what = f"{given.column} ({given.part} half)" if given.part else given.column
        scale = f" × {given.scale:g}" if given.scale != 1 else ""
        unit = given.unit + scale + (f", offset {given.offset:g}" if given.offset else "")
        reach = _range(signal, given, columns.get(given.column))
        result.append((signal, what, unit, sign, given.reference, reach, percent, why))
    return result


def _shown(signal: str, given: SignalMap) -> Unit:
    """In which it is shown; of a piston that stands in the place of the joint in mm."""
    if units.BY_NAME[given.unit].dimension in (units.LENGTH, units.SPEED):
        return Unit("mm" if units.BY_NAME[given.unit].dimension == units.LENGTH else "mm/s", 1e3)
    return _UNITS.get(BY_NAME[signal].unit, Unit(BY_NAME[signal].unit, 1.0))


def _range(signal: str, given: SignalMap, column: Column | None) -> str:
    if column is None:
        return ""
    unit = _shown(signal, given)
    values = to_si(given, column.values) * unit.scale
    return f"{values.min():.4g} .. {values.max():.4g} {unit.name}"


def figure(source: Source, proposal: Proposal) -> Json:
    """Each signal as it would be imported, below each other."""
    panels, traces, columns = Panels(), [], source.by_key()
    zero = min(int(column.stamps_ns.min()) for column in source.columns)
    longest = 0.0
    for signal, given in proposal.mapping.signals.items():
        best = given
        if given == ASK:
            likely = proposal.options.get(signal, [])
            best = next((entry for entry, p in likely if isinstance(entry, SignalMap) and p > _SHOWN), given)
        if not isinstance(best, SignalMap) or best.column not in columns:
            continue
        column = columns[best.column]
        unit = _shown(signal, best)
        n = panels.add(signal, _HEIGHT, _GAP)
        said = f"<b>{signal.replace('_', ' ').capitalize()}</b> [{unit.name}] from {_html(best.column, 14)}"
        title(panels, signal, said + (" ?" if given == ASK else ""))
        time = (column.stamps_ns - zero) / 1e9
        longest = max(longest, float(time[-1]))
        traces.append(line(time, to_si(best, column.values) * unit.scale, n, signal, RED if given == ASK else INK, 1.2))
    if not panels.names:
        panels.add("none", _HEIGHT, _GAP)
    return {"data": traces, "layout": panels.layout([], longest)}


def _rest(source: Source, unused: list[Column]) -> Json:
    panels, traces = Panels(), []
    zero = min(int(column.stamps_ns.min()) for column in source.columns)
    for i, column in enumerate(unused):
        n = panels.add(str(i), 60, _GAP)
        title(panels, str(i), _html(column.key) + (f" [{_html(column.unit)}]" if column.unit else ""))
        time = np.asarray((column.stamps_ns - zero) / 1e9, float)
        traces.append(line(time, column.values, n, str(i), MEASURED, 1.2))
    longest = max(float((column.stamps_ns[-1] - zero) / 1e9) for column in unused)
    return {"data": traces, "layout": panels.layout([], longest)}


def _html(text: str, longest: int = 40) -> str:
    """Foreign text in a heading of a chart, which reads some HTML, short enough for a phone."""
    return quoted(text, longest).replace("&", "&amp;").replace("<", "&lt;")
