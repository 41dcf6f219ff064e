"""Panels below each other with one time axis, as plotly.js takes them: what the charts of all reports are made of."""

from __future__ import annotations

import base64
from typing import Any

import numpy as np
from numpy.typing import NDArray

from boom_report.decimation import decimate
from boom_report.palette import AXIS, FONT, GRID, PAPER, PLOT

Array = NDArray[np.float64]
Json = dict[str, Any]

_TOP, _BOTTOM = 92, 44


class Panels:
    """Where each panel is: panels of one width below each other, all with the same time axis."""

    def __init__(self) -> None:
        self.names: list[str] = []
        self.spans: list[tuple[int, int]] = []  # px from the top of the drawing area
        self.annotations: list[tuple[int, Json]] = []
        self.axes: list[Json] = []
        self.height = 0

    def add(self, name: str, height: int, gap: int, **axis: Any) -> str:
        """One more panel; returns the suffix of its axes."""
        top = self.height + (gap if self.names else 0)
        self.names.append(name)
        self.spans.append((top, top + height))
        self.axes.append(axis)
        self.height = top + height
        return self.suffix(name)

    def suffix(self, name: str) -> str:
        """What the names of a panel's axes end in."""
        index = self.names.index(name) + 1
        return "" if index == 1 else str(index)

    def write(self, panel: str, text: str, **where: Any) -> None:
        """Text above the panel (``yanchor=bottom``) or in its corner."""
        top, _ = self.spans[self.names.index(panel)]
        self.annotations.append((top, {"text": text, "xref": "paper", "yref": "paper", "showarrow": False, **where}))

    def layout(self, shapes: list[Json], duration: float) -> Json:
        """The layout of the whole chart over ``duration`` [s]."""
        result: Json = {
            "height": self.height + _TOP + _BOTTOM,
            "margin": {"l": 52, "r": 12, "t": _TOP, "b": _BOTTOM},
            "paper_bgcolor": PAPER,
            "plot_bgcolor": PLOT,
            "font": dict(FONT),
            "hovermode": "x",
            "legend": {
                "orientation": "h",
                "x": 0,
                "xanchor": "left",
                "y": 1,
                "yanchor": "bottom",
                "font": {"size": 12},
            },
            "shapes": shapes,
            "annotations": [],
        }
        # Above the first panel's heading, whatever the height of the whole.
        result["legend"]["y"] = 1 + 26 / self.height
        for index, ((top, bottom), axis) in enumerate(zip(self.spans, self.axes, strict=True)):
            n = "" if index == 0 else str(index + 1)
            last = index == len(self.spans) - 1
            result[f"yaxis{n}"] = {
                "domain": [1 - bottom / self.height, 1 - top / self.height], "anchor": f"x{n}", "gridcolor": GRID,
                "zerolinecolor": AXIS, "linecolor": AXIS, "showline": True, "automargin": False, "nticks": 5,
                **axis,
            }  # fmt: skip
            result[f"xaxis{n}"] = {
                "anchor": f"y{n}", "domain": [0, 1], "gridcolor": GRID, "zeroline": False, "linecolor": AXIS,
                "showline": True, "showticklabels": last, "range": [0, max(duration, 1e-3)], "nticks": 12,
            }  # fmt: skip
            if index:
                result[f"xaxis{n}"]["matches"] = "x"
            if last:
                result[f"xaxis{n}"]["title"] = {"text": "time since the start of the recording [s]", "standoff": 6}
        for top, annotation in self.annotations:
            result["annotations"].append({"y": 1 - top / self.height, **annotation})
        return result


def line(time: Array, values: Array, n: str, name: str, colour: str, width: float) -> Json:
    """A line that breaks where values are missing; no entry in the legend (see `legend_line`)."""
    x, y = decimate(time, values)
    return {
        "type": "scatter", "mode": "lines", "x": packed(x), "y": packed(y), "xaxis": f"x{n}", "yaxis": f"y{n}",
        "name": name,
        "legendgroup": name, "showlegend": False, "line": {"color": colour, "width": width}, "connectgaps": False,
        "hovertemplate": "%{y:.5g}",
    }  # fmt: skip


def legend_line(name: str, colour: str) -> Json:
    """An entry of its own in the legend: the lines of a chart are too thin to tell colours, and one stands for several."""
    return {"type": "scatter", "mode": "lines", "x": [None], "y": [None], "name": name, "legendgroup": name,
            "line": {"color": colour, "width": 4}}  # fmt: skip


def legend_area(name: str, fill: str, edge: str) -> Json:
    """An entry in the legend for a shaded area."""
    marker = {"symbol": "square", "size": 12, "color": fill, "line": {"color": edge, "width": 1}}
    return {"type": "scatter", "mode": "markers", "x": [None], "y": [None], "name": name, "marker": marker}


def shaded(n: str, start: float, end: float, fill: str, edge: str) -> Json:
    """A stretch of time [s] shaded over the whole height of panel ``n``."""
    return {
        "type": "rect", "xref": f"x{n}", "yref": f"y{n} domain", "x0": start, "x1": end, "y0": 0, "y1": 1,
        "fillcolor": fill, "line": {"width": 0.7, "color": edge}, "layer": "below",
    }  # fmt: skip


def band(n: str, height: float, fill: str, edge: str) -> Json:
    """A band of +-``height`` over the whole width of panel ``n``."""
    return {
        "type": "rect", "xref": f"x{n} domain", "yref": f"y{n}", "x0": 0, "x1": 1, "y0": -height, "y1": height,
        "fillcolor": fill, "line": {"width": 1, "color": edge, "dash": "dot"},
    }  # fmt: skip


def packed(values: Array) -> Json | list[None]:
    """Single precision is finer than any pixel, and base64 is a third of the text."""
    if len(values) == 0:
        return []
    return {"dtype": "f4", "bdata": base64.b64encode(values.astype("<f4").tobytes()).decode("ascii")}
