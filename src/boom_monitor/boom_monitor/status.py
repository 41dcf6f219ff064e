"""What a watch is told and what it says: its settings, its alarm, its status. No ROS."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass


@dataclass(frozen=True)
class WatchSettings:
    """Settings of the watch.

    Attributes:
        threshold: score above which the machine has left the tolerance.
        memory: time constant of the score [s].
        hold: how long the score must be below the threshold for the alarm to end [s].
        delay: how long the watch waits for late samples [s].
    """

    threshold: float = 1.35
    memory: float = 2.0
    hold: float = 10.0
    delay: float = 0.1


@dataclass(frozen=True)
class Alarm:
    """The machine has left the model's tolerance.

    Attributes:
        begin: [s]. subsystem: the located one. effect: the one that explains most.
        share: subsystem -> its share of what the suspects explain, the largest first.
        size: estimated size of the effect, of its ``parameter`` in ``unit``; rough, for orientation only.
    """

    begin: float
    subsystem: str
    effect: str
    share: Mapping[str, float]
    size: float
    unit: str
    parameter: str


@dataclass(frozen=True)
class Status:
    """Present status: whether the watch is active (``watching``), time [s], score, and the alarm, if any.

    absent: channels that the machine does not have. stuck: channels that repeat their value, which nothing is judged by.
    blind: share of the last minute in which the currents had gaps.
    """

    watching: bool
    time: float
    score: float
    alarm: Alarm | None
    alarms: int
    waits_for: str = ""
    absent: tuple[str, ...] = ()
    stuck: tuple[str, ...] = ()
    blind: float = 0.0
