"""The chart of one recording: each channel measured and predicted, its residual below, the currents, events shaded."""

from __future__ import annotations

import numpy as np

from boom_identification.validation import BagValidation
from boom_recording.recording import Event
from boom_report.channels import CHANNELS, ShownChannel, ratio
from boom_report.panels import QUIET, RED, Json, Panels, band, legend_area, legend_line, line, shaded

MEASURED, FULL, REDUCED = "#a3a9b3", "#1257a6", "#d9720a"
_RETRACT, _EXTEND = "#7a3e9d", "#0b8a74"
_BAND, _BAND_EDGE = "rgba(46,133,64,0.16)", "rgba(46,133,64,0.55)"
_EVENT, _EVENT_EDGE = "rgba(214,69,65,0.13)", "rgba(190,40,40,0.55)"
_CHANNEL_HEIGHT, _RESIDUAL_HEIGHT, _CURRENT_HEIGHT = 150, 92, 120
_INNER_GAP, _OUTER_GAP = 12, 46
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
    color = RED if times is None or times > 1 else QUIET
    panels.write(
        channel.name, f"full: {said}", x=1, xanchor="right", yanchor="bottom", yshift=3,
        font={"size": 11, "color": color},
        name="error",
    )  # fmt: skip
    below = f"{channel.name} residual"
    lower = panels.add(below, _RESIDUAL_HEIGHT, _INNER_GAP)
    panels.write(
        below, f"model − measured [{channel.error_unit}]", x=0, xanchor="left", yanchor="top", xshift=4, yshift=-1,
        font={"size": 10, "color": QUIET}, bgcolor="rgba(255,255,255,0.8)",
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


def _legend() -> list[Json]:
    """Entries of their own: the lines of the chart are too thin to tell colours, and each stands for several traces."""
    lines = (("measured", MEASURED), ("full model", FULL), ("reduced model", REDUCED),
             ("retract (lower)", _RETRACT), ("extend (lift)", _EXTEND))  # fmt: skip
    entries = [legend_line(name, colour) for name, colour in lines]
    entries.insert(3, entries[2] | {"name": _HIDDEN, "legendgroup": _HIDDEN, "visible": "legendonly"})
    entries.append(legend_area("noise limit", _BAND, _BAND_EDGE))
    entries.append(legend_area("gap or fault", _EVENT, _EVENT_EDGE))
    return entries


def _shapes(bag: BagValidation, panels: Panels) -> list[Json]:
    shapes: list[Json] = []
    for channel in CHANNELS:
        limit = channel.error(bag.limits)
        if limit is None:
            continue
        n, height = panels.suffix(f"{channel.name} residual"), limit * channel.error_scale
        shapes.append(band(n, height, _BAND, _BAND_EDGE))
    for event in [e for e in bag.recording.events if e.kind != "loss"][:_SHAPES]:
        suffixes = [panels.suffix(name) for name in _panels_of(bag, event)]
        shapes += [shaded(n, event.start_s, event.end_s, _EVENT, _EVENT_EDGE) for n in suffixes]
    return shapes


def _panels_of(bag: BagValidation, event: Event) -> list[str]:
    names = [c.name for c in CHANNELS if bag.recording.signals[c.name].topic == event.topic]
    shown = [panel for name in names for panel in (name, f"{name} residual")]
    return ["currents"] if event.topic == bag.recording.signals["retract_current"].topic else shown
