"""Detects missing signals. Pure: times are those of a steady clock, given as arguments."""

from collections.abc import Iterable


class Watchdog:
    """Time of the last good value of each signal.

    Args:
        names: of the signals
        timeout: longest allowed silence [s]
    """

    def __init__(self, names: Iterable[str], timeout: float = 0.05) -> None:
        self.timeout = timeout
        self._seen: dict[str, float | None] = dict.fromkeys(names)

    def seen(self, names: Iterable[str], now: float) -> None:
        """Note good values of these signals at `now` [s]."""
        for name in names:
            if name in self._seen:
                self._seen[name] = now

    def silent(self, now: float) -> dict[str, float]:
        """Signals that are missing, and for how long [s] (infinity = never seen)."""
        found = {}
        for name, when in self._seen.items():
            age = float("inf") if when is None else now - when
            if age > self.timeout:
                found[name] = age
        return found

    def reset(self) -> None:
        """Forget all signals."""
        self._seen = dict.fromkeys(self._seen)
