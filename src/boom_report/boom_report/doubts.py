"""Doubts about recordings and their levels in words, for the terminal and the reports of validation and chain."""

from __future__ import annotations

from collections.abc import Sequence
from textwrap import wrap

from markupsafe import Markup
from rich.console import Console
from rich.text import Text

from boom_checks.check import RecordingCheck
from boom_checks.doubts import FirstLook
from boom_recording.recording import Recording
from boom_report.templates import render


def damage_lines(recording: Recording) -> list[str]:
    """One line for each part of its files that could not be read."""
    return [f"damaged file: {warning}" for warning in recording.warnings]


def check_lines(checks: Sequence[RecordingCheck]) -> list[str]:
    """One line a doubt: what has to be repaired first, then remarks."""
    return [f"{'repair first' if check.spoils else 'remark'}: {check.topic}: {check.sentence}" for check in checks]


def print_first_looks(looks: Sequence[FirstLook], console: Console) -> None:
    """What has to be repaired and the levels, per recording; remarks and parts are in report and JSON."""
    for look in looks:
        lines = [(line, "bold red") for line in check_lines([check for check in look.checks if check.spoils])]
        lines += [(level.sentence, "") for level in look.statics.levels] if look.statics else [(look.no_levels, "dim")]
        if lines:
            console.print(Text.assemble((look.name, "bold"), ", before any model:"))
        for line, style in lines:
            for part in wrap(line, console.width, initial_indent="  ", subsequent_indent="  "):
                console.print(Text(part, style))


def section(looks: Sequence[FirstLook]) -> Markup:
    """HTML of a section."""
    return render("boom_report/doubts.html", looks=looks, check_lines=check_lines)
