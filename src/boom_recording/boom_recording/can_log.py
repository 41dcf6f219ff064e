"""Reads CAN logs (BLF, ASC, candump .log, CSV, TRC) and makes recordings of them, by the codec that the bridge uses.

A log is read as far as it can be: an unreadable line is counted and left out, a file that ends in the middle of a frame
gives what lies before. Times are whole microseconds, which is what all of these formats can hold.
"""

from __future__ import annotations

import re
import struct
import zlib
from base64 import b64decode
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import BinaryIO, ClassVar

import numpy as np
from numpy.typing import NDArray

from boom_recording.errors import RecordingError

SUFFIXES = (".blf", ".asc", ".log", ".csv", ".trc")
_LONGEST_DATA = 8
_EXTENDED = 0x80000000
_REPORT_EVERY = 20_000
_EPOCH = 1_000_000_000
"""s. Times below are not dates: they count from the beginning of the log."""

Progress = Callable[[float], None]
"""Called with the fraction of the file that has been read, 0 .. 1."""

_Raw = tuple[float, int, bytes]
"""Time [s], identifier with bit 31 for an extended one, data."""


@dataclass(frozen=True)
class CanFrames:
    """The data frames of a log, in its order.

    Attributes:
        stamps_ns: (n,) times [ns since 1970, or since the beginning where the log knows no date].
        ids: (n,) identifiers, bit 31 set for extended ones.
        data: (n, 8) bytes, zero behind the length. lengths: (n,).
        dated: whether the times are dates.
        left_out: lines and objects that are no data frames or are unreadable, by kind.
        warnings: what of the file could not be read, one sentence each.
    """

    stamps_ns: NDArray[np.int64]
    ids: NDArray[np.int64]
    data: NDArray[np.uint8]
    lengths: NDArray[np.int64]
    dated: bool
    left_out: dict[str, int] = field(default_factory=dict)
    warnings: list[str] = field(default_factory=list)


class _SkippedError(Exception):
    """Not a data frame; the argument says what it is."""


def read(path: str | Path, progress: Progress | None = None) -> CanFrames:
    """The data frames of a CAN log.

    Raises:
        RecordingError: no such file, an unknown kind, or not one frame in it.
    """
    path = Path(path)
    suffix = path.suffix.lower()
    if suffix not in SUFFIXES:
        raise RecordingError(f"{path}: the kind of a CAN log is told by its name: give one of {', '.join(SUFFIXES)}")
    left_out: Counter[str] = Counter()
    warnings: list[str] = []
    times: list[float] = []
    ids: list[int] = []
    contents: list[bytes] = []
    try:
        size = max(path.stat().st_size, 1)
        with path.open("rb") as stream:
            source = _read_blf if suffix == ".blf" else _read_text
            for time, identifier, data in source(stream, suffix, left_out, warnings):
                times.append(time)
                ids.append(identifier)
                contents.append(data)
                if progress is not None and len(times) % _REPORT_EVERY == 0:
                    progress(min(stream.tell() / size, 1.0))
    except IsADirectoryError:
        raise RecordingError(f"{path} is a folder: give the log file in it") from None
    except OSError as error:
        raise RecordingError(f"{path} cannot be read: {error.strerror}") from None
    if not times:
        unreadable = left_out.get("unreadable lines", 0) + len(warnings)
        reason = "is it a log of another kind?" if unreadable else "it is empty"
        raise RecordingError(f"{path}: not one CAN frame in it: {warnings[0] if warnings else reason}")
    stamps = np.rint(np.array(times) * 1e6).astype(np.int64) * 1000
    lengths = np.fromiter(map(len, contents), np.int64, len(contents))
    joined = b"".join([data.ljust(_LONGEST_DATA, b"\0") for data in contents])
    table = np.frombuffer(joined, np.uint8).reshape(-1, _LONGEST_DATA)
    if progress is not None:
        progress(1.0)
    if left_out.get("unreadable lines"):
        warnings.append(f"{left_out['unreadable lines']} lines could not be read")
    dated = bool(times[0] >= _EPOCH)
    return CanFrames(stamps, np.array(ids, np.int64), table, lengths, dated, dict(left_out), warnings)


