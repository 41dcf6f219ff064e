"""Writes all frames, received and sent, into a log file, in addition to the topics. A full disk ends the log, never the bridge."""

import threading
from pathlib import Path
from typing import Any

from boom_can_bridge.python_can import can

from .errors import CanConfigurationError

SUFFIXES = (".blf", ".asc", ".log", ".csv", ".trc")


class FrameLog:
    """A log file; the ending of its name decides the format (BLF is compact and lossless).

    Raises:
        CanConfigurationError: the ending is not known, the file exists already, or it cannot be written
    """

    def __init__(self, path: Path) -> None:
        self.failed = False
        self._lock = threading.Lock()
        self._path = path
        self._count = 0
        if path.suffix.lower() not in SUFFIXES:
            raise CanConfigurationError(f"log {path}: the name must end in one of {', '.join(SUFFIXES)}")
        if path.exists():
            raise CanConfigurationError(f"log {path} exists already: give another name or remove it")
        try:
            self._writer: Any = can.Logger(str(path))
        except (OSError, ValueError) as error:
            raise CanConfigurationError(f"log {path} cannot be written: {' '.join(str(error).split())}") from None

    @property
    def state(self) -> str:
        """One line: path and number of frames, or why the log ended."""
        return self._state if self.failed else f"{self._path}: {self._count} frames"

    def write(self, message: can.Message) -> None:
        """Write one frame; from any thread."""
        with self._lock:
            if self._writer is None:
                return
            try:
                self._writer.on_message_received(message)
                self._count += 1
            except (OSError, ValueError) as error:
                self.failed = True
                self._state = f"{self._path} ended after {self._count} frames: {' '.join(str(error).split())}"
                self._shut()

    def close(self) -> None:
        """Finish the file."""
        with self._lock:
            self._shut()

    def _shut(self) -> None:
        writer, self._writer = self._writer, None
        if writer is not None:
            try:
                writer.stop()
            except (OSError, ValueError) as error:
                self.failed = True
                self._state = f"{self._path} could not be finished: {' '.join(str(error).split())}"
