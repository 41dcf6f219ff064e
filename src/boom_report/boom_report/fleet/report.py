"""The page of a fleet: at a glance, what to look at on Monday morning, each changed machine over time with intervals."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from datetime import datetime
from typing import Any

from boom_report import __version__
from boom_report.fleet import words
from boom_report.page import chart, page
from boom_report.palette import EVENT_EDGE, EXTEND, INK, MEASURED, OTHER, QUIET, RED, RETRACT
from boom_report.templates import render
from boom_report.xy import note, xy

Row = Mapping[str, Any]
_COLOURS = (OTHER, RETRACT, EXTEND, QUIET)


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
    for state, (colour, symbol) in states.items():
        points = [
            (row["time"], m.name, row["recording"])
            for m in found
            for row in m.rows
            if row.get("time") and _state(row) == state
        ]
        traces.append({
            "type": "scatter", "mode": "markers", "name": state, "x": [f"{t:%Y-%m-%d %H:%M}" for t, _, _ in points],
            "y": [name for _, name, _ in points], "text": [text for _, _, text in points],
            "marker": {"color": colour, "symbol": symbol, "size": 10}, "hovertemplate": "%{y} %{text}",
        })  # fmt: skip
    result = xy(traces, "date of the recording", "", height=120 + 22 * len(names))
    result["layout"]["yaxis"] |= {
        "type": "category",
        "categoryorder": "array",
        "categoryarray": names,
        "dtick": 1,
    }
    result["layout"]["xaxis"] |= {"type": "date"}
    return result


def _state(row: Row) -> str:
    if row.get("failure") or row.get("refused") or row.get("unchanged") is None:
        return "refused or failed"
    if row.get("raised"):
        return "raised"
    return "changed before" if row.get("changes") else "unchanged"


def _trends(machine: words.FleetMachine) -> list[Any]:
    """A chart for each quantity of a machine that changed: its size in each recording against the first, 90 % intervals."""
    charts = []
    for k, name in enumerate(dict.fromkeys(c["quantity"] for c in machine.changes)):
        points = [
            (row, level) for row in machine.rows for level in row.get("levels") or [] if level["quantity"] == name
        ]
        if not points:
            continue
        unit, scale = words.unit_of(points[0][1]["unit"])
        trace = {
            "type": "scatter", "mode": "lines+markers", "name": name, "showlegend": False,
            "x": [f"{row['time']:%Y-%m-%d %H:%M}" for row, _ in points], "y": [scale * level["level"] for _, level in points],
            "error_y": {
                "type": "data", "symmetric": False, "thickness": 1.5,
                "array": [scale * (level["level_high"] - level["level"]) for _, level in points],
                "arrayminus": [scale * (level["level"] - level["level_low"]) for _, level in points],
            },
            "line": {"color": _COLOURS[k % len(_COLOURS)], "width": 1.5}, "marker": {"size": 7}, "hovertemplate": "%{y:.4g}",
        }  # fmt: skip
        figure = xy([trace], "date of the recording", f"change [{unit}]", height=280)
        figure["layout"]["xaxis"] |= {"type": "date"}
        figure["layout"]["annotations"] = [
            note(f"<b>{words.quantity_words(name)}</b>", y=1.0, yanchor="bottom", font={"size": 13, "color": INK})
        ]
        raised = [row for row, _ in points if row.get("raised")]
        figure["layout"]["shapes"] = [
            {"type": "line", "xref": "x", "yref": "paper", "x0": f"{row['time']:%Y-%m-%d %H:%M}",
             "x1": f"{row['time']:%Y-%m-%d %H:%M}", "y0": 0, "y1": 1, "line": {"color": RED, "width": 1, "dash": "dot"}}
            for row in raised
        ]  # fmt: skip
        charts.append(chart(figure))
    return charts
