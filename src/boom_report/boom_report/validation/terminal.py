"""The result of a validation on a terminal: Tables 5.1 and 5.2, a verdict per recording, events in short."""

from __future__ import annotations

from rich import box
from rich.console import Console
from rich.table import Table
from rich.text import Text

from boom_identification.validation import BagValidation, Validation
from boom_input.channels import PREDICTED
from boom_report import events
from boom_report.channels import limits_text, number, off, statistic
from boom_report.doubts import damage_lines
from boom_report.validation.reference import REMARK, any_alike, beside_short
from boom_report.validation.tables import load_text
from boom_report.validation.verdict import verdict

NARROW = 88
"""Columns below which pose and load are left out: the report shows them."""

_ANGLE, *_BESIDE_THE_ANGLE = PREDICTED
_STYLES = {"agrees": "green", "differs": "bold red", "stopped": "bold red", "not compared": "yellow"}


def print_validation(validation: Validation, console: Console) -> None:
    """Prints tables, verdicts and events; on a terminal in colour, elsewhere without blanks at the ends of lines."""
    if console.is_terminal:
        _print(validation, console)
        return
    with console.capture() as printed:
        _print(validation, console)
    console.file.write("".join(line.rstrip() + "\n" for line in printed.get().splitlines()))


def _print(validation: Validation, console: Console) -> None:
    narrow = console.width < NARROW
    told = _thesis(validation)
    console.print(full_table(validation, narrow=narrow))
    if validation.bags:
        console.print(limits_text(validation.bags[0].limits), style="dim")
    console.print()
    console.print(reduced_table(validation, narrow=narrow))
    if told:
        console.print(REMARK, style="dim")
        console.print()
    for bag in validation.bags:
        _print_bag(bag, console)


def full_table(validation: Validation, *, narrow: bool = False) -> Table:
    """Table 5.1: the full model against the measurement; ``narrow`` without pose and thesis."""
    thesis = not narrow and _thesis(validation)
    table = _table("Table 5.1: full model against the measurement", narrow)
    table.add_column("angle MAE\n[rad]", justify="right", no_wrap=True)
    for sensor in _BESIDE_THE_ANGLE:
        head = f"{sensor.label.split()[0]} {statistic(sensor)}\n[{sensor.error.name}]"
        table.add_column(head, justify="right", no_wrap=True)
    if thesis:
        table.add_column("thesis MAE\n[rad]", no_wrap=True)
    for bag in validation.bags:
        cells = [_rad(bag.full.metrics["angle_mae_rad"])]
        for sensor in _BESIDE_THE_ANGLE:
            value = bag.full.metrics[sensor.judging]
            cells.append("-" if value is None else number(value * sensor.error.scale))
        styles = ["red" if off(s, bag) else "" for s in (_ANGLE, *_BESIDE_THE_ANGLE)]
        texts = [Text(cell, style) for cell, style in zip(cells, styles, strict=True)]
        table.add_row(*_row(bag, texts, "5.1" if thesis else "", narrow))
    return table


def reduced_table(validation: Validation, *, narrow: bool = False) -> Table:
    """Table 5.2: the reduced model against the full model; ``narrow`` without pose and thesis."""
    thesis = not narrow and _thesis(validation)
    table = _table("Table 5.2: reduced model against the full model", narrow)
    table.add_column("angle MAE\n[rad]", justify="right", no_wrap=True)
    table.add_column("\n[mrad]", justify="right", no_wrap=True)
    if thesis:
        table.add_column("thesis MAE\n[rad]", no_wrap=True)
    for bag in validation.bags:
        value = bag.reduced_vs_full_angle_mae_rad
        shown = "-" if value is None else number(value * 1e3)
        table.add_row(*_row(bag, [Text(_rad(value)), Text(shown)], "5.2" if thesis else "", narrow))
    return table


def _table(title: str, narrow: bool) -> Table:
    table = Table(
        title=title,
        title_justify="left",
        title_style="bold",
        box=box.SIMPLE_HEAD,
        pad_edge=False,
        collapse_padding=True,
        header_style="bold",
    )
    table.add_column("recording", overflow="fold", min_width=12)
    if not narrow:
        for head in ("q3\n[rad]", "q4\n[m]", "load\n[kg]"):
            table.add_column(head, justify="right", no_wrap=True)
    return table


def _print_bag(bag: BagValidation, console: Console) -> None:
    said = verdict(bag)
    console.print(Text.assemble((bag.recording.name, "bold"), ": ", (said.short, _STYLES[said.kind])))
    if bag.reduced.stopped:
        console.print(Text(f"  the reduced model stopped: {bag.reduced.stopped}", "red"))
    if bag.full.evaporated:
        console.print(Text(f"  {bag.full.evaporated}", "yellow"))
    for line in damage_lines(bag.recording):
        console.print(Text(f"  {line}", "yellow"))
    for line in events.summary(bag.recording.events):
        console.print(Text(f"  {line}"))


def _row(bag: BagValidation, numbers: list[Text], thesis_table: str, narrow: bool) -> list[Text]:
    c, name = bag.recording.configuration, Text(bag.recording.name)
    if bag.full.stopped:
        name.append(f"\nstopped: {bag.compared_s:.1f} of {bag.recording.duration:.1f} s", "red")
    if narrow:
        return [name, *numbers]
    pose = [Text(f"{c.outer_boom_angle:g}"), Text(f"{c.telescope_length:g}"), Text(load_text(c.load_mass))]
    return [
        name,
        *pose,
        *numbers,
        *([Text(beside_short(c, thesis_table) or "-")] if thesis_table else []),
    ]


def _thesis(validation: Validation) -> bool:
    """Whether the thesis has values to stand beside these."""
    return any_alike(validation.machine, [bag.recording.configuration for bag in validation.bags])


def _rad(value: float | None) -> str:
    return "-" if value is None else f"{value:.5f}"
