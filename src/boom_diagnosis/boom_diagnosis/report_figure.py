"""The chart of one recording: each channel measured and predicted, its residual below, the currents, events shaded."""

from __future__ import annotations

import base64
from typing import Any

import numpy as np
from numpy.typing import NDArray

from boom_diagnosis.report_channels import CHANNELS, ShownChannel, ratio
from boom_diagnosis.report_decimation import decimate
from boom_diagnosis.validation import BagValidation
from boom_recording.recording import Event

Array = NDArray[np.float64]
Json = dict[str, Any]

MEASURED, FULL, REDUCED = "#a3a9b3", "#1257a6", "#d9720a"
_RETRACT, _EXTEND = "#7a3e9d", "#0b8a74"
_BAND, _BAND_EDGE = "rgba(46,133,64,0.16)", "rgba(46,133,64,0.55)"
_EVENT, _EVENT_EDGE = "rgba(214,69,65,0.13)", "rgba(190,40,40,0.55)"
_TEXT, _QUIET, _RED = "#1f2933", "#5b6570", "#b3261e"
_CHANNEL_HEIGHT, _RESIDUAL_HEIGHT, _CURRENT_HEIGHT = 150, 92, 120
_INNER_GAP, _OUTER_GAP, _TOP, _BOTTOM = 12, 46, 92, 44
# Ten times as large as the full model's, it would flatten that one: drawn when its entry in the legend is clicked.
_HIDDEN_OF, _HIDDEN = "reduced model", "reduced − measured (click)"
_SHAPES = 150  # more shaded events than that make a page slow and say nothing more


def figure(bag: BagValidation) -> Json:
    """The chart as plotly.js takes it: ``data`` and ``layout``."""
    panels = Panels()
    traces: list[Json] = []
    for channel in CHANNELS:
        traces += _channel(bag, channel, panels)
    traces += _currents(bag, panels)
    traces += _legend()
    return {"data": traces, "layout": panels.layout(_shapes(bag, panels), bag.recording.duration)}


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
        """What plotly puts behind the names of the panel's axes."""
        index = self.names.index(name) + 1
        return "" if index == 1 else str(index)

    def write(self, panel: str, text: str, **where: Any) -> None:
        """Text above the panel (``yanchor=bottom``) or in its corner."""
        top, _ = self.spans[self.names.index(panel)]
        self.annotations.append((top, {"text": text, "xref": "paper", "yref": "paper", "showarrow": False, **where}))

    def layout(self, shapes: list[Json], duration: float) -> Json:
        """Plotly's layout of all panels; duration [s] of the time axis."""
        result: Json = {
            "height": self.height + _TOP + _BOTTOM,
            "margin": {"l": 52, "r": 12, "t": _TOP, "b": _BOTTOM},
            "paper_bgcolor": "#ffffff",
            "plot_bgcolor": "#fbfcfd",
            "font": {"family": "system-ui, 'Segoe UI', Roboto, Arial, sans-serif", "size": 12, "color": _TEXT},
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
                "domain": [1 - bottom / self.height, 1 - top / self.height], "anchor": f"x{n}", "gridcolor": "#e4e8ec",
                "zerolinecolor": "#c9d0d6", "linecolor": "#c9d0d6", "showline": True, "automargin": False, "nticks": 5,
                **axis,
            }  # fmt: skip
            result[f"xaxis{n}"] = {
                "anchor": f"y{n}", "domain": [0, 1], "gridcolor": "#e4e8ec", "zeroline": False, "linecolor": "#c9d0d6",
                "showline": True, "showticklabels": last, "range": [0, max(duration, 1e-3)], "nticks": 12,
            }  # fmt: skip
            if index:
                result[f"xaxis{n}"]["matches"] = "x"
            if last:
                result[f"xaxis{n}"]["title"] = {"text": "time since the start of the recording [s]", "standoff": 6}
        for top, annotation in self.annotations:
            result["annotations"].append({"y": 1 - top / self.height, **annotation})
        return result


def _channel(bag: BagValidation, channel: ShownChannel, panels: Panels) -> list[Json]:
    signal = bag.recording.signals[channel.name]
    measured = np.where(signal.valid, signal.values, np.nan)
    upper = panels.add(channel.name, _CHANNEL_HEIGHT, _OUTER_GAP)
    error, limit, times = channel.error(bag.full.metrics), channel.error(bag.limits), ratio(channel, bag)
    label = f"<b>{channel.label.capitalize()}</b> {channel.symbol} [{channel.unit}]"
    panels.write(channel.name, label, x=0, xanchor="left", yanchor="bottom", yshift=3, font={"size": 13})
    said = channel.error_text(error)
    if times is not None and limit is not None:
        said += f" (limit {channel.error_text(limit).removesuffix(' ' + channel.statistic)})"
    color = _RED if times is None or times > 1 else _QUIET
    panels.write(
        channel.name, f"full: {said}", x=1, xanchor="right", yanchor="bottom", yshift=3,
        font={"size": 11, "color": color},
        name="error",
    )  # fmt: skip
    below = f"{channel.name} residual"
    lower = panels.add(below, _RESIDUAL_HEIGHT, _INNER_GAP)
    panels.write(
        below, f"model − measured [{channel.error_unit}]", x=0, xanchor="left", yanchor="top", xshift=4, yshift=-1,
        font={"size": 10, "color": _QUIET}, bgcolor="rgba(255,255,255,0.8)",
    )  # fmt: skip
    traces = [line(signal.time, measured * channel.scale, upper, "measured", MEASURED, 2.6)]
    models = ((bag.reduced, "reduced model", REDUCED, 1.2), (bag.full, "full model", FULL, 1.3))
    for prediction, name, colour, width in models:
        values = prediction.values[channel.name]
        traces.append(line(signal.time, values * channel.scale, upper, name, colour, width))
    for prediction, name, colour, _ in models:
        residual = (prediction.values[channel.name] - measured) * channel.error_scale
        trace = line(signal.time, residual, lower, name, colour, 0.9)
        if name == _HIDDEN_OF:
            trace |= {"legendgroup": _HIDDEN, "visible": "legendonly"}
        traces.append(trace)
    return traces


