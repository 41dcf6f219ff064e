"""The folder of a demo's results: used by one demo at a time, and the last good bag stays until the next one is good."""

from __future__ import annotations

import contextlib
import fcntl
import os
import shutil
from collections.abc import Iterator
from pathlib import Path

BAG = "simulated"
MARK = ".boom-demo"
_MARK_TEXT = "Results of ./boom demo. The next demo in this folder replaces them.\n"


class FolderError(RuntimeError):
    """The folder cannot be used; one line that says what to do."""

    exit_status = 2


class DemoFolder:
    """An output folder that is held.

    Attributes:
        path: of the folder.
        recording: where the new bag is to be recorded; does not exist yet.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.recording = path / f".{BAG}-{os.getpid()}"

    @property
    def bag(self) -> Path:
        """Where a bag that is complete lies."""
        return self.path / BAG

    def keep(self) -> Path:
        """The new bag is good: it takes the place of the old one, whose path is returned.

        Raises:
            FolderError: the disk refuses.
        """
        old = self.path / f".{BAG}-old-{os.getpid()}"
        try:
            if self.bag.exists():
                self.bag.rename(old)
            self.recording.rename(self.bag)
        except OSError as error:
            raise FolderError(f"{self.path}: the new bag cannot take its place: {error.strerror}") from None
        shutil.rmtree(old, ignore_errors=True)
        return self.bag


@contextlib.contextmanager
def held(path: Path) -> Iterator[DemoFolder]:
    """Hold the folder, made where it is missing; what was recorded and not kept is removed at the end.

    Args:
        path: of the folder.

    Raises:
        FolderError: another demo uses it, it holds something that is no demo's, or it cannot be written.
    """
    with contextlib.ExitStack() as stack:
        try:
            path.mkdir(parents=True, exist_ok=True)
            if (path / BAG).exists() and not (path / MARK).exists():
                raise FolderError(f"{path / BAG} exists and is not the bag of an earlier demo: give another --output")
            mark = stack.enter_context((path / MARK).open("a+", encoding="utf-8"))
            fcntl.flock(mark, fcntl.LOCK_EX | fcntl.LOCK_NB)
            if not mark.tell():
                mark.write(_MARK_TEXT)
                mark.flush()
        except BlockingIOError:
            raise FolderError(f"{path} is in use by another ./boom demo: give another --output") from None
        except OSError as error:
            raise FolderError(f"{path}: cannot be written: {error.strerror}; give another --output") from None
        for left in path.glob(f".{BAG}-*"):  # of a demo that was killed
            shutil.rmtree(left, ignore_errors=True)
        folder = DemoFolder(path)
        try:
            yield folder
        finally:
            shutil.rmtree(folder.recording, ignore_errors=True)
