"""Reads a foreign file: only a regular one, and only up to a given size.

``/dev/zero`` never ends and opening a FIFO blocks, so the kind of a file is checked before it is read.
"""

from __future__ import annotations

import contextlib
import os
import stat
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO

TEXT_LIMIT = 1_000_000
"""Largest configuration file [bytes]: machine file, mapping, parameters, metadata."""


class InputError(ValueError):
    """A foreign file cannot be used; one line that begins with the file's name and says what is wrong."""

    exit_status = 2


@contextlib.contextmanager
def opened(path: str | Path) -> Iterator[BinaryIO]:
    """A regular file, open for reading; errors of reading are reported like errors of opening.

    Raises:
        InputError: missing, not readable, or not a regular file.
    """
    try:
        # O_NONBLOCK: opening a FIFO would wait for its writer.
        descriptor = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC)
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or "no such name"
        raise InputError(f"{path}: cannot be read: {reason}") from None
    try:
        if not stat.S_ISREG(os.fstat(descriptor).st_mode):
            raise InputError(f"{path}: cannot be read: it is not a regular file")
        with os.fdopen(os.dup(descriptor), "rb") as file:
            yield file
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror}") from None
    finally:
        os.close(descriptor)


def read_bytes(path: str | Path, limit: int) -> bytes:
    """The content of a regular file of at most `limit` bytes.

    Raises:
        InputError: missing, not readable, not a regular file, or larger.
    """
    with opened(path) as file:
        content = file.read(limit + 1)
    if len(content) > limit:
        raise InputError(f"{path}: it is larger than {limit / 1e6:g} MB, more than such a file can hold")
    return content


def read_text(path: str | Path, limit: int = TEXT_LIMIT) -> str:
    """The text (UTF-8) of a regular file of at most `limit` bytes.

    Raises:
        InputError: as `read_bytes`, or not UTF-8.
    """
    try:
        return read_bytes(path, limit).decode("utf-8")
    except UnicodeDecodeError:
        raise InputError(f"{path}: cannot be read: not a text file (UTF-8)") from None


def is_below(path: str, folder: str) -> bool:
    """Whether a local path is a folder or lies below it; file: URLs are local, others lie nowhere."""
    local = [
        os.path.realpath(p.removeprefix("file://")) for p in (path, folder) if "://" not in p.removeprefix("file://")
    ]
    return len(local) == 2 and Path(local[0]).is_relative_to(local[1])
