"""CSV of any dialect. The dialect that makes most cells of the file's beginning numbers is the right one.

Tried are all separators with both decimal marks. Above the first line of numbers lie header, a line of units, and a preamble.
"""

from __future__ import annotations

import csv
import re
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
import pandas as pd

from boom_import import timing, units
from boom_import.errors import ImportingError
from boom_import.source import Column, Floats, Source, column, unique
from boom_input.files import opened
from boom_input.shown import quoted

_SEPARATORS = (";", ",", "\t", "|", " ")
_HEAD_BYTES, _HEAD_LINES = 200_000, 300
_UNITS = re.compile(r"unit|einheit", re.IGNORECASE)
_TOO_FEW = 2
_PREAMBLE = 10
"""Lines of numbers that no preamble has before a heading."""
_ROWS = 50_000
_MOST_COLUMNS = 2000
_EMPTY = frozenset(("", "nan", "n/a", "na", "null", "none", "-", "--", "inf", "-inf", "#n/a"))
_NUMBER = {
    mark: re.compile(rf"[+-]?(?:\d+(?:{re.escape(mark)}\d*)?|{re.escape(mark)}\d+)(?:[eE][+-]?\d+)?", re.ASCII)
    for mark in ".,"
}
_BROKEN = re.compile(r"[-+]?[.,]?\d")
_MINUS = "\u2212"
"""The sign as office programs write it."""
_BREAKS = re.compile(r"\s*[\r\n]\s*")
_FORMULA = re.compile(r'="[^"]*"')
_GROUPED = re.compile(
    r"[-+]?\d{1,3}(?:(?:\.\d{3}){2,}(?:,\d+)?|\.\d{3},\d+|(?:,\d{3}){2,}(?:\.\d+)?|,\d{3}\.\d+|(?:['\u2019\u00a0\u202f]\d{3})+(?:[.,]\d+)?)"
)
_DATE = re.compile(r"\d{4}[-/.]\d{1,2}[-/.]\d{1,2}|\d{1,2}[-/.]\d{1,2}[-/.]\d{2,4}")
_CLOCK = re.compile(r"\d{1,2}:\d{2}(:\d{2}([.,:]\d+)?)?")


@dataclass(frozen=True)
class Dialect:
    """How a file is written: encoding, separator, decimal mark, first line of numbers (from 0), headers and their units."""

    encoding: str
    separator: str
    decimal: str
    first: int
    headers: tuple[str, ...]
    stated: tuple[str, ...]
    clocks: dict[int, str]


def read(path: Path, choice: timing.TimeChoice, progress: Callable[[float], None]) -> Source:
    """The columns of a CSV file.

    Raises:
        ImportingError: no table of numbers, or no time in it.
        InputError: not a regular file.
    """
    with opened(path) as file:
        dialect = sniff(file.read(_HEAD_BYTES))
        size = file.seek(0, 2)
        file.seek(0)
        parts, lost = _parts(file, dialect, lambda: progress(file.tell() / max(size, 1)))
    taken: set[str] = set()
    raw = []
    for i, header in enumerate(dialect.headers):
        name, unit = units.split(header)
        unit = dialect.stated[i] or unit
        values = parts[i]
        raw.append(timing.RawColumn(unique(header, taken), name, unit, values, dialect.clocks.get(i, "")))
    axis = timing.axis(raw, choice)
    columns: list[Column] = []
    taken_from: list[timing.RawColumn] = []
    for entry in raw:
        if entry.key != axis.column and not entry.clock:
            made = column(entry.key, entry.name, entry.unit, axis.stamps_ns, entry.values[axis.rows])
            columns += [made] if made else []
            taken_from += [entry] if made else []
    said = {"\t": "tabs", " ": "spaces"}.get(dialect.separator, f"'{dialect.separator}'")
    notes = [f"lines with another number of cells are left out: {lost}"] if lost else []
    notes += [*axis.notes, *timing.without_number(taken_from, axis)]
    kind = f"CSV, {said}, decimal {'comma' if dialect.decimal == ',' else 'point'}"
    return Source(path, kind, columns, axis.dated, axis.said, notes)


