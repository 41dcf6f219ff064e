"""Files that commands write: refused before the work where they could not be written, one line where writing fails."""

from __future__ import annotations

import json
import math
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

from boom_bringup.cli import UsageError


def checked(given: str | None, option: str) -> Path | None:
    """The path of an output file; None where none was asked for.

    Raises:
        UsageError: it could not be written.
    """
    if given is None:
        return None
    path = Path(given)
    if not given or path.is_dir():
        raise UsageError(f"{option} {given or '(empty)'}: this is a folder, give the name of a file in it")
    if not path.parent.is_dir():
        raise UsageError(f"{option} {given}: there is no folder {path.parent}: create it first")
    if not os.access(path if path.exists() else path.parent, os.W_OK):
        raise UsageError(f"{option} {given}: may not be written by this user: give another path")
    return path


def default_report(command: str, bags: list[str]) -> Path:
    """Where the report of a command goes that was not told; makes the folder ``output``.

    Raises:
        UsageError: the folder cannot be made.
    """
    folder = Path("output")
    try:
        folder.mkdir(exist_ok=True)
    except OSError as error:
        raise UsageError(
            f"folder output cannot be made here ({error.strerror}): give --report FILE or --no-report"
        ) from None
    first = Path(bags[0])
    name = first.stem if first.suffix in (".mcap", ".zstd", ".yaml") else first.resolve().name
    more = f"-and-{len(bags) - 1}-more" if len(bags) > 1 else ""
    path = checked(str(folder / f"{command}-{name}{more}.html"), "report")
    assert path is not None
    return path


def write(path: Path, action: Callable[[], Any]) -> None:
    """Run what writes ``path``.

    Raises:
        UsageError: it failed, e.g. because the disk is full.
    """
    try:
        action()
    except OSError as error:
        raise UsageError(f"{path}: cannot be written: {error.strerror or error}") from None


def json_text(document: dict[str, Any]) -> str:
    """A document as JSON; null for what is no finite number: JSON knows no NaN."""
    return json.dumps(_finite(document), indent=2, allow_nan=False) + "\n"


def write_json(path: Path, document: dict[str, Any]) -> None:
    """Write a document as JSON.

    Raises:
        UsageError: it failed.
    """
    text = json_text(document)
    write(path, lambda: path.write_text(text, encoding="utf-8"))


def _finite(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _finite(entry) for key, entry in value.items()}
    if isinstance(value, list):
        return [_finite(entry) for entry in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
