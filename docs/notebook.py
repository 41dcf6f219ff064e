"""The tutorial as a notebook: text becomes text, each block of code a cell; commands become lines that begin with "!"."""

from __future__ import annotations

import hashlib
import json
import re
from pathlib import Path
from typing import Any

PAGE = Path(__file__).with_name("tutorial.md")
_BLOCK = re.compile(r"^```(python|sh)( slow)?\n(.*?)^```\n", re.MULTILINE | re.DOTALL)
_HERE = 'import os\n\nif not os.path.exists("boom"):  # the commands are typed at the top of the repository\n    os.chdir("..")'


def notebook() -> str:
    """The text of tutorial.ipynb; cells that take a minute have the tag ``slow``."""
    text = PAGE.read_text("utf-8")
    cells, end = [_cell("code", _HERE)], 0
    for block in _BLOCK.finditer(text):
        cells.append(_cell("markdown", text[end : block.start()].strip()))
        code = block[3].strip()
        tags = ["slow"] if block[2] else []
        cells.append(_cell("code", code if block[1] == "python" else "!" + code.replace("\n", "\n!"), tags))
        end = block.end()
    cells.append(_cell("markdown", text[end:].strip()))
    python = {"display_name": "Python 3", "language": "python", "name": "python3"}
    document = {
        "cells": [cell for cell in cells if cell["source"]],
        "metadata": {"kernelspec": python, "language_info": {"name": "python"}},
        "nbformat": 4,
        "nbformat_minor": 5,
    }
    return json.dumps(document, indent=1, ensure_ascii=False) + "\n"


def _cell(kind: str, source: str, tags: list[str] | None = None) -> dict[str, Any]:
    lines = source.splitlines(keepends=True)
    cell = {"cell_type": kind, "id": hashlib.sha256(source.encode()).hexdigest()[:8], "metadata": {"tags": tags or []}}
    return {**cell, **({"execution_count": None, "outputs": []} if kind == "code" else {}), "source": lines}
