"""Where and when: the equations in doubt, seen in two ways, over time, and the map over regimes."""

from __future__ import annotations

import math
from html import escape

import numpy as np
from numpy.typing import NDArray

from boom_diagnosis.document import BagResult, DiagnosisResult, Regime
from boom_input.channels import PREDICTED
from boom_model.catalogue import SUBSYSTEM_NAMES
from boom_report.channels import number
from boom_report.diagnosis.scheme import colours
from boom_report.diagnosis.words import intervals_text
from boom_report.page import chart
from boom_report.panels import QUIET, Json, packed

Array = NDArray[np.float64]

_FULL = 6.0  # standard deviations at which the colour is full
_COLOURS = [[0, "#2c5f9e"], [0.25, "#a9c6e3"], [0.42, "#eef1f3"], [0.58, "#eef1f3"], [0.75, "#f5b48a"], [1, "#b3261e"]]
_STRIP = 46  # px per equation in the strip over time
_COLUMNS = 600  # of the strip over time: finer is not seen


def section(result: DiagnosisResult) -> str:
    """HTML of the whole section; empty where nothing was located."""
    parts = [_equations(result), _over_time(result), _map(result)]
    text = "".join(parts)
    return f"<section class=card><h2>Where and when</h2>{text}</section>" if text else ""


def _equations(result: DiagnosisResult) -> str:
    if not result.equations:
        return ""
    rows = "".join(
        f"<tr><td>{escape(e.title)}</td><td>({escape(e.equation)})</td>"
        f"<td>{', '.join(SUBSYSTEM_NAMES.get(s, s) for s in e.subsystems)}</td>"
        f"{_share(e.statistical)}{_share(e.chain)}</tr>"
        for e in sorted(result.equations, key=lambda e: -(e.statistical + e.chain))
    )
    return (
        "<h3>Which equation, located in two ways</h3><div class=scroll><table><thead><tr><th>equation</th><th>number</th>"
        "<th>what acts there</th><th>unknown input<br>[share]</th><th>link by link<br>[share]</th></tr></thead>"
        f"<tbody>{rows}</tbody></table></div><p>{escape(result.agreement)}</p>"
        "<p class=note>Unknown input: how much of the mismatch an input of unknown cause would explain if it acted in this "
        "equation. Link by link: command, spool, flow, pressure, force, motion; each link is driven by what was measured "
        "before it, and the mismatch that appears behind it is counted.</p>"
    )


def _share(value: float) -> str:
    if not math.isfinite(value):
        return "<td class=cellbar>–</td>"
    return f"<td class=cellbar><i class=bar style='width:{max(value, 0) * 70:.0f}%'></i> {value:.2f}</td>"


def _over_time(result: DiagnosisResult) -> str:
    titles = {e.key: e.title for e in result.equations}
    charts = []
    for bag in result.bags:
        if not bag.equations:
            continue
        windows = (
            f" More than noise: {escape(intervals_text(bag.windows))}." if bag.windows else " Nowhere more than noise."
        )
        charts.append(f"<p><b>{escape(bag.name)}</b>.{windows}</p>{chart(strip(bag, titles))}")
    if not charts:
        return ""
    return "<h3>When: unknown input of each equation over time, in units of its own standard deviation</h3>" + "".join(
        charts
    )


