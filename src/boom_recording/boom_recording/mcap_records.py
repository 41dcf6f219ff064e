"""The records of an MCAP file: what a message, a topic and a loss are, the bytes in memory, and what a file declares."""

import struct
from dataclasses import dataclass
from io import SEEK_END, BytesIO
from typing import BinaryIO

import numpy as np
from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Channel, Schema
from numpy.typing import NDArray

from boom_recording.errors import RecordingError

PREFIX = struct.Struct("<BQ")
"""Opcode and length of every record."""
LENGTH = struct.Struct("<Q").unpack_from
DECLARING = (Opcode.SCHEMA, Opcode.CHANNEL)
READ_AHEAD = 1_000_000
_MOST_TOPICS = 20_000
_LONGEST_DECLARATIONS = 32_000_000


@dataclass(frozen=True)
class Topic:
    """One channel of the file; type as "pkg/msg/Type", definition_encoding "ros2msg", "ros2idl" or "".

    A definition that is no text keeps its bytes (``surrogateescape``).
    """

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

    def message(self, index: int) -> bytes:
        """The bytes of one message."""
        start = int(self.offset[index])
        return self.data[start : start + int(self.size[index])].tobytes()


@dataclass(frozen=True)
class Damage:
    """What could not be read.

    start_ns, end_ns   log time [ns] of the loss, None where unknown (end of file)
    loss               what is lost between them: "messages", "some messages", or "" where `what` says it all
    """

    what: str
    start_ns: int | None = None
    end_ns: int | None = None
    loss: str = "messages"


@dataclass(frozen=True)
class Piece:
    """Records that hold messages, and the log times [ns] of the chunk that they were in."""

    data: bytes
    start_ns: int | None = None
    end_ns: int | None = None


class Window:
    """The part of a file that is in memory."""

    def __init__(self, stream: BinaryIO) -> None:
        self._stream = stream
        self._begin = 0
        self._block = b""
        self.size = stream.seek(0, SEEK_END)

    def covering(self, position: int, length: int) -> tuple[bytes, int]:
        """A block in which `length` bytes from `position` lie, and where in it. Raises RecordingError where they are gone."""
        place = position - self._begin
        if place < 0 or place + length > len(self._block):
            self._stream.seek(position)
            self._block = self._stream.read(max(length, READ_AHEAD))
            self._begin, place = position, 0
            if len(self._block) < length:
                raise RecordingError("it became shorter while it was read: load it again when nothing writes to it")
        return self._block, place

    def at(self, position: int, length: int) -> bytes:
        """The `length` bytes from `position`. Raises RecordingError where they are gone."""
        block, place = self.covering(position, length)
        return block[place : place + length]


class Declarations:
    """Schemas and channels of a file. They are repeated in every chunk; what differs from its repetition is damaged.

    Attributes:
        topics: by the number that `Batch.channel` holds.
        contradict: whether a topic is declared twice and differently; the first declaration counts.
    """

    def __init__(self) -> None:
        self.topics: dict[int, Topic] = {}
        self.contradict = False
        self._schemas: dict[int, Schema] = {}
        self._known: set[bytes] = set()
        self._length = 0

    def add(self, opcode: int, body: bytes) -> None:
        """Take in a schema or channel. Raises RecordingError where there are more than any recording has."""
        if body in self._known:
            return
        self._known.add(body)
        self._length += len(body)
        if len(self._known) > _MOST_TOPICS or self._length > _LONGEST_DECLARATIONS:
            raise RecordingError("it declares more topics than any recording has, and is not read")
        stream = ReadDataStream(BytesIO(body))
        try:
            if opcode == Opcode.SCHEMA:
                schema = Schema.read(stream)
                contradicts = schema.id in self._schemas
                self._schemas.setdefault(schema.id, schema)
            else:
                channel = Channel.read(stream)
                contradicts = channel.id in self.topics
                if not contradicts:
                    self._add(channel)
        except Exception:  # garbage without a checksum may raise anything; its messages are then counted as unreadable
            return
        self.contradict = self.contradict or contradicts

    def _add(self, channel: Channel) -> None:
        schema = self._schemas.get(channel.schema_id)
        name = schema.name if schema else ""
        parts = name.split("/")
        self.topics[channel.id] = Topic(
            topic=channel.topic,
            type=f"{parts[0]}/msg/{parts[1]}" if len(parts) == 2 else name,
            definition=schema.data.decode("utf-8", "surrogateescape") if schema else "",
            definition_encoding=schema.encoding if schema else "",
            message_encoding=channel.message_encoding,
        )


def whole_records(data: bytes) -> bytes:
    """`data` without the record at its end that is not whole."""
    position = 0
    while position + 9 <= len(data):
        following = position + 9 + LENGTH(data, position + 1)[0]
        if following > len(data):
            break
        position = following
    return data[:position]