# --------------------------------------------------------------------------------------------------------------- text


def _read_text(stream: BinaryIO, suffix: str, left_out: Counter[str], warnings: list[str]) -> Iterator[_Raw]:
    parsers: dict[str, type[_Asc | _Candump | _Csv | _Trc]] = {
        ".asc": _Asc, ".log": _Candump, ".csv": _Csv, ".trc": _Trc,
    }  # fmt: skip
    parse = parsers[suffix]().parse
    last = 0.0
    first: float | None = None
    # Undecodable bytes become characters that no number contains: such a line is counted as unreadable, not fatal.
    while raw := stream.readline():
        if raw[-1:] != b"\n" and suffix != ".csv" and raw.strip():
            since = last - (first or 0.0)
            warnings.append(f"cut at {since:.3f} s, in the middle of a line: what lies before was read")
            return
        try:
            frame = parse(raw.decode("ascii", "replace").strip())
        except _SkippedError as skip:
            left_out[str(skip)] += 1
            continue
        except (ValueError, IndexError, KeyError):
            left_out["unreadable lines"] += 1
            continue
        if frame is None:
            continue
        if len(frame[2]) > _LONGEST_DATA:
            left_out["CAN FD frames"] += 1
            continue
        last = frame[0]
        first = last if first is None else first
        yield frame


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


class _Candump:
    """``(1790000000.000300) can0 101#AC4C09C28206E7E3 R``, as candump -L writes it."""

    def parse(self, line: str) -> _Raw | None:
        if not line:
            return None
        stamp, _, frame = line.split()[:3]
        if stamp[0] != "(" or stamp[-1] != ")":
            raise ValueError("no time")
        name, mark, data = frame.partition("#")
        if not mark:
            raise ValueError("no data")
        if data[:1] == "#":
            raise _SkippedError("CAN FD frames")
        if data[:1] in ("R", "r"):
            raise _SkippedError("remote frames")
        number = int(name, 16)
        if len(name) > 3 and number & 0x20000000:
            raise _SkippedError("error frames")
        # a classic frame's raw length may follow as _9 .. _F
        return float(stamp[1:-1]), _identifier(name, 16, len(name) > 3), bytes.fromhex(data.split("_")[0])


class _Csv:
    """Columns timestamp,arbitration_id,extended,remote,error,dlc,data (base64), as python-can writes them."""

    def parse(self, line: str) -> _Raw | None:
        if not line or line.startswith("timestamp,"):
            return None
        stamp, name, extended, remote, error, length, data = line.split(",")
        if error == "1":
            raise _SkippedError("error frames")
        if remote == "1":
            raise _SkippedError("remote frames")
        content = b64decode(data, validate=True)
        if len(content) != int(length):
            raise ValueError("fewer or more bytes than told")
        return float(stamp), _identifier(name, 16, extended == "1"), content


