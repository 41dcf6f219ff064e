"""Reads the messages of an MCAP file in bulk, as far as the file is whole, and tells what is not.

The framing of MCAP is read here and not by the `mcap` package's readers, which build one object per message (an hour
would take a minute to load) and give up at the first broken record. A chunk whose checksum is wrong is left out with
its time span; a chunk that ends in the middle is unpacked up to the break; after a broken record the index at the end
of the file, where there is one, says where to go on.
"""

import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass, field
from io import BytesIO

import numpy as np
import zstandard
from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Channel, ChunkIndex, Schema
from numpy.typing import NDArray

from boom_recording.errors import RecordingError

MAGIC = b"\x89MCAP0\r\n"
_PREFIX = struct.Struct("<BQ")
_LENGTH = struct.Struct("<Q").unpack_from
_CHUNK = struct.Struct("<QQQII")  # start, end, size, checksum, length of the compression's name
_FOOTER = struct.Struct("<QQI")
_MESSAGE_PREFIX = 31  # opcode, length, channel, sequence, log time, publish time
_BATCH_BYTES = 8_000_000
_LAST_OPCODE = 0x0F


@dataclass(frozen=True)
class Topic:
    """One channel of the file; type as "pkg/msg/Type", definition_encoding "ros2msg", "ros2idl" or ""."""

    topic: str
    type: str
    definition: str
    definition_encoding: str
    message_encoding: str


@dataclass(frozen=True)
class Batch:
    """Messages in the order of the file. `data` holds their bytes; message i is data[offset[i] : offset[i] + size[i]].

    log_ns, publish_ns: [ns]; channel: key of `McapFile.topics`.
    """

    data: NDArray[np.uint8]
    channel: NDArray[np.int64]
    offset: NDArray[np.int64]
    size: NDArray[np.int64]
    log_ns: NDArray[np.int64]
    publish_ns: NDArray[np.int64]


@dataclass(frozen=True)
class Damage:
    """What could not be read. start_ns, end_ns: log time [ns] of the loss, None where unknown (end of file)."""

    what: str
    start_ns: int | None
    end_ns: int | None


