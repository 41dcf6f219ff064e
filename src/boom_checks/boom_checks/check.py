"""A doubt about a recording: what is wrong with it, where, and how much."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

CheckKind = Literal[
    "sign", "latched_command", "clock", "units", "repeated", "swapped_channels", "jump", "chatter", "derived_rate"
]

SPOILING: frozenset[CheckKind] = frozenset({"sign", "latched_command", "clock", "units", "swapped_channels", "jump"})
"""Kinds after which no physics may be named: the model would be fitted to a fault of the recording."""


@dataclass(frozen=True)
class IntervalValue:
    """A number with its interval: value, interval of 90 % [unit]."""

    name: str
    value: float
    unit: str
    interval_90: tuple[float, float]

    @property
    def text(self) -> str:
        """For people, pressures in bar: "piston speed 0.39 m/s/A, 0.38 to 0.40"."""
        scale, unit = (1e-5, "bar") if self.unit == "Pa" else (1.0, "" if self.unit == "-" else self.unit)
        value, low, high = (f"{scale * v:.3g}" for v in (self.value, *self.interval_90))
        return f"{self.name} {' '.join((value, unit)).strip()}, {low} to {high}"

    def document(self) -> dict[str, Any]:
        """As JSON."""
        return {"name": self.name, "value": self.value, "unit": self.unit, "interval_90": list(self.interval_90)}


@dataclass(frozen=True)
class RecordingCheck:
    """One doubt.

    Attributes:
        kind: as in the contract's ``checks``; ``chatter`` and ``derived_rate`` are remarks.
        topic: that is wrong, or several joined by a comma.
        intervals_s: (start, end) [s] of where it shows.
        sentence: for an engineer.
        measure: the number behind it.
        log_odds: natural logarithm of the odds that it is so, prior included.
    """

    kind: CheckKind
    topic: str
    intervals_s: tuple[tuple[float, float], ...]
    sentence: str
    measure: IntervalValue
    log_odds: float

    @property
    def spoils(self) -> bool:
        """Whether it has to be repaired before any physics is named."""
        return self.kind in SPOILING

    def document(self) -> dict[str, Any]:
        """As in ``checks`` of diagnosis.json."""
        return {
            "kind": self.kind, "topic": self.topic, "intervals_s": [list(pair) for pair in self.intervals_s],
            "sentence": self.sentence, "measure": self.measure.document(), "log_odds": self.log_odds, "spoils": self.spoils,
        }  # fmt: skip
