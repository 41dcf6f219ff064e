"""The document of ``robustness --json`` (contract): means per mode and configuration, intervals, off-nominal plants, stability."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from boom_trials.robustness.stability import stability_document
from boom_trials.robustness.study import Result, summary, with_poses

MEASURES = ("mae_mm", "maxe_mm", "rmse_mm")


def document(
    results: Mapping[str, Sequence[Result]], modes: Sequence[str], bags: Sequence[str], seed: int
) -> dict[str, Any]:
    """All numbers; parts that were not requested are left out."""
    configured = results["configurations"]
    numbers: dict[str, Any] = {"modes": {mode: {} for mode in modes}, "trajectories": list(bags), "seed": seed}
    for mode in modes:
        mine = [r for r in configured if r.job.mode == mode]
        for name in dict.fromkeys(r.job.case.name for r in mine):
            chosen = [r for r in mine if r.job.case.name == name]
            numbers["modes"][mode][name] = {**with_poses(chosen), **_intervals(chosen), **_stops(chosen)}
    if "off_nominal" in results:
        numbers["off_nominal"] = {
            mode: {
                name: summary(group)
                for name, group in _by_case(r for r in results["off_nominal"] if r.job.mode == mode)
            }
            for mode in modes
        }
    for part in ("monte_carlo", "monte_carlo_unloaded"):
        if part in results:
            numbers[part] = {mode: _drawn([r for r in results[part] if r.job.mode == mode]) for mode in modes}
    if "stability_map" in results:
        numbers["stability_map"] = stability_document(results["stability_map"])
    return numbers


def _intervals(results: Sequence[Result]) -> dict[str, Any]:
    """5 % and 95 % points of the means over the seeds, if there are several."""
    seeds = list(dict.fromkeys(r.job.seed for r in results))
    if len(seeds) < 2:
        return {}
    each = [summary([r for r in results if r.job.seed == seed]) for seed in seeds]
    known = {name: [e[name] for e in each if e[name] is not None] for name in MEASURES}
    return {
        "interval_90": {
            name: [float(v) for v in np.quantile(values, (0.05, 0.95))] for name, values in known.items() if values
        }
    }


def _stops(results: Sequence[Result]) -> dict[str, Any]:
    """Number and latest time of stops by the controller; empty if there were none."""
    stops = [r.stopped for r in results if r.stopped]
    if not stops:
        return {}
    return {"stops": {"latest_s": max(time for time, _ in stops), "reason": stops[0][1]}}


def _drawn(results: Sequence[Result]) -> dict[str, Any]:
    good = [r for r in results if r.finished]
    numbers = {**summary(results), "plants": len(results)}
    if good:
        numbers["mae_mm_quantiles"] = {
            f"{q:g}": float(1e3 * np.quantile([r.mae for r in good], q)) for q in (0.05, 0.5, 0.95, 1.0)
        }  # fmt: skip
    numbers["diverged_runs"] = [
        {"trajectory": r.job.bag, "load_kg": r.job.case.load, "factors": dict(r.job.case.factors), "why": r.diverged}
        for r in results if r.diverged
    ]  # fmt: skip
    return numbers


def _by_case(results: Iterable[Result]) -> list[tuple[str, list[Result]]]:
    groups: dict[str, list[Result]] = {}
    for result in results:
        groups.setdefault(result.job.case.name, []).append(result)
    return list(groups.items())
