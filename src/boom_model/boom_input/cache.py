"""The user's cache folder: what lies in it is loaded as code, so it must be whole, and nobody else's.

A file carries the SHA-256 of its content as its last 32 bytes (a shared library does not mind them). It is written beside its
place, brought to the disk and then renamed: a reader finds the old one, the new one or none, however many write at once.
"""

from __future__ import annotations

import hashlib
import os
import stat
import tempfile
from pathlib import Path

from boom_input.files import InputError

_DIGEST = hashlib.sha256().digest_size
_OTHERS_MAY_WRITE = stat.S_IWGRP | stat.S_IWOTH


def cache_folder() -> Path:
    """The folder for what can be made anew: $BOOM_CACHE, else ``boom`` in the user's cache folder. Made where it is missing.

    Raises:
        InputError: it cannot be made, belongs to somebody else, or others may write into it.
    """
    given = os.environ.get("BOOM_CACHE") or ""
    folder = Path(given or Path(os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache")) / "boom")
    try:
        folder.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
        folder.mkdir(exist_ok=True, mode=0o700)  # whatever the umask: it can only take away
        _check(folder)
    except OSError as error:
        raise InputError(f"cache folder {folder}: {error.strerror}: set BOOM_CACHE to a folder of your own") from None
    return folder


def is_whole(path: Path) -> bool:
    """Whether a file of the cache is there and holds what was once written; a damaged one is to be written anew.

    Raises:
        InputError: it belongs to somebody else, or others may write to it.
    """
    try:
        _check(path)
        content = path.read_bytes()
    except OSError:
        return False
    return hashlib.sha256(memoryview(content)[:-_DIGEST]).digest() == content[-_DIGEST:]


def keep(path: Path, content: bytes) -> None:
    """Writes a file of the cache, whole or not at all, for its owner only.

    Raises:
        OSError: it cannot be written.
    """
    descriptor, temporary = tempfile.mkstemp(prefix=f".{path.name}.", dir=path.parent)  # mode 0600
    try:
        with os.fdopen(descriptor, "wb") as file:
            file.write(content + hashlib.sha256(content).digest())
            file.flush()
            os.fsync(file.fileno())
        os.replace(temporary, path)
    except BaseException:
        os.unlink(temporary)
        raise


def _check(path: Path) -> None:
    status = path.stat()
    kind, remedy = ("folder", "or set BOOM_CACHE") if stat.S_ISDIR(status.st_mode) else ("file", "or remove it")
    if status.st_uid != os.geteuid():
        raise InputError(
            f"cache {kind} {path} belongs to another user, whose programs would be run: set BOOM_CACHE to a folder of your own"
        )
    if status.st_mode & _OTHERS_MAY_WRITE:
        raise InputError(
            f"cache {kind} {path} may be written by others, whose programs would be run: chmod go-w {path}, {remedy}"
        )
