"""Chapters 5.2 and 5.3 of an identification's report: Figs. 5.5-5.10 and the polygons of Figs. 6.2, 6.3."""

from __future__ import annotations

from html import escape

import numpy as np

from boom_identification import hose_burst_valve
from boom_identification.hose_burst_valve import HoseBurstValveResult
from boom_identification.identify import Identification
from boom_identification.main_valve import EDGES, MainValveResult, PortAreas
from boom_identification.spool import Spool
from boom_identification.stationary import Points
from boom_report.channels import number
from boom_report.page import chart
from boom_report.panels import Json
from boom_report.xy import cloud, curve, note, xy, zone

_MEASURED, _FIT, _LAW, _BEFORE = "#8d96a1", "#1257a6", "#d9720a", "#9a9fa6"
_DEAD = "rgba(214,69,65,0.10)"
_COLOURS = {"A_sa": "#0b8a74", "A_tb": "#1257a6", "A_ta": "#7a3e9d", "A_sb": "#d9720a"}
_SPOOL = "spool position s<sub>s</sub> / s<sub>s,max</sub> (negative: extend, lift)"


def sections(result: Identification) -> str:
    """HTML of what was looked at."""
    parts = [_spool(result.spool) if result.spool else ""]
    if result.main_valve is not None and result.points is not None:
        parts.append(_main_valve(result.main_valve, result.points))
    if result.hose_burst_valve is not None:
        parts.append(_hose_burst_valve(result.hose_burst_valve, result))
    if result.friction is not None:
        parts.append(_friction(result))
    return "".join(f"<section class=card>{part}</section>" for part in parts if part)


def _spool(spool: Spool) -> str:
    rows = "".join(
        f"<tr><td>{c.symbol}</td><td class=n>{_known(c.stated)}</td><td class=n>{_known(c.computed)}</td>"
        f"<td>{escape(c.unit)}</td><td>{escape(c.equation)}</td></tr>"
        for c in spool.constants
    )
    friction = xy(
        [curve(spool.speed, spool.friction, "f_f", _FIT)], "spool speed [m/s]", "friction force [N]", height=280
    )
    step = xy([curve(spool.time, spool.position * 1e3, "s_s", _FIT)], "time [s]", "spool position [mm]", height=280)
    return (
        "<h2>Main valve: spool (5.8)-(5.13)</h2><p>No sensor sees the spool. These are catalogue values, and what follows from "
        "them; nothing here was identified.</p><div class=scroll><table class=compact><thead><tr><th>constant</th><th class=n>"
        "machine file</th><th class=n>from the catalogue</th><th>unit</th><th>equation</th></tr></thead><tbody>"
        f"{rows}</tbody></table></div><h3>Fig. 5.5: friction of the spool (5.13)</h3>{chart(friction)}"
        f"<h3>Fig. 5.6: step response to a pilot pressure of 1 bar</h3>{chart(step)}"
        "<p class=note>Coulomb friction smoothed by the tanh acts as strong damping at low speed: no overshoot, slow creep.</p>"
    )


def _main_valve(result: MainValveResult, points: Points) -> str:
    excluded = ", ".join(f"{count} {reason}" for reason, count in points.excluded.items() if count)
    parts = [
        "<h2>Main valve: orifice areas (5.14)-(5.27)</h2>"
        f"<p>{len(points)} stationary samples in {len(np.unique(points.group))} stretches; left out: {escape(excluded or 'none')}. "
        f"Areas are relative to dp_c, A_s and k. Dead zone x<sub>0</sub> = {number(result.dead_zone)}, "
        f"A<sub>0</sub> = {number(result.A_0 * 1e6)} mm².</p>"
    ]
    for port, figure, symbol in zip(result.ports, ("5.7", "5.8"), ("a", "b"), strict=True):
        heading = f"<h3>Fig. {figure}: normalised orifice area of port {symbol}</h3>"
        parts.append(f"{heading}{chart(_areas(port, result))}{_smoothing(port)}")
    if result.polygons:
        parts.append(f"<h3>Figs. 6.2, 6.3: piecewise linear areas for the controller</h3>{chart(_polygons(result))}")
    return "".join(parts)


