"""The chart of one recording: each channel measured and predicted, its residual below, the currents, events shaded.

A channel that the model does not predict is drawn as it was measured, where the recording has it; so are other joints that move.
"""

from __future__ import annotations

import numpy as np

from boom_identification.validation import BagValidation
from boom_input.channels import CURRENTS, JOINTS, PREDICTED, SENSORS, Sensor
from boom_recording.joint_motion import moving_joints
from boom_recording.recording import Event
from boom_report import channel_panels as common
from boom_report.channel_panels import Curve, compared, measured, rest, title
from boom_report.channels import error_text, ratio, statistic
from boom_report.palette import (
    EVENT,
    EVENT_EDGE,
    EXTEND,
    JOINT_COLOURS,
    MEASURED,
    MODEL,
    NOISE,
    NOISE_EDGE,
    OTHER,
    QUIET,
    RED,
    RETRACT,
)
from boom_report.panels import Json, Panels, band, legend_area, legend_line, line, shaded

_RESIDUAL_HEIGHT, _CURRENT_HEIGHT = 92, 120
# Ten times as large as the full model's, it would flatten that one: drawn when its entry in the legend is clicked.
_HIDDEN: Json = {"legendgroup": "reduced − measured (click)", "visible": "legendonly"}


def figure(bag: BagValidation) -> Json:
    """The chart as plotly.js takes it: ``data`` and ``layout``."""
    panels = Panels()
    traces: list[Json] = []
    for sensor in SENSORS:
        if sensor.name in bag.recording.signals:
            traces += _channel(bag, sensor, panels)
    traces += _currents(bag, panels)
    traces += _joints(bag, panels)
    traces += _legend()
    return {"data": traces, "layout": panels.layout(_shapes(bag, panels), bag.recording.duration)}


def _channel(bag: BagValidation, sensor: Sensor, panels: Panels) -> list[Json]:
    signal = bag.recording.signals[sensor.name]
    values = np.where(signal.valid, signal.values, np.nan)
    traces = measured(panels, sensor, signal.time, values)
    if not sensor.predicted:
        return traces
    limit, times = bag.limits[sensor.judging], ratio(sensor, bag)
    said = f"full: {error_text(sensor, bag.full.metrics[sensor.judging])}"
    if times is not None and limit is not None:
        said += f" (limit {error_text(sensor, limit).removesuffix(' ' + statistic(sensor))})"
    colour = RED if times is None or times > 1 else QUIET
    curves = [
        Curve("reduced model", OTHER, 1.2, bag.reduced.values[sensor.name], below=_HIDDEN),
        Curve("full model", MODEL, 1.3, bag.full.values[sensor.name]),
    ]
    return traces + compared(panels, sensor, signal.time, values, curves, said, _RESIDUAL_HEIGHT, colour)


def _currents(bag: BagValidation, panels: Panels) -> list[Json]:
    n = panels.add("currents", _CURRENT_HEIGHT, common.OUTER_GAP, rangemode="tozero")
    title(panels, "currents", "<b>Solenoid currents</b> measured [A]")
    traces = []
    for name, label, colour in (
        ("retract_current", "retract (lower)", RETRACT),
        ("extend_current", "extend (lift)", EXTEND),
    ):
        signal = bag.recording.signals[name]
        trace = line(signal.time, np.where(signal.valid, signal.values, np.nan), n, label, colour, 1.2)
        traces.append(trace | {"line": {"color": colour, "width": 1.2, "shape": "hv"}})
    return traces


def _joints(bag: BagValidation, panels: Panels) -> list[Json]:
    """Where the other joints are; nothing where they stand still. The heading is the legend: three lines are enough for it."""
    if not moving_joints(bag.recording):
        return []
    shown = [joint for joint in JOINTS if joint.field == "position" and joint.name in bag.recording.signals]
    words = (
        f'<span style="color:{JOINT_COLOURS[joint.joint]}">{joint.joint.replace("_", " ")} [{joint.unit}]</span>'
        for joint in shown
    )
    n = panels.add("joints", _CURRENT_HEIGHT, common.OUTER_GAP)
    title(panels, "joints", f"<b>Other joints</b><br>{', '.join(words)}")
    signals = [bag.recording.signals[joint.name] for joint in shown]
    return [
        line(s.time, np.where(s.valid, s.values, np.nan), n, joint.joint, JOINT_COLOURS[joint.joint], 1.4)
        for joint, s in zip(shown, signals, strict=True)
    ]


def _legend() -> list[Json]:
    """Entries of their own: the lines of the chart are too thin to tell colours, and each stands for several traces."""
    lines = (("measured", MEASURED), ("full model", MODEL), ("reduced model", OTHER),
             ("retract (lower)", RETRACT), ("extend (lift)", EXTEND))  # fmt: skip
    entries = [legend_line(name, colour) for name, colour in lines]
    entries.insert(3, entries[2] | {"name": _HIDDEN["legendgroup"]} | _HIDDEN)
    entries.append(legend_area("noise limit", NOISE, NOISE_EDGE))
    entries.append(legend_area("gap or fault", EVENT, EVENT_EDGE))
    return entries


def _shapes(bag: BagValidation, panels: Panels) -> list[Json]:
    shapes: list[Json] = []
    for sensor in PREDICTED:
        limit = bag.limits[sensor.judging]
        if limit is None:
            continue
        n, height = panels.suffix(rest(sensor)), limit * sensor.error.scale
        shapes.append(band(n, height, NOISE, NOISE_EDGE))
    for event in [e for e in bag.recording.events if e.kind != "loss"][: common.SHAPES]:
        suffixes = [panels.suffix(name) for name in _panels_of(panels, event)]
        shapes += [shaded(n, event.start_s, event.end_s, EVENT, EVENT_EDGE) for n in suffixes]
    return shapes


def _panels_of(panels: Panels, event: Event) -> list[str]:
    if event.topic == CURRENTS[0].topic:
        return ["currents"]
    shown = [panel for sensor in SENSORS if sensor.topic == event.topic for panel in (sensor.name, rest(sensor))]
    return [panel for panel in shown if panel in panels.names]
