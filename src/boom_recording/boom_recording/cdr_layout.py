"""Locates the fields of a CDR message, so that thousands of messages can be read or written as one array.

In CDR (OMG, XCDR version 1, what ROS 2 Jazzy puts on the wire) a number lies at a multiple of its size, counted from
the end of the four-byte encapsulation header; a string or sequence is a 32-bit length and its elements. Two
messages of one type with equal lengths therefore have every field at the same place: `locate` walks one message,
`Layout.matches` says which rows share its lengths.
"""

import struct
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rosbags.interfaces import Nodetype

Rows = NDArray[np.uint8]
FieldTypes = Mapping[str, Any]  # message type -> (constants, [(field, description)]), as rosbags parses definitions

HEADER_SIZE = 4
_LONG_SEQUENCE = 64  # elements of longer sequences get no entry of their own
_DEEPEST = 32  # a definition that contains itself never ends
_MOST_FIELDS = 20_000
_FORMATS = {
    "bool": "u1", "byte": "u1", "char": "u1", "uint8": "u1", "int8": "i1", "int16": "i2", "uint16": "u2",
    "int32": "i4", "uint32": "u4",
    "int64": "i8", "uint64": "u8", "float32": "f4", "float64": "f8",
}  # fmt: skip


class LayoutError(ValueError):
    """The bytes are not a message of that type."""


@dataclass
class Layout:
    """Places of the fields of one message.

    numbers   path ("header.stamp.sec", "position[0]") -> (offset, numpy format with byte order)
    texts     path ("name[0]") -> text
    lengths   path of a sequence -> number of elements
    size      bytes of the message as far as the definition goes
    """

    size: int = 0
    numbers: dict[str, tuple[int, str]] = field(default_factory=dict)
    texts: dict[str, str] = field(default_factory=dict)
    lengths: dict[str, int] = field(default_factory=dict)
    template: Rows = field(default_factory=lambda: np.zeros(0, np.uint8))
    decisive: NDArray[np.intp] = field(default_factory=lambda: np.zeros(0, np.intp))

    def matches(self, rows: Rows) -> NDArray[np.bool_]:
        """Which of `rows` (n, size) have this layout and name the same elements."""
        return np.asarray((rows[:, self.decisive] == self.template[self.decisive]).all(axis=1))

    def column(self, rows: Rows, path: str) -> NDArray[Any]:
        """The number at `path` of each of `rows` (n, size). Raises KeyError for an unknown path."""
        offset, code = self.numbers[path]
        dtype = np.dtype(code)
        return np.ascontiguousarray(rows[:, offset : offset + dtype.itemsize]).view(dtype)[:, 0]

    def store(self, rows: Rows, path: str, values: NDArray[Any]) -> None:
        """Write `values` (n,) at `path` into `rows` (n, size). Raises KeyError for an unknown path."""
        offset, code = self.numbers[path]
        dtype = np.dtype(code)
        rows[:, offset : offset + dtype.itemsize] = (
            np.ascontiguousarray(values, dtype).view(np.uint8).reshape(-1, dtype.itemsize)
        )


class _Walker:
    def __init__(self, data: bytes, types: FieldTypes) -> None:
        if len(data) < HEADER_SIZE or data[0] != 0 or data[1] not in (0, 1):
            raise LayoutError("no CDR encapsulation header")
        self.data = data
        self.types = types
        self.order = "<" if data[1] else ">"
        self.position = HEADER_SIZE
        self.layout = Layout()
        self.decisive: list[tuple[int, int]] = [(0, 2)]
        self._depth = self._fields = 0

    def align(self, size: int) -> None:
        self.position += -(self.position - HEADER_SIZE) % size

    def skip(self, size: int) -> int:
        start = self.position
        self.position += size
        if self.position > len(self.data):
            raise LayoutError("the message is too short for its type")
        return start

    def length(self) -> int:
        self.align(4)
        start = self.skip(4)
        self.decisive.append((start, start + 4))
        return int(struct.unpack_from(self.order + "I", self.data, start)[0])

    def text(self, path: str) -> None:
        size = self.length()
        start = self.skip(size)
        self.layout.texts[path] = self.data[start : start + size].rstrip(b"\0").decode("utf-8", "replace")
        if path.endswith("]"):  # an element's name decides what the numbers beside it mean; a frame's name does not
            self.decisive.append((start, start + size))

    def number(self, path: str, name: str) -> None:
        code = _FORMATS[name]
        size = int(code[1])
        self.align(size)
        self.layout.numbers[path] = (self.skip(size), self.order + code)

    def element(self, path: str, description: Any) -> None:
        self._fields += 1
        if self._fields > _MOST_FIELDS:
            raise LayoutError(f"it has more than {_MOST_FIELDS} fields")
        kind, detail = description
        if kind == Nodetype.NAME:
            self.message(path, detail)
        elif kind == Nodetype.BASE:
            if detail[0] == "string":
                self.text(path)
            elif detail[0] in _FORMATS:
                self.number(path, detail[0])
            else:
                raise LayoutError(f"field type {detail[0]} is not supported")
        else:
            self.sequence(path, kind, detail)

    def sequence(self, path: str, kind: Any, detail: Any) -> None:
        inner, size = detail
        count = size if kind == Nodetype.ARRAY else self.length()
        self.layout.lengths[path] = count
        plain = inner[0] == Nodetype.BASE and inner[1][0] in _FORMATS
        if count > len(self.data):
            raise LayoutError("a sequence is longer than its message")
        if plain and count > _LONG_SEQUENCE:
            width = int(_FORMATS[inner[1][0]][1])
            self.align(width)
            self.skip(width * count)
            return
        for index in range(count):
            self.element(f"{path}[{index}]", inner)

    def message(self, path: str, name: str) -> None:
        if name not in self.types:
            raise LayoutError(f"the definition of {name} is missing")
        if self._depth == _DEEPEST:
            raise LayoutError(f"its definition is nested deeper than {_DEEPEST} levels")
        self._depth += 1
        fields = self.types[name][1]
        if not fields:  # an empty message is one byte on the wire
            self.skip(1)
        for label, description in fields:
            self.element(f"{path}.{label}" if path else label, description)
        self._depth -= 1


def locate(data: bytes, name: str, types: FieldTypes) -> Layout:
    """Walk one message of type `name`. Raises LayoutError if the bytes cannot be one."""
    walker = _Walker(data, types)
    walker.message("", name)
    layout = walker.layout
    layout.size = walker.position
    layout.template = np.frombuffer(data, np.uint8).copy()
    layout.decisive = np.concatenate([np.arange(a, b) for a, b in walker.decisive]).astype(np.intp)
    return layout


def gather(data: Rows, offsets: NDArray[np.int64], size: int) -> Rows:
    """The `size` bytes at each of `offsets` in `data`, as (n, size)."""
    if len(offsets) == 0:
        return np.zeros((0, size), np.uint8)
    return np.lib.stride_tricks.sliding_window_view(data, size)[offsets]
