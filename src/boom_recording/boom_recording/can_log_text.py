"""Reads CAN logs that are text: Vector's ASC, candump -L, python-can's CSV, PCAN's TRC."""

from __future__ import annotations

import re
from abc import ABC, abstractmethod
from base64 import b64decode
from codecs import BOM_UTF8
from collections import Counter
from collections.abc import Callable, Iterator
from datetime import UTC, datetime, timedelta
from typing import BinaryIO, ClassVar

from boom_input.shown import quoted
from boom_recording.can_log_blf import Raw, is_date

_LONGEST_DATA = 8
_LONGEST_LINE = 100_000
_LARGEST_STEP_S = 86_400.0
_EXTENDED = 0x80000000
_UNREADABLE = "unreadable lines"


class SkippedError(Exception):
    """Not a data frame; the argument says what it is."""


def read_text(stream: BinaryIO, suffix: str, left_out: Counter[str], warnings: list[str]) -> Iterator[Raw]:
    """The data frames of a log; what of it cannot be read is told in `left_out` and `warnings`."""
    parsers: dict[str, type[_LineParser]] = {".asc": _Asc, ".log": _Candump, ".csv": _Csv, ".trc": _Trc}
    parser = parsers[suffix]()
    last = 0.0
    first: float | None = None
    _skip_mark(stream)
    # Undecodable bytes become characters that no number contains: such a line is counted as unreadable, not fatal.
    while raw := stream.readline(_LONGEST_LINE):
        if raw[-1:] != b"\n" and (len(raw) == _LONGEST_LINE or (suffix != ".csv" and raw.strip())):
            where = "in the middle of a line" if len(raw) < _LONGEST_LINE else "where a line does not end"
            warnings.append(f"cut at {last - (first or 0.0):.3f} s, {where}: what lies before was read")
            break
        try:
            line = raw.decode("ascii", "replace").strip()
            frame = parser.parse(line)
        except SkippedError as skip:
            left_out[str(skip)] += 1
            continue
        except (ValueError, IndexError, KeyError, OverflowError):
            left_out[_UNREADABLE] += 1
            continue
        if frame is None:
            if first is not None and line and not parser.ends(line):
                left_out["lines among the frames that are none"] += 1
            continue
        if len(frame[2]) > _LONGEST_DATA:
            left_out["CAN FD frames"] += 1
            continue
        last = frame[0]
        first = last if first is None else first
        yield frame
    if parser.undated:
        warnings.append(f"the date of its beginning cannot be read ({parser.undated}): its times count from there")
    if left_out[_UNREADABLE]:
        warnings.append(f"{left_out[_UNREADABLE]} lines could not be read")


def _skip_mark(stream: BinaryIO) -> None:
    """Skip the byte order mark with which some Windows editors begin a text."""
    begin = stream.tell()
    if stream.read(len(BOM_UTF8)) != BOM_UTF8:
        stream.seek(begin)


class _LineParser(ABC):
    """Reads the lines of one format.

    Attributes:
        undated: the line whose date cannot be one, "" where there is none.
    """

    def __init__(self) -> None:
        self.undated = ""

    @abstractmethod
    def parse(self, line: str) -> Raw | None:
        """The frame in a line, None where it is a header. Raises what `read_text` catches."""

    def ends(self, line: str) -> bool:
        """Whether a line without a frame may stand among the frames."""
        del line
        return False

    def dated(self, begin: Callable[[], datetime], line: str) -> float:
        """The beginning of the log [s since 1970], 0 where its date cannot be one."""
        try:
            seconds = begin().timestamp()
        except (ValueError, OverflowError, KeyError, IndexError, OSError):
            seconds = -1.0
        self.undated = "" if is_date(seconds) else quoted(line, 60)
        return 0.0 if self.undated else seconds


def _identifier(text: str, base: int, extended: bool) -> int:
    number = int(text, base)
    if not 0 <= number < (1 << 29 if extended else 1 << 11):
        raise ValueError("not an identifier")
    return number | (_EXTENDED if extended else 0)


def _exactly(text: str, length: int) -> bytes:
    data = bytes.fromhex(text)
    if len(data) != length:
        raise ValueError("fewer or more bytes than told")
    return data


class _Candump(_LineParser):
    """``(1790000000.000300) can0 101#AC4C09C28206E7E3 R``, as candump -L writes it."""

    def parse(self, line: str) -> Raw | None:
        if not line:
            return None
        stamp, _, frame = line.split()[:3]
        if stamp[0] != "(" or stamp[-1] != ")":
            raise ValueError("no time")
        name, mark, data = frame.partition("#")
        if not mark:
            raise ValueError("no data")
        if data[:1] == "#":
            raise SkippedError("CAN FD frames")
        if data[:1] in ("R", "r"):
            raise SkippedError("remote frames")
        number = int(name, 16)
        if len(name) > 3 and number & 0x20000000:
            raise SkippedError("error frames")
        # a classic frame's raw length may follow as _9 .. _F
        return float(stamp[1:-1]), _identifier(name, 16, len(name) > 3), bytes.fromhex(data.split("_")[0])


class _Csv(_LineParser):
    """Columns timestamp,arbitration_id,extended,remote,error,dlc,data (base64), as python-can writes them."""

    def parse(self, line: str) -> Raw | None:
        if not line or line.startswith("timestamp,"):
            return None
        stamp, name, extended, remote, error, length, data = line.split(",")
        if error == "1":
            raise SkippedError("error frames")
        if remote == "1":
            raise SkippedError("remote frames")
        content = b64decode(data, validate=True)
        if len(content) != int(length):
            raise ValueError("fewer or more bytes than told")
        return float(stamp), _identifier(name, 16, extended == "1"), content


