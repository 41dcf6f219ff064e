"""A sensor that repeats its value: stuck, or as quiet as it always is at rest? Its own noise at rest tells."""

from __future__ import annotations

from collections import deque

import numpy as np

WINDOW, ENOUGH = 200, 50
"""Changes at rest that are remembered, and those from which on a sensor's noise is known."""
TURNING, FURTHER = 0.3, 0.2
"""Share of changes that turn back, of noise, and of those that do so by more than one step: noise that is finer than the steps of a
sensor does not show at rest, and such a sensor may repeat its value for as long as nothing moves."""
LONGER = 5.0
"""Times the longest run of equal values at rest."""
SHORTEST = 0.1
"""s. No shorter run is told."""
CARRIED, STEPS = 0.02, 5.0
"""rad, and times the largest change between two samples: so far another sensor has carried it on while it repeated its value."""


class Repeats:
    """Whether a channel repeats its value for longer than its noise ever let it at rest; in motion it changes more, not less.

    A sensor that is quiet at rest is never told: an encoder, a rate computed from it, a pressure of coarse steps. Neither is a
    value of exactly 0, at which transducers end and computed rates stay.

    Where another sensor says how far it went meanwhile, as a gyro does of the angle, a quiet one is told, too.

    Args:
        least: what counts as no change at all, in the channel's unit.
    """

    def __init__(self, least: float) -> None:
        self._least = least
        self._changes: deque[tuple[float, float]] = deque(maxlen=WINDOW)
        self._value, self._since, self._last, self._rested = np.nan, np.nan, np.nan, False
        self._carried = self._largest = 0.0

    def take(self, value: float, time: float, at_rest: bool, carried: float = 0.0) -> None:
        """A sample and its time [s], the valve closed (``at_rest``) or not; ``carried``: how far it went since, by another one."""
        change = value - self._value
        if abs(change) <= self._least:
            self._last, self._rested = time, self._rested and at_rest
            self._carried = self._carried if self._left else 0.0 if at_rest else self._carried + carried
            return
        self._carried, self._largest = 0.0, max(self._largest, abs(np.nan_to_num(change)))
        if self._rested and at_rest:
            self._changes.append((time - self._since, change))
        self._value, self._since, self._last, self._rested = value, time, time, at_rest

    @property
    def _left(self) -> bool:
        """Whether it was carried on and did not follow; it is so until it changes."""
        return abs(self._carried) > max(CARRIED, STEPS * self._largest)

    @property
    def stuck(self) -> tuple[float, float] | None:
        """For how long it has repeated its value, and how long it may [s]; None where there is nothing to tell."""
        repeated = self._last - self._since
        if repeated > SHORTEST and self._left:
            return repeated, SHORTEST
        if not repeated > SHORTEST or self._value == 0.0 or len(self._changes) < ENOUGH:
            return None
        runs, changes = np.array(self._changes).T
        turns = np.sign(changes[1:]) != np.sign(changes[:-1])
        far = turns & (np.abs(changes[1:]) > 1.5 * np.abs(changes).min())
        allowed = max(LONGER * float(runs.max()), SHORTEST)
        noisy = turns.mean() > TURNING and far.mean() > FURTHER
        return (repeated, allowed) if noisy and repeated > allowed else None
