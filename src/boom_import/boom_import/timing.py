"""Which column of a table is its time, and in which unit: a score of name, unit and steps; asked where that does not tell.

A table of a CSV or MAT file has no stamps of its own. The unit is weighed by the period that it gives the samples (log-normal
around 10 ms, a factor of five each way: what loggers of machines have) against what the header states.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from boom_import import units
from boom_import.errors import ImportingError
from boom_import.source import Floats, Stamps
from boom_input.shown import quoted

_PERIOD, _PERIOD_SPREAD = math.log(0.01), math.log(5.0)
_PRIOR = {"s": 0.5, "ms": 0.25, "us": 0.1, "ns": 0.05, "d": 0.05, "min": 0.02, "h": 0.03}
_STATED_WRONG = 0.02
_SURE = 0.9
FASTEST = 1e5
"""Samples per second that a table may have."""
_NAMES = ("time", "zeit", "stamp", "clock", "datum", "date", "uhr", "temps", "tiempo")
_SHORT = ("t", "ts", "x", "sec", "ms")
_COUNTERS = ("index", "idx", "count", "sample", "frame", "seq", "line", "row", "nr", "no", "id", "zeile", "zaehler")
_CALLED = 4.0
"""Log odds from which a column says that it is the time."""
_LATE = 1.0  # s: a row that a logger wrote so late is put in its place
_GAP, _GAP_PERIODS = 1.0, 20.0  # s, and in periods
_HOUR, _ABOUT = 3600.0, 60.0  # s
_LISTED = 3
_SHARED, _SECONDS, _PAUSE = 0.5, 4, 1.5
"""Share of the rows that have the stamp of the row above where a clock is too coarse for them; stamps that there are at least; a
pause, over the time between two stamps."""
_SECONDS_2000, _SECONDS_2100 = 946_684_800.0, 4_102_444_800.0
_HALF_A_DAY = 43_200.0
_EXCEL_1970 = 25_569.0  # days from Excel's zero, 1899-12-30
_MATLAB_1970 = 719_529.0  # days from Matlab's year 0


@dataclass(frozen=True)
class TimeChoice:
    """How a mapping file says that time is to be read.

    Attributes:
        column: name of the column, "" where there is none.
        unit: "s", "ms", "us", "ns", "min", "h", "d", or "" to find out.
        rate: samples per second where no column is time, 0 for none.

    Raises:
        ImportingError: a column or its unit, and a rate.
    """

    column: str = ""
    unit: str = ""
    rate: float = 0.0

    def __post_init__(self) -> None:
        if self.rate and (self.column or self.unit):
            raise ImportingError("a sample rate is for a table without a column of time: give one of the two")


@dataclass(frozen=True)
class Axis:
    """The time of a table.

    Attributes:
        stamps_ns: (n,) [ns], none before the one in front of it.
        dated: they count from 1970.
        said: how they were read.
        column: which one they are, "" for none.
        rows: (n,) of the table, in the order of the stamps; rows without a time are not among them.
        notes: what was done to the rows, and gaps, a sentence each.
    """

    stamps_ns: Stamps
    dated: bool
    said: str
    column: str
    rows: NDArray[np.intp]
    notes: tuple[str, ...] = ()


@dataclass
class RawColumn:
    """A column before its table's time is known.

    Attributes:
        key, name, unit: as in `boom_import.source.Column`.
        values: (n,) NaN where there is no number; for a column of dates seconds since 1970 or midnight.
        clock: "date" or "time of day" for a column that was written as such, "" for plain numbers.
    """

    key: str
    name: str
    unit: str
    values: Floats
    clock: str = field(default="")


def axis(columns: list[RawColumn], choice: TimeChoice, hint_rate: float = 0.0) -> Axis:
    """The stamps of a table.

    Args:
        columns: of the table, of one length.
        choice: what the user said; an empty one is no choice.
        hint_rate: samples per second that the file states elsewhere, 0 for none.

    Raises:
        ImportingError: no column is time, its unit cannot be told, or it goes back; the message says what to do.
    """
    count = len(columns[0].values)
    rate = choice.rate or (0.0 if choice.column else hint_rate)
    if choice.column:
        found = next((c for c in columns if choice.column in (c.key, c.name)), None)
        if found is None:
            raise ImportingError(
                f"there is no column '{quoted(choice.column, 60)}' for the time: it has {_listed(columns)}"
            )
        return _of_column(found, choice.unit, columns)
    if not choice.rate:
        best = max(columns, key=_score)
        if _score(best) > 0:
            return _of_column(best, choice.unit, columns)
    if rate > 0:
        stamps = np.rint(np.arange(count) * 1e9 / rate).astype(np.int64)
        return Axis(stamps, False, f"{rate:g} samples/s", "", np.arange(count))
    called = max(columns, key=_called_time)
    if _called_time(called) >= _CALLED:
        _of_column(called, choice.unit, columns)  # says what is wrong with it
        raise ImportingError(
            f"the values of '{quoted(called.key, 60)}' do not rise from row to row: if it is the time, give it with --time"
        )
    raise ImportingError(
        f"no column is recognisable as the time ({_listed(columns)}): give --time COLUMN, "
        "or --sample-rate with the samples per second"
    )


def _listed(columns: list[RawColumn]) -> str:
    return quoted(", ".join(c.key for c in columns[:12]), 160) + (" ..." if len(columns) > 12 else "")


def _score(column: RawColumn) -> float:
    """Evidence [log odds] that a column is the time of its table."""
    values = column.values[np.isfinite(column.values)]
    if len(values) < 2:
        return -99.0
    steps = np.diff(values)
    if column.clock == "time of day":
        steps = np.where(steps < -_HALF_A_DAY, steps + 2 * _HALF_A_DAY, steps)
    rising = float(np.mean(steps >= 0))
    if rising < 0.99 or not float(steps.sum()) > 0.0:
        return -99.0
    score = -2.0 + _called_time(column) - (6.0 if column.clock == "time of day" and rising < 1 else 0.0)
    positive = steps[steps > 0]
    regular = len(positive) > 0 and float(np.median(np.abs(positive / np.median(positive) - 1.0))) < 0.2
    score += 3.5 if regular and float(np.mean(steps > 0)) > 0.9 else -2.0  # nothing else rises evenly all the time
    if not column.clock and np.all(steps == 1.0) and units.parse(column.unit).measure is None:
        score -= 6.0  # a counter rises by one, whatever it is called: its unit is not told by its steps
    return score


def _called_time(column: RawColumn) -> float:
    """Evidence [log odds] of name and unit, whatever the values are."""
    name = column.name.lower()
    words = name.replace("_", " ").replace("-", " ").split()
    score = 8.0 if column.clock else 0.0
    score += 4.0 if any(part in name for part in _NAMES) else 2.0 if any(word in _SHORT for word in words) else 0.0
    score += 0.5 if "stamp" in name else 0.0  # of the measurement, where the other is that of its arrival
    stated = units.parse(column.unit).measure
    if stated is not None:
        score += 4.0 if stated.dimension == units.TIME else -8.0
    if any(word.rstrip("0123456789.") in _COUNTERS for word in words):
        score -= 4.0
    return score


def _of_column(column: RawColumn, unit: str, columns: list[RawColumn]) -> Axis:
    rows = np.flatnonzero(np.isfinite(column.values))
    if not len(rows):
        raise ImportingError(f"column '{quoted(column.key, 60)}' holds no number: give another one with --time")
    if column.clock:
        found = _of_clock(column, rows, columns)
    else:
        stated = units.parse(column.unit)
        if not unit and stated.measure is not None and stated.measure.dimension == units.TIME:  # "[10 us]"
            column = replace(column, values=column.values * stated.scale, unit=stated.measure.name)
        seconds, dated, what = _seconds(column.values[rows], unit or _unit(column))
        found = Axis(stamps_of(seconds), dated, f"column '{column.key}' in {what}", column.key, rows)
    placed = in_order(found, columns, len(column.values) - len(rows))
    return replace(placed, notes=(*placed.notes, *_gaps(placed.stamps_ns)))


def _spread(found: Axis, columns: list[RawColumn]) -> Axis:
    """Rows that share their stamps, as a clock of whole seconds gives them, evenly over the time until the next stamp."""
    stamps, rows = found.stamps_ns, found.rows
    steps = np.diff(stamps)
    same = steps == 0
    if not len(steps) or (steps < 0).any() or same.mean() < _SHARED or not _changes(columns, rows, same):
        return found
    first = np.concatenate(([0], np.flatnonzero(steps) + 1))
    counts = np.diff(np.append(first, len(rows)))
    if len(first) < _SECONDS:
        return found
    lasting, usual = np.diff(stamps[first]).astype(np.float64), float(np.median(counts[1:-1]))
    period = float(np.median(lasting))
    spacing = np.append(lasting, np.inf) / counts
    spacing[np.append(lasting, np.inf) > _PAUSE * period] = period / usual  # nothing follows at once
    late = np.zeros(len(first))
    late[0] = max(usual - counts[0], 0.0)  # the first second began before the recording
    spacing[0] = period / max(usual, counts[0])
    inside = np.arange(len(rows)) - np.repeat(first, counts) + np.repeat(late, counts)
    placed = stamps + np.rint(inside * np.repeat(spacing, counts)).astype(np.int64)
    note = f"{usual:.0f} rows share each stamp: they are spread evenly until the next one"
    return replace(found, stamps_ns=placed, notes=(*found.notes, note))


def _changes(columns: list[RawColumn], rows: NDArray[np.intp], same: NDArray[np.bool_]) -> bool:
    """Whether some column has numbers in most rows that share a stamp, and other ones there than in the row above."""
    for column in columns:
        before, after = column.values[rows[:-1]][same], column.values[rows[1:]][same]
        if float(np.mean(np.isfinite(before) & np.isfinite(after) & (before != after))) > _SHARED:
            return True
    return False


def in_order(found: Axis, columns: list[RawColumn], lost: int) -> Axis:
    """The rows sorted by their times where that is safe, with notes on it and on rows without a time.

    Args:
        found: as the rows stand in the file.
        columns: of the table.
        lost: rows without a time.

    Raises:
        ImportingError: the times go back in a way that may have several reasons.
    """
    found = _spread(found, columns)
    rows, stamps, notes = found.rows, found.stamps_ns, [*found.notes]
    if lost:
        notes.append(f"rows without a time are left out: {lost}")
    steps = np.diff(stamps)
    if (steps < 0).any():
        late = float((np.maximum.accumulate(stamps) - stamps).max()) / 1e9
        order = np.argsort(stamps, kind="stable")
        if not (steps < 0).all() and (late > _LATE or (np.diff(stamps[order]) == 0).any()):
            raise ImportingError(_goes_back(found, steps))
        if (steps < 0).all():
            notes.append("the rows stand in falling order of their times: they are turned")
        else:
            notes.append(
                f"rows up to {late:.3g} s older than the one above were put in their place: {(steps < 0).sum()}"
            )
        rows, stamps = rows[order], stamps[order]
    return replace(found, rows=rows, stamps_ns=stamps, notes=tuple(notes))


def _goes_back(found: Axis, steps: Stamps) -> str:
    first = int(np.flatnonzero(steps < 0)[0])
    by, left = -float(steps[first]) / 1e9, len(steps) - first
    where = f"'{quoted(found.column, 60)}' goes back by {by:.5g} s at row {found.rows[first + 1] + 1} of the numbers"
    if abs(by - _HOUR) < _ABOUT:
        return f"{where}; {left} samples follow: the end of summer time? Write the times in UTC or with an offset such as +01:00"
    more = f" (and {(steps < 0).sum() - 1} more times)" if (steps < 0).sum() > 1 else ""
    return (
        f"{where}{more}: cut the file there and import the parts one by one, remove what it repeats, or sort the rows by time "
        "if only their order is lost"
    )


def _gaps(stamps: Stamps) -> list[str]:
    """A sentence on the longest pause, where there is one that is no pause between two samples."""
    steps = np.diff(stamps) / 1e9
    if not (steps > 0).any():
        return []
    limit = max(_GAP, _GAP_PERIODS * float(np.median(steps[steps > 0])))
    count, longest = int((steps > limit).sum()), int(steps.argmax())
    if not count:
        return []
    gap = float(steps[longest])
    more = f"; {count - 1} more gaps of more than {limit:.3g} s" if count > 1 else ""
    season = (
        ": the beginning of summer time? Then write the times in UTC or with an offset such as +02:00"
        if abs(gap - _HOUR) < _ABOUT
        else ""
    )
    return [f"no samples for {gap:.5g} s from {float(stamps[longest] - stamps[0]) / 1e9:.5g} s on{more}{season}"]


def without_number(columns: Sequence[RawColumn], axis: Axis) -> list[str]:
    """A sentence on the cells of a table that hold no number, if there are some.

    Args:
        columns: that were taken from the table.
        axis: its time.
    """
    missing = {c.key: int((~np.isfinite(c.values[axis.rows])).sum()) for c in columns}
    found = [f"{count} of {len(axis.rows)} of '{quoted(key, 60)}'" for key, count in missing.items() if count]
    if not found:
        return []
    more = f" and of {len(found) - _LISTED} more columns" if len(found) > _LISTED else ""
    return [f"cells without a number are left out: {', '.join(found[:_LISTED])}{more}"]


def _of_clock(column: RawColumn, rows: NDArray[np.intp], columns: list[RawColumn]) -> Axis:
    seconds, said = column.values[rows], f"column '{column.key}' ({column.clock})"
    if column.clock == "time of day":
        turned = np.concatenate(([0.0], np.cumsum(np.diff(seconds) < -_HALF_A_DAY) * 86_400.0))
        seconds = seconds + turned
        day = next(
            (c for c in columns if c.clock == "date" and np.nanmax(c.values) - np.nanmin(c.values) < 90_000.0), None
        )
        if day is not None and np.all(np.nan_to_num(day.values) % 86_400.0 == 0.0):
            return Axis(
                stamps_of(seconds + np.nanmin(day.values)),
                True,
                f"columns '{day.key}' and '{column.key}'",
                column.key,
                rows,
            )
    return Axis(stamps_of(seconds), column.clock == "date", said, column.key, rows)


def _unit(column: RawColumn) -> str:
    """The most probable unit. Raises ImportingError where two are about as probable."""
    values = column.values[np.isfinite(column.values)]
    steps = np.diff(np.unique(values))  # rows may stand in any order
    period = float(np.median(steps)) if len(steps) else 0.0
    if not period > 0:
        raise ImportingError(
            f"column '{quoted(column.key, 60)}' does not rise: it is no time: give another one with --time, or --sample-rate"
        )
    stated = units.parse(column.unit).measure
    score = {}
    for name, prior in _PRIOR.items():
        seconds = period * units.BY_NAME[name].factor
        fit = -0.5 * ((math.log(seconds) - _PERIOD) / _PERIOD_SPREAD) ** 2
        given = 0.0
        if stated is not None and stated.dimension == units.TIME:
            given = math.log(1 - _STATED_WRONG if stated.name == name else _STATED_WRONG / len(_PRIOR))
        era = 3.0 if _dated(values[0], name) else 0.0
        score[name] = math.log(prior) + max(fit, -12.0) + given + era
    best = max(score, key=lambda name: score[name])
    sure = 1.0 / sum(math.exp(s - score[best]) for s in score.values())
    if sure < _SURE:
        likely = sorted(score, key=lambda name: -score[name])[:2]
        raise ImportingError(
            f"the unit of the time '{column.key}' cannot be told ({' or '.join(likely)}?): give --time-unit"
        )
    if stated is not None and stated.dimension == units.TIME and best != stated.name and not _dated(values[0], best):
        own, other = (period * units.BY_NAME[name].factor for name in (stated.name, best))
        raise ImportingError(
            f"the time '{column.key}' is said to be in {stated.name}, samples {own:.3g} s apart; in {best} they would be "
            f"{other:.3g} s apart: give --time-unit"
        )
    return best


def _dated(value: float, unit: str) -> bool:
    if unit == "d":
        return any(_SECONDS_2000 < (value - zero) * 86_400 < _SECONDS_2100 for zero in (_EXCEL_1970, _MATLAB_1970))
    return unit in ("s", "ms", "us", "ns") and _SECONDS_2000 < value * units.BY_NAME[unit].factor < _SECONDS_2100


def _seconds(values: Floats, unit: str) -> tuple[Floats, bool, str]:
    first = float(values[0])
    dated = _dated(first, unit)
    if unit == "d" and dated:
        excel = _SECONDS_2000 < (first - _EXCEL_1970) * 86_400 < _SECONDS_2100
        zero, what = (_EXCEL_1970, "days (Excel's dates)") if excel else (_MATLAB_1970, "days (Matlab's dates)")
        return (values - zero) * 86_400.0, True, what
    factor = units.BY_NAME[unit].factor
    return values * factor, dated, unit + (" since 1970" if dated else "")


def stamps_of(seconds: Floats) -> NDArray[np.int64]:
    """[ns]; a double of seconds since 1970 resolves 0.2 us, which is enough. Raises ImportingError for times beyond 2096."""
    whole = np.nan_to_num(np.floor(seconds), nan=-1.0)
    fraction = np.nan_to_num(seconds - whole)
    if np.abs(whole).max(initial=0.0) > 4e9:
        raise ImportingError("the times lie beyond the year 2096: is the unit of the time right?")
    return np.asarray(whole.astype(np.int64) * 10**9 + np.rint(fraction * 1e9).astype(np.int64), np.int64)
