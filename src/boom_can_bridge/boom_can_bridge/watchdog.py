"""Which signals have come lately. Pure: times are those of a steady clock, handed in."""

from collections.abc import Iterable


class Watchdog:
    """Time of the last good value of each signal.

    Args:
        names: of the signals
        timeout: silence that is allowed [s]
    """

    def __init__(self, names: Iterable[str], timeout: float = 0.05) -> None:
        self.timeout = timeout
        self._seen: dict[str, float | None] = dict.fromkeys(names)

    def seen(self, names: Iterable[str], now: float) -> None:
        """Good values of these signals came at `now` [s]."""
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
        """Nothing has been seen."""
        self._seen = dict.fromkeys(self._seen)
