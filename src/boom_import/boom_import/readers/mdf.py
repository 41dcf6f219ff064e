"""MF4 and other MDF files (ASAM MDF 3 and 4), read with asammdf."""

from __future__ import annotations

import gc
import logging
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from asammdf import MDF
from numpy.typing import NDArray

from boom_import.errors import ImportingError
from boom_import.source import Column, Source, column, unique
from boom_import.timing import Axis, RawColumn, in_order, stamps_of
from boom_input.files import opened
from boom_input.shown import quoted

_EARLIEST = 946_684_800
_MOST_COLUMNS = 5000


def _opened(content: BinaryIO) -> Any:
    """The file. Raises ImportingError; what asammdf says while its half-made object is thrown away stays unsaid."""
    hook, sys.unraisablehook = sys.unraisablehook, lambda _: None
    try:
        try:
            return MDF(content, raise_on_multiple_occurrences=False)
        except Exception as error:  # of many kinds, for a damaged file
            why = quoted(error, 120) or type(error).__name__
        gc.collect()  # the error is gone, and now the object that it held, too
    finally:
        sys.unraisablehook = hook
    raise ImportingError(f"it begins like an MDF file, but cannot be read ({why}): export it again")


def read(path: Path, progress: Callable[[float], None]) -> Source:
    """The channels of an MDF file that are numbers, each with the time of its group.

    Raises:
        ImportingError: no such channels, or none with times that rise.
    """
    logging.getLogger("asammdf").setLevel(logging.CRITICAL)
    columns: list[Column] = []
    notes: dict[str, None] = {}
    left_out: list[str] = []
    taken: set[str] = set()
    with opened(path) as content, _opened(content) as file:
        begin = file.header.start_time.timestamp()
        dated = begin > _EARLIEST
        zero = round(begin * 1e9) if dated else 0
        for index, group in enumerate(file.groups):
            try:
                columns += _columns(file, index, group, zero, taken, notes, _MOST_COLUMNS - len(columns))
            except ImportingError as error:
                left_out.append(str(error))
            progress((index + 1) / len(file.groups))
    if not columns:
        raise ImportingError(left_out[0] if left_out else "it holds no channels of numbers with a time")
    said = "each group's time channel" + (" and the file's start time" if dated else "")
    return Source(path, "MDF", columns, dated, said, [*notes, *(f"a group is left out: {why}" for why in left_out)])


def _columns(
    file: Any, index: int, group: Any, zero: int, taken: set[str], notes: dict[str, None], most: int
) -> list[Column]:
    """The channels of a group that are numbers; those with the same samples on one axis.

    Raises:
        ImportingError: times that go back or do not rise.
    """
    master = file.masters_db.get(index)
    label = (getattr(group.channel_group, "acq_name", "") or "").strip()
    found: dict[bytes, list[RawColumn]] = {}
    for number, channel in enumerate(group.channels):
        if number == master or master is None or sum(map(len, found.values())) >= most:
            continue
        signal = file.get(group=index, index=number, ignore_invalidation_bits=False)
        if signal.samples.ndim != 1 or signal.samples.dtype.kind not in "fiub":
            continue
        key = unique(f"{label}/{channel.name}" if label else channel.name, taken)
        words = " ".join(part for part in (label, channel.name, signal.comment or "") if part)[:200]
        raw = RawColumn(key, words, signal.unit or "", np.asarray(signal.samples, np.float64))
        found.setdefault(np.asarray(signal.timestamps, np.float64).tobytes(), []).append(raw)
    columns: list[Column] = []
    for time, own in found.items():
        axis = _axis(np.frombuffer(time), own, zero, notes)
        made = (column(raw.key, raw.name, raw.unit, axis.stamps_ns, raw.values[axis.rows]) for raw in own)
        columns += [one for one in made if one]
    return columns


def _axis(time: NDArray[np.float64], columns: list[RawColumn], zero: int, notes: dict[str, None]) -> Axis:
    """When the samples of channels were taken, as the times of a table are read; what was done to them is a note.

    Args:
        time: (n,) of the samples [s].
        columns: the channels.
        zero: of the time [ns].
        notes: to add to.

    Raises:
        ImportingError: the times go back or do not rise.
    """
    rows, name = np.flatnonzero(np.isfinite(time)), columns[0].key
    stamps = zero + stamps_of(time[rows])
    if len(rows) > 2 and np.ptp(stamps) == 0:
        raise ImportingError(
            f"all {len(rows)} samples of '{quoted(name, 60)}' have the same time: export the file again"
        )
    found = in_order(Axis(stamps, zero != 0, "", name, rows), columns, len(time) - len(rows))
    notes |= dict.fromkeys(found.notes)
    return found
