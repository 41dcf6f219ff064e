"""The hydraulic scheme as inline SVG: the twelve subsystems of the contract, each coloured by the evidence against it."""

from __future__ import annotations

from collections.abc import Mapping

from markupsafe import Markup

from boom_diagnosis.document import SUBSYSTEMS
from boom_model.catalogue import SUBSYSTEM_NAMES
from boom_report.diagnosis.words import probability
from boom_report.templates import render

_STEPS = ((0.05, "#ffffff", "#8793a0"), (0.2, "#fff3cf", "#b98a14"), (0.5, "#ffd98a", "#b36b00"),
          (0.8, "#f7a04b", "#a84300"), (1.01, "#e2533f", "#8f1d12"))  # fmt: skip
"""Upper limit of the probability, fill, edge. Lightness falls with evidence, so that it survives a black and white print."""
_KEYS = ("below 0.05", "to 0.2", "to 0.5", "to 0.8", "above 0.8")


def colours(value: float) -> tuple[str, str]:
    """Fill and edge for a probability."""
    return next((fill, edge) for limit, fill, edge in _STEPS if value < limit)


def scheme(subsystems: Mapping[str, float]) -> Markup:
    """The drawing, coloured by the probability that something is wrong in each subsystem (missing: zero)."""
    p = {name: min(max(float(subsystems.get(name, 0.0)), 0.0), 1.0) for name in SUBSYSTEMS}
    order = sorted(SUBSYSTEMS, key=lambda name: p[name])  # what is in doubt lies on top
    said = ", ".join(f"{SUBSYSTEM_NAMES[n]} {probability(p[n])}" for n in reversed(order) if _doubted(p[n]))
    return render(
        "boom_report/diagnosis/scheme.html",
        said=said or "No subsystem is in doubt",
        parts=[_part(name, p[name]) for name in order],
        keys=list(zip(_STEPS, _KEYS, strict=True)),
    )


def _doubted(value: float) -> bool:
    return value >= _STEPS[0][0]


def _part(name: str, value: float) -> dict[str, object]:
    fill, edge = colours(value)
    x, y, anchor = _LABELS[name]
    title = SUBSYSTEM_NAMES[name]
    label = title if name != "structure" else "boom"
    return {
        "name": name, "fill": fill, "edge": edge, "doubted": _doubted(value), "title": title, "label": label,
        "probability": probability(value), "x": x, "y": y, "anchor": anchor,
    }  # fmt: skip


# Where the name is written: x, y, anchor.
_LABELS = {
    "structure": (240, 78, "middle"), "load": (503, 226, "middle"), "cylinder": (246, 350, "start"),
    "oil": (172, 350, "end"), "friction": (246, 317, "start"), "hose_burst_valve": (246, 431, "start"),
    "accumulators": (98, 394, "middle"), "main_valve": (392, 606, "start"), "pilot_valves": (244, 603, "end"),
    "supply": (258, 636, "end"), "return_line": (360, 638, "start"), "sensors": (412, 386, "end"),
}  # fmt: skip
