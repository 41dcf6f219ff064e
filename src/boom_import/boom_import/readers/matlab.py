"""MAT files, v4 to v7.3: every array of numbers becomes columns, with the names and units that stand beside it.

Arrays of one length in one struct are a table; its time lies in that struct or above it ("structure with time" of Simulink).
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import scipy.io

from boom_import import timing, units
from boom_import.errors import ImportingError
from boom_import.source import Column, Source, column, unique
from boom_input.shown import quoted

_SHORTEST = 10
_DEEPEST = 12
_MOST_COLUMNS = 2000
_MOST_NUMBERS = 200_000_000
"""Of one array: 1.6 GB."""
_UNIT_KEYS = ("unit", "units", "einheit", "einheiten")
_NAME_KEYS = (
    "names",
    "name",
    "labels",
    "label",
    "header",
    "headers",
    "columns",
    "channels",
    "kanal",
    "kanaele",
    "signals",
    "vars",
    "namen",
)
_PERIOD_KEYS, _RATE_KEYS = (
    ("ts", "dt", "t_s", "sampletime", "sample_time", "abtastzeit"),
    ("fs", "f_s", "samplerate", "sample_rate", "abtastrate"),
)


@dataclass
class _Struct:
    """A struct of the file: its arrays, texts, single numbers and inner structs."""

    path: str
    above: _Struct | None = None
    arrays: dict[str, Any] = field(default_factory=dict)
    texts: dict[str, list[str]] = field(default_factory=dict)
    numbers: dict[str, float] = field(default_factory=dict)
    inner: list[_Struct] = field(default_factory=list)

    def everything(self) -> Iterator[_Struct]:
        yield self
        for struct in self.inner:
            yield from struct.everything()

    def up(self) -> Iterator[_Struct]:
        yield self
        if self.above is not None:
            yield from self.above.up()


def read(path: Path, choice: timing.TimeChoice, hdf5: bool) -> Source:
    """The columns of a MAT file.

    Raises:
        ImportingError: no arrays, or no time beside them.
    """
    top = _content(path, hdf5)
    read: list[tuple[list[timing.RawColumn], timing.Axis]] = []
    failed: ImportingError | None = None
    for struct in top.everything():
        for raw in _tables(struct):
            try:
                read.append((raw, timing.axis([*raw, *_times_above(struct, raw)], choice, _rate(struct))))
            except ImportingError as error:
                failed = failed or error
    notes = [f"a part of it was left out: {failed}"] if failed and read else []
    dated = any(axis.dated for _, axis in read)
    if dated and not all(axis.dated for _, axis in read):
        notes.append("arrays whose times have no date were left out, because others have one")
    taken: set[str] = set()
    columns: list[Column] = []
    for raw, axis in read:
        if axis.dated != dated:
            continue
        used = [entry for entry in raw if entry.key != axis.column]
        for entry in used:
            made = column(unique(entry.key, taken), entry.name, entry.unit, axis.stamps_ns, entry.values[axis.rows])
            columns += [made] if made else []
        notes += [*axis.notes, *timing.without_number(used, axis)]
    if not columns:
        what = "it holds no arrays of numbers: save signals as plain arrays or structs, not as objects (timeseries, timetable)"
        raise failed or ImportingError(what)
    return Source(path, f"MAT {'v7.3' if hdf5 else 'file'}", columns, dated, read[0][1].said, notes)


def _content(path: Path, hdf5: bool) -> _Struct:
    top = _Struct("")
    if hdf5:
        with h5py.File(path, "r") as file:
            for name in file:
                if not name.startswith("#"):
                    _sort(top, name, _from_hdf5(file, file[name], 0), 0)
    else:
        for name, shape, _ in scipy.io.whosmat(str(path)):  # a compressed file of 4 MB may hold 4 GB
            _check_size(name, math.prod(shape))
        content = scipy.io.loadmat(str(path), simplify_cells=True)
        for name, value in content.items():
            if not name.startswith("__"):
                _sort(top, name, value, 0)
    return top


def _check_size(name: str, numbers: int) -> None:
    if numbers > _MOST_NUMBERS:
        raise ImportingError(
            f"its array '{quoted(name, 60)}' holds {numbers:.3g} numbers, more than the {_MOST_NUMBERS:.0e} that are read: save "
            "a part of it, or export it again if it should not be so large"
        )


def _sort(struct: _Struct, name: str, value: Any, depth: int) -> None:
    """Put one variable where it belongs."""
    if depth > _DEEPEST:
        return
    if isinstance(value, dict):
        inner = _Struct(f"{struct.path}.{name}" if struct.path else name, struct)
        struct.inner.append(inner)
        for label, entry in value.items():
            _sort(inner, str(label), entry, depth + 1)
    elif isinstance(value, str):
        struct.texts[name] = [value]
    elif isinstance(value, list) or (isinstance(value, np.ndarray) and value.dtype.kind in "OUS"):
        _sort_cell(struct, name, list(np.ravel(np.asarray(value, object))), depth)
    elif isinstance(value, np.ndarray) and value.dtype.kind in "fiub":
        array = np.squeeze(value)
        if array.ndim in (1, 2) and max(array.shape) >= _SHORTEST:
            struct.arrays[name] = array
        elif array.size == 1:
            struct.numbers[name.lower()] = float(array.ravel()[0])
    elif isinstance(value, (int, float, np.number)):
        struct.numbers[name.lower()] = float(value)


def _sort_cell(struct: _Struct, name: str, entries: list[Any], depth: int) -> None:
    """A cell is a list of texts, or as many variables as it has entries."""
    if entries and all(isinstance(entry, str) for entry in entries):
        struct.texts[name] = [str(entry) for entry in entries]
        return
    for i, entry in enumerate(entries[:_MOST_COLUMNS]):
        _sort(struct, f"{name}({i + 1})", entry, depth + 1)


def _from_hdf5(file: Any, item: Any, depth: int) -> Any:
    """A variable of a v7.3 file as `scipy.io` gives it for the older ones."""
    if depth > _DEEPEST:
        return None
    if isinstance(item, h5py.Group):
        return {name: _from_hdf5(file, item[name], depth + 1) for name in item}
    kind = item.attrs.get("MATLAB_class", b"")
    if kind == b"char" and item.dtype.kind in "ui":
        return "".join(chr(c) for c in np.ravel(item[()].T) if c)
    if item.dtype.kind == "O":  # a cell, or an array of structs: references
        references = np.ravel(item[()].T)[:_MOST_COLUMNS]
        return [_from_hdf5(file, file[reference], depth + 1) for reference in references if reference]
    _check_size(item.name, item.size)
    return item[()].T if item.dtype.kind in "fiub" else None


def _tables(struct: _Struct) -> Iterator[list[timing.RawColumn]]:
    """The arrays of a struct by their length, cut into columns."""
    by_length: dict[int, list[timing.RawColumn]] = {}
    for name, array in struct.arrays.items():
        key = f"{struct.path}.{name}" if struct.path else name
        table = array if array.ndim == 2 else array[:, None]
        if array.ndim == 2 and array.shape[1] > array.shape[0]:
            table = table.T
        names, stated = _labels(struct, _NAME_KEYS, table.shape[1]), _labels(struct, _UNIT_KEYS, table.shape[1])
        for i in range(min(table.shape[1], _MOST_COLUMNS)):
            own = f"{key}(:,{i + 1})" if array.ndim == 2 else key
            words, unit = units.split(names[i]) if names else units.split(name)
            # "p_A.data": what the struct is called says more than what its field is called.
            full = words if names else f"{struct.path} {words}" if array.ndim == 1 else f"{key} {i + 1}"
            shown = f"{own} {names[i]}" if names and array.ndim == 2 else own
            time = words.lower() in ("t", "ts") or any(part in words.lower() for part in ("time", "zeit"))
            values = np.asarray(table[:, i], np.float64)
            raw = timing.RawColumn(shown, words if time else full, unit if not stated or time else stated[i], values)
            by_length.setdefault(len(raw.values), []).append(raw)
    yield from by_length.values()


def _labels(struct: _Struct, keys: tuple[str, ...], count: int) -> list[str]:
    """The texts beside an array that name its columns, or their units; [] where there are none of that number."""
    for name, texts in struct.texts.items():
        if len(texts) == count and any(
            name.lower() == key or (count > 1 and name.lower().endswith(key)) for key in keys
        ):
            return texts
    return []


def _times_above(struct: _Struct, raw: list[timing.RawColumn]) -> list[timing.RawColumn]:
    """Columns of the structs above that are as long, among which may be the time."""
    count = len(raw[0].values)
    above = list(struct.up())[1:]
    return [c for outer in above for table in _tables(outer) if len(table[0].values) == count for c in table]


def _rate(struct: _Struct) -> float:
    """Samples per second that a single number of the file states, or 0."""
    for outer in struct.up():
        for name, value in outer.numbers.items():
            if name in _PERIOD_KEYS and 1e-6 < value < 10.0:
                return 1.0 / value
            if name in _RATE_KEYS and 0.1 < value < 1e6:
                return value
    return 0.0
