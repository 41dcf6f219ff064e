"""Writes files completely or not at all, and locks a folder for one process at a time."""

from __future__ import annotations

import fcntl
import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path


class InUseError(RuntimeError):
    """Another process uses the folder; one line that says so."""

    exit_status = 2


def write_whole(path: str | Path, content: str | bytes) -> None:
    """Write a file completely or not at all: the old one stays until the new one is complete and on the disk.

    A link keeps its target. A target that is not a regular file, e.g. ``/dev/stdout``, is written directly.

    Raises:
        OSError: it cannot be written.
    """
    data = (
        content.encode("utf-8", "backslashreplace") if isinstance(content, str) else content
    )  # names of files may be anything
    target = Path(os.path.realpath(path))
    if target.exists() and not target.is_file():
        target.write_bytes(data)
        return
    temporary = target.with_name(f".{target.name}.{os.getpid()}.new")
    try:
        with temporary.open("wb") as file:  # with the permissions that a new file has
            file.write(data)
            file.flush()
            os.fsync(file.fileno())
        temporary.replace(target)
    except OSError as error:
        error.filename = error.filename or str(path)
        raise
    finally:
        with suppress(OSError):
            temporary.unlink(missing_ok=True)


def write_new(path: str | Path, content: str) -> None:
    """Write a file that is not there yet; of two processes that try at once, one does.

    Raises:
        FileExistsError: something has that name, be it a link to nothing.
        OSError: it cannot be written; nothing of it stays.
    """
    with open(path, "xb") as file:
        try:
            file.write(content.encode("utf-8", "backslashreplace"))
            file.flush()
            os.fsync(file.fileno())
        except BaseException:
            os.unlink(path)
            raise


@contextmanager
def one_writer(folder: str | Path, said: str | Path = "") -> Iterator[None]:
    """Lock an existing folder. The kernel holds the lock, so it disappears however the process ends.

    said: what the message calls it, if not that.

    Raises:
        InUseError: another process holds it.
        OSError: it cannot be opened.
    """
    descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
    try:
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise InUseError(
                f"{said or folder} is in use by another ./boom: wait until it has ended, or give another --output"
            ) from None
        yield
    finally:
        os.close(descriptor)
