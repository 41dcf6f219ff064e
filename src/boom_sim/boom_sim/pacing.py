"""Time in the real-time simulation: number of due periods, and freshness of the last command. Uses steady clocks."""

from __future__ import annotations

import math

from boom_node.commands import LONGEST_SILENCE_S

LARGEST_BACKLOG = 50
"""Periods. A larger backlog, after half a second of standstill, is skipped."""


class SimulationPacer:
    """Counts periods against a steady clock [s].

    Attributes:
        skipped: periods that were never simulated because the process stood still.
    """

    def __init__(self, period: float) -> None:
        self._period = period
        self._done_until: float | None = None
        self.skipped = 0

    @property
    def started(self) -> bool:
        """Whether time runs: ``due`` or ``hold`` was called."""
        return self._done_until is not None

    def due(self, now: float) -> int:
        """Number of whole periods since the last call; at most ``LARGEST_BACKLOG``. ``now``: due time of a tick."""
        if self._done_until is None:
            self._done_until = now
            return 0
        # the times at which ticks were due lie on a grid of periods, but for rounding
        periods = int((now - self._done_until) / self._period + 0.5)
        self._done_until += periods * self._period
        if periods > LARGEST_BACKLOG:
            self.skipped += periods - LARGEST_BACKLOG
            periods = LARGEST_BACKLOG
        return periods

    def hold(self, now: float) -> None:
        """Let time pass that is not simulated (pause)."""
        self._done_until = now


class WatchedCommand:
    """Freshness of commands.

    Attributes:
        received: number of commands so far. late: number refused because of their stamp.
        closed: whether no fresh command acts.
    """

    def __init__(self) -> None:
        self._last: float | None = None
        self._looked, self._doubtful_until = math.inf, -math.inf
        self.received = 0
        self.late = 0
        self.closed = True

    def receive(self, now: float, age: float, stamped: bool) -> str:
        """Note a command arriving at steady time ``now`` [s], ``age`` [s] after its stamp. Returns why it is refused, or ""."""
        self.received += 1
        if stamped and age > LONGEST_SILENCE_S:
            self.late += 1
            return (
                f"its stamp is older than {LONGEST_SILENCE_S * 1e3:.0f} ms: synchronise the clocks, or send it at once"
            )
        if stamped and age < -LONGEST_SILENCE_S:
            self.late += 1
            return f"its stamp is {-age * 1e3:.0f} ms in the future: synchronise the clocks"
        if not stamped and now < self._doubtful_until:
            self.late += 1
            return "it may have waited while the simulation stood still: stamp it"
        self._last = now
        self.closed = False
        return ""

    def has_expired(self, now: float) -> bool:
        """True once, when the last command has become too old. To be asked in every tick.

        A long pause means that the process stood still: stamps alone tell what waited for it from what is new.
        """
        if now - self._looked > LONGEST_SILENCE_S:
            self._doubtful_until = now + LONGEST_SILENCE_S
        self._looked = now
        if self.closed or self._last is None or now - self._last <= LONGEST_SILENCE_S:
            return False
        self.closed = True
        return True