def strip(bag: BagResult, titles: dict[str, str]) -> Json:
    """The unknown inputs over time as a strip of colour for each equation: plotly.js ``data`` and ``layout``."""
    keys = list(reversed(list(bag.equations)))
    edges = np.linspace(0.0, max(bag.duration, 1e-3), _COLUMNS + 1)
    at = np.clip(np.searchsorted(edges, bag.time, side="right") - 1, 0, _COLUMNS - 1)
    z = np.full((len(keys), _COLUMNS), np.nan)
    for row, key in enumerate(keys):
        values = bag.equations[key]
        known = np.isfinite(values)
        # of each column the value that is furthest from zero: a short mismatch is not to vanish
        order = np.argsort(np.abs(values[known]), kind="stable")
        z[row, at[known][order]] = values[known][order]
    z = _filled(z)
    names = [titles.get(key, key) for key in keys]
    trace = {
        "type": "heatmap", "z": {"dtype": "f4", "shape": f"{len(keys)},{_COLUMNS}", **_bytes(z)},
        "x": packed((edges[:-1] + edges[1:]) / 2), "y": names, "zmin": -_FULL, "zmax": _FULL, "colorscale": _COLOURS,
        "hovertemplate": "%{y}<br>%{x:.1f} s: %{z:.1f} sigma<extra></extra>", "ygap": 16, "showscale": False,
    }  # fmt: skip
    # Names above their rows: beside them they would take half of a phone's width.
    written = [
        {"text": name, "x": 0, "xref": "paper", "xanchor": "left", "y": row + 0.5, "yref": "y",
         "yanchor": "middle", "showarrow": False, "font": {"size": 11, "color": QUIET}}
        for row, name in enumerate(names)
    ]  # fmt: skip
    layout = {
        "height": 66 + _STRIP * len(keys), "margin": {"l": 8, "r": 8, "t": 12, "b": 44}, "paper_bgcolor": "#ffffff",
        "plot_bgcolor": "#ffffff", "annotations": written,
        "font": {"family": "system-ui, 'Segoe UI', Roboto, Arial, sans-serif", "size": 12, "color": "#1f2933"},
        "xaxis": {"title": {"text": "time since the start of the recording [s]", "standoff": 6}, "nticks": 12,
                  "range": [0, bag.duration], "showgrid": False},
        "yaxis": {"showticklabels": False, "fixedrange": True, "showgrid": False, "zeroline": False},
    }  # fmt: skip
    return {"data": [trace], "layout": layout}


def _filled(z: Array) -> Array:
    """Columns without a sample of their own show the one before, as far as one sample is missing."""
    for column in range(1, z.shape[1]):
        empty = np.isnan(z[:, column])
        z[empty, column] = z[empty, column - 1]
    return z


def _bytes(z: Array) -> Json:
    flat = packed(z.reshape(-1))
    return flat if isinstance(flat, dict) else {}


def _map(result: DiagnosisResult) -> str:
    if not result.regimes:
        return ""
    heads = "".join(f"<th class=n>{sensor.label}</th>" for sensor in PREDICTED)
    rows = "".join(_regime(r) for r in result.regimes)
    return (
        "<h3>In which regime: mismatch over noise, before → after</h3><div class=scroll><table class=map><thead><tr>"
        f"<th>what the boom did</th><th class=n>time [s]</th>{heads}</tr></thead><tbody>{rows}</tbody></table></div>"
        "<p class=note>Mean squared difference between model and measurement from one sample to the next, over that of a "
        "machine that hides nothing: 1 is noise. The colour is that of the model before.</p>"
    )


def _regime(regime: Regime) -> str:
    cells = []
    for sensor in PREDICTED:
        before, after = (side.get(sensor.name, math.nan) for side in (regime.mismatch, regime.explained))
        if not math.isfinite(before):
            cells.append("<td class=heat>–</td>")
            continue
        # the colours of the scheme: noise is white, ten times noise is red
        fill, _ = colours(min(max(math.log10(max(before, 1e-9)) - 0.1, 0.0), 1.0))
        then = f" → {number(after, 2)}" if math.isfinite(after) else ""
        cells.append(f"<td class=heat style='background:{fill}'>{number(before, 2)}{then}</td>")
    detail = f" <span class=quiet>{escape(regime.detail)}</span>" if regime.detail else ""
    return f"<tr><td>{escape(regime.label)}{detail}</td><td class=n>{regime.seconds:.1f}</td>{''.join(cells)}</tr>"
