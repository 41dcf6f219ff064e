"""The score for a terminal, as Markdown and as a JSON document."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from math import isfinite
from typing import Any

from boom_trials.blind import scoring
from boom_trials.blind.outcomes import Row
from boom_trials.blind.scoring import Measure
from boom_trials.blind.trial import TrialState


def value_text(measure: Measure) -> str:
    """The measured value with its 95 % bounds."""
    if measure.value is None:
        return "no case"
    if measure.unit != "%":
        return f"{measure.value:.3f}"
    bounds = f" ({measure.low:.0f}-{measure.high:.0f})" if measure.low is not None and measure.high is not None else ""
    return f"{measure.value:.1f} %{bounds}"


def wanted_text(measure: Measure) -> str:
    """The requirement."""
    if measure.unit != "%":
        return f"at most {measure.most:g}"
    if measure.least is not None and measure.most is not None:
        return f"{measure.least:g}-{measure.most:g} %"
    return f"at least {measure.least:g} %" if measure.least is not None else f"at most {measure.most:g} %"


def met_text(measure: Measure) -> str:
    """Yes, no, too few cases, or "-" without a value."""
    return "too few cases" if measure.too_few else {True: "yes", False: "no", None: "-"}[measure.met]


def heading(state: TrialState) -> str:
    """Identification of the trial."""
    return (
        f"seed {state.seed}, {state.count} cases, machine {state.machine}, version {state.version}, begun {state.begun}, "
        f"answers {state.sha256[:16]}"
    )


def percent(error: float) -> str:
    """A normalised error (1 = the channel's standard deviation)."""
    return f"{100 * error:.2f} %" if isfinite(error) else "stopped"


def measures_table(rows: Sequence[Row]) -> str:
    """Every measure, as Markdown."""
    lines = ["| measure | cases | measured (95 % bounds) | required | met |", "|---|---|---|---|---|"]
    for m in scoring.measures(rows):
        lines.append(f"| {m.title} | {m.count} | {value_text(m)} | {wanted_text(m)} | {met_text(m)} |")
    return "\n".join(lines)


def strengths_table(rows: Sequence[Row]) -> str:
    """Single effects by multiple of their detectability, as Markdown."""
    lines = ["| detectability | cases | right first | among three | named nothing |", "|---|---|---|---|---|"]
    for strength, (count, first, three, silent) in scoring.by_strength(rows).items():
        shares = " | ".join(f"{100 * n / count:.0f} %" for n in (first, three, silent))
        lines.append(f"| {strength:g} x | {count} | {shares} |")
    return "\n".join(lines)


def document(state: TrialState, rows: Sequence[Row], seconds: float) -> dict[str, Any]:
    """The document of ``prove --json``."""
    return {
        **asdict(state),
        "seconds": seconds,
        "measures": {
            m.key: {
                "title": m.title, "value": m.value, "bounds_95": None if m.low is None else [m.low, m.high], "unit": m.unit,
                "cases": m.count, "at_least": m.least, "at_most": m.most, "met": m.met, "too_few_cases": m.too_few,
            }
            for m in scoring.measures(rows)
        },
        "by_strength": {
            f"{strength:g}": dict(zip(("cases", "right_first", "among_three", "named_nothing"), counts, strict=True))
            for strength, counts in scoring.by_strength(rows).items()
        },
        "calibration": [
            {"confidence": said, "right": right, "cases": count} for said, right, count in scoring.confidence_bins(rows)
        ],
        "confusion": {name: dict(counts) for name, counts in scoring.confusion(rows).items()},
        "cases": [
            {
                "case": row.truth.name, "kind": row.truth.kind,
                "concealed": [
                    {"effect": e.effect, "strength": e.strength, "size": e.size, "unit": e.unit} for e in row.truth.effects
                ],
                "verdict": row.said.verdict, "said": scoring.label(row), "right_first": row.right_first,
                "confidence": row.said.first.confidence if row.said.first else None,
                "gap_closed": row.gap_closed, "seconds": row.seconds,
            }
            for row in rows
        ],
    }  # fmt: skip
