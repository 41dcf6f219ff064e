"""The tables of parameters and control laws in README.md and docs/control.md, made from the specifications that the node reads.

./boom python -m boom_controller.parameter_tables src/boom_controller/README.md docs/control.md
"""

from __future__ import annotations

import re
import sys
from collections.abc import Iterable
from pathlib import Path

from boom_controller import laws
from boom_controller.controller import SETTINGS
from boom_controller.node.node_parameters import OWN, PARAMETERS
from boom_controller.supervision.supervision_settings import SUPERVISION
from boom_node.parameters import ParameterSpec

_MARK = "<!-- {name}: {end} (made by python -m boom_controller.parameter_tables) -->"


def updated(text: str) -> str:
    """The document with every marked table regenerated."""
    tables = {
        "laws": _laws(),
        "parameters": _parameters(OWN),
        "parameters of the laws": _parameters(SETTINGS),
        "parameters of the supervision": _parameters(SUPERVISION),
    }
    for name, table in tables.items():
        begin, end = (_MARK.format(name=name, end=word) for word in ("begin", "end"))
        pattern = re.compile(f"(?<={re.escape(begin)}\n).*?(?={re.escape(end)})", re.DOTALL)
        text = pattern.sub(lambda _, table=table: table, text)  # type: ignore[misc]
    return text


def _laws() -> str:
    rows = (
        (f"`{name}`", text + ("; the default" if name == laws.DEFAULT else ""))
        for name, text in laws.described().items()
    )
    return _table(("mode", "what it is"), rows)


def _parameters(specs: Iterable[ParameterSpec]) -> str:
    declared = {spec.name: spec for spec in PARAMETERS}
    rows = []
    for spec in (declared[spec.name] for spec in specs):
        name = f"`{spec.name}`" + (" (r)" if spec.read_only else "")
        default = str(spec.default).lower() if isinstance(spec.default, bool | str) else f"{spec.default:g}"
        ends = "" if spec.minimum is None else f", {spec.minimum:g} to {spec.maximum:g}"
        rows.append((name, f"{default or '(empty)'} {spec.unit}".strip(), spec.description + ends))
    return _table(("parameter", "default", ""), rows)


def _table(head: tuple[str, ...], rows: Iterable[tuple[str, ...]]) -> str:
    lines = [" | ".join(line).rstrip() for line in (head, *rows)]
    return f"| {lines[0]} |\n|{'---|' * len(head)}\n" + "".join(f"| {line} |\n" for line in lines[1:])


if __name__ == "__main__":
    for document in map(Path, sys.argv[1:]):
        document.write_text(updated(document.read_text(encoding="utf-8")), encoding="utf-8")
