"""The user's cache folder. Its files are loaded as code, so they must be intact and belong to the user.

A file carries the SHA-256 of its content as its last 32 bytes (a shared library tolerates them). It is written under a temporary
name, synced to the disk and renamed: a reader finds the old file, the new one or none, however many processes write at once.
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
    """The cache folder: $BOOM_CACHE, else ``boom`` in the user's cache folder. Created if missing.

    Raises:
        InputError: it cannot be created, belongs to another user, or is writable by others.
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
    """Whether a file of the cache exists and is intact; a damaged one has to be rewritten.

    Raises:
        InputError: it belongs to another user, or is writable by others.
    """
    try:
        _check(path)
        content = path.read_bytes()
    except OSError:
        return False
    return hashlib.sha256(memoryview(content)[:-_DIGEST]).digest() == content[-_DIGEST:]


def keep(path: Path, content: bytes) -> None:
    """Write a file of the cache completely or not at all, accessible to its owner only.

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
