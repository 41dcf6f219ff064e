"""Reads CAN logs in Vector's binary format (BLF): containers, mostly deflated, with objects that go on from one to the next."""

from __future__ import annotations

import struct
from collections import Counter
from collections.abc import Generator, Iterator
from datetime import UTC, datetime
from io import SEEK_END
from typing import BinaryIO

from boom_recording import unpacking
from boom_recording.unpacking import LARGEST_BLOCK, Budget, UnpackingError

Raw = tuple[float, int, bytes]
"""Time [s], identifier with bit 31 for an extended one, data."""

_FILE_HEADER = struct.Struct(
    "<4sL8xQQL"
)  # LOGG, size of the header, of the file, of the file unpacked, number of objects
_SHORTEST_HEADER, _LONGEST_HEADER = 72, 4096
_SYSTEM_TIME = struct.Struct("<8H")
_SYSTEM_TIME_AT = 40
_OBJECT = struct.Struct("<4sHHLL")
_CONTAINER = struct.Struct("<H6xL4x")  # how it is packed, size of the content
_STAMPED = struct.Struct("<LHHQ")
_MESSAGE = struct.Struct("<HBBL8s")
_CAN_MESSAGE, _CONTAINER_KIND, _CAN_MESSAGE2 = 1, 10, 86
_OTHER_KINDS = {2: "error frames", 73: "error frames", 100: "CAN FD frames", 101: "CAN FD frames"}
_REMOTE = 0x80
_LONGEST_DATA = 8
_LONGEST_OBJECT = 16_000_000
_FREE = 16_000_000
"""Bytes that any log may unpack to: 300 000 frames."""


def read_blf(stream: BinaryIO, left_out: Counter[str], warnings: list[str]) -> Iterator[Raw]:
    """The data frames of a log; what of it cannot be read is told in `warnings`.

    Raises:
        RecordingError: it unpacks to more than any log does.
    """
    header = stream.read(_FILE_HEADER.size)
    if len(header) < _FILE_HEADER.size or header[:4] != b"LOGG":
        warnings.append("it is no BLF file: the first four bytes are not LOGG")
        return
    _, header_size, _, _, promised = _FILE_HEADER.unpack(header)
    header += stream.read(min(max(header_size, _SHORTEST_HEADER), _LONGEST_HEADER) - len(header))
    place = stream.tell()
    budget = Budget(stream.seek(0, SEEK_END), _FREE)
    stream.seek(place)
    reader = _BlfReader(left_out, warnings, _system_time(header, warnings))
    for block in reader.containers(stream, budget):
        yield from reader.frames(block)
    if len(reader.rest) > _OBJECT.size and not warnings:
        warnings.append(f"cut at {reader.elapsed:.3f} s, in the middle of a frame: what lies before was read")
    if promised > reader.objects:
        lost = f"{promised - reader.objects} of the {promised} objects that its header counts are lost"
        warnings[-1:] = ["; ".join((*warnings[-1:], lost))]


def _system_time(header: bytes, warnings: list[str]) -> float:
    """Start of the measurement [s since 1970]; 0 where the header has none. BLF writes it as UTC."""
    if len(header) < _SYSTEM_TIME_AT + _SYSTEM_TIME.size:
        return 0.0
    fields = _SYSTEM_TIME.unpack_from(header, _SYSTEM_TIME_AT)
    if not any(fields):
        return 0.0
    year, month, _, day, hour, minute, second, millisecond = fields
    try:
        begin = datetime(year, month, day, hour, minute, second, millisecond * 1000, UTC).timestamp()
    except (ValueError, OverflowError):
        begin = -1.0
    if not is_date(begin):
        warnings.append("the date of its beginning cannot be read: its times count from there")
        return 0.0
    return begin


def is_date(seconds: float) -> bool:
    """Whether a log can begin then [s since 1970]: after 2001, and a week before the stamps of ROS end in 2038."""
    return 1e9 <= seconds < 2**31 - 7 * 86_400