class _Asc:
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
        self._base = 16
        self._relative = False
        self._start = self._last = 0.0

    def parse(self, line: str) -> _Raw | None:
        if not line:
            return None
        if not line[0].isdigit():
            self._header(line)
            return None
        words = line.split()
        time = float(words[0])
        if len(words) < 3 or words[1] == "Start":
            return None
        if self._relative:
            time = self._last = self._last + time
        if words[1] == "CANFD":
            raise _SkippedError("CAN FD frames")
        if words[2].lower() == "errorframe":
            raise _SkippedError("error frames")
        if not words[1].isdigit() or len(words) < 5 or words[3] not in ("Rx", "Tx", "TxRq"):
            raise _SkippedError("events that are no frames")
        if words[4].lower() == "r":
            raise _SkippedError("remote frames")
        extended = words[2][-1:] in ("x", "X")
        length = int(words[5], self._base)
        if self._base == 16:
            data = _exactly("".join(words[6 : 6 + length]), length)
        else:
            data = bytes(int(word) for word in words[6 : 6 + length])
        if len(data) != length:
            raise ValueError("fewer bytes than told")
        return self._start + time, _identifier(words[2].rstrip("xX"), self._base, extended), data

    def _header(self, line: str) -> None:
        if not self._HEADER.match(line):
            raise ValueError("no line of an ASC log")
        low = line.lower()
        if low.startswith("base"):
            self._base = 10 if "dec" in low.split()[1] else 16
            self._relative = "timestamps relative" in " ".join(low.split())
        date = self._DATE.match(line)
        if date:
            self._start = self._date(*date.groups())

    def _date(self, month: str, day: str, rest: str) -> float:
        # 14:13:20.0 2026, 02:13:20.123 pm 2026: local time of the computer that wrote it
        words = rest.split()
        seconds = 0.0
        for part in words[0].split(":"):
            seconds = seconds * 60 + float(part)
        if len(words) == 3:
            seconds = seconds % 43_200 + (43_200 if words[1].lower() == "pm" else 0)
        begin = datetime(int(words[-1]), self._MONTHS[month.lower()[:3]], int(day)) + timedelta(seconds=seconds)
        return begin.timestamp()


class _Trc:
    """PCAN's ``.trc``, versions 1.0, 1.1, 1.3 and 2.x."""

    # place of time, identifier, length, kind; the data follow the length (and in 2.x stand where the header says)
    _COLUMNS: ClassVar = {"1.0": "NOILD", "1.1": "NOTILD", "1.2": "NOBTILD", "1.3": "NOBTIRLD"}

    def __init__(self) -> None:
        self._start = 0.0
        self._version = "1.0"
        self._columns = self._COLUMNS["1.0"]

    def parse(self, line: str) -> _Raw | None:
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
            raise _SkippedError("remote frames")
        if kind in ("FD", "FB", "FE", "BI"):
            raise _SkippedError("CAN FD frames")
        if kind not in ("DT", "Rx", "Tx"):
            raise _SkippedError("events that are no frames")
        name = words[place["I"]]
        if name == "FFFFFFFF":
            raise _SkippedError("events that are no frames")
        length = int(words[place["L"] if "L" in place else place["l"]])
        content = _exactly(data, length)
        return self._start + float(words[place["O"]]) / 1000, _identifier(name, 16, len(name) > 4), content

    def _header(self, line: str) -> None:
        key, _, value = line[1:].partition("=")
        if key == "$FILEVERSION":
            self._version = value.strip()
            self._columns = self._COLUMNS.get(self._version, self._columns)
        elif key == "$STARTTIME":
            begin = datetime(1899, 12, 30, tzinfo=UTC) + timedelta(days=float(value))
            self._start = begin.timestamp()
        elif key == "$COLUMNS":
            self._columns = "".join(value.strip().split(","))


# ---------------------------------------------------------------------------------------------------------------- BLF

_FILE_HEADER = struct.Struct("<4sL4B4B")
_SYSTEM_TIME = struct.Struct("<8H")
_SYSTEM_TIME_AT = 40
_OBJECT = struct.Struct("<4sHHLL")
_CONTAINER = struct.Struct("<H6xL4x")
_STAMPED = struct.Struct("<LHHQ")
_MESSAGE = struct.Struct("<HBBL8s")
_CAN_MESSAGE, _CONTAINER_KIND, _ERRORS, _FD, _CAN_MESSAGE2 = 1, 10, (2, 73), (100, 101), 86
_REMOTE = 0x80


@dataclass
class _Elapsed:
    """Time of the last frame [s since the start]."""

    time: float = 0.0