def sniff(head: bytes) -> Dialect:
    """The dialect of a file that begins with `head`.

    Raises:
        ImportingError: its beginning holds no table of numbers.
    """
    if b"\0" in head and head[:2] not in (b"\xff\xfe", b"\xfe\xff"):
        raise ImportingError(
            "it is neither text nor of a kind that is known: CSV, MAT, MF4, MCAP, rosbag2 .db3 or ROS 1 .bag"
        )
    encoding, text = _decoded(head)
    lines = text.replace(_MINUS, "-").splitlines()
    if len(head) == _HEAD_BYTES:
        lines = lines[:-1]  # may be cut
    lines = lines[:_HEAD_LINES]
    best: tuple[float, str, str, list[list[str]], int] | None = None
    for separator in _SEPARATORS:
        rows = _records(lines, separator)
        for decimal in ".,":
            if decimal == separator:
                continue
            score, first = _table_score(rows, decimal)
            if first >= 0 and (best is None or score > best[0]):
                best = score, separator, decimal, rows, first
    if best is None or best[0] <= 0:
        raise ImportingError(_no_table([line for line in lines if line.strip()]))
    _, separator, decimal, rows, first = best
    width = max(len(row) for row in rows[first : first + 20])
    if width > _MOST_COLUMNS:
        raise ImportingError(f"its lines have {width} cells: more than {_MOST_COLUMNS} columns are not read")
    headers, stated = _headers([row for row in rows[:first] if any(row)], width)
    clocks = {i: _clock([row[i] for row in rows[first : first + 20] if len(row) > i], decimal) for i in range(width)}
    return Dialect(encoding, separator, decimal, first, headers, stated, {i: c for i, c in clocks.items() if c})


def _no_table(lines: list[str]) -> str:
    """Why the lines that are not blank hold no table of numbers."""
    cells = [cell.strip() for line in lines[1:] for separator in _SEPARATORS[:-1] for cell in line.split(separator)]
    for written, what in (
        (_FORMULA, "are formulas: save the values"),
        (_GROUPED, "have thousands separators: save them without"),
    ):
        if found := next((cell for cell in cells if written.fullmatch(cell)), ""):
            return f"cells like {quoted(found, 40)} {what}"
    if 0 < len(lines) <= _TOO_FEW and any(len(_cells(lines[0], separator)) > 2 for separator in _SEPARATORS[:-1]):
        return f"below its header there are {len(lines) - 1} rows of numbers: nothing was recorded"
    if not lines:
        return f"its first line has more than {_HEAD_BYTES // 1000} kB: it is no table with at most {_MOST_COLUMNS} columns"
    if len(lines) > 2 and all(any(n.fullmatch(line.strip()) for n in _NUMBER.values()) for line in lines[1:-1]):
        return "its lines hold one number each: time and signals belong side by side, in columns of one file"
    return "there is no table of numbers in its beginning: is it a CSV file?"


