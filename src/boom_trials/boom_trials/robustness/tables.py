"""The result of the robustness test on a terminal: Table 6.3 of the thesis beside ours, and further requested results."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from rich import box
from rich.console import Console
from rich.table import Table

from boom_report.tracking.position_error import THESIS

PRINTED = "thesis, Table 6.3"


def print_document(numbers: Mapping[str, Any], console: Console, *, limited: bool) -> None:
    """Prints the document of ``boom_trials.robustness.document``; ``limited``: the supply was."""
    with console.capture() as printed:
        console.print(
            "Piston position, mean over nine trajectories: MAE / MAXE / RMSE [mm] / rho [ms], supply "
            + ("limited" if limited else "unlimited"),
            markup=False,
        )
        console.print(_configurations(numbers))
        console.print("per pose, MAE / MAXE [mm] and force oscillation above 0.8 Hz [kN]", markup=False)
        console.print(_poses(numbers))
        _stopped(numbers, console)
        if "off_nominal" in numbers:
            console.print("C0 on plants 5 % off nominal, MAE / MAXE / RMSE [mm] / rho [ms]", markup=False)
            console.print(_off_nominal(numbers["off_nominal"]))
        for part, title in (
            ("monte_carlo", "Monte Carlo over Table 6.1 and +-5 % on dead zone, spring, areas, pilot lag"),
            ("monte_carlo_unloaded", "Monte Carlo, C0 with +-5 % on dead zone, spring, areas, pilot lag"),
        ):
            if part in numbers:
                console.print(title, markup=False)
                console.print(_monte_carlo(numbers[part]))
        if "requirements" in numbers:
            console.print(
                "what is asked and what is reached (*: not met; rho: largest of largest error over largest speed, ms)",
                markup=False,
            )
            console.print(_requirements(numbers["requirements"]))
        if "stability_map" in numbers:
            console.print("largest dead time [ms] up to which the loop is stable (-: never stable)", markup=False)
            console.print(_stability(numbers["stability_map"]))
    console.file.write("\n".join(line.rstrip() for line in printed.get().splitlines()) + "\n")


def three(numbers: Mapping[str, Any]) -> str:
    """``MAE / MAXE / RMSE`` [mm] ``/ rho`` [ms], with the number of diverged runs where there are any."""
    ended = [f"{numbers[word]} {word}" for word in ("diverged", "stopped") if numbers[word]]
    if numbers["mae_mm"] is None:
        return ", ".join(ended)
    rho = "" if numbers.get("rho_ms") is None else f" / {numbers['rho_ms']:.0f}"
    return ", ".join([f"{numbers['mae_mm']:.2f} / {numbers['maxe_mm']:.1f} / {numbers['rmse_mm']:.2f}{rho}", *ended])


def largest_dead_times(stability: Mapping[str, Any], mode: str, pose: str) -> dict[str, str]:
    """Case -> largest dead time [ms] below which no run was unstable, "-" if the first was."""
    result = {}
    for case, stable in stability["maps"][mode][pose].items():
        count = next((i for i, s in enumerate(stable) if not s), len(stable))
        result[case] = str(stability["dead_time_ms"][count - 1]) if count else "-"
    return result


def _configurations(numbers: Mapping[str, Any]) -> Table:
    names = list(next(iter(numbers["modes"].values())))
    table = _table("", *names)
    table.add_row(PRINTED, *(" / ".join(f"{1e3 * v:.3g}" for v in THESIS[name]) for name in names))
    for mode, each in numbers["modes"].items():
        table.add_row(mode, *(three(each[name]) for name in names))
        if all("interval_90" in each[name] for name in names):
            intervals = (each[name]["interval_90"].get("mae_mm") for name in names)
            table.add_row("  MAE, 90 %", *(f"{i[0]:.2f} .. {i[1]:.2f}" if i else "-" for i in intervals))
    return table


def _poses(numbers: Mapping[str, Any]) -> Table:
    names = list(next(iter(numbers["modes"].values())))
    table = _table("", "pose", *names)
    for mode, each in numbers["modes"].items():
        for pose in each[names[0]]["poses"]:
            table.add_row(mode, pose, *(_short(each[name]["poses"][pose]) for name in names))
    return table


def _short(numbers: Mapping[str, Any]) -> str:
    ended = [f"{numbers[word]} {word}" for word in ("diverged", "stopped") if numbers[word]]
    if numbers["mae_mm"] is None:
        return ", ".join(ended)
    text = f"{numbers['mae_mm']:.2f} / {numbers['maxe_mm']:.1f}, {numbers['force_oscillation_n'] / 1e3:.1f}"
    return ", ".join([text, *ended])


def _stopped(numbers: Mapping[str, Any], console: Console) -> None:
    for mode, each in numbers["modes"].items():
        for name, values in each.items():
            if "stops" in values:
                s = values["stops"]
                console.print(
                    f"{mode}, {name}: stopped in {values['stopped']} runs, after {s['latest_s']:.1f} s at the latest, e.g.: "
                    f"{s['reason']}",
                    markup=False,
                )


def _off_nominal(numbers: Mapping[str, Any]) -> Table:
    modes = list(numbers)
    table = _table("plant", *modes)
    for case in numbers[modes[0]]:
        table.add_row(case, *(three(numbers[mode][case]) for mode in modes))
    return table


def _monte_carlo(numbers: Mapping[str, Any]) -> Table:
    table = _table("", "plants", "diverged", "MAE / MAXE / RMSE / rho, mean", "MAE 5 / 50 / 95 / 100 %, mm")
    for mode, each in numbers.items():
        quantiles = each.get("mae_mm_quantiles", {})
        means = three({**each, "diverged": 0, "stopped": 0}) if quantiles else "-"
        table.add_row(
            mode, str(each["plants"]), str(each["diverged"]), means, " / ".join(f"{v:.2f}" for v in quantiles.values())
        )
    return table


def _requirements(rows: Sequence[Mapping[str, Any]]) -> Table:
    modes = list(rows[0]["reached"])
    table = _table("plant", "asked, at most", *modes)
    for row in rows:
        asked = ", ".join(f"{name} {a['at_most']:g} {a['unit']}".rstrip() for name, a in row["asked"].items())
        table.add_row(row["row"], asked, *(_one_reached(row["reached"][mode], row["asked"]) for mode in modes))
    return table


def _one_reached(reached: Mapping[str, Any], asked: Mapping[str, Any]) -> str:
    values = [reached["numbers"][name] for name in asked]
    text = ", ".join("-" if value is None else f"{value:.3g}" for value in values)
    lost = f", {reached['lost']} lost" if reached["lost"] else ""
    largest = reached["numbers"].get("rho")
    rho = "" if largest is None or "rho" in asked else f" (rho {largest:.0f})"
    return f"{text}{lost}{rho}{'' if reached['met'] else ' *'}"


def _stability(stability: Mapping[str, Any]) -> Table:
    maps = stability["maps"]
    cases = list(next(iter(next(iter(maps.values())).values())))
    table = _table("", "pose", *cases)
    for mode, poses in maps.items():
        for pose in poses:
            table.add_row(mode, pose, *largest_dead_times(stability, mode, pose).values())
    return table


def _table(*columns: str) -> Table:
    table = Table(box=box.SIMPLE_HEAD, pad_edge=False, show_edge=False)
    for column in columns:
        table.add_column(column, justify="left", overflow="fold")
    return table
