"""Chapter 5.1 of an identification's report: Figs. 5.1-5.4, both valves, orders and delays, the bias of ARX."""

from __future__ import annotations

from html import escape

import numpy as np

from boom_identification.identify import Identification
from boom_identification.pilot_dynamics import FirstOrder
from boom_identification.pilot_static import AveragedTrace
from boom_identification.pilot_valve import Check, PilotValves, ValveResult
from boom_model.components.pilot_valve import BAR
from boom_report.channels import number
from boom_report.page import chart
from boom_report.panels import Json, Panels, legend_line, line
from boom_report.xy import band_around, cloud, curve, note, xy

_RAW, _MEAN, _POINTS, _MODEL = "#b9c0c8", "#1257a6", "#c2410c", "#d9720a"
_VALVES = {"retract": "#7a3e9d", "extend": "#0b8a74"}
_EXCERPT = 0.12
"""s of Fig. 5.1."""


def section(result: Identification) -> str:
    """HTML; empty where no oscilloscope trace was given."""
    pilot = result.pilot
    if pilot is None:
        return ""
    parts = [f"<h2>Pilot valves (ch. 5.1)</h2>{_sentence(pilot)}"]
    if pilot.traces:
        shown = max(pilot.traces, key=lambda t: sum(np.count_nonzero(np.diff(s.stationary)) for s in t.stretches))
        parts.append(
            f"<h3>Fig. 5.1: current and its average, {escape(shown.trace.name)}</h3>{chart(_average(shown))}"
            f"<h3>Fig. 5.2: stationary points (5.1), {escape(shown.trace.name)}</h3>{chart(_stationary(shown))}"
        )
    if pilot.curve is not None:
        parts.append(f"<h3>Fig. 5.3: static curve h</h3>{chart(_static(pilot))}{_curves(pilot)}")
    if pilot.valves:
        parts.append(f"<h3>Linear part, both valves</h3>{_valves(pilot)}")
        for valve in pilot.valves:
            parts.append(
                f"<h3>Bias of ARX, {valve.valve} valve</h3>{chart(_bias(valve))}"
                "<p class=note>Output simulated by the model found, on the measured current, with white noise of so many times "
                "the measured size, not averaged. ARX has the noisy output in its regressor and loses the pole; the output error "
                "does not.</p>"
                f"<details><summary>Orders and delays compared, {valve.valve} valve</summary>{_candidates(valve)}</details>"
            )
    checks = [c for c in pilot.checks if c.held_out] or list(pilot.checks)
    for check in checks:
        parts.append(
            f"<h3>Fig. 5.4: {escape(check.trace)}, {'held out' if check.held_out else 'used in the fit'}: "
            f"{check.rms / BAR:.3f} bar rms</h3>{chart(_check(check))}"
        )
    if pilot.checks:
        parts.append(_check_table(pilot))
    return f"<section class=card>{''.join(parts)}</section>"


def _sentence(pilot: PilotValves) -> str:
    if pilot.joint is None:
        return "<p>The traces do not tell the linear part; see above for the reasons.</p>"
    curve_found, model = pilot.joint
    low, high = model.intervals()[0]
    h = curve_found.h
    return (
        f"<p>Pole {model.continuous[0]:.2f} 1/s (90 %: {-high:.2f} .. {-low:.2f}), time constant "
        f"{1e3 / model.continuous[0]:.1f} ms; h(x) = {h[0]:.2f} x² {h[1]:+.3f} x {h[2]:+.3f} bar, seen from "
        f"{curve_found.current_range[0]:.3f} A to {curve_found.current_range[1]:.3f} A. The thesis found 19.67 1/s and "
        "76.1 x² − 0.58 x + 0.247.</p>"
    )


