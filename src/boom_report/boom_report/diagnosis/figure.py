"""The chart of one recording: each channel measured, before and after, what is left of the difference below each."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from boom_diagnosis.document import BagResult, Channel
from boom_input.channels import PREDICTED, SENSORS, Sensor
from boom_report.channels import heading
from boom_report.panels import QUIET, Json, Panels, band, legend_area, legend_line, line, shaded

Array = NDArray[np.float64]

MEASURED, BEFORE, PARAMETERS, AFTER = "#a3a9b3", "#d9720a", "#8a63b8", "#1257a6"
STAGES = (
    ("nominal", "model before", BEFORE),
    ("parameters_only", "parameters only", PARAMETERS),
    ("explained", "model after", AFTER),
)
_NOISE, _NOISE_EDGE = "rgba(46,133,64,0.16)", "rgba(46,133,64,0.55)"
_WINDOW, _WINDOW_EDGE = "rgba(240,173,32,0.20)", "rgba(190,130,10,0.45)"
_EVENT, _EVENT_EDGE = "rgba(214,69,65,0.13)", "rgba(190,40,40,0.55)"
_HELD_OUT, _HELD_OUT_EDGE = "rgba(18,87,166,0.06)", "rgba(18,87,166,0.35)"
_BAND = 2.0  # standard deviations of sensor noise that the band is wide
_CHANNEL_HEIGHT, _REST_HEIGHT = 150, 96
_INNER_GAP, _OUTER_GAP = 12, 46
_SHAPES = 150  # more shaded stretches than that make a page slow and say nothing more


def figure(bag: BagResult) -> Json:
    """The chart as plotly.js takes it: ``data`` and ``layout``."""
    panels = Panels()
    traces: list[Json] = []
    for sensor in SENSORS:
        if sensor.name in bag.channels:
            traces += _channel(bag.channels[sensor.name], sensor, panels)
    traces += _legend(bag)
    return {"data": traces, "layout": panels.layout(_shapes(bag, panels), bag.duration)}


def _channel(channel: Channel, sensor: Sensor, panels: Panels) -> list[Json]:
    measured = np.where(channel.valid, channel.measured, np.nan)
    upper = panels.add(channel.name, _CHANNEL_HEIGHT, _OUTER_GAP)
    panels.write(channel.name, heading(sensor), x=0, xanchor="left", yanchor="bottom", yshift=3, font={"size": 13})
    traces = [line(channel.time, measured * sensor.shown.scale, upper, "measured", MEASURED, 2.6)]
    return traces + _compared(channel, sensor, panels, measured) if sensor.predicted else traces


def _compared(channel: Channel, sensor: Sensor, panels: Panels, measured: Array) -> list[Json]:
    """The stages in the panel of a channel, and what is left of the difference in one below."""
    upper = panels.suffix(channel.name)
    panels.write(
        channel.name, _said(channel, sensor), x=1, xanchor="right", yanchor="bottom", yshift=3,
        font={"size": 11, "color": QUIET}, name="error",
    )  # fmt: skip
    below = f"{channel.name} rest"
    lower = panels.add(below, _REST_HEIGHT, _INNER_GAP)
    panels.write(
        below, f"model − measured [{sensor.error.name}]", x=0, xanchor="left", yanchor="top", xshift=4, yshift=-1,
        font={"size": 10, "color": QUIET}, bgcolor="rgba(255,255,255,0.8)",
    )  # fmt: skip
    traces = []
    for stage, name, colour in STAGES:
        if stage in channel.stages:
            traces.append(
                _hidden(line(channel.time, channel.stages[stage] * sensor.shown.scale, upper, name, colour, 1.3), stage)
            )
    for stage, name, colour in STAGES:
        if stage in channel.stages:
            rest = (channel.stages[stage] - measured) * sensor.error.scale
            traces.append(_hidden(line(channel.time, rest, lower, name, colour, 0.9), stage))
    return traces


def _hidden(trace: Json, stage: str) -> Json:
    """The stage in between only where its entry in the legend is clicked: three lines on one another say nothing."""
    return trace | {"visible": "legendonly"} if stage == "parameters_only" else trace


def _said(channel: Channel, sensor: Sensor) -> str:
    """Root mean square errors before and after, in the unit of the channel's errors."""
    said = []
    for stage in ("nominal", "explained"):
        if stage in channel.stages:
            error = np.where(channel.valid, channel.stages[stage] - channel.measured, np.nan)
            known = error[np.isfinite(error)]
            said.append(f"{np.sqrt(np.mean(known**2)) * sensor.error.scale:.3g}" if len(known) else "–")
    what = "rms before → after" if len(said) > 1 else "rms"
    return (
        f"{' → '.join(said)} {sensor.error.name} ({what}; noise {channel.noise * sensor.error.scale:.2g})"
        if said
        else ""
    )


def _legend(bag: BagResult) -> list[Json]:
    entries = [legend_line("measured", MEASURED)]
    present = bag.channels[PREDICTED[0].name].stages
    for stage, name, colour in STAGES:
        if stage in present:
            entry = _hidden(legend_line(name, colour), stage)
            entries.append(entry | {"name": f"{name} (click)"} if stage == "parameters_only" else entry)
    entries.append(legend_area(f"noise, ±{_BAND:g} sigma", _NOISE, _NOISE_EDGE))
    if bag.windows:
        entries.append(legend_area("mismatch", _WINDOW, _WINDOW_EDGE))
    if bag.held_out_from is not None:
        entries.append(legend_area("held out", _HELD_OUT, _HELD_OUT_EDGE))
    if any(event.kind != "loss" for event in bag.events):
        entries.append(legend_area("gap or fault", _EVENT, _EVENT_EDGE))
    return entries


def _shapes(bag: BagResult, panels: Panels) -> list[Json]:
    shapes: list[Json] = []
    for sensor in PREDICTED:
        upper, lower = panels.suffix(sensor.name), panels.suffix(f"{sensor.name} rest")
        shapes.append(band(lower, _BAND * bag.channels[sensor.name].noise * sensor.error.scale, _NOISE, _NOISE_EDGE))
        for n in (upper, lower):
            if bag.held_out_from is not None:
                shapes.append(shaded(n, bag.held_out_from, bag.duration, _HELD_OUT, _HELD_OUT_EDGE))
            shapes += [shaded(n, a, b, _WINDOW, _WINDOW_EDGE) for a, b in bag.windows[: _SHAPES // 8]]
    topics = [event for event in bag.events if event.kind != "loss"][: _SHAPES // 8]
    for event in topics:
        for n in (panels.suffix(name) for name in panels.names):
            shapes.append(shaded(n, event.start_s, event.end_s, _EVENT, _EVENT_EDGE))
    return shapes
