"""The chain on a terminal: per recording the doubts, a table of links, the statics; then the valve at the cylinder."""

from __future__ import annotations

from rich import box
from rich.console import Console
from rich.table import Table
from rich.text import Text

from boom_checks.chain import ChainStudy, RecordingChain
from boom_report import events
from boom_report.chain.figures import link_row
from boom_report.doubts import check_lines, damage_lines

HEADS = ("link", "rms error (90 %)", "NRMSE", "noise and tolerances", "ratio")


def print_chain(study: ChainStudy, console: Console) -> None:
    """Prints the result of ``chain``."""
    for chain in study.chains:
        _print(chain, console)
    if study.valve_sentence:
        console.print(Text(f"valve at the cylinder, fitted on {study.fitted}:"))
        console.print(Text(f"  {study.valve_sentence}"), soft_wrap=True)


def _print(chain: RecordingChain, console: Console) -> None:
    console.print(Text.assemble((chain.recording.name, "bold"), ": ", chain.sentence), soft_wrap=True)
    told = [check for check in chain.checks if check.sentence not in chain.sentence]
    for line in (*damage_lines(chain.recording), *check_lines(told)):
        console.print(Text(f"  {line}", "yellow"), soft_wrap=True)
    for line in events.summary(chain.recording.events):
        console.print(Text(f"  {line}"), soft_wrap=True)
    if chain.links:
        table = Table(box=box.SIMPLE_HEAD, pad_edge=False, header_style="bold")
        for k, head in enumerate(HEADS):
            table.add_column(head, justify="right" if k else "left", no_wrap=True)
        for link in chain.links:
            table.add_row(*(Text(cell, "red" if link.ratio > 1.0 else "") for cell in link_row(link)))
        console.print(table)
    for name, why in chain.missing:
        console.print(Text(f"  {name}: not driven, {why}"), soft_wrap=True)
    for sentence in chain.statics.sentences if chain.statics else ():
        console.print(Text(f"  {sentence}"), soft_wrap=True)
    console.print()