def _decoded(head: bytes) -> tuple[str, str]:
    if head[:2] in (b"\xff\xfe", b"\xfe\xff"):
        return "utf-16", head[: len(head) // 2 * 2].decode("utf-16", "replace")
    try:
        return "utf-8-sig", head[: max(0, len(head) - 4)].decode("utf-8-sig") if len(
            head
        ) == _HEAD_BYTES else head.decode("utf-8-sig")
    except UnicodeDecodeError:
        return "cp1252", head.decode("cp1252", "replace")


def _records(lines: list[str], separator: str) -> list[list[str]]:
    """The cells of all records; a quoted cell may hold line breaks, as pandas has it where it skips what is above the numbers."""
    if separator != " ":
        try:
            found = list(csv.reader((line + "\n" for line in lines), delimiter=separator, skipinitialspace=True))
        except csv.Error:
            found = []
        if len(found) > len(lines) / 2:  # a quote that is left open takes all that follows
            return [[_BREAKS.sub(" ", cell.strip()) for cell in row] for row in found]
    return [_cells(line, separator) for line in lines]


def _cells(line: str, separator: str) -> list[str]:
    if separator == " ":
        return line.split()
    try:
        return [cell.strip() for cell in next(csv.reader([line], delimiter=separator), [])]
    except csv.Error:
        return [line]


def _is_value(cell: str, decimal: str) -> bool:
    return bool(_NUMBER[decimal].fullmatch(cell)) or (
        cell[:1].isdigit() and bool(_DATE.match(cell) or _CLOCK.fullmatch(cell))
    )


def _table_score(rows: list[list[str]], decimal: str) -> tuple[float, int]:
    """Cells that are numbers less those that are broken ones, over the lines of numbers; the first such line or -1.

    A broken number, such as "0,5;12" where the separator is wrong, weighs three; a word may be a column of its own. A preamble may
    have a few lines of numbers, too: the table begins behind a heading that follows less than ``_PREAMBLE`` of them.
    """
    score, first, widths, count = 0.0, -1, list[int](), 0
    for number, row in enumerate(rows):
        values = sum(_is_value(cell, decimal) for cell in row)
        others = [cell for cell in row if cell.lower() not in _EMPTY and not _is_value(cell, decimal)]
        if len(row) < 2 or values < len(others) or values == 0:
            if count < _PREAMBLE and _is_heading(others):
                first, count = -1, 0
            continue
        first, count = number if first < 0 else first, count + 1
        score += values - sum(3.0 if _BROKEN.match(cell) else 0.3 for cell in others)
        widths.append(len(row))
    if len(widths) < 2:
        return 0.0, -1
    return score * widths.count(max(set(widths), key=widths.count)) / len(widths), first


def _is_heading(words: list[str]) -> bool:
    """Whether the cells of a line that are no numbers are names, of which no two are the same."""
    return len(words) > 1 and len(set(words)) == len(words)


def _headers(above: list[list[str]], width: int) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Names and units of the columns from the lines above the numbers."""
    stated = ("",) * width
    blank = tuple(f"column {i + 1}" for i in range(width))
    fitting = [_widened(row, width) for row in above if len(row) in (width, width - 1, width + 1)]
    if not fitting:
        return blank, stated
    named = fitting[-1]
    if len(fitting) > 1 and _are_units(named):
        stated, named = tuple(cell.strip("[]()") for cell in named), fitting[-2]
    elif told := [
        row for row in fitting[:-1] if _UNITS.search(row[0]) and _are_units(row[1:])
    ]:  # in a preamble, as of LabVIEW
        stated = ("", *(cell.strip("[]()") for cell in told[-1][1:]))
    names = (cell.lstrip("#% ").strip() for cell in named)
    return tuple(name or other for name, other in zip(names, blank, strict=True)), stated


def _widened(row: list[str], width: int) -> list[str]:
    if len(row) == width + 1 and row[0] in ("#", "%", "//"):
        return row[1:]
    return [*row, ""][:width]


def _are_units(row: list[str]) -> bool:
    filled = [cell for cell in row if cell]
    return bool(filled) and sum(units.parse(cell).measure is not None for cell in filled) > 0.6 * len(filled)


def _clock(cells: list[str], decimal: str) -> str:
    filled = [cell for cell in cells if cell.lower() not in _EMPTY]
    if not filled or all(_NUMBER[decimal].fullmatch(cell) for cell in filled):
        return ""
    if all(_CLOCK.fullmatch(cell) for cell in filled):
        return "time of day"
    return "date" if all(_DATE.match(cell) for cell in filled) else ""


def _parts(file: BinaryIO, dialect: Dialect, progress: Callable[[], None]) -> tuple[list[Floats], int]:
    """The columns (n,) and the number of lines that do not fit; text is in memory for a part of the file only."""
    options: dict[str, Any] = {
        "sep": r"\s+" if dialect.separator == " " else dialect.separator,
        "decimal": dialect.decimal, "header": None, "names": list(range(len(dialect.headers))), "skiprows": dialect.first,
        "encoding": dialect.encoding, "encoding_errors": "replace", "skip_blank_lines": True,
        "low_memory": True, "index_col": False, "skipinitialspace": True,
        "dtype": dict.fromkeys(dialect.clocks, str), "on_bad_lines": "warn", "chunksize": _ROWS, "na_values": list(_EMPTY),
    }  # fmt: skip
    parts: list[list[Floats]] = [[] for _ in dialect.headers]
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        for frame in pd.read_csv(file, **options):
            for i, collected in enumerate(parts):
                collected.append(_numbers(frame[i], dialect.clocks.get(i, ""), dialect.decimal))
            progress()
    lost = sum(str(w.message).count("Skipping line") for w in caught)
    if not parts[0]:
        raise ImportingError("there is no line of numbers in it")
    return [np.concatenate(collected) for collected in parts], lost


def _numbers(series: Any, clock: str, decimal: str) -> Floats:
    if clock == "time of day":
        text = series.str.replace(",", ".")
        made = pd.to_timedelta(text.where(text.str.count(":") > 1, text + ":00"), errors="coerce").dt.total_seconds()
    elif clock == "date":
        text = series.str.replace(",", ".")
        first = next((cell for cell in text if isinstance(cell, str)), "")
        day_first = bool(re.match(r"\d{1,2}\.", first))
        dates = pd.to_datetime(
            text,
            errors="coerce",
            utc=True,
            dayfirst=day_first,
            format="ISO8601" if re.match(r"\d{4}-", first) else "mixed",
        )
        made = (dates - datetime(1970, 1, 1, tzinfo=UTC)).dt.total_seconds()
    elif series.dtype.kind in "OSU" or str(series.dtype).startswith("str"):
        text = series.astype(str).str.strip().str.replace(_MINUS, "-")
        made = pd.to_numeric(text.str.replace(",", ".") if decimal == "," else text, errors="coerce")
    else:
        made = series
    return np.asarray(made.to_numpy(dtype=np.float64, na_value=np.nan))
