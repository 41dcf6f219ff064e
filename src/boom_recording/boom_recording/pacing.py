"""Delivers samples at the pace of the recording, faster or slower, with pause and stop. No ROS."""

import math
import threading
import time
from collections.abc import Callable, Iterable

from boom_recording.replay import PERIOD_NS, ReplaySample


class StoodStillError(Exception):
    """Nothing was sent for so long that its readers have closed the valve: it may not open in the middle of the motion."""


class ReplayPacer:
    """Calls `send` for each sample when it is due.

    rate       replayed seconds per second
    send       called with the sample and the replayed time [ns] it is due at
    tick       called every 10 ms of replayed time, and at each sample, with the replayed time [ns]; None = no clock
    start_ns   replayed time of stamp zero [ns]
    silence    longest time between two samples, without pauses [s]

    `run` blocks and belongs into a thread of its own; the other methods may be called from any thread.
    """

    def __init__(
        self,
        rate: float,
        send: Callable[[ReplaySample, int], None],
        tick: Callable[[int], None] | None = None,
        start_ns: int = 0,
        silence: float = math.inf,
    ) -> None:
        self._rate = rate
        self._send = send
        self._tick = tick
        self._start_ns = start_ns
        self._silence = silence
        self._sent_at = math.inf  # monotonic time [s] of the last sample; infinite: none since the beginning or a pause
        self._changed = threading.Condition()
        self._stopped = False
        self._paused = False
        self._position_ns = 0  # replayed time at `_since`
        self._since: float | None = None  # monotonic time [s] from which replayed time runs; None = not running
        self._clock_ns = start_ns
        self._ticked = False

    @property
    def paused(self) -> bool:
        """True between `pause` and `resume`."""
        return self._paused

    @property
    def clock_ns(self) -> int:
        """Replayed time [ns] of what was sent last."""
        return self._clock_ns

    def pause(self) -> None:
        """Stop replayed time."""
        with self._changed:
            if not self._paused:
                self._position_ns = self._now_ns()
                self._since = None
                self._paused = True
                self._sent_at = math.inf
                self._changed.notify_all()

    def resume(self) -> None:
        """Resume replayed time."""
        with self._changed:
            if self._paused:
                self._paused = False
                self._changed.notify_all()

    def stop(self) -> None:
        """Make `run` return."""
        with self._changed:
            self._stopped = True
            self._changed.notify_all()

    def run(self, samples: Iterable[ReplaySample]) -> bool:
        """Send `samples` (by time). True if the last was sent, False if `stop` came first.

        Raises:
            StoodStillError: this process was suspended, or had no processor, for longer than `silence`.
        """
        next_tick = 0
        for sample in samples:
            while self._tick is not None and next_tick <= sample.stamp_ns:
                if not self._wait_until(next_tick):
                    return False
                self._advance(next_tick)
                next_tick += PERIOD_NS
            with self._changed:  # a pause comes before this sample or after it
                if not self._wait_until(sample.stamp_ns):
                    return False
                self._advance(sample.stamp_ns)
                now = time.monotonic()
                self._refuse_a_standstill(now)
                self._sent_at = now
                self._send(sample, self._clock_ns)
        return True

    def _refuse_a_standstill(self, now: float) -> None:
        """Asked after each wait and once more at the send itself: a process is suspended between any two lines."""
        if (silent := now - self._sent_at) > self._silence:
            raise StoodStillError(
                f"the replay itself stood still for {1e3 * silent:.0f} ms, and a valve is closed after "
                f"{1e3 * self._silence:.0f} ms: it does not go on in the middle of a motion. Start it again"
            )

    def _advance(self, position_ns: int) -> None:
        clock = self._start_ns + position_ns
        if self._tick is not None and (clock > self._clock_ns or not self._ticked):
            self._ticked = True
            self._tick(clock)
        self._clock_ns = clock

    def _now_ns(self) -> int:
        if self._since is None:
            return self._position_ns
        return self._position_ns + round((time.monotonic() - self._since) * self._rate * 1e9)

    def _wait_until(self, position_ns: int) -> bool:
        with self._changed:
            while not self._stopped:
                if self._paused:
                    self._changed.wait()
                    continue
                if self._since is None:
                    self._since = time.monotonic()
                left = (position_ns - self._now_ns()) / (self._rate * 1e9)
                self._refuse_a_standstill(time.monotonic())
                if left <= 0:
                    return True
                self._changed.wait(left)
            return False
