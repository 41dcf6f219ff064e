"""What was learnt without a name, what remains, and what to record next."""

from __future__ import annotations

from html import escape

from boom_diagnosis.document import DiagnosisResult, Experiment, LearnedCurve
from boom_model.catalogue import effect_name
from boom_report.page import chart
from boom_report.panels import Json, packed

_LINE, _FILL, _RETRACT, _EXTEND = "#1257a6", "rgba(18,87,166,0.16)", "#7a3e9d", "#0b8a74"
_PEOPLE = {"Pa": (1e-5, "bar"), "m^3/s": (6e4, "l/min")}
_FONT = {"family": "system-ui, 'Segoe UI', Roboto, Arial, sans-serif", "size": 12, "color": "#1f2933"}


def learned(result: DiagnosisResult) -> str:
    """HTML: the terms learnt from the data, as formula and curve; empty where there are none."""
    if not result.learned:
        return ""
    parts = []
    for curve in result.learned:
        parts.append(
            f"<h3>Added to equation ({escape(curve.equation)})</h3><div class=formula>{escape(curve.formula)}</div>"
            f"<p>{escape(curve.reading)}</p>{chart(learned_chart(curve))}"
        )
    return (
        f"<section class=card><h2>A term learnt from the data</h2>{''.join(parts)}<p class=note>Over its main variable, the "
        "others in the middle of their range; the band is the 90 % interval. It holds in the drawn range only. It was kept "
        "because it improves data that it was not learnt from. It is part of the written machine file.</p></section>"
    )


def learned_chart(curve: LearnedCurve) -> Json:
    """The learnt term over its main variable with its 90 % band."""
    (sx, ux), (sy, uy) = (_PEOPLE.get(u, (1.0, u)) for u in (curve.variable_unit, curve.value_unit))
    x = packed(curve.x * sx)
    low = {"type": "scatter", "mode": "lines", "x": x, "y": packed(curve.low * sy), "line": {"width": 0}, "hoverinfo": "skip",
           "showlegend": False}  # fmt: skip
    high = low | {"y": packed(curve.high * sy), "fill": "tonexty", "fillcolor": _FILL}
    middle = low | {"y": packed(curve.y * sy), "line": {"width": 2.4, "color": _LINE}, "hoverinfo": "all"}
    return {"data": [low, high, middle], "layout": _layout(300, f"{curve.variable} [{ux}]", f"term [{uy}]")}


def remaining(result: DiagnosisResult) -> str:
    """HTML: what stays unexplained, and what moved within its tolerance."""
    text = result.remaining or "Nothing beyond the noise of the sensors."
    return f"<section class=card><h2>What remains unexplained</h2><p>{escape(text)}</p></section>"


def experiment(result: DiagnosisResult) -> str:
    """HTML: the proposed recording with its currents, and what it would separate."""
    said = result.document.next_experiment
    if not said and result.experiment is None:
        return ""
    proposed = result.experiment
    text = f"<p>{escape(said or (proposed.text if proposed else ''))}</p>"
    if proposed is not None:
        rows = "".join(
            f"<tr><td>{escape(effect_name(a))}</td><td>{escape(effect_name(b))}</td>"
            f"<td class=n>{now:.1f}</td><td class=n>{then:.1f}</td></tr>"
            for a, b, now, then in proposed.separation
        )
        table = (
            "<div class=scroll><table class=compact><thead><tr><th>hypothesis</th><th>against</th>"
            "<th class=n>apart now<br>[sigma]</th><th class=n>apart then<br>[sigma]</th></tr></thead>"
            f"<tbody>{rows}</tbody></table></div>"
        )
        text += (table if rows else "") + chart(experiment_chart(proposed))
    return f"<section class=card><h2>What to record next</h2>{text}</section>"


def experiment_chart(proposed: Experiment) -> Json:
    """The proposed solenoid currents over time."""
    time = packed(proposed.time)
    traces = [
        {"type": "scatter", "mode": "lines", "name": name, "x": time, "y": packed(proposed.currents[:, k]),
         "line": {"width": 1.6, "color": colour, "shape": "hv"}}
        for k, (name, colour) in enumerate((("retract (lower)", _RETRACT), ("extend (lift)", _EXTEND)))
    ]  # fmt: skip
    layout = _layout(260, "time [s]", "current [A]")
    layout["showlegend"] = True
    return {"data": traces, "layout": layout}


def _layout(height: int, x: str, y: str) -> Json:
    axis = {"gridcolor": "#e4e8ec", "zerolinecolor": "#c9d0d6", "linecolor": "#c9d0d6", "showline": True}
    return {
        "height": height, "margin": {"l": 58, "r": 12, "t": 26, "b": 46}, "paper_bgcolor": "#ffffff", "plot_bgcolor": "#fbfcfd",
        "font": dict(_FONT), "annotations": [], "showlegend": False,
        "legend": {"orientation": "h", "x": 0, "y": 1.02, "yanchor": "bottom"},
        "xaxis": {**axis, "title": {"text": x, "standoff": 6}}, "yaxis": {**axis, "title": {"text": y, "standoff": 6}},
    }  # fmt: skip