class _Asc(_LineParser):
    """``0.000300 1  101             Rx   d 8 AC 4C 09 C2 82 06 E7 E3``, behind a header with date and number base."""

    _HEADER = re.compile(
        r"(//|date\s|base\s|internal events|no internal events|begin triggerblock|end triggerblock)", re.IGNORECASE
    )
    _DATE = re.compile(r"(?:date|begin triggerblock)\s+\w+\s+(\S+)\s+(\d+)\s+(.+)", re.IGNORECASE)
    _MONTHS: ClassVar = {
        name: number
        for number, names in enumerate(
            ("jan", "feb", "mar mär mrz", "apr", "may mai", "jun", "jul", "aug", "sep", "oct okt", "nov", "dec dez"), 1
        )
        for name in names.split()
    }

    def __init__(self) -> None:
        super().__init__()
        self._base = 16
        self._relative = False
        self._start = self._last = 0.0

    def parse(self, line: str) -> Raw | None:
        if not line:
            return None
        if not line[0].isdigit():
            self._header(line)
            return None
        words = line.split()
        time = float(words[0])
        if words[1] == "Start":
            return None
        if self._relative:
            time = self._after(time)
        return self._start + time, *self._frame(words)

    def _after(self, step: float) -> float:
        if not -_LARGEST_STEP_S < step < _LARGEST_STEP_S:  # one bad step would move all that follow
            raise ValueError("no step of time")
        self._last += step
        return self._last

    def _frame(self, words: list[str]) -> tuple[int, bytes]:
        """Identifier and data."""
        if words[1] == "CANFD":
            raise SkippedError("CAN FD frames")
        if words[2].lower() == "errorframe":
            raise SkippedError("error frames")
        if not words[1].isdigit() or len(words) < 5 or words[3] not in ("Rx", "Tx", "TxRq"):
            raise SkippedError("events that are no frames")
        if words[4].lower() == "r":
            raise SkippedError("remote frames")
        extended = words[2][-1:] in ("x", "X")
        length = int(words[5], self._base)
        if self._base == 16:
            data = _exactly("".join(words[6 : 6 + length]), length)
        else:
            data = bytes(int(word) for word in words[6 : 6 + length])
        if len(data) != length:
            raise ValueError("fewer bytes than told")
        return _identifier(words[2].rstrip("xX"), self._base, extended), data

    def _header(self, line: str) -> None:
        if not self._HEADER.match(line):
            raise ValueError("no line of an ASC log")
        low = line.lower()
        if low.startswith("base"):
            self._base = 10 if "dec" in low.split()[1] else 16
            self._relative = "timestamps relative" in " ".join(low.split())
        date = self._DATE.match(line)
        if date:
            self._start = self.dated(lambda: self._date(*date.groups()), line)
        elif low.startswith("date"):
            self.undated = quoted(line, 60)

    def ends(self, line: str) -> bool:
        return bool(self._HEADER.match(line)) or " Start " in line

    def _date(self, month: str, day: str, rest: str) -> datetime:
        # 14:13:20.0 2026, 02:13:20.123 pm 2026: local time of the computer that wrote it
        words = rest.split()
        seconds = 0.0
        for part in words[0].split(":"):
            seconds = seconds * 60 + float(part)
        if len(words) == 3:
            seconds = seconds % 43_200 + (43_200 if words[1].lower() == "pm" else 0)
        if not 0 <= seconds < 86_400:
            raise ValueError("no time of the day")
        return datetime(int(words[-1]), self._MONTHS[month.lower()[:3]], int(day)) + timedelta(seconds=seconds)


class _Trc(_LineParser):
    """PCAN's ``.trc``, versions 1.0, 1.1, 1.3 and 2.x."""

    # place of time, identifier, length, kind; the data follow the length (and in 2.x stand where the header says)
    _COLUMNS: ClassVar = {"1.0": "NOILD", "1.1": "NOTILD", "1.2": "NOBTILD", "1.3": "NOBTIRLD"}

    def __init__(self) -> None:
        super().__init__()
        self._start = 0.0
        self._version = "1.0"
        self._columns = self._COLUMNS["1.0"]

    def parse(self, line: str) -> Raw | None:
        if not line:
            return None
        if line[0] == ";":
            self._header(line)
            return None
        columns = self._columns
        words = line.split(maxsplit=len(columns) - 1)
        place = {name: k for k, name in enumerate(columns)}
        kind = words[place["T"]] if "T" in place else "Rx"
        data = words[place["D"]] if len(words) > place["D"] else ""
        if kind == "RR" or data.startswith("RTR"):
            raise SkippedError("remote frames")
        if kind in ("FD", "FB", "FE", "BI"):
            raise SkippedError("CAN FD frames")
        if kind not in ("DT", "Rx", "Tx"):
            raise SkippedError("events that are no frames")
        name = words[place["I"]]
        if name == "FFFFFFFF":
            raise SkippedError("events that are no frames")
        length = int(words[place["L"] if "L" in place else place["l"]])
        content = _exactly(data, length)
        return self._start + float(words[place["O"]]) / 1000, _identifier(name, 16, len(name) > 4), content

    def _header(self, line: str) -> None:
        key, _, value = line[1:].partition("=")
        if key == "$FILEVERSION":
            self._version = value.strip()
            self._columns = self._COLUMNS.get(self._version, self._columns)
        elif key == "$STARTTIME":
            first = datetime(1899, 12, 30, tzinfo=UTC)
            self._start = self.dated(lambda: first + timedelta(days=float(value)), line)
        elif key == "$COLUMNS":
            self._columns = "".join(value.strip().split(","))
