"""Unpacks compressed data within limits: 30 kB of compressed zeros can become a gigabyte.

A block (chunk of a bag, container of a log) states its size. The size is checked against the limit of a block before unpacking,
and against the output during unpacking. All blocks of a file together may be a hundred times as large as the file; recordings
are four to twenty times as large.
"""

from __future__ import annotations

import zlib
from dataclasses import dataclass
from io import BytesIO
from typing import BinaryIO

import zstandard

from boom_recording.errors import RecordingError

LARGEST_BLOCK = 64_000_000
"""Bytes; rosbag2 makes chunks of 0.8 MB, others of up to 16 MB."""
_RATIO = 100
_STEP = 65_536


class UnpackingError(ValueError):
    """A block is damaged, or differs from its header; a short phrase."""


@dataclass
class Budget:
    """How much of a file may still be unpacked. packed: its size [byte]; free: allowed for any file [byte]."""

    packed: int
    free: int = LARGEST_BLOCK

    def __post_init__(self) -> None:
        self.left = self.free + _RATIO * self.packed

    def spend(self, size: int) -> None:
        """Raises RecordingError if the file unpacks to more than any recording does."""
        self.left -= size
        if self.left < 0:
            raise RecordingError(
                f"it unpacks to more than {_RATIO} times its size, as no recording does, and is not read: "
                "copy it again from its source"
            )


def check_size(size: int) -> None:
    """Raises UnpackingError if a block claims to be larger than the limit."""
    if size > LARGEST_BLOCK:
        raise UnpackingError(f"it claims {size / 1e6:.6g} MB, blocks have at most {LARGEST_BLOCK / 1e6:g} MB")


def unpack(packed: bytes, compression: str, size: int) -> bytes:
    """The content of a block that claims `size` bytes: "zstd", "lz4", "deflate" or "" for uncompressed.

    Raises:
        UnpackingError: damaged, of another size, larger than the limit, or of another compression.
        RecordingError: lz4 is not installed.
    """
    check_size(size)
    if compression == "":
        content = packed
    elif compression == "zstd":
        content = _zstd(packed, size)
    elif compression == "lz4":
        content = _lz4(packed, size)
    elif compression == "deflate":
        content = _deflate(packed, size)
    else:
        raise UnpackingError(f"unknown compression {compression[:20]!a}")
    if len(content) != size:
        more = "more" if len(content) > size else "less"
        raise UnpackingError(f"it holds {more} than the {size} bytes that it claims")
    return content


def _zstd(packed: bytes, size: int) -> bytes:
    try:
        # The frame's own size is what would be allocated.
        told = zstandard.get_frame_parameters(packed).content_size
        if told not in (size, zstandard.CONTENTSIZE_UNKNOWN):
            raise UnpackingError(f"it claims {size} bytes and {told} bytes")
        return zstandard.ZstdDecompressor().decompress(packed, max_output_size=size) if size else b""
    except zstandard.ZstdError as error:
        raise UnpackingError(_first_line(error)) from None


def _lz4(packed: bytes, size: int) -> bytes:
    try:
        import lz4.frame
    except ImportError:
        raise RecordingError(
            "it is compressed with lz4: install the Python package lz4, or convert the bag to zstd"
        ) from None
    try:
        return bytes(lz4.frame.LZ4FrameDecompressor().decompress(packed, max_length=size + 1))
    except (RuntimeError, EOFError) as error:
        raise UnpackingError(_first_line(error)) from None


def _deflate(packed: bytes, size: int) -> bytes:
    try:
        return zlib.decompressobj().decompress(packed, size + 1)
    except zlib.error as error:
        raise UnpackingError(_first_line(error)) from None


def unpack_partly(packed: bytes, compression: str, size: int) -> bytes:
    """The part of a truncated or damaged block that can be unpacked, at most `size` bytes."""
    limit = min(size, LARGEST_BLOCK)
    if compression == "":
        return packed[:limit]
    if compression == "zstd":
        unpacker = zstandard.ZstdDecompressor().decompressobj()
    elif compression == "deflate":
        unpacker = zlib.decompressobj()  # type: ignore[assignment]  # the same method
    else:
        return b""
    parts: list[bytes] = []
    length = 0
    for start in range(0, len(packed), 512):  # in small steps: an error then costs no more than one
        try:
            parts.append(unpacker.decompress(packed[start : start + 512]))
        except (zstandard.ZstdError, zlib.error):
            break
        length += len(parts[-1])
        if length >= limit:
            break
    return b"".join(parts)[:limit]


def unpack_file(stream: BinaryIO, budget: Budget) -> tuple[BytesIO, str]:
    """The content of a file that is compressed as a whole with zstd, within its budget, and its defect, or "".

    Raises:
        RecordingError: not compressed with zstd, or larger than the budget.
    """
    reader = zstandard.ZstdDecompressor().stream_reader(stream, read_across_frames=True, closefd=False)
    content = BytesIO()
    while True:
        try:
            part = reader.read(_STEP)
        except zstandard.ZstdError as error:
            if not content.tell():
                raise RecordingError(f"it cannot be unpacked: {_first_line(error)}") from None
            return content, _first_line(error)
        if not part:
            return content, ""
        budget.spend(len(part))
        content.write(part)


def _first_line(error: Exception) -> str:
    return str(error).splitlines()[0] if str(error) else type(error).__name__
