"""Time in lockstep with a simulated ECU: one command frame advances the ECU by one cycle, however long that takes.

The frames of cycle k show the crane at t_k = k T, T = 10 ms, so the number of a frame's cycle is its time; frames that were lost
count too, by their counters. A cycle is complete once the last frame of every sensor has come; only then does the next command
go out. All checks of frames and commands are those of real time, on this clock.
"""

import math
import time
from collections.abc import Callable

from .codec import Codec
from .errors import CanConfigurationError
from .mapping import SENSOR_FIELDS
from .sender import PERIOD_S, Pace

ANSWER_PATIENCE_S = 0.2
"""Real time without a complete cycle after which the command is sent again: a frame was lost, in either direction."""
MOST_REPEATS = 5
"""After so many repeats a new command goes out: a restarted ECU does not know the old one."""
IDLE_S = 1.0


class BusLockstep(Pace):
    """Counts the cycles of the ECU, and releases the sender when one is complete.

    Args:
        codec: of the machine
        idle: whether zero current advances the ECU every 10 ms (until the boom may move)

    Raises:
        CanConfigurationError: the frames of the sensors have no counter, or do not come every 10 ms
    """

    def __init__(self, codec: Codec, idle: Callable[[], bool] = lambda: False) -> None:
        super().__init__()
        self._idle = idle
        self._seen: dict[str, int] = {}
        for spec in codec.incoming:
            if not set(spec.fields) & set(SENSOR_FIELDS):
                continue
            if spec.counter is None or round(spec.period_s / PERIOD_S) != 1:
                raise CanConfigurationError(
                    f"lockstep counts the cycles by the frames of the sensors: {spec.name} needs a counter and a period of "
                    f"{1e3 * PERIOD_S:.0f} ms"
                )
            self._seen[spec.name] = -1
        self._newest = -1
        self._asked = -1
        self._repeats = 0

    @property
    def complete(self) -> bool:
        """Whether all sensor frames of the newest cycle have come."""
        return min(self._seen.values()) == self._newest

    def is_sensor(self, name: str) -> bool:
        """Whether this frame is needed for a complete cycle."""
        return name in self._seen

    def frame_time(self, name: str, lost: int) -> float:
        """Note a good frame, before which ``lost`` of its name were lost; returns its time [s]."""
        if name in self._seen:
            self._seen[name] += 1 + lost
            self._newest = max(self._newest, self._seen[name])
        return self._newest * PERIOD_S

    def restart(self) -> None:
        """Start counting again: losses in between are unknown."""
        self._seen = dict.fromkeys(self._seen, self._newest)

    # ---------------------------------------------------------------------------------------------- pace of the sender

    def clock(self) -> float:
        """Time from which the next command acts [s]."""
        return (self._newest + 1) * PERIOD_S

    def sent(self, _commanded: bool) -> None:
        """Note a sent command frame, which the next cycle answers."""
        self._asked = self._newest + 1
        self._repeats = 0

    def repeats(self) -> bool:
        """See `Pace.repeats`: an ECU that has answered repeats its answer and does not advance."""
        if self._asked < 0 or (self._newest >= self._asked and self.complete):
            return False
        self._repeats += 1
        return self._repeats <= MOST_REPEATS

    def until(self, last: float, waiting: float | None) -> float:
        """See `Pace.until`."""
        if self._newest < self._asked or not self.complete:
            return last + ANSWER_PATIENCE_S
        if waiting is not None:
            return -math.inf
        return last + PERIOD_S if self._idle() else time.monotonic() + IDLE_S