def _read_blf(stream: BinaryIO, _suffix: str, left_out: Counter[str], warnings: list[str]) -> Iterator[_Raw]:
    header = stream.read(_FILE_HEADER.size)
    if len(header) < _FILE_HEADER.size or header[:4] != b"LOGG":
        warnings.append("it is no BLF file: the first four bytes are not LOGG")
        return
    header_size = _FILE_HEADER.unpack(header)[1]
    header += stream.read(max(header_size, 72) - len(header))
    start = _system_time(header)
    rest, aligned = b"", True
    elapsed = _Elapsed()
    for block in _blf_containers(stream, warnings, elapsed):
        if block is None:  # the frame that continues there is lost; the next one begins somewhere in the next container
            rest, aligned = b"", False
            continue
        if not aligned:
            block = block[block.find(b"LOBJ") :] if b"LOBJ" in block else b""
            aligned = bool(block)
        rest += block
        used = 0
        for time, kind, place, end in _blf_objects(rest):
            used = end
            if kind in (_CAN_MESSAGE, _CAN_MESSAGE2):
                _, flags, length, identifier, data = _MESSAGE.unpack_from(rest, place)
                if flags & _REMOTE:
                    left_out["remote frames"] += 1
                    continue
                elapsed.time = time
                yield start + time, identifier & 0x9FFFFFFF, data[: min(length, _LONGEST_DATA)]
            elif kind in _ERRORS:
                left_out["error frames"] += 1
            elif kind in _FD:
                left_out["CAN FD frames"] += 1
            elif kind:
                left_out["events that are no frames"] += 1
        rest = rest[used:]
    if len(rest) > _OBJECT.size and not warnings:
        warnings.append(f"cut at {elapsed.time:.3f} s, in the middle of a frame: what lies before was read")


def _system_time(header: bytes) -> float:
    """Start of the measurement [s since 1970]; 0 where the header has none. BLF writes it as UTC."""
    if len(header) < _SYSTEM_TIME_AT + _SYSTEM_TIME.size:
        return 0.0
    year, month, _, day, hour, minute, second, millisecond = _SYSTEM_TIME.unpack_from(header, _SYSTEM_TIME_AT)
    try:
        return datetime(year, month, day, hour, minute, second, millisecond * 1000, UTC).timestamp()
    except ValueError:
        return 0.0


def _blf_containers(stream: BinaryIO, warnings: list[str], elapsed: _Elapsed) -> Iterator[bytes | None]:
    """The contents of the containers, None for a damaged one; of one that was cut what can be unpacked."""
    while head := stream.read(_OBJECT.size):
        if len(head) < _OBJECT.size or head[:4] != b"LOBJ":
            warnings.append(f"cut or damaged at {elapsed.time:.3f} s: what lies before was read")
            return
        _, _, _, size, kind = _OBJECT.unpack(head)
        body = stream.read(max(size - _OBJECT.size, 0))
        complete = len(body) == size - _OBJECT.size
        stream.read(size % 4)
        if kind == _CONTAINER_KIND and len(body) >= _CONTAINER.size:
            method, _ = _CONTAINER.unpack_from(body)
            content = body[_CONTAINER.size :]
            if method == 2:
                try:
                    content = zlib.decompressobj().decompress(content)
                except zlib.error:
                    warnings.append(f"a container behind {elapsed.time:.3f} s is damaged and left out")
                    yield None
                    content = b""
            yield content
        if not complete:
            warnings.append(f"cut at {elapsed.time:.3f} s, in the middle of a container: what lies before was read")
            return


def _blf_objects(data: bytes) -> Iterator[tuple[float, int, int, int]]:
    """Time [s since the start], kind, place of the content and end of each whole object in ``data``."""
    place = 0
    while True:
        begin = data.find(b"LOBJ", place, place + 8)
        if begin < 0 or begin + _OBJECT.size + _STAMPED.size > len(data):
            return
        _, header_size, _, size, kind = _OBJECT.unpack_from(data, begin)
        end = begin + size
        if size < _OBJECT.size or end > len(data):
            return
        unit, _, _, ticks = _STAMPED.unpack_from(data, begin + _OBJECT.size)
        if kind in (_CAN_MESSAGE, _CAN_MESSAGE2) and size - header_size < _MESSAGE.size:
            kind = 0
        yield ticks * (1e-5 if unit == 1 else 1e-9), kind, begin + header_size, end
        place = end
