"""Detects that an input has fallen silent. No ROS; times are those of a steady clock."""

from __future__ import annotations

from dataclasses import dataclass, field


@dataclass
class InputWatch:
    """Warns at intervals that an input is missing.

    Attributes:
        message: warning for the user; ``{age}`` is replaced by the seconds without input.
        timeout: longest allowed silence [s].
        repeat: time between two warnings [s].
        once: True for a latched input, which never counts as missing once it has come.
    """

    message: str
    started: float
    timeout: float = 2.0
    repeat: float = 10.0
    once: bool = False
    _last_seen: float | None = field(default=None, init=False)
    _last_warning: float | None = field(default=None, init=False)

    def seen(self, now: float) -> None:
        """Note that the input came at the time `now` [s]."""
        self._last_seen = now
        self._last_warning = None

    def missing(self, now: float) -> bool:
        """True if the input has been silent for longer than allowed."""
        if self.once and self._last_seen is not None:
            return False
        return now - (self.started if self._last_seen is None else self._last_seen) > self.timeout

    def text(self, now: float) -> str:
        """The warning, with the age filled in."""
        return self.message.format(age=f"{now - (self.started if self._last_seen is None else self._last_seen):.1f}")

    def warning(self, now: float) -> str | None:
        """The warning that is due at the time `now` [s], or None."""
        if not self.missing(now) or (self._last_warning is not None and now - self._last_warning < self.repeat):
            return None
        self._last_warning = now
        return self.text(now)
