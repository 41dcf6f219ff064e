"""The report of the robustness test: tables, pictures like Figs. 6.5 to 6.9, stability maps. One HTML file without a network."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from datetime import datetime
from pathlib import Path
from typing import Any

from boom_input.whole import write_whole
from boom_report import palette, terms
from boom_report.page import chart, page
from boom_report.templates import render
from boom_report.tracking.position_error import THESIS
from boom_trials.robustness.figures import COLOURS, figure, stability_figure
from boom_trials.robustness.study import Result
from boom_trials.robustness.tables import PRINTED, three

_METHOD = (
    "Plant: the full model (5.39), stepped by 10 ms with held currents; sensors of ch. 6.4 (angle quantised, pressure noise "
    "0.17 bar rms and 0.1 bar steps, rate noise 1.5 mrad/s). The load of the configuration is attached from the first instant, "
    "beside what the recording says, and the controller does not know of it. A piston more than 100 mm from its reference "
    "counts as diverged and is left out of the means. Force oscillation: rms of the piston force against the one that the "
    "reference needs (6.2), above 0.8 Hz."
)
_FURTHER = (
    ("off_nominal", "C0 on plants 5 % off nominal"),
    ("monte_carlo", "Monte Carlo over Table 6.1, valve within 5 %"),
    ("monte_carlo_unloaded", "Monte Carlo at C0, valve within 5 %"),
)
_FIGURE = {"C0": "6.5", "C1": "6.6", "C2": "6.7", "C3": "6.8", "C4": "6.9"}


def write_report(
    path: Path, numbers: Mapping[str, Any], results: Mapping[str, Sequence[Result]], *, command: str, limited: bool
) -> None:
    """Writes the report of ``numbers`` (``boom_trials.robustness.document``); pictures from the results that kept a history.

    Raises:
        OSError: the file cannot be written.
    """
    kept = [r for r in results["configurations"] if r.history is not None]
    cases = dict.fromkeys(r.job.case.name for r in kept)
    body = render(
        "boom_trials/robustness/report.html",
        numbers=numbers,
        limited=limited,
        when=datetime.now().astimezone().strftime("%Y-%m-%d %H:%M %z"),
        command=command,
        method=_METHOD,
        main=_main_table(numbers),
        poses=_poses(numbers),
        further=[(title, _further(numbers[key])) for key, title in _FURTHER if key in numbers],
        stability=chart(stability_figure(numbers["stability_map"])) if "stability_map" in numbers else "",
        pictures={name: [r for r in kept if r.job.case.name == name] for name in cases},
        figures=_FIGURE,
        colours=COLOURS,
        variable=palette.variable,
        chart=chart,
        words=terms.section("C0 to C4", "control law", "MAE, rms, RMSE, MAXE", "90 % interval"),
        figure=figure,
    )
    write_whole(path, page("Robustness of the closed loop", body))


def _main_table(numbers: Mapping[str, Any]) -> tuple[list[str], list[list[str]]]:
    names = list(next(iter(numbers["modes"].values())))
    rows = [[PRINTED, *(" / ".join(f"{1e3 * v:.3g}" for v in THESIS[name]) for name in names)]]
    for mode, each in numbers["modes"].items():
        rows.append([mode, *(three(each[name]) for name in names)])
        if all(each[name].get("interval_90") for name in names):
            intervals = ("{:.2f} .. {:.2f}".format(*each[name]["interval_90"]["mae_mm"]) for name in names)
            rows.append(["MAE, 90 % over seeds", *intervals])
    return ["", *names], rows


def _poses(numbers: Mapping[str, Any]) -> list[list[str]]:
    rows = []
    for mode, each in numbers["modes"].items():
        for name, values in each.items():
            for pose, n in values["poses"].items():
                oscillation = "-" if n["force_oscillation_n"] is None else f"{n['force_oscillation_n'] / 1e3:.2f}"
                rows.append([mode, name, pose, three(n), oscillation])
    return rows


def _further(numbers: Mapping[str, Any]) -> list[list[str]]:
    rows = []
    for mode, each in numbers.items():
        if "plants" in each:
            quantiles = " / ".join(f"{v:.2f}" for v in each.get("mae_mm_quantiles", {}).values())
            rows.append([mode, f"{each['plants']} plants", three(each), f"MAE 5 / 50 / 95 / 100 %: {quantiles} mm"])
        else:
            rows += [[mode, case, three(values), ""] for case, values in each.items()]
    return rows