def _average(trace: AveragedTrace) -> Json:
    s = trace.stretches[0]
    middle = len(s.current) // 2
    part = slice(middle, middle + round(_EXCERPT / s.period))
    return xy(
        [
            curve(s.time[part], s.raw_current[part], "measured", _RAW, width=1.4),
            curve(s.time[part], s.current[part], "average over the PWM period", _MEAN),
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
            traces.append(line(s.time, getattr(s, f"raw_{name}") * scale, n, "measured", _RAW, 0.8))
            traces.append(line(s.time, values * scale, n, "average", _MEAN, 1.4))
            points = np.where(s.stationary, values, np.nan)
            traces.append(line(s.time, points * scale, n, "stationary", _POINTS, 3.5))
    traces += [legend_line(*entry) for entry in (("measured", _RAW), ("average", _MEAN), ("stationary", _POINTS))]
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
    traces.append(band_around(x, y, shown.half_width(x) / BAR, "90 % of h", "rgba(18,87,166,0.25)"))
    traces.append(curve(x, y, "h", _MEAN))
    return xy(traces, "stationary current [A]", "pilot control pressure [bar]", height=440)


def _curves(pilot: PilotValves) -> str:
    rows = []
    named = [(f"stationary points, {valve}", c) for valve, c in pilot.curves.items()]
    named += [("stationary points, both", pilot.curve)] if pilot.curve else []
    named += [("fitted with the linear part (machine file)", pilot.joint[0])] if pilot.joint else []
    for name, c in named:
        cells = "".join(f"<td class=n>{v:.3f}</td>" for v in c.h)
        rows.append(
            f"<tr><td>{name}</td>{cells}<td class=n>{c.residual / BAR:.3f}</td><td class=n>{c.groups}</td></tr>"
        )
    rows.append(
        "<tr><td>thesis (5.2)</td><td class=n>76.1</td><td class=n>-0.58</td><td class=n>0.247</td><td class=n>–</td>"
        "<td></td></tr>"
    )
    return (
        "<div class=scroll><table class=compact><thead><tr><th>h</th><th class=n>h<sub>0</sub> [bar/A²]</th>"
        "<th class=n>h<sub>1</sub> [bar/A]</th><th class=n>h<sub>2</sub> [bar]</th><th class=n>residual [bar rms]</th>"
        f"<th class=n>stretches</th></tr></thead><tbody>{''.join(rows)}</tbody></table></div>"
    )


def _valves(pilot: PilotValves) -> str:
    rows = []
    for valve in pilot.valves:
        used = f"{valve.valve} ({escape(valve.training)}{', first two thirds' if valve.split else ''})"
        rows.append(_model_row(used, "ARX (5.4), samples as measured", valve.arx_raw))
        rows.append(_model_row(used, "ARX (5.4), averaged as the thesis", valve.arx))
        rows.append(_model_row(used, "output error, averaged", valve.model))
    if pilot.joint is not None:
        rows.append(_model_row("all traces", "output error with h (machine file)", pilot.joint[1]))
    rows.append(
        "<tr><td>thesis (5.7)</td><td></td><td class=n>19.67</td><td class=n></td><td class=n>20.23</td>"
        "<td class=n>-0.0285</td><td class=n>1.0000</td></tr>"
    )
    same = ""
    if len(pilot.valves) == 2:
        first, second = (v.model for v in pilot.valves)
        difference = abs(first.continuous[0] / second.continuous[0] - 1)
        same = f"<p>The poles of both valves differ by {100 * difference:.2f} %"
        if len(pilot.curves) == 2:
            a, b = pilot.curves["retract"], pilot.curves["extend"]
            x = np.linspace(
                max(a.current_range[0], b.current_range[0]), min(a.current_range[1], b.current_range[1]), 50
            )
            same += f", their static curves by at most {np.abs(a.pressure(x) - b.pressure(x)).max() / BAR:.3f} bar"
        same += ".</p>"
    return (
        "<div class=scroll><table class=compact><thead><tr><th>valve</th><th>estimate</th><th class=n>pole [1/s]</th>"
        "<th class=n>90 %</th><th class=n>b<sub>0</sub><sup>s</sup> [1/s]</th><th class=n>b<sub>1</sub><sup>s</sup></th>"
        f"<th class=n>G(0)</th></tr></thead><tbody>{''.join(rows)}</tbody></table></div>{same}"
    )


def _model_row(valve: str, how: str, model: FirstOrder) -> str:
    low, high = model.intervals()[0]
    _, b0, b1 = model.state_space
    return (
        f"<tr><td>{valve}</td><td>{how}</td><td class=n>{model.continuous[0]:.2f}</td><td class=n>{-high:.2f} .. {-low:.2f}"
        f"</td><td class=n>{b0:.2f}</td><td class=n>{b1:.4f}</td><td class=n>{model.gain:.4f}</td></tr>"
    )


def _bias(valve: ValveResult) -> Json:
    x = np.array([p.noise for p in valve.bias])
    true = valve.model.continuous[0]
    arx = np.array([p.arx_pole for p in valve.bias])
    error = np.array([p.output_error_pole for p in valve.bias])
    return xy(
        [
            curve(x, arx, "ARX", _POINTS, mode="lines+markers"),
            curve(x, error, "output error", _MEAN, mode="lines+markers"),
            curve(x[[0, -1]], np.full(2, true), "simulated pole", _RAW, dash="dash"),
        ],
        "output noise [times the measured]", "pole [1/s]", height=300,
    )  # fmt: skip


def _candidates(valve: ValveResult) -> str:
    rows = "".join(
        f"<tr><td class=n>{c.n}</td><td class=n>{c.m}</td><td class=n>{c.delay_s * 1e3:.1f}</td>"
        f"<td class=n>{c.one_step * 1e6:.2f}</td>"
        f"<td class=n>{number(c.simulated / BAR) if c.stable else 'unstable'}</td></tr>"
        for c in valve.candidates
    )
    return (
        "<div class=scroll><table class=compact><thead><tr><th class=n>n</th><th class=n>m</th><th class=n>delay [ms]</th>"
        "<th class=n>one-step error [µA rms]</th><th class=n>simulated on "
        f"{escape(valve.validation)} [bar rms]</th></tr></thead><tbody>{rows}</tbody></table></div>"
    )


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
        line(check.time, check.measured / BAR, upper, "measured (average)", _RAW, 2.6),
        line(check.time, check.predicted / BAR, upper, "model", _MODEL, 1.3),
        line(check.time, (check.predicted - check.measured) / BAR, lower, "model", _MODEL, 0.9),
        legend_line("measured (average)", _RAW),
        legend_line("model", _MODEL),
    ]
    layout = panels.layout([], float(np.nanmax(check.time)))
    layout["xaxis"]["range"] = [float(np.nanmin(check.time)), float(np.nanmax(check.time))]
    layout["xaxis2"]["title"]["text"] = "time since the start of the trace [s]"
    return {"data": traces, "layout": layout}


def _check_table(pilot: PilotValves) -> str:
    rows = "".join(
        f"<tr><td>{escape(c.trace)}</td><td>{c.valve}</td><td>{'held out' if c.held_out else 'used'}</td>"
        f"<td class=n>{c.rms / BAR:.3f}</td><td class=n>{c.rms_raw / BAR:.3f}</td></tr>"
        for c in pilot.checks
    )
    return (
        "<h3>All traces</h3><div class=scroll><table class=compact><thead><tr><th>trace</th><th>valve</th><th></th>"
        "<th class=n>averaged [bar rms]</th><th class=n>as measured [bar rms]</th></tr></thead><tbody>"
        f"{rows}</tbody></table></div><p class=note>As measured: predicted from the current with its PWM ripple and compared "
        "with the pressure with its ripple and noise.</p>"
    )
