"""What was learnt without a name, and what to record next."""

from __future__ import annotations

from markupsafe import Markup

from boom_diagnosis.document import DiagnosisResult, Experiment, LearnedCurve
from boom_model.catalogue import effect_name
from boom_report.page import chart
from boom_report.palette import AXIS, EXTEND, FONT, GRID, MODEL, MODEL_BAND, PAPER, PLOT, RETRACT
from boom_report.panels import Json, packed
from boom_report.templates import render

_PEOPLE = {"Pa": (1e-5, "bar"), "m^3/s": (6e4, "l/min")}


def learned(result: DiagnosisResult) -> Markup:
    """HTML: the terms learnt from the data, as formula and curve; empty where there are none."""
    return render(
        "boom_report/diagnosis/learned.html",
        curves=result.learned,
        chart=lambda curve: chart(learned_chart(curve)),
    )


def learned_chart(curve: LearnedCurve) -> Json:
    """The learnt term over its main variable with its 90 % band."""
    (sx, ux), (sy, uy) = (_PEOPLE.get(u, (1.0, u)) for u in (curve.variable_unit, curve.value_unit))
    x = packed(curve.x * sx)
    low = {"type": "scatter", "mode": "lines", "x": x, "y": packed(curve.low * sy), "line": {"width": 0}, "hoverinfo": "skip",
           "showlegend": False}  # fmt: skip
    high = low | {"y": packed(curve.high * sy), "fill": "tonexty", "fillcolor": MODEL_BAND}
    middle = low | {"y": packed(curve.y * sy), "line": {"width": 2.4, "color": MODEL}, "hoverinfo": "all"}
    return {"data": [low, high, middle], "layout": _layout(300, f"{curve.variable} [{ux}]", f"term [{uy}]")}


def experiment(result: DiagnosisResult) -> Markup:
    """HTML: the proposed recording with its currents, and what it would separate."""
    return render(
        "boom_report/diagnosis/experiment.html",
        said=result.document.next_experiment,
        proposed=result.experiment,
        effect_name=effect_name,
        chart=lambda proposed: chart(experiment_chart(proposed)),
    )


def experiment_chart(proposed: Experiment) -> Json:
    """The proposed solenoid currents over time."""
    time = packed(proposed.time)
    traces = [
        {"type": "scatter", "mode": "lines", "name": name, "x": time, "y": packed(proposed.currents[:, k]),
         "line": {"width": 1.6, "color": colour, "shape": "hv"}}
        for k, (name, colour) in enumerate((("retract (lower)", RETRACT), ("extend (lift)", EXTEND)))
    ]  # fmt: skip
    layout = _layout(260, "time [s]", "current [A]")
    layout["showlegend"] = True
    return {"data": traces, "layout": layout}


def _layout(height: int, x: str, y: str) -> Json:
    axis = {"gridcolor": GRID, "zerolinecolor": AXIS, "linecolor": AXIS, "showline": True}
    return {
        "height": height, "margin": {"l": 58, "r": 12, "t": 26, "b": 46}, "paper_bgcolor": PAPER, "plot_bgcolor": PLOT,
        "font": dict(FONT), "annotations": [], "showlegend": False,
        "legend": {"orientation": "h", "x": 0, "y": 1.02, "yanchor": "bottom"},
        "xaxis": {**axis, "title": {"text": x, "standoff": 6}}, "yaxis": {**axis, "title": {"text": y, "standoff": 6}},
    }  # fmt: skip
