"""Charts of the robustness report, in the form of plotly.js: data and layout."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import cycle
from typing import Any

import numpy as np
from numpy.typing import NDArray

from boom_controller.controller import MODES
from boom_model.machine_file import load_machine
from boom_report.palette import FONT, GRID, INK, LAWS, PAPER, PLOT, STABILITY
from boom_report.panels import packed
from boom_report.tracking.position_error import piston_positions
from boom_trials.robustness.study import Result, force

Json = dict[str, Any]

COLOURS = dict(zip(MODES, cycle(LAWS), strict=False))
_EVERY = 2  # samples: half of them are finer than a pixel
_ROWS = (
    ("piston position s_p [m]", 190), ("error s_p - s_p* [mm]", 150), ("piston force f_p [kN]", 190), ("p_h [bar]", 130),
    ("currents: lift up, lower down [A]", 130),
)  # fmt: skip
_GAP = 34
_MAP, _MAP_GAP = 180, 70  # px, of the maps of stability


def figure(results: Sequence[Result]) -> Json:
    """One configuration, all modes above each other: position, error, force with its reference, pressure, currents."""
    traces: list[Json] = []
    machine = load_machine(results[0].job.machine)
    for index, result in enumerate(results):
        h = result.history
        if h is None:
            continue
        reference, position = piston_positions(machine, h.reference), piston_positions(machine, h.values["true_angle"])
        colour, mode = COLOURS[result.job.mode], result.job.mode
        if index == 0:
            traces.append(_line(h.time, reference, 1, "reference", INK, 1.0))
        traces.append(_line(h.time, position, 1, mode, colour, 1.3))
        traces.append(_line(h.time, 1e3 * (position - reference), 2, mode, colour, 1.1))
        traces.append(_line(h.time, h.values["force_set_point"] / 1e3, 3, f"{mode} set point", colour, 0.8, "dot"))
        traces.append(_line(h.time, force(machine, h) / 1e3, 3, mode, colour, 1.2))
        traces.append(_line(h.time, h.values["hose_pressure"] / 1e5, 4, mode, colour, 1.1))
        traces.append(_line(h.time, h.values["extend"], 5, f"{mode} lift", colour, 0.8))
        traces.append(_line(h.time, -h.values["retract"], 5, f"{mode} lower", colour, 0.8))
    return {"data": traces, "layout": _stacked(_ROWS, "time [s]")}


def stability_figure(stability: Mapping[str, Any]) -> Json:
    """Mode by pose, each a map of dead time over stiffness and load: 1 stable, 0 not."""
    maps, delays = stability["maps"], stability["dead_time_ms"]
    modes = list(maps)
    poses = list(next(iter(maps.values())))
    traces: list[Json] = []
    total = (_MAP + _MAP_GAP) * len(modes) - _MAP_GAP
    layout: Json = {
        "height": total + 100, "margin": {"l": 90, "r": 10, "t": 50, "b": 50}, "annotations": [], "showlegend": False,
        "paper_bgcolor": PAPER, "plot_bgcolor": PLOT, "font": FONT | {"size": 11},
    }  # fmt: skip
    for i, mode in enumerate(modes):
        for j, pose in enumerate(poses):
            n = i * len(poses) + j + 1
            suffix = "" if n == 1 else str(n)
            cases = list(maps[mode][pose])
            z = [[int(v) for v in maps[mode][pose][case]] for case in cases]
            traces.append({
                "type": "heatmap", "x": delays, "y": cases, "z": z, "zmin": 0, "zmax": 1, "showscale": False,
                "xgap": 2, "ygap": 2, "colorscale": STABILITY, "xaxis": f"x{suffix}", "yaxis": f"y{suffix}",
                "hovertemplate": "%{y}, %{x} ms: %{z}<extra></extra>",
            })  # fmt: skip
            left, width = j / len(poses), 1 / len(poses) - 0.03
            top = 1 - i * (_MAP + _MAP_GAP) / total
            layout[f"xaxis{suffix}"] = {"domain": [left, left + width], "anchor": f"y{suffix}", "tickvals": delays}
            if (i, j) == (len(modes) - 1, len(poses) // 2):
                layout[f"xaxis{suffix}"]["title"] = {"text": "dead time [ms]", "standoff": 4}
            layout[f"yaxis{suffix}"] = {
                "domain": [max(0.0, top - _MAP / total), top],
                "anchor": f"x{suffix}",
                "automargin": True,
                "showticklabels": j == 0,  # all maps of a row have the same cases
            }
            layout["annotations"].append({
                "text": f"<b>{mode}</b><br>{pose}", "x": left, "y": top, "xref": "paper", "yref": "paper",
                "xanchor": "left", "yanchor": "bottom", "showarrow": False,
            })  # fmt: skip
    return {"data": traces, "layout": layout}


def _line(
    time: NDArray[np.float64],
    values: NDArray[np.float64],
    row: int,
    name: str,
    colour: str,
    width: float,
    dash: str = "solid",
) -> Json:
    n = "" if row == 1 else str(row)
    return {
        "type": "scatter", "mode": "lines", "x": packed(time[::_EVERY]), "y": packed(values[::_EVERY]),
        "xaxis": f"x{n}", "yaxis": f"y{n}", "name": name, "showlegend": False,
        "line": {"color": colour, "width": width, "dash": dash}, "hovertemplate": "%{y:.4g}",
    }  # fmt: skip


def _stacked(rows: Sequence[tuple[str, int]], time_label: str) -> Json:
    total = sum(height for _, height in rows) + _GAP * (len(rows) - 1)
    layout: Json = {
        "height": total + 80, "margin": {"l": 56, "r": 10, "t": 30, "b": 44}, "annotations": [], "hovermode": "x",
        "paper_bgcolor": PAPER, "plot_bgcolor": PLOT, "font": dict(FONT),
    }  # fmt: skip
    top = 0
    for k, (label, height) in enumerate(rows):
        n = "" if k == 0 else str(k + 1)
        upper = 1 - top / total
        layout[f"yaxis{n}"] = {
            "domain": [max(0.0, upper - height / total), upper],
            "anchor": f"x{n}",
            "gridcolor": GRID,
            "nticks": 5,
        }
        layout[f"xaxis{n}"] = {"anchor": f"y{n}", "gridcolor": GRID, "showticklabels": k == len(rows) - 1}
        if k:
            layout[f"xaxis{n}"]["matches"] = "x"
        layout["annotations"].append({
            "text": f"<b>{label}</b>", "x": 0, "y": upper, "xref": "paper", "yref": "paper", "xanchor": "left", "yanchor": "bottom",
            "showarrow": False,
        })  # fmt: skip
        top += height + _GAP
    layout[f"xaxis{len(rows)}"]["title"] = {"text": time_label, "standoff": 6}
    return layout
