"""Reads the messages of an MCAP file in bulk, as far as the file is whole, and tells what is not.

The framing of MCAP is read here and not by the `mcap` package's readers, which build one object per message (an hour
would take a minute to load), trust every length, and give up at the first broken record. A chunk whose checksum is wrong
is left out with its time span; a chunk that ends in the middle is unpacked up to the break; after a broken record the index
at the end of the file, where there is one, says where to go on. No more of the file is in memory than a chunk and a batch.
"""

import struct
import zlib
from bisect import bisect_right
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from io import SEEK_END, BytesIO
from pathlib import Path
from typing import BinaryIO

import numpy as np
from mcap.opcode import Opcode
from numpy.typing import NDArray

from boom_input.files import InputError, opened
from boom_input.shown import quoted
from boom_recording import unpacking
from boom_recording.errors import RecordingError
from boom_recording.mcap_records import (
    DECLARING,
    LENGTH,
    PREFIX,
    READ_AHEAD,
    Batch,
    Damage,
    Declarations,
    Piece,
    Topic,
    Window,
    whole_records,
)
from boom_recording.unpacking import LARGEST_BLOCK, Budget, UnpackingError

MAGIC = b"\x89MCAP0\r\n"
_CHUNK = struct.Struct("<QQQII")  # start, end, size, checksum, length of the compression's name
_CHUNK_INDEX = struct.Struct("<QQQ")  # start, end, place of the chunk
_FOOTER = struct.Struct("<QQI")
_TAIL = 9 + _FOOTER.size + len(MAGIC)
_MESSAGE_PREFIX = 31  # opcode, length, channel, sequence, log time, publish time
_BATCH_BYTES = 8_000_000
_BATCH_MESSAGES = 100_000
_LAST_OPCODE = 0x0F
_CHECKED_BYTES = 1_000_000_000
"""A larger file is not read a second time for the checksum over all of it."""


