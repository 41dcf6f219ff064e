"""The closed loop in a report: the numbers of (6.29) beside Table 6.3, reference and angle, the piston's error, the currents."""

from __future__ import annotations

from typing import Any

import numpy as np
from markupsafe import Markup

from boom_recording.recording import Recording
from boom_report.page import chart
from boom_report.palette import ERROR, EXTEND, INK, MEASURED, RETRACT
from boom_report.panels import Json, Panels, line
from boom_report.templates import render
from boom_report.tracking.position_error import THESIS, Errors, Tracking

_HEADS = ("mean |e| (MAE)", "largest |e| (MAXE)", "rms e (RMSE)")
_METHOD = (
    "e is the reference's piston position minus that of the measured angle of the same moment, from the first motion on (6.29). "
    "The reference is the wanted angle after the trajectory generator (6.27). Table 6.3 is the mean over the trajectories of the "
    "thesis, which are others than this one."
)


def rows(tracking: Tracking, mode: str) -> list[tuple[str, Errors]]:
    """Label and measures: this run, and configuration C0 of Table 6.3."""
    return [(f"this run, {mode}", tracking.errors), ("thesis, Table 6.3, C0", Errors(*THESIS["C0"]))]


def print_tracking(tracking: Tracking, mode: str, console: Any) -> None:
    """The numbers as a table on the terminal."""
    from rich.table import Table

    table = Table(title="Closed loop: error of the piston position [mm]")
    table.add_column("")
    for head in _HEADS:
        table.add_column(head, justify="right")
    for label, errors in rows(tracking, mode):
        table.add_row(label, *(f"{1e3 * v:.2f}" for v in (errors.mae, errors.maxe, errors.rmse)))
    console.print(table)


def section(tracking: Tracking, recording: Recording, mode: str) -> Markup:
    """HTML of one section for ``report.write_report``."""
    return render(
        "boom_report/tracking/report.html",
        mode=mode,
        heads=_HEADS,
        rows=rows(tracking, mode),
        method=_METHOD,
        chart=chart(figure(tracking, recording)),
    )


def figure(tracking: Tracking, recording: Recording) -> Json:
    """The chart as plotly.js takes it."""
    panels = Panels()
    traces: list[Json] = []
    angle = _panel(panels, "angle", "<b>Angle</b> q<sub>2</sub> [rad]", 190)
    traces.append(line(tracking.time, tracking.angle, angle, "measured", MEASURED, 2.6))
    traces.append(line(tracking.time, tracking.reference, angle, "reference", INK, 1.3))
    error = _panel(panels, "error", "<b>Piston position error</b> e [mm]", 150)
    traces.append(line(tracking.time, 1e3 * tracking.error, error, "error", ERROR, 1.1))
    currents = _panel(panels, "currents", "<b>Commanded currents</b> [A]", 130, rangemode="tozero")
    for name, label, colour in (
        ("retract_current_command", "retract (lower)", RETRACT), ("extend_current_command", "extend (lift)", EXTEND)
    ):  # fmt: skip
        signal = recording.signals.get(name)
        if signal is not None:
            traces.append(
                line(signal.time, np.where(signal.valid, signal.values, np.nan), currents, label, colour, 1.0)
            )
    shown = {trace["name"]: trace["line"]["color"] for trace in traces}
    traces += [
        {"type": "scatter", "mode": "lines", "x": [None], "y": [None], "name": name, "legendgroup": name,
         "line": {"color": colour, "width": 4}}
        for name, colour in shown.items()
    ]  # fmt: skip
    return {"data": traces, "layout": panels.layout([], recording.duration)}


def _panel(panels: Panels, name: str, label: str, height: int, **axis: Any) -> str:
    suffix = panels.add(name, height, 46, **axis)
    panels.write(name, label, x=0, xanchor="left", yanchor="bottom", yshift=3, font={"size": 13})
    return suffix
