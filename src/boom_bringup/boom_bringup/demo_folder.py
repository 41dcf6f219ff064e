"""The folder of a demo's results: used by one demo at a time, and the last good bag stays until the next one is good."""

from __future__ import annotations

import contextlib
import fcntl
import os
import shutil
from collections.abc import Iterator
from pathlib import Path

BAG = "simulated"
CLOSED_BAG = "closed_loop"
BAGS = (BAG, CLOSED_BAG)
MARK = ".boom-demo"
_MARK_TEXT = "Results of ./boom demo. The next demo in this folder replaces them.\n"


class FolderError(RuntimeError):
    """The folder cannot be used; one line that says what to do."""

    exit_status = 2


class DemoFolder:
    """An output folder that is held.

    Attributes:
        path: of the folder.
    """

    def __init__(self, path: Path) -> None:
        self.path = path

    def recording(self, name: str = BAG) -> Path:
        """Where the new bag of that name is to be recorded; does not exist yet."""
        return self.path / f".{name}-{os.getpid()}"

    def bag(self, name: str = BAG) -> Path:
        """Where a bag that is complete lies."""
        return self.path / name

    def keep(self, name: str = BAG) -> Path:
        """The new bag is good: it takes the place of the old one, whose path is returned.

        Raises:
            FolderError: the disk refuses.
        """
        bag, old = self.bag(name), self.path / f".{name}-old-{os.getpid()}"
        try:
            if bag.exists():
                bag.rename(old)
            self.recording(name).rename(bag)
        except OSError as error:
            raise FolderError(f"{self.path}: the new bag cannot take its place: {error.strerror}") from None
        shutil.rmtree(old, ignore_errors=True)
        return bag


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
            for name in BAGS:
                if (path / name).exists() and not (path / MARK).exists():
                    raise FolderError(
                        f"{path / name} exists and is not the bag of an earlier demo: give another --output"
                    )
            mark = stack.enter_context((path / MARK).open("a+", encoding="utf-8"))
            fcntl.flock(mark, fcntl.LOCK_EX | fcntl.LOCK_NB)
            if not mark.tell():
                mark.write(_MARK_TEXT)
                mark.flush()
        except BlockingIOError:
            raise FolderError(f"{path} is in use by another ./boom demo: give another --output") from None
        except OSError as error:
            raise FolderError(f"{path}: cannot be written: {error.strerror}; give another --output") from None
        for name in BAGS:
            for left in path.glob(f".{name}-*"):  # of a demo that was killed
                shutil.rmtree(left, ignore_errors=True)
        folder = DemoFolder(path)
        try:
            yield folder
        finally:
            for name in BAGS:
                shutil.rmtree(folder.recording(name), ignore_errors=True)