@dataclass
class McapFile:
    """Bulk reader of one MCAP file; iterate over `batches` once, then look at the other attributes.

    content     the file, or its bytes
    damages     what could not be read. notes: what a reader may want to know
    complete    the file was closed by whoever wrote it
    promised    messages that the file says it has, None where it does not say
    messages    that were read
    """

    content: BinaryIO | bytes
    damages: list[Damage] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    last_log_ns: int | None = None
    complete: bool = True
    promised: int | None = None
    messages: int = 0
    budget: Budget | None = None

    def __post_init__(self) -> None:
        self._window = Window(BytesIO(self.content) if isinstance(self.content, bytes) else self.content)
        self._budget = self.budget or Budget(self._window.size)
        self._chunks: list[tuple[int, int]] = []  # place and first log time [ns]
        self._declarations = Declarations()
        self._unchecked = False
        self._outside_chunks = False
        self._data_wrong = False

    @property
    def topics(self) -> dict[int, Topic]:
        """By the number that `Batch.channel` holds."""
        return self._declarations.topics

    def batches(self) -> Iterator[Batch]:
        """Give all messages that can be read. Raises RecordingError for a file that is not MCAP, or a bomb."""
        size = self._window.size
        if size < len(MAGIC) or self._window.at(0, len(MAGIC)) != MAGIC:
            raise RecordingError(
                "it is not an MCAP file (it does not begin like one): give a rosbag2 directory or a .mcap file"
            )
        data_end = self._read_summary()
        self._chunks.sort()
        pending: list[Piece] = []
        length = 0
        for piece in self._pieces(data_end):
            if length and length + len(piece.data) > _BATCH_BYTES:
                yield from self._scan(pending)
                pending, length = [], 0
            if piece.data:
                pending.append(piece)
                length += len(piece.data)
        yield from self._scan(pending)
        if self._data_wrong and not self._outside_chunks and self.messages == self.promised:
            self.notes.append("a byte outside the messages is damaged (checksum of the file); all messages are whole")
        elif self._data_wrong:
            what = "the file is damaged: its checksum does not fit, and what is wrong or lost cannot be told"
            self.damages.append(Damage(what, loss=""))
        if self._unchecked:
            self.notes.append("the file carries no checksums: a flipped byte would go unnoticed")

    def _read_summary(self) -> int:
        """Index, schemas and channels behind the data. Returns where the data end, as far as known."""
        size = self._window.size
        end = size - _TAIL
        footer = self._window.at(end, _TAIL) if end >= len(MAGIC) else b""
        if not footer.endswith(MAGIC) or footer[0] != Opcode.FOOTER:
            self.complete = False
            return size
        start, _, checksum = _FOOTER.unpack_from(footer, 9)
        if not len(MAGIC) <= start < end:
            return end
        if size - start > LARGEST_BLOCK:
            self.notes.append("the index at the end of the file is not used: it is too large to be one")
            return end
        summary = self._window.at(start, size - len(MAGIC) - 4 - start)
        if checksum and zlib.crc32(summary) != checksum:
            self.notes.append("the index at the end of the file is damaged and not used (checksum)")
            return end
        records, position = [], 0
        while position + 9 <= end - start:
            opcode, length = PREFIX.unpack_from(summary, position)
            records.append((opcode, summary[position + 9 : position + 9 + length]))
            position += 9 + length
        if position != end - start:  # without a checksum this is how it shows
            what = "the index at the end of the file is damaged and not used: what is lost cannot be told from it"
            self.damages.append(Damage(what, loss=""))
            return end
        for opcode, body in records:
            self._index(opcode, body)
        return int(start)

    def _index(self, opcode: int, body: bytes) -> None:
        """Take in a record of the summary."""
        if opcode in DECLARING:
            self._declare(opcode, body)
        elif opcode == Opcode.CHUNK_INDEX and len(body) >= _CHUNK_INDEX.size:
            first, _, place = _CHUNK_INDEX.unpack_from(body)
            self._chunks.append((place, first))
        elif opcode == Opcode.STATISTICS and len(body) >= 8:
            (self.promised,) = LENGTH(body)

    def _declare(self, opcode: int, body: bytes) -> None:
        agreed = not self._declarations.contradict
        self._declarations.add(opcode, body)
        if agreed and self._declarations.contradict:
            what = "the file is damaged: it declares a topic twice and differently; the first declaration was taken"
            self.damages.append(Damage(what, loss=""))

    def _pieces(self, end: int) -> Iterator[Piece]:
        """The records that hold messages: unpacked chunks, and runs of records outside chunks."""
        position, ended = len(MAGIC), False
        while position + 9 <= end:
            opcode, length = PREFIX.unpack(self._window.at(position, 9))
            following = position + 9 + length
            known = 0 < opcode <= _LAST_OPCODE or opcode >= 0x80
            held = opcode in (Opcode.CHUNK, Opcode.MESSAGE, *DECLARING)
            if not known or following > end or (held and length > LARGEST_BLOCK):
                resumed = self._next_chunk(position)
                if resumed is None:
                    if opcode == Opcode.CHUNK and following > end:
                        yield from self._cut_chunk(position + 9, end)
                    if self.complete or not known or following <= end:
                        self.damages.append(
                            Damage("the file is damaged: a record cannot be read", self.last_log_ns, None)
                        )
                    return
                self.damages.append(Damage("a part of the file is damaged", self.last_log_ns, resumed[1]))
                position = resumed[0]
                continue
            if opcode == Opcode.CHUNK:
                yield from self._chunk(self._window.at(position + 9, length))
            elif held:
                run = self._run(position, 9 + length)
                self._outside_chunks = True
                yield Piece(run)
                following = position + len(run)
            elif opcode == Opcode.DATA_END:
                ended = True
                self._check_data(self._window.at(position + 9, min(length, 4)), position)
                return
            position = following
        if not ended and self.complete:
            self.notes.append("the record that ends the data is missing")
        self._unchecked = self._unchecked or self._outside_chunks

    def _run(self, position: int, length: int) -> bytes:
        """The message, schema or channel of `length` bytes at `position`, and those that follow it in memory."""
        block, begin = self._window.covering(position, length)
        place, end = begin + length, len(block)
        while place + 9 <= end and block[place] in (5, 4, 3):
            following = place + 9 + LENGTH(block, place + 1)[0]
            if following > end:
                break
            place = following
        return block[begin:place]

    def _next_chunk(self, position: int) -> tuple[int, int] | None:
        """Place and first log time [ns] of the next chunk that the index knows."""
        k = bisect_right(self._chunks, (position, 2**64))
        return self._chunks[k] if k < len(self._chunks) else None

    def _check_data(self, told: bytes, end: int) -> None:
        """Hold the checksum of all data against them, where they have not been found damaged already."""
        checksum = int.from_bytes(told, "little")
        if not checksum or end > _CHECKED_BYTES:
            self._unchecked = self._unchecked or self._outside_chunks
            return
        if self.damages:
            return
        found = 0
        for position in range(0, end, READ_AHEAD):
            found = zlib.crc32(self._window.at(position, min(READ_AHEAD, end - position)), found)
        self._data_wrong = found != checksum

    def _chunk(self, record: bytes) -> Iterator[Piece]:
        if len(record) < _CHUNK.size + 8:
            self.damages.append(Damage("a chunk is damaged (it is too short)", self.last_log_ns, None, "some messages"))
            return
        first, last, size, checksum, name_length = _CHUNK.unpack_from(record)
        body = _CHUNK.size + name_length + 8
        compression = record[_CHUNK.size : body - 8].decode("ascii", "replace")
        packed = record[body:]
        try:
            if body > len(record):
                raise UnpackingError("it is too short")
            unpacking.check_size(size)
            self._budget.spend(size)
            records = unpacking.unpack(packed, compression, size)
        except UnpackingError as error:
            self.damages.append(Damage(f"a chunk is damaged ({error})", first, last))
            if not checksum:
                yield Piece(unpacking.unpack_partly(packed, compression, size), first, last)
            return
        if checksum and zlib.crc32(records) != checksum:
            self.damages.append(Damage("a chunk is damaged (its checksum does not fit)", first, last))
            return
        self._unchecked = self._unchecked or not checksum
        yield Piece(records, first, last)

    def _cut_chunk(self, start: int, end: int) -> Iterator[Piece]:
        """What can be unpacked of a chunk behind which the file ends."""
        record = self._window.at(start, min(end - start, LARGEST_BLOCK))
        if len(record) < _CHUNK.size + 8:
            return
        first, last, size, _, name_length = _CHUNK.unpack_from(record)
        body = _CHUNK.size + name_length + 8
        compression = record[_CHUNK.size : body - 8].decode("ascii", "replace")
        # It is told as a cut file; that its records end in the middle need not be told again.
        yield Piece(whole_records(unpacking.unpack_partly(record[body:], compression, size)), first, last)

    def _scan(self, pieces: list[Piece]) -> Iterator[Batch]:
        """Find the messages in unpacked records. Schemas and channels between them are taken in on the way."""
        data = b"".join([piece.data for piece in pieces])
        array = np.frombuffer(data, np.uint8)
        starts: list[int] = []
        position = 0
        for piece in pieces:
            end = position + len(piece.data)
            position, odd = self._walk(data, position, end, starts)
            while len(starts) == _BATCH_MESSAGES:
                yield from self._batch(array, starts, piece)
                starts.clear()
                position, more = self._walk(data, position, end, starts)
                odd += more
            if odd:
                what = f"{odd} {'record' if odd == 1 else 'records'} of a chunk cannot be read"
                self.damages.append(Damage(what, piece.start_ns, piece.end_ns, "some messages"))
            if position != end:
                what = "a chunk is damaged (a record in it cannot be read)"
                self.damages.append(Damage(what, piece.start_ns, piece.end_ns, "some messages"))
            position = end
        if starts:
            yield from self._batch(array, starts, pieces[-1])

    def _walk(self, data: bytes, position: int, end: int, starts: list[int]) -> tuple[int, int]:
        """Add where messages begin to `starts`, up to `end`, to a record that is none, or until they fill a batch.

        Returns where it stopped, and how many records are of a kind that lies in no chunk.
        """
        odd = 0
        append, length_at = starts.append, LENGTH  # every message passes here
        while position + 9 <= end:
            opcode = data[position]
            following = position + 9 + length_at(data, position + 1)[0]
            if following > end:  # garbage in a chunk without a checksum
                break
            if opcode == 5:
                append(position)
                if len(starts) == _BATCH_MESSAGES:
                    return following, odd
            elif opcode in DECLARING:
                self._declare(opcode, data[position + 9 : following])
            elif not opcode:
                break
            elif opcode < 0x80:  # its length may be right all the same
                odd += 1
            position = following
        return position, odd

    def _batch(self, array: NDArray[np.uint8], starts: list[int], piece: Piece) -> Iterator[Batch]:
        offsets = np.array(starts, np.int64)
        fitting = offsets[offsets + _MESSAGE_PREFIX <= len(array)]
        head = np.lib.stride_tricks.sliding_window_view(array, _MESSAGE_PREFIX)[fitting] if len(fitting) else None
        if head is not None:

            def column(place: int, code: str) -> NDArray[np.int64]:
                width = int(code[1])
                return np.ascontiguousarray(head[:, place : place + width]).view("<" + code)[:, 0].astype(np.int64)

            size = column(1, "u8") + 9 - _MESSAGE_PREFIX
            columns = [column(9, "u2"), fitting + _MESSAGE_PREFIX, size, column(15, "u8"), column(23, "u8")]
            whole = size >= 0
            if not whole.all():
                columns = [values[whole] for values in columns]
        else:
            columns = [fitting] * 5
        short = len(offsets) - len(columns[0])
        if short:
            what = f"{short} {'message is' if short == 1 else 'messages are'} too short to be one"
            self.damages.append(Damage(what, piece.start_ns, piece.end_ns, "some messages"))
        if not len(columns[0]):
            return
        batch = Batch(array, *columns)
        self.messages += len(batch.offset)
        last = int(batch.log_ns.max())
        self.last_log_ns = last if self.last_log_ns is None else max(self.last_log_ns, last)
        yield batch


@contextmanager
def opened_mcap(path: Path) -> Iterator[McapFile]:
    """The MCAP file at `path`, unpacked where it is packed as a whole (.mcap.zstd). Raises RecordingError."""
    try:
        with opened(path) as stream:
            if path.suffix != ".zstd":
                yield McapFile(stream)
                return
            budget = Budget(stream.seek(0, SEEK_END))
            stream.seek(0)
            content, wrong = unpacking.unpack_file(stream, budget)
            file = McapFile(content, budget=Budget(content.tell()))
            if wrong:
                file.damages.append(
                    Damage(f"the file is damaged ({quoted(wrong)}): it cannot be unpacked further", loss="")
                )
            yield file
    except InputError as error:
        raise RecordingError(str(error).replace(f"{path}:", path.name, 1)) from None
