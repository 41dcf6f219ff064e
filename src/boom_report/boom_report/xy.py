"""Charts of one quantity over another: points measured, curves fitted, bands of 90 %."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from boom_report.palette import AXIS, FONT, GRID, INK, PAPER, PLOT, QUIET, VEIL
from boom_report.panels import packed

Array = NDArray[np.float64]
Json = dict[str, Any]

_ROW = 32  # px
MOST_POINTS = 4000
"""A cloud; more of them are drawn over each other."""


def xy(traces: list[Json], x_title: str, y_title: str, *, height: int = 400, **layout: Any) -> Json:
    """A chart as plotly.js takes it; titles with units, ``layout`` goes over the usual one."""
    axis = {"gridcolor": GRID, "zerolinecolor": AXIS, "linecolor": AXIS, "showline": True, "automargin": True}
    return {
        "data": traces,
        "layout": {
            "height": height,
            "margin": {"l": 60, "r": 12, "t": 56, "b": 48},
            "paper_bgcolor": PAPER,
            "plot_bgcolor": PLOT,
            "font": dict(FONT),
            "hovermode": "closest",
            "legend": {"orientation": "h", "x": 0, "xanchor": "left", "y": 1.02, "yanchor": "bottom"},
            "annotations": [],
            "shapes": [],
            "xaxis": {**axis, "title": {"text": x_title, "standoff": 6}, "nticks": 10},
            "yaxis": {**axis, "title": {"text": y_title, "standoff": 6}, "nticks": 7},
        }
        | layout,
    }


def rows_of(traces: list[Json], names: list[str], x_title: str) -> Json:
    """A chart with a row for each name, written above what is drawn at its number, and a dotted line at 1."""
    figure = xy(traces, x_title, "", height=_ROW * len(names) + 84)
    layout = figure["layout"]
    layout["margin"] = {"l": 12, "r": 12, "t": 20, "b": 48}
    layout["yaxis"] |= {"tickvals": [], "showgrid": False, "zeroline": False, "range": [len(names) - 0.4, -0.8]}
    dotted = {"color": INK, "width": 1.2, "dash": "dot"}
    layout["shapes"] = [{"type": "line", "x0": 1, "x1": 1, "yref": "paper", "y0": 0, "y1": 1, "line": dotted}]
    font = {"size": 11, "color": INK}
    layout["annotations"] = [
        note(name, x=0.0, y=k - 0.3, yref="y", yanchor="bottom", font=font) for k, name in enumerate(names)
    ]
    return figure


def cloud(x: Array, y: Array, name: str, colour: str, size: float = 4.0) -> Json:
    """Measured points; evenly thinned out where they are too many."""
    kept = np.linspace(0, len(x) - 1, MOST_POINTS).astype(int) if len(x) > MOST_POINTS else np.arange(len(x))
    marker = {"size": size, "color": colour, "opacity": 0.55}
    return {"type": "scatter", "mode": "markers", "x": packed(x[kept]), "y": packed(y[kept]), "name": name,
            "marker": marker, "hovertemplate": "%{x:.4g}, %{y:.4g}"}  # fmt: skip


def curve(x: Array, y: Array, name: str, colour: str, *, width: float = 2.2, dash: str = "solid", **more: Any) -> Json:
    """A line through (x, y), broken where a value is missing."""
    shown = {"type": "scatter", "mode": "lines", "x": packed(x), "y": packed(y), "name": name, "connectgaps": False,
             "line": {"color": colour, "width": width, "dash": dash}, "hovertemplate": "%{x:.4g}, %{y:.4g}"}  # fmt: skip
    return shown | more


def band_around(x: Array, y: Array, half: Array, name: str, fill: str) -> Json:
    """The area y +- half (n,)."""
    return {"type": "scatter", "mode": "lines", "x": packed(np.concatenate((x, x[::-1]))),
            "y": packed(np.concatenate((y + half, (y - half)[::-1]))), "fill": "toself", "fillcolor": fill,
            "line": {"width": 0}, "name": name, "hoverinfo": "skip"}  # fmt: skip


def zone(low: float, high: float, fill: str) -> Json:
    """A range of the abscissa, shaded over the whole height."""
    return {"type": "rect", "xref": "x", "yref": "paper", "x0": low, "x1": high, "y0": 0, "y1": 1, "fillcolor": fill,
            "line": {"width": 0}, "layer": "below"}  # fmt: skip


def note(text: str, **where: Any) -> Json:
    """Small text in the chart, by default in its upper left corner."""
    return {"text": text, "xref": "paper", "yref": "paper", "x": 0.01, "y": 0.99, "xanchor": "left", "yanchor": "top",
            "showarrow": False, "font": {"size": 11, "color": QUIET}, "bgcolor": VEIL,
            **where}  # fmt: skip
