"""Folders that last as long as they are needed, and the end of those that a killed process left.

The process that uses a folder holds the kernel's lock on it, which goes with the process, however that ends: a folder of this
kind that can be locked belongs to nobody any more.
"""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from functools import cache
from pathlib import Path
from tempfile import gettempdir, mkdtemp

from boom_input.whole import InUseError, one_writer

PREFIX = "boom-fleet-"


@contextmanager
def scratch() -> Iterator[Path]:
    """A new folder for temporary files, gone at the end; the first one of a process clears away what killed ones left."""
    _cleared_once()
    with ExitStack() as stack:
        folder = _locked(stack)
        try:
            yield folder
        finally:
            shutil.rmtree(folder, ignore_errors=True)


def clear() -> None:
    """Remove the folders of processes that are gone; those of living ones are locked and stay."""
    for folder in Path(gettempdir()).glob(f"{PREFIX}*"):
        with suppress(InUseError, OSError), one_writer(folder):
            shutil.rmtree(folder, ignore_errors=True)


def _locked(stack: ExitStack) -> Path:
    """A new folder whose lock the stack holds; another process may have cleared it away before it was locked: then another one."""
    while True:
        folder = Path(mkdtemp(prefix=PREFIX))
        with suppress(InUseError, FileNotFoundError):
            stack.enter_context(one_writer(folder))
            if folder.is_dir():
                return folder


@cache
def _cleared_once() -> None:
    clear()
