"""The page of a fleet: at a glance, what to look at on Monday morning, each changed machine over time with intervals."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from datetime import datetime
from itertools import pairwise
from typing import Any

from boom_report import __version__
from boom_report.fleet import words
from boom_report.page import chart, page
from boom_report.palette import EVENT_EDGE, EXTEND, INK, MEASURED, OTHER, QUIET, RED, RETRACT
from boom_report.templates import render
from boom_report.xy import note, xy

Row = Mapping[str, Any]
_COLOURS = (OTHER, RETRACT, EXTEND, QUIET)
APART = 10.0
"""s. Recordings of a machine that are closer than this in time are drawn in their order: their clock tells nothing."""


def page_of(rows: Sequence[Row], command: str = "") -> str:
    """The HTML page.

    Args:
        rows: of the table (``boom_fleet.table.rows``), machine by machine in the order of time.
        command: the command line that made it.
    """
    found = words.machines(rows)
    heading = f"Fleet of {len(found)} machines"
    body = render(
        "boom_report/fleet/report.html",
        heading=heading, when=datetime.now().astimezone().strftime("%Y-%m-%d %H:%M %z"), version=__version__, command=command,
        machines=found, rows=rows, sums=words.sums(rows), change=words.change_sentence, verdict=words.verdict_sentence,
        quantity=words.quantity_words, glance=chart(_glance(found)), trends={m.name: _trends(m) for m in found if m.changes},
        failures=[row for row in rows if row.get("failure") or row.get("diagnosis_failure")],
    )  # fmt: skip
    return page(heading, body)


def _glance(found: Sequence[words.FleetMachine]) -> dict[str, Any]:
    """Every recording as a point: machine over time, the colour its state."""
    states = {
        "unchanged": (MEASURED, "circle"), "raised": (RED, "diamond"), "changed before": (EVENT_EDGE, "circle"),
        "refused or failed": (QUIET, "x"),
    }  # fmt: skip
    traces = []
    names = [m.name for m in reversed(found)]
    dated = all(_dated(m.rows) for m in found)
    for state, (colour, symbol) in states.items():
        points = [
            (_when(row["time"]) if dated else k, m.name, row["recording"])
            for m in found
            for k, row in enumerate(m.rows, 1)
            if row.get("time") and _state(row) == state
        ]
        traces.append({
            "type": "scatter", "mode": "markers", "name": state, "x": [x for x, _, _ in points],
            "y": [name for _, name, _ in points], "text": [text for _, _, text in points],
            "marker": {"color": colour, "symbol": symbol, "size": 10}, "hovertemplate": "%{y} %{text}",
        })  # fmt: skip
    title = "date of the recording" if dated else "number of the machine's recording"
    result = xy(traces, title, "", height=120 + 22 * len(names))
    result["layout"]["yaxis"] |= {
        "type": "category",
        "categoryorder": "array",
        "categoryarray": names,
        "dtick": 1,
    }
    result["layout"]["xaxis"] |= {"type": "date"} if dated else {"dtick": 1}
    return result


def _when(time: datetime) -> str:
    return f"{time:%Y-%m-%d %H:%M}"


def _dated(rows: Sequence[Row]) -> bool:
    """Whether the times of a machine's recordings, in their order, tell them apart."""
    times = [row["time"] for row in rows if row.get("time")]
    return all((b - a).total_seconds() >= APART for a, b in pairwise(times))


def _place(row: Row, dated: bool) -> str:
    """On the axis of a machine's recordings."""
    return _when(row["time"]) if dated else str(row["recording"])


def _state(row: Row) -> str:
    if row.get("failure") or row.get("refused") or row.get("unchanged") is None:
        return "refused or failed"
    if row.get("raised"):
        return "raised"
    return "changed before" if row.get("changes") else "unchanged"


def _trends(machine: words.FleetMachine) -> list[Any]:
    """A chart for each quantity of a machine that changed: its size in each recording against the first, 90 % intervals."""
    charts, dated = [], _dated(machine.rows)
    for k, name in enumerate(dict.fromkeys(c["quantity"] for c in machine.changes)):
        points = [
            (row, level) for row in machine.rows for level in row.get("levels") or [] if level["quantity"] == name
        ]
        if not points:
            continue
        unit, scale = words.unit_of(points[0][1]["unit"])
        trace = {
            "type": "scatter", "mode": "lines+markers", "name": name, "showlegend": False,
            "x": [_place(row, dated) for row, _ in points], "y": [scale * level["level"] for _, level in points],
            "error_y": {
                "type": "data", "symmetric": False, "thickness": 1.5,
                "array": [scale * (level["level_high"] - level["level"]) for _, level in points],
                "arrayminus": [scale * (level["level"] - level["level_low"]) for _, level in points],
            },
            "line": {"color": _COLOURS[k % len(_COLOURS)], "width": 1.5}, "marker": {"size": 7}, "hovertemplate": "%{y:.4g}",
        }  # fmt: skip
        figure = xy(
            [trace], "date of the recording" if dated else "recording, in order", f"change [{unit}]", height=280
        )
        figure["layout"]["xaxis"] |= {"type": "date" if dated else "category"}
        figure["layout"]["annotations"] = [
            note(f"<b>{words.quantity_words(name)}</b>", y=1.0, yanchor="bottom", font={"size": 13, "color": INK})
        ]
        raised = [row for row, _ in points if row.get("raised")]
        figure["layout"]["shapes"] = [
            {"type": "line", "xref": "x", "yref": "paper", "x0": _place(row, dated), "x1": _place(row, dated),
             "y0": 0, "y1": 1, "line": {"color": RED, "width": 1, "dash": "dot"}}
            for row in raised
        ]  # fmt: skip
        charts.append(chart(figure))
    return charts
