"""The chart of one recording: each channel measured and predicted, its residual below, the currents, events shaded.

A channel that the model does not predict is drawn as it was measured, where the recording has it.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from boom_identification.validation import BagValidation
from boom_input.channels import CURRENTS, PREDICTED, SENSORS, Sensor, of_topic
from boom_recording.recording import Event
from boom_report.channels import error_text, heading, judging, ratio, statistic
from boom_report.panels import QUIET, RED, Json, Panels, band, legend_area, legend_line, line, shaded

Array = NDArray[np.float64]

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
    for sensor in SENSORS:
        if sensor.name in bag.recording.signals:
            traces += _channel(bag, sensor, panels)
    traces += _currents(bag, panels)
    traces += _legend()
    return {"data": traces, "layout": panels.layout(_shapes(bag, panels), bag.recording.duration)}


def _channel(bag: BagValidation, sensor: Sensor, panels: Panels) -> list[Json]:
    signal = bag.recording.signals[sensor.name]
    measured = np.where(signal.valid, signal.values, np.nan)
    upper = panels.add(sensor.name, _CHANNEL_HEIGHT, _OUTER_GAP)
    panels.write(sensor.name, heading(sensor), x=0, xanchor="left", yanchor="bottom", yshift=3, font={"size": 13})
    traces = [line(signal.time, measured * sensor.shown.scale, upper, "measured", MEASURED, 2.6)]
    return traces + _compared(bag, sensor, panels, measured) if sensor.predicted else traces


def _compared(bag: BagValidation, channel: Sensor, panels: Panels, measured: Array) -> list[Json]:
    """Both models in the panel of a channel, and their residuals in one below."""
    upper, time = panels.suffix(channel.name), bag.recording.signals[channel.name].time
    error, limit, times = bag.full.metrics[judging(channel)], bag.limits[judging(channel)], ratio(channel, bag)
    said = error_text(channel, error)
    if times is not None and limit is not None:
        said += f" (limit {error_text(channel, limit).removesuffix(' ' + statistic(channel))})"
    color = RED if times is None or times > 1 else QUIET
    panels.write(
        channel.name, f"full: {said}", x=1, xanchor="right", yanchor="bottom", yshift=3,
        font={"size": 11, "color": color},
        name="error",
    )  # fmt: skip
    below = f"{channel.name} residual"
    lower = panels.add(below, _RESIDUAL_HEIGHT, _INNER_GAP)
    panels.write(
        below, f"model − measured [{channel.error.name}]", x=0, xanchor="left", yanchor="top", xshift=4, yshift=-1,
        font={"size": 10, "color": QUIET}, bgcolor="rgba(255,255,255,0.8)",
    )  # fmt: skip
    traces = []
    models = ((bag.reduced, "reduced model", REDUCED, 1.2), (bag.full, "full model", FULL, 1.3))
    for prediction, name, colour, width in models:
        values = prediction.values[channel.name]
        traces.append(line(time, values * channel.shown.scale, upper, name, colour, width))
    for prediction, name, colour, _ in models:
        residual = (prediction.values[channel.name] - measured) * channel.error.scale
        trace = line(time, residual, lower, name, colour, 0.9)
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
    for sensor in PREDICTED:
        limit = bag.limits[judging(sensor)]
        if limit is None:
            continue
        n, height = panels.suffix(f"{sensor.name} residual"), limit * sensor.error.scale
        shapes.append(band(n, height, _BAND, _BAND_EDGE))
    for event in [e for e in bag.recording.events if e.kind != "loss"][:_SHAPES]:
        suffixes = [panels.suffix(name) for name in _panels_of(panels, event)]
        shapes += [shaded(n, event.start_s, event.end_s, _EVENT, _EVENT_EDGE) for n in suffixes]
    return shapes


def _panels_of(panels: Panels, event: Event) -> list[str]:
    if event.topic == CURRENTS[0].topic:
        return ["currents"]
    names = [channel.name for channel in of_topic(event.topic)]
    return [panel for name in names for panel in (name, f"{name} residual") if panel in panels.names]
