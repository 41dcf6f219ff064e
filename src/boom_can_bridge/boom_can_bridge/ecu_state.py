"""What the status frames of an ECU tell: that it is alive, has restarted, or left the mode in which it drove. No ROS, no bus."""

from __future__ import annotations

from collections.abc import Mapping
from math import inf

from .codec import Codec

MISSED, SHORTEST_S = 5, 0.5
"""Status frames in a row that may be missing, and the time [s] for which they may at least."""


class EcuState:
    """Follows mode and uptime while motion is enabled. Which mode is which is the ECU's matter; that it changes is not.

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
        """Motion is not enabled: the mode may be any."""
        self._before: float | None = None
        self._driving: float | None = None

    def seen(self, values: Mapping[str, float], now: float) -> str:
        """Take a status frame that came at ``now`` [s]; why motion has to be disabled, or empty."""
        self._seen = now
        uptime, mode = values.get("uptime_s", inf), values.get("mode")
        restarted, self._uptime = uptime < self._uptime, uptime
        if restarted:
            return f"the ECU has restarted: its uptime went back to {uptime:.1f} s"
        if self._driving is not None and mode != self._driving:
            was, self._driving = self._driving, None
            return f"the ECU went from mode {was:g} to {values.get('mode', inf):g} by itself"
        if mode is not None and mode == self._before:
            self._driving = mode  # twice: it has followed the enabling
        self._before = mode
        return ""

    def silent(self, now: float) -> str:
        """Whether the status frames have stayed away, in a sentence; empty: they have not."""
        if now - self._seen <= self._longest:
            return ""
        return f"no good {self._names} for {self._longest:g} s: faults of the ECU would not be seen"
