"""What ``./boom identify`` prints."""

import io
from types import SimpleNamespace
from typing import Any

from rich.console import Console

from boom_bringup.commands.identify import _show_held_out


def test_a_channel_that_was_not_measured_has_a_dash_in_the_held_out_check() -> None:
    errors = {"angle": 0.01, "rate": 0.02, "hose_pressure": 0.03}
    held_out = [{"bag": "a", "before": errors, "after": {k: v / 2 for k, v in errors.items()}}]
    result: Any = SimpleNamespace(refined=SimpleNamespace(document=lambda: {"held_out": held_out}))
    out = io.StringIO()
    _show_held_out(result, Console(file=out, width=200, color_system=None))
    row = next(line for line in out.getvalue().splitlines() if " a " in line)
    assert [cell.strip() for cell in row.strip("│").split("│")] == [
        "a",
        "1.00",
        "0.50",
        "2.00",
        "1.00",
        "3.00",
        "1.50",
        "–",
        "–",
    ]