def _currents(bag: BagValidation, panels: Panels) -> list[Json]:
    n = panels.add("currents", _CURRENT_HEIGHT, _OUTER_GAP, rangemode="tozero")
    panels.write(
        "currents",
        "<b>Solenoid currents</b> measured [A]",
        x=0,
        xanchor="left",
        yanchor="bottom",
        yshift=3,
        font={"size": 13},
    )
    traces = []
    for name, label, colour in (
        ("retract_current", "retract (lower)", _RETRACT),
        ("extend_current", "extend (lift)", _EXTEND),
    ):
        signal = bag.recording.signals[name]
        trace = line(signal.time, np.where(signal.valid, signal.values, np.nan), n, label, colour, 1.2)
        traces.append(trace | {"line": {"color": colour, "width": 1.2, "shape": "hv"}})
    return traces


def line(time: Array, values: Array, n: str, name: str, colour: str, width: float) -> Json:
    """A trace in the panel with the suffix `n`: time [s] and values (m,), decimated; NaN breaks the line."""
    x, y = decimate(time, values)
    return {
        "type": "scatter", "mode": "lines", "x": packed(x), "y": packed(y), "xaxis": f"x{n}", "yaxis": f"y{n}",
        "name": name,
        "legendgroup": name, "showlegend": False, "line": {"color": colour, "width": width}, "connectgaps": False,
        "hovertemplate": "%{y:.5g}",
    }  # fmt: skip


def _legend() -> list[Json]:
    """Entries of their own: the lines of the chart are too thin to tell colours, and each stands for several traces."""
    lines = (("measured", MEASURED), ("full model", FULL), ("reduced model", REDUCED),
             ("retract (lower)", _RETRACT), ("extend (lift)", _EXTEND))  # fmt: skip
    entries: list[Json] = [
        {"type": "scatter", "mode": "lines", "x": [None], "y": [None], "name": name, "legendgroup": name,
         "line": {"color": colour, "width": 4}}
        for name, colour in lines
    ]  # fmt: skip
    entries.insert(3, entries[2] | {"name": _HIDDEN, "legendgroup": _HIDDEN, "visible": "legendonly"})
    for name, fill, edge in (("noise limit", _BAND, _BAND_EDGE), ("gap or fault", _EVENT, _EVENT_EDGE)):
        marker = {"symbol": "square", "size": 12, "color": fill, "line": {"color": edge, "width": 1}}
        entries.append({"type": "scatter", "mode": "markers", "x": [None], "y": [None], "name": name, "marker": marker})
    return entries


def _shapes(bag: BagValidation, panels: Panels) -> list[Json]:
    shapes: list[Json] = []
    for channel in CHANNELS:
        limit = channel.error(bag.limits)
        if limit is None:
            continue
        n, height = panels.suffix(f"{channel.name} residual"), limit * channel.error_scale
        shapes.append(
            {"type": "rect", "xref": f"x{n} domain", "yref": f"y{n}", "x0": 0, "x1": 1, "y0": -height, "y1": height,
             "fillcolor": _BAND, "line": {"width": 1, "color": _BAND_EDGE, "dash": "dot"}}
        )  # fmt: skip
    for event in [e for e in bag.recording.events if e.kind != "loss"][:_SHAPES]:
        shapes += [_shaded(event, panels.suffix(name)) for name in _panels_of(bag, event)]
    return shapes


def _panels_of(bag: BagValidation, event: Event) -> list[str]:
    names = [c.name for c in CHANNELS if bag.recording.signals[c.name].topic == event.topic]
    shown = [panel for name in names for panel in (name, f"{name} residual")]
    return ["currents"] if event.topic == bag.recording.signals["retract_current"].topic else shown


def _shaded(event: Event, n: str) -> Json:
    return {
        "type": "rect", "xref": f"x{n}", "yref": f"y{n} domain", "x0": event.start_s, "x1": event.end_s, "y0": 0,
        "y1": 1, "fillcolor": _EVENT, "line": {"width": 0.7, "color": _EVENT_EDGE}, "layer": "below",
    }  # fmt: skip


def packed(values: Array) -> Json | list[None]:
    """Single precision is finer than any pixel, and base64 is a third of the text."""
    if len(values) == 0:
        return []
    return {"dtype": "f4", "bdata": base64.b64encode(values.astype("<f4").tobytes()).decode("ascii")}