@dataclass
class McapFile:
    """Bulk reader of the bytes of one MCAP file; iterate over `batches` once, then look at `damages` and `notes`."""

    content: bytes
    topics: dict[int, Topic] = field(default_factory=dict)
    damages: list[Damage] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    last_log_ns: int | None = None
    complete: bool = True
    _schemas: dict[int, Schema] = field(default_factory=dict)
    _chunks: list[ChunkIndex] = field(default_factory=list)
    _unchecked: bool = False

    def batches(self) -> Iterator[Batch]:
        """Give all messages that can be read. Raises RecordingError for a file that is not MCAP."""
        if not self.content.startswith(MAGIC):
            raise RecordingError(
                "it is not an MCAP file (it does not begin like one): give a rosbag2 directory or a .mcap file"
            )
        data_end = self._read_summary()
        pending: list[bytes] = []
        for piece in self._pieces(data_end):
            pending.append(piece)
            if sum(map(len, pending)) > _BATCH_BYTES:
                yield from self._scan(pending)
                pending = []
        yield from self._scan(pending)
        if self._unchecked:
            self.notes.append("the file carries no checksums: a flipped byte would go unnoticed")

    def _read_summary(self) -> int:
        """Index, schemas and channels behind the data. Returns where the data end, as far as known."""
        size = len(self.content)
        tail = 9 + _FOOTER.size + len(MAGIC)
        if size < len(MAGIC) + tail or not self.content.endswith(MAGIC) or self.content[size - tail] != Opcode.FOOTER:
            self.complete = False
            return size
        start, _, checksum = _FOOTER.unpack_from(self.content, size - tail + 9)
        if not 0 < start < size:
            return size - tail
        covered = self.content[start : size - len(MAGIC) - 4]
        if checksum and zlib.crc32(covered) != checksum:
            self.notes.append("the index at the end of the file is damaged and not used (checksum)")
            return size - tail
        position = start
        while position < size - tail:
            position = self._record(position, size - tail)
        return int(start)

    def _record(self, position: int, end: int) -> int:
        """Take in one schema, channel or index record; returns the position behind it, or `end` where it is broken."""
        opcode, length = _PREFIX.unpack_from(self.content, position)
        following = int(position + 9 + length)
        if following > end:
            return end
        self._describe(opcode, self.content[position + 9 : following])
        return following

    def _describe(self, opcode: int, body: bytes) -> None:
        stream = ReadDataStream(BytesIO(body))
        try:
            if opcode == Opcode.SCHEMA:
                schema = Schema.read(stream)
                self._schemas[schema.id] = schema
            elif opcode == Opcode.CHANNEL:
                self._add(Channel.read(stream))
            elif opcode == Opcode.CHUNK_INDEX:
                self._chunks.append(ChunkIndex.read(stream))
        except Exception:  # garbage without a checksum may raise anything; its messages are then counted as unreadable
            return

    def _add(self, channel: Channel) -> None:
        schema = self._schemas.get(channel.schema_id)
        name = schema.name if schema else ""
        parts = name.split("/")
        self.topics[channel.id] = Topic(
            topic=channel.topic,
            type=f"{parts[0]}/msg/{parts[1]}" if len(parts) == 2 else name,
            definition=schema.data.decode("utf-8", "replace") if schema else "",
            definition_encoding=schema.encoding if schema else "",
            message_encoding=channel.message_encoding,
        )

    def _pieces(self, end: int) -> Iterator[bytes]:
        """The records that hold messages: unpacked chunks, and runs of records outside chunks."""
        content, position, ended = self.content, len(MAGIC), False
        while position + 9 <= end:
            opcode, length = _PREFIX.unpack_from(content, position)
            following = position + 9 + length
            known = 0 < opcode <= _LAST_OPCODE or opcode >= 0x80
            if not known or following > end:
                if opcode == Opcode.CHUNK and not self._next_chunk(position):
                    yield from self._chunk(position + 9, end, cut=True)
                    return
                resumed = self._next_chunk(position)
                if resumed is None:
                    if self.complete or not known:
                        self.damages.append(
                            Damage("the file is damaged: a record cannot be read", self.last_log_ns, None)
                        )
                    return
                self.damages.append(
                    Damage("a part of the file is damaged", self.last_log_ns, resumed.message_start_time)
                )
                position = resumed.chunk_start_offset
                continue
            if opcode == Opcode.CHUNK:
                yield from self._chunk(position + 9, following, cut=False)
            elif opcode == Opcode.MESSAGE:
                yield content[position:following]
            elif opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
                self._describe(opcode, content[position + 9 : following])
            elif opcode == Opcode.DATA_END:
                ended = True
                self._check_data(content[position + 9 : following], position)
                return
            position = following
        if not ended and self.complete:
            self.notes.append("the record that ends the data is missing")

    def _next_chunk(self, position: int) -> ChunkIndex | None:
        later = [chunk for chunk in self._chunks if chunk.chunk_start_offset > position]
        return min(later, key=lambda chunk: chunk.chunk_start_offset) if later else None

    def _check_data(self, body: bytes, position: int) -> None:
        checksum = int.from_bytes(body[:4], "little")
        if checksum and not self.damages and zlib.crc32(self.content[:position]) != checksum:
            self.notes.append("a byte outside the messages is damaged (checksum of the file); all messages are whole")

    def _chunk(self, start: int, end: int, *, cut: bool) -> Iterator[bytes]:
        if end - start < _CHUNK.size:
            return
        first, last, size, checksum, name_length = _CHUNK.unpack_from(self.content, start)
        body = start + _CHUNK.size + name_length + 8
        compression = self.content[start + _CHUNK.size : body - 8].decode("ascii", "replace")
        packed = self.content[body:end]
        if cut:
            yield _unpack_partly(packed, compression)
            return
        try:
            records = _unpack(packed, compression, size)
        except (zstandard.ZstdError, ValueError) as error:
            self.damages.append(Damage(f"a chunk is damaged ({_first_line(error)})", first, last))
            rest = b"" if checksum else _unpack_partly(packed, compression)
            if rest:
                yield rest
            return
        if checksum and zlib.crc32(records) != checksum:
            self.damages.append(Damage("a chunk is damaged (its checksum does not fit)", first, last))
            return
        self._unchecked = self._unchecked or not checksum
        yield records

    def _scan(self, pieces: list[bytes]) -> Iterator[Batch]:
        """Find the messages in unpacked records. Schemas and channels between them are taken in on the way."""
        if not pieces:
            return
        data = b"".join(pieces)
        starts: list[int] = []
        append = starts.append
        position = 0
        for piece in pieces:
            end = position + len(piece)
            while position + 9 <= end:
                opcode = data[position]
                following = position + 9 + _LENGTH(data, position + 1)[0]
                if following > end:  # cut, or garbage in a chunk without a checksum
                    break
                if opcode == 5:
                    append(position)
                elif opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
                    self._describe(opcode, data[position + 9 : following])
                position = following
            position = end
        if not starts:
            return
        array = np.frombuffer(data, np.uint8)
        offsets = np.array(starts, np.int64)
        offsets = offsets[offsets + _MESSAGE_PREFIX <= len(array)]
        head = np.lib.stride_tricks.sliding_window_view(array, _MESSAGE_PREFIX)[offsets]

        def column(place: int, code: str) -> NDArray[np.int64]:
            width = int(code[1])
            return np.ascontiguousarray(head[:, place : place + width]).view("<" + code)[:, 0].astype(np.int64)

        size = column(1, "u8") + 9 - _MESSAGE_PREFIX
        log = column(15, "u8")
        batch = Batch(array, column(9, "u2"), offsets + _MESSAGE_PREFIX, size, log, column(23, "u8"))
        self.last_log_ns = int(log.max()) if self.last_log_ns is None else max(self.last_log_ns, int(log.max()))
        yield batch


def _unpack(packed: bytes, compression: str, size: int) -> bytes:
    if compression == "zstd":
        return zstandard.ZstdDecompressor().decompress(packed, max_output_size=size)
    if compression == "":
        return packed
    if compression == "lz4":
        try:
            import lz4.frame
        except ImportError:
            raise RecordingError(
                "it is compressed with lz4: install the Python package lz4, or convert the bag to zstd"
            ) from None
        try:
            return bytes(lz4.frame.decompress(packed))
        except RuntimeError as error:
            raise ValueError(str(error)) from None
    raise ValueError(f"unknown compression {compression!r}")


def _unpack_partly(packed: bytes, compression: str) -> bytes:
    """What can be unpacked of a chunk that ends in the middle."""
    if compression == "":
        return packed
    if compression != "zstd":
        return b""
    unpacker = zstandard.ZstdDecompressor().decompressobj()
    parts: list[bytes] = []
    for start in range(0, len(packed), 512):  # in small steps: an error then costs no more than one
        try:
            parts.append(unpacker.decompress(packed[start : start + 512]))
        except zstandard.ZstdError:
            break
    return b"".join(parts)


def _first_line(error: Exception) -> str:
    return str(error).splitlines()[0] if str(error) else type(error).__name__
