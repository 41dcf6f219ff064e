"""Chapter 5.1 of an identification's report: Figs. 5.1-5.4, both valves, orders and delays, the bias of ARX."""

from __future__ import annotations

import numpy as np
from markupsafe import Markup

from boom_identification.identify import Identification
from boom_identification.pilot_static import AveragedTrace, StaticCurve
from boom_identification.pilot_valve import Check, PilotValves, ValveResult
from boom_model.components.pilot_valve import BAR
from boom_report.page import chart
from boom_report.palette import EXTEND, INK, MEASURED, MODEL, MODEL_BAND, OTHER, RETRACT
from boom_report.panels import Json, Panels, legend_line, line
from boom_report.templates import render
from boom_report.xy import band_around, cloud, curve, note, xy

_VALVES = {"retract": RETRACT, "extend": EXTEND}
_EXCERPT = 0.12
"""s of Fig. 5.1."""


def section(result: Identification) -> Markup:
    """HTML; empty where no oscilloscope trace was given."""
    pilot = result.pilot
    if pilot is None:
        return Markup()
    shown = max(
        pilot.traces, key=lambda t: sum(np.count_nonzero(np.diff(s.stationary)) for s in t.stretches), default=None
    )
    return render(
        "boom_report/identification/pilot.html",
        pilot=pilot,
        shown=shown,
        curves=_curves(pilot),
        difference=_difference(pilot),
        bar=BAR,
        chart=chart,
        average=_average,
        stationary=_stationary,
        static=_static,
        bias=_bias,
        compared=_check,
    )


def _average(trace: AveragedTrace) -> Json:
    s = trace.stretches[0]
    middle = len(s.current) // 2
    part = slice(middle, middle + round(_EXCERPT / s.period))
    return xy(
        [
            curve(s.time[part], s.raw_current[part], "measured", MEASURED, width=1.4),
            curve(s.time[part], s.current[part], "average over the PWM period", INK),
        ],
        "time since the start of the trace [s]", "solenoid current [A]", height=300,
        annotations=[note(f"PWM period {trace.window:.2f} samples = {trace.window * s.period * 1e3:.3f} ms")],
    )  # fmt: skip


def _stationary(trace: AveragedTrace) -> Json:
    panels = Panels()
    traces: list[Json] = []
    duration = max(float(s.time[-1]) for s in trace.stretches)
    rows = (("current", "Solenoid current", "A", 1.0), ("pressure", "Pilot control pressure", "bar", 1 / BAR))
    for name, label, unit, scale in rows:
        n = panels.add(name, 190, 46)
        panels.write(
            name, f"<b>{label}</b> [{unit}]", x=0, xanchor="left", yanchor="bottom", yshift=3, font={"size": 13}
        )
        for s in trace.stretches:
            values = getattr(s, name)
            traces.append(line(s.time, getattr(s, f"raw_{name}") * scale, n, "measured", MEASURED, 0.8))
            traces.append(line(s.time, values * scale, n, "average", INK, 1.4))
            points = np.where(s.stationary, values, np.nan)
            traces.append(line(s.time, points * scale, n, "stationary", OTHER, 3.5))
    traces += [legend_line(*entry) for entry in (("measured", MEASURED), ("average", INK), ("stationary", OTHER))]
    return {"data": traces, "layout": panels.layout([], duration)}


def _static(pilot: PilotValves) -> Json:
    shown = pilot.final_curve
    assert shown is not None
    traces = []
    for valve, colour in _VALVES.items():
        own = [t.stationary_points for t in pilot.traces if t.trace.valve == valve]
        if own:
            i, p = (np.concatenate(parts) for parts in zip(*own, strict=True))
            traces.append(cloud(i, p / BAR, f"stationary points, {valve}", colour))
    x = np.linspace(*shown.current_range, 200)
    y = shown.pressure(x) / BAR
    traces.append(band_around(x, y, shown.half_width(x) / BAR, "90 % of h", MODEL_BAND))
    traces.append(curve(x, y, "h", MODEL))
    return xy(traces, "stationary current [A]", "pilot control pressure [bar]", height=440)


def _curves(pilot: PilotValves) -> list[tuple[str, StaticCurve]]:
    named = [(f"stationary points, {valve}", c) for valve, c in pilot.curves.items()]
    named += [("stationary points, both", pilot.curve)] if pilot.curve else []
    named += [("fitted with the linear part (machine file)", pilot.joint[0])] if pilot.joint else []
    return named


def _difference(pilot: PilotValves) -> str:
    """How far the two valves are from each other; empty where one of them is not told."""
    if len(pilot.valves) != 2:
        return ""
    first, second = (v.model for v in pilot.valves)
    said = f"The poles of both valves differ by {100 * abs(first.continuous[0] / second.continuous[0] - 1):.2f} %"
    if len(pilot.curves) == 2:
        a, b = pilot.curves["retract"], pilot.curves["extend"]
        x = np.linspace(max(a.current_range[0], b.current_range[0]), min(a.current_range[1], b.current_range[1]), 50)
        said += f", their static curves by at most {np.abs(a.pressure(x) - b.pressure(x)).max() / BAR:.3f} bar"
    return said + "."


def _bias(valve: ValveResult) -> Json:
    x = np.array([p.noise for p in valve.bias])
    true = valve.model.continuous[0]
    arx = np.array([p.arx_pole for p in valve.bias])
    error = np.array([p.output_error_pole for p in valve.bias])
    return xy(
        [
            curve(x, arx, "ARX", OTHER, mode="lines+markers"),
            curve(x, error, "output error", MODEL, mode="lines+markers"),
            curve(x[[0, -1]], np.full(2, true), "simulated pole", MEASURED, dash="dash"),
        ],
        "output noise [times the measured]", "pole [1/s]", height=300,
    )  # fmt: skip


def _check(check: Check) -> Json:
    panels = Panels()
    upper, lower = panels.add("pressure", 220, 46), panels.add("residual", 110, 12)
    panels.write(
        "pressure",
        "<b>Pilot control pressure</b> p [bar]",
        x=0,
        xanchor="left",
        yanchor="bottom",
        yshift=3,
        font={"size": 13},
    )
    panels.write(
        "residual", "model − measured [bar]", x=0, xanchor="left", yanchor="top", xshift=4, yshift=-1, font={"size": 10}
    )
    traces = [
        line(check.time, check.measured / BAR, upper, "measured (average)", MEASURED, 2.6),
        line(check.time, check.predicted / BAR, upper, "model", MODEL, 1.3),
        line(check.time, (check.predicted - check.measured) / BAR, lower, "model", MODEL, 0.9),
        legend_line("measured (average)", MEASURED),
        legend_line("model", MODEL),
    ]
    layout = panels.layout([], float(np.nanmax(check.time)))
    layout["xaxis"]["range"] = [float(np.nanmin(check.time)), float(np.nanmax(check.time))]
    layout["xaxis2"]["title"]["text"] = "time since the start of the trace [s]"
    return {"data": traces, "layout": layout}
