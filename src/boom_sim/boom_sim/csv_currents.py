"""Currents from a CSV file: a header ``time_s,retract_a,extend_a``, then numbers; held from line to line.

Spreadsheets write CSV in the local format: columns separated by commas, semicolons or tabs, decimal commas where the columns are
not separated by commas, quotes, a byte order mark, UTF-16, a first line ``sep=;``. The names in the header are known, so the
character between them separates the columns, without guessing. Empty lines and lines that begin with ``#`` are skipped.
"""

from __future__ import annotations

import csv
import io
import re
from array import array
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from boom_input.files import InputError, read_bytes
from boom_input.shown import quoted
from boom_sim.settings import SimulationSettingError
from boom_sim.simulated_crane import LARGEST_CURRENT

COLUMNS = ("time_s", "retract_a", "extend_a")
LARGEST_FILE = 20_000_000
"""bytes; an hour at 100 Hz has 10 MB."""
LATEST = 3600.0
"""s"""

Array = NDArray[np.float64]

_NUMBER = re.compile(r"[+-]?(?:\d+[.,]?\d*|[.,]\d+)(?:[eE][+-]?\d+)?", re.ASCII)


def read(path: Path) -> tuple[Array, Array]:
    """Times (m,) [s] and currents (m, 2) [A].

    Raises:
        SimulationSettingError: not readable, another header, a line without numbers, times that do not increase, an impossible
            current.
    """
    try:
        text = _text(path)
        lines = _lines(text)
        head, header = next(lines, (1, ""))
        separator = next((s for s in ",;\t" if _names(header, s) == COLUMNS), "")
        if not separator:
            raise SimulationSettingError(
                f"{path}: the first line must be {','.join(COLUMNS)}, separated by commas, semicolons or tabs; "
                f"it is {quoted(repr(header), 80)}"
            )
        table = _table(path, lines, separator)
    except InputError as error:
        raise SimulationSettingError(str(error)) from None
    if not len(table):
        raise SimulationSettingError(f"{path}, line {head}: no currents, only a header")
    if table[-1, 0] <= 0.0:
        raise SimulationSettingError(
            f"{path}: the last time, {table[-1, 0]:g} s, is not after the beginning of the run at 0 s: add a line with its end"
        )
    return table[:, 0], table[:, 1:]


def _text(path: Path) -> str:
    content = read_bytes(path, LARGEST_FILE)
    encoding = "utf-16" if content[:2] in (b"\xff\xfe", b"\xfe\xff") else "utf-8-sig"
    try:
        return content.decode(encoding)
    except UnicodeDecodeError:
        raise SimulationSettingError(f"{path}: cannot be read: not a text file (UTF-8 or UTF-16)") from None


def _lines(text: str) -> Iterator[tuple[int, str]]:
    """Number and text of the lines that are not empty."""
    for number, line in enumerate(io.StringIO(text, newline=None), 1):
        line = line.strip(" \r\n")
        if line.strip() and not line.lstrip().startswith("#") and not (number == 1 and line.lower().startswith("sep=")):
            yield number, line


def _names(header: str, separator: str) -> tuple[str, ...]:
    return tuple(cell.strip().lower() for cell in _cells(header, separator))


def _cells(line: str, separator: str) -> list[str]:
    if '"' not in line:
        return line.split(separator)
    try:
        return next(csv.reader([line], delimiter=separator), [])
    except csv.Error:  # longer than csv takes
        return [line]


def _table(path: Path, lines: Iterator[tuple[int, str]], separator: str) -> Array:
    values = array("d")
    before, mark = -LATEST, ""
    for number, line in lines:
        cells = [cell.strip() for cell in _cells(line, separator)]
        if not any(cells):
            continue
        where = f"{path}, line {number}"
        if len(cells) != 3 or not all(map(_NUMBER.fullmatch, cells)):
            hint = "; decimal commas need semicolons between the columns" if separator == "," and len(cells) > 3 else ""
            raise SimulationSettingError(f"{where}: expected three numbers, found {quoted(repr(line), 60)}{hint}")
        marks = {c for cell in cells for c in cell if c in ".,"} | ({mark} if mark else set())
        if len(marks) > 1 or (separator == "," and "," in marks):
            raise SimulationSettingError(
                f"{where}: decimal points and commas are mixed, {quoted(repr(line), 60)}: write one of them"
            )
        mark = "".join(marks)
        time, *currents = (float(cell.replace(",", ".")) for cell in cells)
        if not before < time <= LATEST:
            raise SimulationSettingError(
                f"{where}: time {time:g} s: times must increase from line to line, up to {LATEST:g} s"
            )
        for current in currents:
            if not 0.0 <= current <= LARGEST_CURRENT:
                raise SimulationSettingError(f"{where}: current {current:g} A: allowed is 0 .. {LARGEST_CURRENT:g} A")
        before = time
        values.extend((time, *currents))
    return np.frombuffer(values).reshape(-1, 3)