class _BlfReader:
    """Takes the containers in turn.

    Attributes:
        rest: of the last container, the beginning of an object.
        elapsed: time of the last frame [s since the start].
        objects: that were found, containers too.
    """

    def __init__(self, left_out: Counter[str], warnings: list[str], start: float) -> None:
        self._left_out, self._warnings, self._start = left_out, warnings, start
        self.rest = bytearray()
        self.elapsed = 0.0
        self.objects = 0
        self._aligned = True
        self._wanted = 0

    def containers(self, stream: BinaryIO, budget: Budget) -> Iterator[bytes | None]:
        """The contents of the containers, None behind a damaged one; of one that was cut what can be unpacked."""
        while head := stream.read(_OBJECT.size):
            if len(head) < _OBJECT.size or head[:4] != b"LOBJ":
                self._tell("cut or damaged at", ": what lies before was read")
                return
            _, _, _, size, kind = _OBJECT.unpack(head)
            if not _OBJECT.size <= size <= LARGEST_BLOCK:
                self._tell("damaged at", ": what lies before was read")
                return
            body = stream.read(size - _OBJECT.size)
            complete = len(body) == size - _OBJECT.size
            stream.read(size % 4)
            self.objects += 1
            if kind == _CONTAINER_KIND and len(body) >= _CONTAINER.size:
                yield from self._unpacked(body, complete, budget)
            elif kind == _CONTAINER_KIND and complete:
                self._tell("a container behind", " is damaged and left out")
                yield None
            elif kind != _CONTAINER_KIND:
                self._left_out["objects outside containers"] += 1
            if not complete:
                self._tell("cut at", ", in the middle of a container: what lies before was read")
                return

    def _unpacked(self, body: bytes, complete: bool, budget: Budget) -> Iterator[bytes | None]:
        method, size = _CONTAINER.unpack_from(body)
        packed = body[_CONTAINER.size :]
        if method == 0:
            yield packed
            return
        if method != 2:
            self._tell("a container behind", f" is packed in an unknown way ({method}) and left out")
            yield None
            return
        try:
            unpacking.check_size(size)
            budget.spend(size)
            yield unpacking.unpack(packed, "deflate", size)
        except UnpackingError as error:
            if complete:
                self._tell("a container behind", f" is damaged ({error}): what can be read of it was read")
            yield unpacking.unpack_partly(packed, "deflate", size)
            yield None

    def _tell(self, what: str, then: str) -> None:
        text = f"{what} {self.elapsed:.3f} s{then}"
        if text not in self._warnings:
            self._warnings.append(text)

    def frames(self, block: bytes | None) -> Iterator[Raw]:
        """The frames that a further container completes; None where one is missing."""
        if block is None:  # the frame that continues there is lost; the next one begins somewhere in the next container
            self.rest.clear()
            self._aligned, self._wanted = False, 0
            return
        if not self._aligned:
            block = block[block.find(b"LOBJ") :] if b"LOBJ" in block else b""
            self._aligned = bool(block)
        self.rest += block
        if (
            len(self.rest) < self._wanted
        ):  # an object that goes on over many containers is looked at once, when it is whole
            return
        data = bytes(self.rest)
        used = 0
        while True:
            used, self._wanted, broken = yield from self._objects(data, used)
            if not broken:
                break
            self._tell("an object behind", " is damaged: some frames are lost")
            used = data.find(b"LOBJ", used)
            if used < 0:
                used, self._aligned = len(data), False
                break
        del self.rest[:used]

    def _objects(self, data: bytes, place: int) -> Generator[Raw, None, tuple[int, int, bool]]:
        """The frames among the whole objects from `place`.

        Returns where the rest begins, how long it has to be to be looked at again, and whether what lies before it is damaged.
        """
        while True:
            begin = data.find(b"LOBJ", place, place + 8)
            if begin < 0:
                broken = len(data) - place >= 8
                return place + broken, 0, broken
            if begin + _OBJECT.size + _STAMPED.size > len(data):
                return begin, _OBJECT.size + _STAMPED.size, False
            _, header_size, _, size, kind = _OBJECT.unpack_from(data, begin)
            end = begin + size
            if not _OBJECT.size + _STAMPED.size <= size <= _LONGEST_OBJECT:
                return begin + 4, 0, True
            if end > len(data):
                return begin, size, False
            self.objects += 1
            place = end
            if kind not in (_CAN_MESSAGE, _CAN_MESSAGE2):
                self._left_out[_OTHER_KINDS.get(kind, "events that are no frames")] += 1
                continue
            if size - header_size < _MESSAGE.size:
                self._left_out["damaged frames"] += 1
                continue
            unit, _, _, ticks = _STAMPED.unpack_from(data, begin + _OBJECT.size)
            _, flags, length, identifier, content = _MESSAGE.unpack_from(data, begin + header_size)
            if flags & _REMOTE:
                self._left_out["remote frames"] += 1
                continue
            self.elapsed = ticks * (1e-5 if unit == 1 else 1e-9)
            yield self._start + self.elapsed, identifier & 0x9FFFFFFF, content[: min(length, _LONGEST_DATA)]
