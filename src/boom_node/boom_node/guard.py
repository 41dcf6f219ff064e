"""Handles what must not end a node: exceptions in callbacks and unusable messages. Counts, logs, reacts. No ROS.

An exception in a callback is a fault of this program, whatever message caused it: a node that moves something brings it to rest,
the traceback is logged once, and ``/diagnostics`` shows ERROR until the node is restarted. A refused message is a fault of its
sender: it is counted by topic and reason, and logged from time to time.
"""

from __future__ import annotations

import time
import traceback
from collections import Counter
from collections.abc import Callable

TOLD_EVERY_S = 10.0
"""s between two log lines about the same event."""
_MOST_KINDS = 100


class Guard:
    """Collects the faults of one node.

    Args:
        tell: writes to the log; arguments: whether it is an error, and the text.
        stop: brings to rest whatever the node moves; argument: the reason.
        changed: called when ``/diagnostics`` may have changed.
        clock: steady time [s].

    Attributes:
        internal: the last exception that a callback raised, in one line; empty if there was none.
        exceptions: their number, by callback.
        refused: number of messages that were not used, by topic and reason.
    """

    def __init__(
        self,
        tell: Callable[[bool, str], None],
        stop: Callable[[str], None],
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self.internal = ""
        self.exceptions: Counter[str] = Counter()
        self.refused: Counter[str] = Counter()
        self.changed: Callable[[], None] = lambda: None
        self._tell, self._stop, self._clock = tell, stop, clock
        self._told: dict[str, float] = {}
        self._answering = False

    def caught(self, where: str, error: Exception) -> None:
        """Handle an exception of a callback: log it, stop what moves, and continue."""
        self.exceptions[where] += 1
        frames = traceback.extract_tb(error.__traceback__)
        place = f"{frames[-1].filename.rsplit('/', 1)[-1]}:{frames[-1].lineno}" if frames else "?"
        text = f"{type(error).__name__} in {place} ({where}): {' '.join(str(error).split())[:200]}"
        self.internal = self.internal or text
        if not self._answering:  # else the stop or the diagnostics raised themselves
            self._answer("the stop after an internal error", lambda: self._stop(f"internal error, {text}"))
        due = self._due(f"{where} {type(error).__name__} {place}")
        if due == "first":
            self._tell(True, f"internal error, {text}\n" + "".join(traceback.format_exception(error)))
        elif due:
            self._tell(True, f"internal error again, {self.exceptions[where]} times in {where}: {text}")
        if not self._answering:
            self._answer("diagnostics", self.changed)

    def _answer(self, where: str, answer: Callable[[], None]) -> None:
        was, self._answering = self._answering, True
        try:
            answer()
        except Exception as another:
            self.caught(where, another)
        finally:
            self._answering = was

    def refuse(self, topic: str, reason: str, detail: str = "") -> None:
        """Count a message that is not used. `reason`: a constant phrase; `detail`: data of this message."""
        key = f"{topic}, {reason}"
        self.refused[key] += 1
        if self._due(key):
            self._tell(False, f"{topic} refused: {reason}{': ' if detail else ''}{detail} ({self.refused[key]} so far)")

    def values(self) -> dict[str, object]:
        """For ``/diagnostics``."""
        told: dict[str, object] = {f"internal errors, {where}": n for where, n in sorted(self.exceptions.items())}
        return told | {f"messages refused, {key}": n for key, n in sorted(self.refused.items())}

    def _due(self, key: str) -> str:
        """Whether to log this now: "first", "again" or ""."""
        now, last = self._clock(), self._told.get(key)
        if last is not None and now - last < TOLD_EVERY_S:
            return ""
        if last is None and len(self._told) >= _MOST_KINDS:
            return ""
        self._told[key] = now
        return "first" if last is None else "again"
