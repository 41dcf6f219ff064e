"""A fleet on the terminal: one line a machine that has changed, one a recording that failed, and the sums."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from rich.console import Console

from boom_report.fleet import words

Row = Mapping[str, Any]


def print_fleet(rows: Sequence[Row], console: Console) -> None:
    """Print what to look at.

    Args:
        rows: of the table (``boom_fleet.table.rows``), machine by machine in the order of time.
        console: where.
    """
    for machine in words.machines(rows):
        for sentence in machine.sentences:
            console.print(f"{machine.name}: {sentence}", markup=False, soft_wrap=True)
    for row in rows:
        if row.get("failure"):
            console.print(
                f"not screened: {row['machine']}/{row['recording']}: {row['failure']}", markup=False, soft_wrap=True
            )
    console.print(words.sums(rows), markup=False, soft_wrap=True)