def _areas(port: PortAreas, result: MainValveResult) -> Json:
    traces = [cloud(port.spool, port.area / result.A_0, "measured (5.17)", _MEASURED)]
    if port.spline is not None:
        x = np.linspace(port.spline.nodes[0], port.spline.nodes[-1], 401)
        traces.append(curve(x, port.spline(x), "P-spline (5.26)", _FIT))
    drawn = [result.law[edge] for edge, (own, _) in EDGES.items() if own == port.port and edge in result.law]
    for k, (x, area) in enumerate(drawn):
        traces.append(curve(x, area / result.A_0, "law of the machine file", _LAW, dash="dash", showlegend=k == 0))
    return xy(
        traces, _SPOOL, f"area A<sub>{port.port}</sub> / A<sub>0</sub>",
        shapes=[zone(-result.dead_zone, result.dead_zone, _DEAD)],
        annotations=[note("dead zone", x=0, xref="x", xanchor="center")],
    )  # fmt: skip


def _smoothing(port: PortAreas) -> str:
    if port.spline is None:
        return f"<p class=note>No P-spline: {escape(port.why)}.</p>"
    chosen = "chosen by cross-validation" if port.spline.scores else "given"
    low, high = port.spline.covered
    return (
        f"<p class=note>λ = {port.spline.smoothing:g}, {chosen}; 15 cubic basis functions, never falling away from the dead zone, "
        f"zero in it; measured from {low:.2f} to {high:.2f}.</p>"
    )


def _polygons(result: MainValveResult) -> Json:
    traces = []
    for edge, (nodes, areas) in result.polygons.items():
        sign = -1.0 if EDGES[edge][1] == "extend" else 1.0
        label = f"A<sub>{edge[2:]}</sub>"
        traces.append(curve(sign * nodes, areas * 1e6, label, _COLOURS[edge], mode="lines+markers"))
    return xy(traces, _SPOOL, "area [mm²]", shapes=[zone(-result.dead_zone, result.dead_zone, _DEAD)])


def _hose_burst_valve(result: HoseBurstValveResult, whole: Identification) -> str:
    traces = [cloud(result.drop_bar, result.flow_lpm, result.source, _MEASURED)]
    table = ""
    if len(result.drop_bar):
        x = np.linspace(float(result.drop_bar.min()), float(result.drop_bar.max()), 401)
        if result.coefficients is not None:
            traces.append(curve(x, result.flow(x), "constrained least squares", _FIT))
    if result.coefficients is not None:
        old = whole.machine.parameters
        rows = "".join(
            f"<tr><td>{name}</td><td class=n>{value:.4g}</td>"
            f"<td class=n>{_known(old[key].value[0]) if (key := f'hose_burst_valve.{name}') in old else '–'}</td></tr>"
            for name, value in zip(hose_burst_valve.NAMES, result.coefficients, strict=True)
        )
        table = (
            "<div class=scroll><table class=compact><thead><tr><th>coefficient (5.36)</th><th class=n>fitted</th><th class=n>before"
            f"</th></tr></thead><tbody>{rows}</tbody></table></div><p class=note>Flow in l/min, drop in bar; the "
            f"branches meet at {result.node_bar:.2f} bar with equal value and slope; residual {number(result.residual_lpm)} "
            "l/min rms.</p>"
        )
    figure = xy(traces, "pressure drop p<sub>h</sub> − p<sub>a</sub> [bar]", "flow into the cylinder [l/min]")
    why = result.not_determined[0].why if result.not_determined else ""
    remark = f"<p class=note>Not written to the machine file: {escape(why)}.</p>" if why else ""
    return f"<h2>Hose burst valve (5.28)-(5.36)</h2><h3>Fig. 5.9</h3>{chart(figure)}{table}{remark}"


def _friction(result: Identification) -> str:
    friction = result.friction
    assert friction is not None
    order = np.argsort(friction.rate)
    rate, fitted = friction.rate[order], friction.fitted[order]
    gap = int(np.searchsorted(rate, 0.0))
    traces = [
        cloud(friction.rate, friction.torque / 1e3, "measured (5.38)", _MEASURED),
        curve(np.insert(rate, gap, 0.0), np.insert(fitted, gap, np.nan) / 1e3, "(3.7)", _FIT),
    ]
    figure = xy(traces, "angular velocity [rad/s]", "friction torque [kN m]")
    return (
        f"<h2>Friction (5.37), (5.38)</h2><h3>Fig. 5.10</h3>{chart(figure)}"
        f"<p class=note>Residual {number(friction.residual) if len(rate) else '–'} N m rms over {len(rate)} samples. The torque "
        "also holds what is wrong with areas, geometry, load and hose burst valve.</p>"
    )


def _known(value: float) -> str:
    return number(value, 4) if np.isfinite(value) else "–"
