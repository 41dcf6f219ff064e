"""One picture of an identification: how far each number moved, with its interval."""

from __future__ import annotations

from collections.abc import Mapping

from boom_identification.identify import Identification
from boom_report.palette import MODEL
from boom_report.panels import Json
from boom_report.xy import rows_of


def change(result: Identification, before: Mapping[str, float]) -> Json | None:
    """Value over the number before, with its 90 % interval; None where no number has one before."""
    rows = [(e.key, before[e.key], e) for e in result.estimates if before.get(e.key)]
    if not rows:
        return None
    traces = [
        {"type": "scatter", "mode": "lines", "x": sorted(v / old for v in e.interval_90), "y": [k, k], "hoverinfo": "skip",
         "line": {"color": MODEL, "width": 3}, "showlegend": False}
        for k, (_, old, e) in enumerate(rows)
    ]  # fmt: skip
    points = [e.value / old for _, old, e in rows]
    traces.append({
        "type": "scatter", "mode": "markers", "x": points, "y": list(range(len(rows))), "showlegend": False,
        "marker": {"color": MODEL, "size": 8}, "hovertemplate": "%{x:.4g} times the number before<extra></extra>",
    })  # fmt: skip
    return rows_of(traces, [key for key, _, _ in rows], "value / number before [-], 90 % interval")
