"""The folder of a demo's results: one demo uses it at a time, and the last good bag stays until the next one is good."""

from __future__ import annotations

import contextlib
import os
import shutil
from collections.abc import Iterator
from pathlib import Path

from boom_input.whole import one_writer

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
        """Path for recording the new bag of that name; does not exist yet. Its data file has the folder's name."""
        return self.path / f".{name}-{os.getpid()}" / name

    def bag(self, name: str = BAG) -> Path:
        """Path of a complete bag."""
        return self.path / name

    def keep(self, name: str = BAG) -> Path:
        """Replace the old bag by the new one, which is good; returns its path.

        Raises:
            FolderError: the disk refuses the operation.
        """
        bag, old = self.bag(name), self.path / f".{name}-old-{os.getpid()}"
        try:
            if bag.exists():
                bag.rename(old)
            self.recording(name).rename(bag)
        except OSError as error:
            raise FolderError(f"{self.path}: cannot move the new bag into place: {error.strerror}") from None
        shutil.rmtree(old, ignore_errors=True)
        return bag


@contextlib.contextmanager
def held(path: Path) -> Iterator[DemoFolder]:
    """Create the folder if needed and hold it; recordings that were not kept are removed at the end.

    Args:
        path: of the folder.

    Raises:
        InUseError: another command uses it.
        FolderError: it holds foreign files, or it cannot be written.
    """
    with contextlib.ExitStack() as stack:
        try:
            path.mkdir(parents=True, exist_ok=True)
            for name in BAGS:
                if (path / name).exists() and not (path / MARK).exists():
                    raise FolderError(
                        f"{path / name} exists and is not the bag of an earlier demo: give another --output"
                    )
            stack.enter_context(one_writer(path))
            if not (path / MARK).exists():
                (path / MARK).write_text(_MARK_TEXT, encoding="utf-8")
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
                shutil.rmtree(folder.recording(name).parent, ignore_errors=True)
