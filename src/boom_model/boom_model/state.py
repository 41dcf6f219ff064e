"""What a state of the equations is."""

from __future__ import annotations

from dataclasses import dataclass
from math import inf


@dataclass(frozen=True)
class State:
    """One state: name, symbol, unit, size of its usual range (scales the error control), limits of meaning.

    What an effect says of its own states besides:

    Attributes:
        equation: of the thesis, in which it stands.
        standstill_noise: white disturbance that an observer assumes while the boom stands still [unit/sqrt(s)].
        like: another state, whose limits it has.
        corrected: an observer whose gains were computed without the state needs gains of its own for it.
    """

    name: str
    symbol: str
    unit: str
    scale: float
    minimum: float = -inf
    maximum: float = inf
    equation: str = "-"
    standstill_noise: float = 0.0
    corrected: bool = False
    like: str = ""

    @property
    def is_spool(self) -> bool:
        """Whether it is the main valve's spool, or another one with its limits."""
        return "spool_position" in (self.name, self.like)


ELAPSED_TIME = State("elapsed_time", "t", "s", 10.0)
"""Time since the start of the run: there only where an effect needs it."""
