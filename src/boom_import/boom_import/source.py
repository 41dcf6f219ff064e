"""What a foreign file holds, whatever its kind: columns of numbers with stamps, names and units. No decision is made here."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from boom_input.shown import quoted
from boom_recording.recording import Configuration

_LARGEST = 1e25  # what is larger is damage: even nanoseconds since 1970 are 2e18
Floats = NDArray[np.float64]
Stamps = NDArray[np.int64]
_CODES = tuple(
    sign * number / scale
    for number in (999, 9999, 99999, 32767, 32768, 65534, 65535) for scale in (1, 10, 100, 1000) for sign in (1, -1)
)  # fmt: skip
"""What loggers and buses give for "no measurement", and its tenths, hundredths and thousandths."""
_ONE, _MOST = 5e-10, 0.5
"""How close a number is to a code, over the number; the share of a column from which on it is no code."""


@dataclass(frozen=True)
class Column:
    """One series of numbers.

    Attributes:
        key: names it in a mapping file; unique within a source.
        name: the words that say what it is.
        unit: as the file states it, "" where it does not.
        stamps_ns: (n,) [ns] since 1970 where the source is dated, else since its beginning.
        values: (n,) as the file has them, finite.
        by_type: the unit is the message type's (``sensor_msgs/FluidPressure`` is Pa), not the author's.
        joint: of the element of a JointState, "" for all else.
        signal: that topic and field carry by the contract, "" for all others.
    """

    key: str
    name: str
    unit: str
    stamps_ns: Stamps
    values: Floats
    by_type: bool = False
    joint: str = ""
    signal: str = ""


@dataclass
class Source:
    """All columns of the files that make one recording.

    Attributes:
        path, kind: of the file; the kind for people, "CSV".
        dated: stamps count from 1970, not from the beginning of the recording.
        time: how time was read, one phrase.
        notes: what was left out or assumed, a sentence each.
        configuration: of the machine, where the source has one of the contract.
    """

    path: Path
    kind: str
    columns: list[Column]
    dated: bool
    time: str
    notes: list[str] = field(default_factory=list)
    configuration: Configuration | None = None

    def by_key(self) -> dict[str, Column]:
        """The columns by their key."""
        return {column.key: column for column in self.columns}


def without_error_values(source: Source) -> None:
    """Leaves out what a sensor gives for "no measurement": -9999, 6553.5, 999, the same again and again, far from all others."""
    for k, one in enumerate(source.columns):
        kept, missing = np.ones(len(one.values), dtype=bool), list[str]()
        while (value := _error_value(one.values[kept] if missing else one.values)) is not None:
            there = one.values == value
            missing.append(f"{int(there.sum())} times {value:g}")
            kept &= ~there
        if missing:
            source.columns[k] = replace(one, values=one.values[kept], stamps_ns=one.stamps_ns[kept])
            source.notes.append(
                f"'{quoted(one.key, 60)}': {', '.join(missing)} is left out: so far from all others it is no measurement"
            )


def _error_value(values: Floats) -> float | None:
    """The least or largest value, where it is a code that stands there several times, beyond all that the others span."""
    for value in (float(values.min()), float(values.max())):
        if not any(abs(value - code) <= _ONE * abs(code) for code in _CODES):
            continue
        others = values[values != value]
        if 1 < len(values) - len(others) < _MOST * len(values):
            low, high = float(others.min()), float(others.max())
            if max(low - value, value - high) > high - low:
                return value
    return None


def unique(key: str, taken: set[str]) -> str:
    """The key, with a number behind it where it is taken already."""
    found, number = key, 1
    while found in taken:
        number += 1
        found = f"{key} #{number}"
    taken.add(found)
    return found


def column(
    key: str, name: str, unit: str, stamps_ns: Stamps, values: Floats, *, by_type: bool = False, joint: str = "",
    signal: str = "",
) -> Column | None:  # fmt: skip
    """A column of what is finite of `values` (n,), or None where that is less than two samples."""
    there = np.abs(values) < _LARGEST  # false for NaN, too
    if there.sum() < 2:
        return None
    if not there.all():
        stamps_ns, values = stamps_ns[there], values[there]
    return Column(key, name, unit, stamps_ns, values, by_type, joint, signal)
