"""Where and when: the equations in doubt, seen in two ways, over time, and the map over regimes."""

from __future__ import annotations

import math

import numpy as np
from markupsafe import Markup
from numpy.typing import NDArray

from boom_diagnosis.document import BagResult, DiagnosisResult
from boom_input.channels import PREDICTED
from boom_model.catalogue import SUBSYSTEM_NAMES
from boom_report.diagnosis import words
from boom_report.page import chart
from boom_report.palette import DIVERGING, FONT, PAPER, QUIET
from boom_report.panels import Json, packed
from boom_report.scheme import heat
from boom_report.templates import render

Array = NDArray[np.float64]

_FULL = 6.0  # standard deviations at which the colour is full
_STRIP = 46  # px per equation in the strip over time
_COLUMNS = 600  # of the strip over time: finer is not seen


def section(result: DiagnosisResult) -> Markup:
    """HTML of the whole section; empty where nothing was located."""
    bags = [bag for bag in result.bags if bag.equations]
    if not (result.equations or bags or result.regimes):
        return Markup()
    titles = {e.key: e.title for e in result.equations}
    return render(
        "boom_report/diagnosis/where.html",
        result=result,
        equations=sorted(result.equations, key=lambda e: -(e.statistical + e.chain)),
        bags=bags,
        strip=lambda bag: chart(strip(bag, titles)),
        heat=_heat,
        channels=PREDICTED,
        words=words,
        subsystem_names=SUBSYSTEM_NAMES,
        nan=math.nan,
    )


def _heat(mismatch: float) -> int:
    """The steps of the scheme: noise is the least, ten times noise the largest."""
    return heat(min(max(math.log10(max(mismatch, 1e-9)) - 0.1, 0.0), 1.0))


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
        "x": packed((edges[:-1] + edges[1:]) / 2), "y": names, "zmin": -_FULL, "zmax": _FULL, "colorscale": DIVERGING,
        "hovertemplate": "%{y}<br>%{x:.1f} s: %{z:.1f} sigma<extra></extra>", "ygap": 16, "showscale": False,
    }  # fmt: skip
    # Names above their rows: beside them they would take half of a phone's width.
    written = [
        {"text": name, "x": 0, "xref": "paper", "xanchor": "left", "y": row + 0.5, "yref": "y",
         "yanchor": "middle", "showarrow": False, "font": {"size": 11, "color": QUIET}}
        for row, name in enumerate(names)
    ]  # fmt: skip
    layout = {
        "height": 66 + _STRIP * len(keys), "margin": {"l": 8, "r": 8, "t": 12, "b": 44}, "paper_bgcolor": PAPER,
        "plot_bgcolor": PAPER, "annotations": written,
        "font": dict(FONT),
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
