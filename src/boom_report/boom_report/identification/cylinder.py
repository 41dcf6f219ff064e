"""Chapters 5.2 and 5.3 of an identification's report: Figs. 5.5-5.10 and the polygons of Figs. 6.2, 6.3."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from markupsafe import Markup

from boom_identification import hose_burst_valve
from boom_identification.friction import FrictionResult
from boom_identification.hose_burst_valve import HoseBurstValveResult
from boom_identification.identify import Identification
from boom_identification.main_valve import EDGES, MainValveResult, PortAreas
from boom_identification.spool import SpoolNumbers
from boom_report.channels import number
from boom_report.page import chart
from boom_report.palette import ERROR, EVENT, EXTEND, MEASURED, MODEL, OTHER, RETRACT
from boom_report.panels import Json
from boom_report.templates import render
from boom_report.xy import cloud, curve, note, xy, zone

_COLOURS = {"A_sa": EXTEND, "A_tb": ERROR, "A_ta": RETRACT, "A_sb": OTHER}
_SPOOL = "spool position s<sub>s</sub> / s<sub>s,max</sub> (negative: extend, lift)"


def sections(result: Identification) -> Markup:
    """HTML of what was looked at."""
    points, valve, burst = result.points, result.main_valve, result.hose_burst_valve
    return render(
        "boom_report/identification/cylinder.html",
        result=result,
        stretches=0 if points is None else len(np.unique(points.group)),
        excluded="" if points is None else ", ".join(f"{n} {reason}" for reason, n in points.excluded.items() if n),
        ports=[] if valve is None else list(zip(("5.7", "5.8"), "ab", valve.ports, strict=True)),
        coefficients=[] if burst is None or burst.coefficients is None else _coefficients(burst.coefficients, result),
        known=_known,
        chart=chart,
        spool_friction=_spool_friction,
        spool_step=_spool_step,
        areas=_areas,
        polygons=_polygons,
        flow=_flow,
        friction=_friction,
    )


def _spool_friction(spool: SpoolNumbers) -> Json:
    return xy([curve(spool.speed, spool.friction, "f_f", MODEL)], "spool speed [m/s]", "friction force [N]", height=280)


def _spool_step(spool: SpoolNumbers) -> Json:
    return xy([curve(spool.time, spool.position * 1e3, "s_s", MODEL)], "time [s]", "spool position [mm]", height=280)


def _areas(port: PortAreas, result: MainValveResult) -> Json:
    traces = [cloud(port.spool, port.area / result.A_0, "measured (5.17)", MEASURED)]
    if port.spline is not None:
        x = np.linspace(port.spline.nodes[0], port.spline.nodes[-1], 401)
        traces.append(curve(x, port.spline(x), "P-spline (5.26)", MODEL))
    drawn = [result.law[edge] for edge, (own, _) in EDGES.items() if own == port.port and edge in result.law]
    for k, (x, area) in enumerate(drawn):
        traces.append(curve(x, area / result.A_0, "law of the machine file", OTHER, dash="dash", showlegend=k == 0))
    return xy(
        traces, _SPOOL, f"area A<sub>{port.port}</sub> / A<sub>0</sub>",
        shapes=[zone(-result.dead_zone, result.dead_zone, EVENT)],
        annotations=[note("dead zone", x=0, xref="x", xanchor="center")],
    )  # fmt: skip


def _polygons(result: MainValveResult) -> Json:
    traces = []
    for edge, (nodes, areas) in result.polygons.items():
        sign = -1.0 if EDGES[edge][1] == "extend" else 1.0
        label = f"A<sub>{edge[2:]}</sub>"
        traces.append(curve(sign * nodes, areas * 1e6, label, _COLOURS[edge], mode="lines+markers"))
    return xy(traces, _SPOOL, "area [mm²]", shapes=[zone(-result.dead_zone, result.dead_zone, EVENT)])


def _flow(result: HoseBurstValveResult) -> Json:
    traces = [cloud(result.drop_bar, result.flow_lpm, result.source, MEASURED)]
    if len(result.drop_bar) and result.coefficients is not None:
        x = np.linspace(float(result.drop_bar.min()), float(result.drop_bar.max()), 401)
        traces.append(curve(x, result.flow(x), "constrained least squares", MODEL))
    return xy(traces, "pressure drop p<sub>h</sub> − p<sub>a</sub> [bar]", "flow into the cylinder [l/min]")


def _coefficients(values: Iterable[float], whole: Identification) -> list[tuple[str, float, str]]:
    """Name, value and the value before, of (5.36)."""
    old = whole.machine.parameters
    return [
        (name, value, _known(old[key].value[0]) if (key := f"hose_burst_valve.{name}") in old else "–")
        for name, value in zip(hose_burst_valve.NAMES, values, strict=True)
    ]


def _friction(friction: FrictionResult) -> Json:
    order = np.argsort(friction.rate)
    rate, fitted = friction.rate[order], friction.fitted[order]
    gap = int(np.searchsorted(rate, 0.0))
    traces = [
        cloud(friction.rate, friction.torque / 1e3, "measured (5.38)", MEASURED),
        curve(np.insert(rate, gap, 0.0), np.insert(fitted, gap, np.nan) / 1e3, "(3.7)", MODEL),
    ]
    return xy(traces, "angular velocity [rad/s]", "friction torque [kN m]")


def _known(value: float) -> str:
    return number(value, 4) if np.isfinite(value) else "–"
