"""The chart of one recording: each channel measured, before and after, what is left of the difference below each."""

from __future__ import annotations

import numpy as np

from boom_diagnosis.document import BagResult, ChannelFit
from boom_input.channels import PREDICTED, SENSORS, Sensor
from boom_report import channel_panels as common
from boom_report.channel_panels import Curve, compared, measured, rest
from boom_report.palette import (
    BETWEEN,
    EVENT,
    EVENT_EDGE,
    HELD_OUT,
    HELD_OUT_EDGE,
    MEASURED,
    MODEL,
    NOISE,
    NOISE_EDGE,
    OTHER,
    WINDOW,
    WINDOW_EDGE,
)
from boom_report.panels import Json, Panels, band, legend_area, legend_line, shaded

STAGES = (
    ("nominal", "model before", OTHER),
    ("parameters_only", "parameters only", BETWEEN),
    ("explained", "model after", MODEL),
)
_BAND = 2.0  # standard deviations of sensor noise that the band is wide
_REST_HEIGHT = 96


def figure(bag: BagResult) -> Json:
    """The chart as plotly.js takes it: ``data`` and ``layout``."""
    panels = Panels()
    traces: list[Json] = []
    for sensor in SENSORS:
        if sensor.name in bag.channels:
            traces += _channel(bag.channels[sensor.name], sensor, panels)
    traces += _legend(bag)
    return {"data": traces, "layout": panels.layout(_shapes(bag, panels), bag.duration)}


def _channel(channel: ChannelFit, sensor: Sensor, panels: Panels) -> list[Json]:
    values = np.where(channel.valid, channel.measured, np.nan)
    traces = measured(panels, sensor, channel.time, values)
    if not sensor.predicted:
        return traces
    curves = [
        Curve(name, colour, 1.3, channel.stages[stage], _hidden(stage), _hidden(stage))
        for stage, name, colour in STAGES
        if stage in channel.stages
    ]
    return traces + compared(panels, sensor, channel.time, values, curves, _said(channel, sensor), _REST_HEIGHT)


def _hidden(stage: str) -> Json:
    """The stage in between only where its entry in the legend is clicked: three lines on one another say nothing."""
    return {"visible": "legendonly"} if stage == "parameters_only" else {}


def _said(channel: ChannelFit, sensor: Sensor) -> str:
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
            entry = legend_line(name, colour) | _hidden(stage)
            entries.append(entry | {"name": f"{name} (click)"} if stage == "parameters_only" else entry)
    entries.append(legend_area(f"noise, ±{_BAND:g} sigma", NOISE, NOISE_EDGE))
    if bag.windows:
        entries.append(legend_area("mismatch", WINDOW, WINDOW_EDGE))
    if bag.held_out_from is not None:
        entries.append(legend_area("held out", HELD_OUT, HELD_OUT_EDGE))
    if any(event.kind != "loss" for event in bag.events):
        entries.append(legend_area("gap or fault", EVENT, EVENT_EDGE))
    return entries


def _shapes(bag: BagResult, panels: Panels) -> list[Json]:
    shapes: list[Json] = []
    for sensor in PREDICTED:
        upper, lower = panels.suffix(sensor.name), panels.suffix(rest(sensor))
        shapes.append(band(lower, _BAND * bag.channels[sensor.name].noise * sensor.error.scale, NOISE, NOISE_EDGE))
        for n in (upper, lower):
            if bag.held_out_from is not None:
                shapes.append(shaded(n, bag.held_out_from, bag.duration, HELD_OUT, HELD_OUT_EDGE))
            shapes += [shaded(n, a, b, WINDOW, WINDOW_EDGE) for a, b in bag.windows[: common.SHAPES // 8]]
    topics = [event for event in bag.events if event.kind != "loss"][: common.SHAPES // 8]
    for event in topics:
        for n in (panels.suffix(name) for name in panels.names):
            shapes.append(shaded(n, event.start_s, event.end_s, EVENT, EVENT_EDGE))
    return shapes
