"""What the status frames of an ECU tell: that it is alive, has restarted, or left the mode in which it drove. No ROS, no bus."""

from __future__ import annotations

from collections.abc import Mapping
from math import inf

from .codec import Codec

MISSED, SHORTEST_S = 5, 0.5
"""Status frames in a row that may be missing, and the time [s] for which they may at least."""
TWICE = 2
"""Status frames in a row of another mode that count."""


class EcuState:
    """Follows uptime, and the mode while current is commanded. Which mode is which is the ECU's matter; that it changes is not.

    Args:
        codec: of the machine. Without a status frame nothing is told.
    """

    def __init__(self, codec: Codec) -> None:
        status = [spec for spec in codec.incoming if "mode" in spec.fields or "uptime_s" in spec.fields]
        self._names = ", ".join(spec.name for spec in status)
        self._longest = max((MISSED * spec.period_s for spec in status), default=inf)
        self._longest = max(self._longest, SHORTEST_S)
        self.reset(-inf)

    def reset(self, now: float) -> None:
        """Start again: the bus was opened or lost at ``now`` [s]."""
        self._seen, self._uptime = now, -inf
        self.released()

    def released(self) -> None:
        """No current is commanded: the mode may be any."""
        self._before: float | None = None
        self._driving: float | None = None
        self._left = 0

    def seen(self, values: Mapping[str, float], now: float) -> str:
        """Take a status frame that came at ``now`` [s]; why motion has to be disabled, or empty."""
        self._seen = now
        uptime, mode = values.get("uptime_s", inf), values.get("mode")
        restarted, self._uptime = uptime < self._uptime, uptime
        if restarted:
            return f"the ECU has restarted: its uptime went back to {uptime:.1f} s"
        if mode is None:
            return ""
        if self._driving is None:
            self._driving = mode if mode == self._before else None  # twice: it has followed the command
            self._before = mode
        self._left = self._left + 1 if self._driving not in (None, mode) else 0
        if self._left < TWICE:  # once it may have missed a command
            return ""
        was = self._driving
        self.released()
        return f"the ECU went from mode {was:g} to {mode:g} by itself"

    def silent(self, now: float) -> str:
        """Whether the status frames have stayed away, in a sentence; empty: they have not."""
        if now - self._seen <= self._longest:
            return ""
        return f"no good {self._names} for {self._longest:g} s: faults of the ECU would not be seen"
