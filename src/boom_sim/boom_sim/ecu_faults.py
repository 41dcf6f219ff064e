"""Injects faults into frames between ECU and bus: lost, corrupted, late, out of order. Seeded, without a clock.

Times are seconds of any steady clock; a frame enters with ``put`` and leaves with ``due`` when its time has come. At the
neutral settings every frame leaves unchanged in the call that follows. The same seed and the same frames at the same
times give the same faults.
"""

from __future__ import annotations

import heapq
import itertools
from dataclasses import dataclass, replace

import numpy as np

from boom_node.parameters import ParameterSpec

LONGEST_DELAY = 10.0


@dataclass(frozen=True)
class Frame:
    """One CAN data frame on the wire."""

    arbitration_id: int
    extended: bool
    data: bytes


@dataclass(frozen=True)
class FaultSettings:
    """The faults to inject; every default is neutral.

    Attributes:
        loss: probability that a frame is lost.
        burst: probability that a frame begins a burst, and all frames within ``burst_duration`` [s] are lost.
        bit_flip: probability that one random bit of a frame's data arrives inverted.
        delay: every frame is this late [s].
        jitter: additional delay up to this, uniformly distributed [s]; the order is kept.
        reorder: probability that a frame is overtaken by the one behind it.
    """

    loss: float = 0.0
    burst: float = 0.0
    burst_duration: float = 0.05
    bit_flip: float = 0.0
    delay: float = 0.0
    jitter: float = 0.0
    reorder: float = 0.0


PARAMETERS = (
    ParameterSpec("fault_loss", 0.0, "probability that a frame is lost", minimum=0.0, maximum=1.0),
    ParameterSpec(
        "fault_burst", 0.0, "probability that a frame begins a burst of losses", minimum=0.0, maximum=1.0
    ),
    ParameterSpec("fault_burst_duration", 0.05, "how long a burst lasts", "s", 0.0, 10.0),
    ParameterSpec(
        "fault_bit_flip", 0.0, "probability that one bit of a frame's data is inverted", minimum=0.0, maximum=1.0
    ),
    ParameterSpec("fault_delay", 0.0, "every frame is this late", "s", 0.0, LONGEST_DELAY),
    ParameterSpec("fault_jitter", 0.0, "additional delay up to this, with the order kept", "s", 0.0, LONGEST_DELAY),
    ParameterSpec(
        "fault_reorder", 0.0, "probability that a frame is overtaken by the next", minimum=0.0, maximum=1.0
    ),
    ParameterSpec("fault_frozen_counter", False, "the counters of the frames stand still"),
    ParameterSpec(
        "fault_direction", "both", "which frames loss, bursts, flips, delay and order concern",
        choices=("both", "from_ecu", "to_ecu"),
    ),
    ParameterSpec(
        "fault_bus_off", 0.0, "on every change to above 0, the ECU neither sends nor receives for this time", "s", 0.0, 60.0
    ),
    ParameterSpec(
        "fault_restart", 0.0, "on every change to above 0, the ECU restarts and is silent for this time", "s", 0.0, 60.0
    ),
)  # fmt: skip
"""Parameters of the ECU stand-in; all but the seed can be changed while it runs."""


def from_values(values: dict[str, object]) -> FaultSettings:
    """The settings that parameters ``fault_NAME`` describe; other names are left out."""
    names = FaultSettings.__dataclass_fields__
    given = {name[6:]: float(str(v)) for name, v in values.items() if name[:6] == "fault_" and name[6:] in names}
    return replace(FaultSettings(), **given)


@dataclass
class FaultCounts:
    """Number of frames that passed, and of faults."""

    passed: int = 0
    lost: int = 0
    flipped: int = 0
    reordered: int = 0


class FaultyLine:
    """One direction of the connection between ECU and bus.

    Args:
        seed: seed of all random numbers.
        settings: may be replaced at any time; frames under way keep their times.
    """

    def __init__(self, seed: int = 0, settings: FaultSettings | None = None) -> None:
        self.settings = settings or FaultSettings()
        self.counts = FaultCounts()
        self._rng = np.random.default_rng(seed)
        self._order = itertools.count()
        self._under_way: list[tuple[float, int, Frame]] = []
        self._held: Frame | None = None
        self._latest = -np.inf
        self._burst_until = -np.inf

    def put(self, frame: Frame, now: float) -> None:
        """A frame enters at ``now`` [s]."""
        settings = self.settings
        # every frame draws the same numbers whatever is set: a fault that is switched on does not move the others
        loss, burst, flip, late, overtaken, bit = (float(v) for v in self._rng.random(6))
        if burst < settings.burst:
            self._burst_until = now + settings.burst_duration
        if loss < settings.loss or now < self._burst_until:
            self.counts.lost += 1
            return
        if flip < settings.bit_flip and frame.data:
            data = bytearray(frame.data)
            place = int(bit * 8 * len(data))
            data[place // 8] ^= 1 << place % 8
            frame = replace(frame, data=bytes(data))
            self.counts.flipped += 1
        leaves = max(now + settings.delay + late * settings.jitter, self._latest)
        if self._held is None and overtaken < settings.reorder:
            self._held = frame
            self.counts.reordered += 1
            return
        self._latest = leaves
        self._push(leaves, frame)
        if self._held is not None:
            self._push(leaves, self._held)
            self._held = None

    def due(self, now: float) -> list[Frame]:
        """The frames that leave until ``now`` [s], in their order."""
        result = []
        while self._under_way and self._under_way[0][0] <= now:
            result.append(heapq.heappop(self._under_way)[2])
        self.counts.passed += len(result)
        return result

    def next_time(self) -> float:
        """When the next frame leaves [s]; infinity where none is under way."""
        return self._under_way[0][0] if self._under_way else np.inf

    def clear(self) -> None:
        """Drop all frames under way."""
        self.counts.lost += len(self._under_way) + (self._held is not None)
        self._under_way.clear()
        self._held = None

    def _push(self, time: float, frame: Frame) -> None:
        heapq.heappush(self._under_way, (time, next(self._order), frame))
