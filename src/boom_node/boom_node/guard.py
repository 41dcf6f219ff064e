"""What must not end a node: an exception in a callback, a message that cannot be used. Counted, told, answered. No ROS.

An exception in a callback is a mistake in this program, whatever message brought it about: the node that moves something brings it
to rest, the traceback is told once, and ``/diagnostics`` says ERROR until the node is started anew. A message that is refused is a
mistake of its sender: it is counted by topic and reason, and told now and then.
"""

from __future__ import annotations

import time
import traceback
from collections import Counter
from collections.abc import Callable

TOLD_EVERY_S = 10.0
"""s between two lines about the same, however often it happens."""
_MOST_KINDS = 100


class Guard:
    """Takes what went wrong in one node.

    Args:
        tell: writes to the log: whether it is an error, and the text.
        stop: brings to rest what the node moves; told the reason.
        changed: called where ``/diagnostics`` may have something new to say.
        clock: steady time [s].

    Attributes:
        internal: the last exception that a callback raised, in one line; empty while there was none.
        exceptions: how many there were, by callback.
        refused: messages that were not used, by topic and reason.
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
        """A callback raised: tell it, stop what moves, and go on."""
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
        """A message is not used. `reason`: a few words that stay the same; `detail`: what this one is like."""
        key = f"{topic}, {reason}"
        self.refused[key] += 1
        if self._due(key):
            self._tell(False, f"{topic} refused: {reason}{': ' if detail else ''}{detail} ({self.refused[key]} so far)")

    def values(self) -> dict[str, object]:
        """For ``/diagnostics``."""
        told: dict[str, object] = {f"internal errors, {where}": n for where, n in sorted(self.exceptions.items())}
        return told | {f"messages refused, {key}": n for key, n in sorted(self.refused.items())}

    def _due(self, key: str) -> str:
        """Whether to tell this now: "first", "again" or not at all."""
        now, last = self._clock(), self._told.get(key)
        if last is not None and now - last < TOLD_EVERY_S:
            return ""
        if last is None and len(self._told) >= _MOST_KINDS:
            return ""
        self._told[key] = now
        return "first" if last is None else "again"
