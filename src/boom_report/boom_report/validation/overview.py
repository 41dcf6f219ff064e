"""One picture of a validation: how large the error of each channel is, in units of what noise alone would leave."""

from __future__ import annotations

import numpy as np

from boom_identification.validation import Validation
from boom_input.channels import PREDICTED
from boom_report.channels import ratio
from boom_report.palette import MODEL, RED
from boom_report.panels import Json, packed
from boom_report.xy import rows_of

_MOST = 24
_SMALLEST = 0.1  # of the limit: what is less is as good


def overview(validation: Validation) -> Json | None:
    """Bars of error over noise limit; None where nothing was compared. Of many recordings those that err most."""
    rows = [
        (f"{bag.recording.name}: {sensor.label}", max(times, _SMALLEST))
        for bag in validation.bags
        for sensor in PREDICTED
        if (times := ratio(sensor, bag)) is not None and np.isfinite(times)
    ]
    if not rows:
        return None
    rows = sorted(rows, key=lambda row: -row[1])[:_MOST] if len(rows) > _MOST else rows
    values = np.array([times for _, times in rows])
    bars = {
        "type": "bar", "orientation": "h", "x": packed(values), "y": list(range(len(rows))), "showlegend": False, "width": 0.36,
        "marker": {"color": [RED if times > 1 else MODEL for times in values]},
        "hovertemplate": "%{x:.2f} times the limit<extra></extra>",
    }  # fmt: skip
    title = "error / noise limit, full model [-]"
    figure = rows_of([bars], [name for name, _ in rows], title)
    top = 1.2 * max(float(values.max()), 2.0)
    figure["layout"]["xaxis"] |= {"type": "log", "range": [np.log10(_SMALLEST / 2), np.log10(top)], "dtick": 1}
    return figure
