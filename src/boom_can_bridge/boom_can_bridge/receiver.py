"""The receive thread: receives frames, checks them, passes on valid ones, counts the others.

`FrameChecker` holds the checks, without thread and bus. `Receiver` is the thread, which opens the bus, reopens it after a failure,
and ends only on request.
"""

import contextlib
import math
import threading
import time
from collections import Counter, deque
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from boom_can_bridge.python_can import can

from .clock_map import ClockMap
from .codec import Codec, CounterCheck, Decoded
from .connection import BackOff, BusSettings, BusUnavailableError, close_bus, open_bus
from .errors import CanConfigurationError, FrameError
from .lockstep import BusLockstep
from .plausibility import RateCheck

RECEIVE_TIMEOUT_S = 0.05
CROWD_WINDOW_S = 1.0
CROWD_SHARE, CROWD_REFUSED = 1.6, 0.2
"""Shares of the frames due and of those received: more frames and more refused counters mean two senders of one frame."""
STANDSTILL_S = 0.2
"""Time away from the bus after which waiting frames are old."""
BUS_OFF, OVERRUN = 0x40, 0x04


@dataclass(frozen=True)
class Reading:
    """A frame that passed all checks.

    frame      name
    values     SI values by field
    steady     when it was on the bus, on the steady clock [s]
    received   when it was received [s]
    """

    frame: str
    values: dict[str, float]
    steady: float
    received: float


@dataclass
class Counts:
    """Counts of bus events so far.

    good      frames by name
    bad       frames by reason (also: error, bus_off, overrun, remote)
    lost      frames by name, from the counters
    unknown   ids that the mapping does not name, the first `UNKNOWN_IDS` of them
    """

    UNKNOWN_IDS = 32

    good: Counter[str] = field(default_factory=Counter)
    bad: Counter[str] = field(default_factory=Counter)
    lost: Counter[str] = field(default_factory=Counter)
    unknown: Counter[int] = field(default_factory=Counter)
    connects: int = 0
    discarded: int = 0
    last_bad: str = ""


class Crowd:
    """Detects two senders of one frame: twice as many frames come as are due, and their counters contradict each other."""

    def __init__(self, codec: Codec) -> None:
        self._outgoing = codec.command.name
        self._due = {frame.name: CROWD_WINDOW_S / frame.period_s for frame in codec.incoming}
        self._frames: dict[str, deque[list[Any]]] = {name: deque() for name in self._due}
        self._commanded = -math.inf

    def seen(self, name: str, now: float) -> None:
        """Note a frame with a valid checksum at `now` [s]."""
        if name == self._outgoing:
            self._commanded = now
            return
        frames = self._frames[name]
        frames.append([now, True])
        while frames[0][0] < now - CROWD_WINDOW_S:
            frames.popleft()

    def contradicted(self, name: str) -> None:
        """Note that the counter of the last frame does not continue the previous one."""
        self._frames[name][-1][1] = False

    def conflict(self, now: float) -> str:
        """The conflict at `now` [s], in one line, or ""."""
        if now - self._commanded < CROWD_WINDOW_S:
            return "another node sends commands on the bus: end all bridges but one"
        for name, frames in list(self._frames.items()):
            if len(frames) <= CROWD_SHARE * self._due[name]:
                continue
            kept = [good for at, good in list(frames) if at >= now - CROWD_WINDOW_S]
            if len(kept) > CROWD_SHARE * self._due[name] and kept.count(False) > CROWD_REFUSED * len(kept):
                return f"two nodes send {name} on the bus, by its counters: disconnect all ECUs but one"
        return ""


class FrameChecker:
    """All checks of one frame, in the order: error frame, id, length, checksum, counter, values.

    Args:
        codec: of the machine
        proof: number of frames of each kind that must pass after a (re)connection before any is passed on
        lockstep: derives the time from the frames of a simulated ECU
    """

    def __init__(self, codec: Codec, proof: int = 5, lockstep: BusLockstep | None = None) -> None:
        self.codec = codec
        self.counts = Counts()
        self.clock = ClockMap()
        self._lockstep = lockstep
        self._proof = proof
        self._counters = CounterCheck(codec)
        self._rates = RateCheck(codec)
        self.crowd = Crowd(codec)
        self._outgoing = codec.command.name
        self._needed = {spec.name for spec in codec.incoming if not set(spec.fields) <= {"mode", "faults", "uptime_s"}}
        self._proven: Counter[str] = Counter()
        self.proving = True

    def restart(self) -> None:
        """Start again after the bus was reopened: pass on nothing until enough good frames have come."""
        self._counters.forget()
        self._rates.forget()
        self.clock.reset()
        self._proven.clear()
        self.proving = True
        if self._lockstep is not None:
            self._lockstep.restart()

    def check(self, message: can.Message, received: float) -> Reading | None:
        """The reading of a frame, or None if there is none to pass on. Never raises, whatever the frame holds.

        Args:
            message: as received by python-can
            received: steady time [s]
        """
        try:
            return self._check(message, received)
        except FrameError as error:
            self.counts.bad[error.reason] += 1
            if error.reason != "unknown_id":
                self.counts.last_bad = str(error)
        except Exception as error:  # a driver may hand over anything
            self.counts.bad["decode"] += 1
            self.counts.last_bad = f"{type(error).__name__}: {error}"
        return None

    def _check(self, message: can.Message, received: float) -> Reading | None:
        if message.is_error_frame:
            self._count_error(message)
            return None
        if message.is_remote_frame:
            self.counts.bad["remote"] += 1
            return None
        if message.is_fd:  # of another node: the machine's frames are classic ones
            self.counts.bad["fd"] += 1
            return None
        if not self.codec.knows(message.arbitration_id, bool(message.is_extended_id)):
            self._count_unknown(message.arbitration_id)
            return None
        decoded = self.codec.decode(message.arbitration_id, bytes(message.data), extended=bool(message.is_extended_id))
        name = decoded.frame
        if name == self._outgoing:  # another sender of commands, or our own echo: nothing to publish
            self.counts.good[name] += 1
            self.crowd.seen(name, received)
            return None
        try:
            steady = self._accept(decoded, float(message.timestamp), received)
        except FrameError as error:
            if error.reason == "counter":
                self.crowd.contradicted(name)
            if self.proving:
                self._proven.clear()
            raise
        self.counts.good[name] += 1
        if self.proving:
            self._prove(name)
            return None
        return Reading(name, decoded.values, steady, received)

    def _count_error(self, message: can.Message) -> None:
        kind = message.arbitration_id
        overrun = kind & OVERRUN and len(message.data) > 1 and message.data[1] & 1
        self.counts.bad["bus_off" if kind & BUS_OFF else "overrun" if overrun else "error"] += 1
        if kind & BUS_OFF:
            self.restart()

    def _count_unknown(self, arbitration_id: int) -> None:
        self.counts.bad["unknown_id"] += 1
        if len(self.counts.unknown) < Counts.UNKNOWN_IDS or arbitration_id in self.counts.unknown:
            self.counts.unknown[arbitration_id] += 1

    def _accept(self, decoded: Decoded, stamp: float, received: float) -> float:
        """Counter and values go on from the frame before. Returns when it was on the bus [s]; raises FrameError."""
        name = decoded.frame
        self.crowd.seen(name, received)
        lost = self._counters.accept(name, decoded.counter, received)
        self.counts.lost[name] += lost
        told = self._lockstep
        steady = told.frame_time(name, lost) if told is not None else self.clock.to_steady(stamp, received)
        self._rates.accept(name, decoded.values, steady)
        return steady

    def _prove(self, name: str) -> None:
        """One more good frame after a connection; enough of each that is needed, and they are believed."""
        self._proven[name] += 1
        if all(self._proven[needed] >= self._proof for needed in self._needed):
            self.proving = False


class Receiver:
    """Owns the bus and the thread that receives.

    Args:
        settings: of the bus
        checker: checks every frame
        on_reading: called in the thread with every reading; its exceptions are counted, not passed on
        on_state: called in the thread when the connection changes, with a line and whether it is up
        on_raw: called with every frame as it came (for a log)
        bus_factory: opens the bus; for tests
        clock: steady time [s]
    """

    def __init__(
        self,
        settings: BusSettings,
        checker: FrameChecker,
        on_reading: Callable[[Reading], None],
        on_state: Callable[[bool, str], None] = lambda up, text: None,
        on_raw: Callable[[can.Message], None] | None = None,
        bus_factory: Callable[[BusSettings], Any] = open_bus,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self.settings = settings
        self.checker = checker
        self._clock = clock
        self.trouble = ""
        self.failures: Counter[str] = Counter()
        self.latencies: deque[float] = deque(maxlen=1000)
        self._on_reading = on_reading
        self._on_state = on_state
        self._on_raw = on_raw
        self._factory = bus_factory
        self._bus: Any = None
        self._stop = threading.Event()
        self._thread: threading.Thread | None = None
        self._back_off = BackOff()

    @property
    def bus(self) -> Any:
        """The open bus, or None."""
        return self._bus

    def open(self) -> None:
        """Open the bus before the thread starts, so that the caller learns of errors.

        Raises:
            CanConfigurationError, BusUnavailableError: as `open_bus`
        """
        self._bus = self._factory(self.settings)

    def start(self) -> None:
        """Start the thread, which opens the bus if it is not open yet."""
        self._stop.clear()
        self._thread = threading.Thread(target=self._run, name="can-receive", daemon=True)
        self._thread.start()

    def stop(self) -> None:
        """End the thread and close the bus."""
        self._stop.set()
        if self._thread is not None:
            self._thread.join(5.0)
            self._thread = None
        self._close()

    def fail(self, bus: Any, error: BaseException) -> None:
        """Let the receive thread reopen the bus, which a sender found broken."""
        if bus is self._bus and not self.trouble:
            self.trouble = _plain(error)

    def _close(self) -> None:
        bus, self._bus = self._bus, None
        if bus is not None:
            close_bus(bus)

    def _run(self) -> None:
        if self._bus is not None:
            self._begin()
        while not self._stop.is_set():
            try:
                if self._bus is None and not self._reopen():
                    continue
                self._receive()
            except Exception as error:  # nothing may end this thread but `stop`
                self.failures[type(error).__name__] += 1
                self.trouble = _plain(error)
            if self.trouble and not self._stop.is_set():
                self._lose()

    def _lose(self) -> None:
        text, self.trouble = self.trouble, ""
        self._close()
        self.checker.restart()
        self._tell(False, f"{self.settings} is lost: {text}")
        self._stop.wait(self._back_off.wait())

    def _reopen(self) -> bool:
        try:
            self._bus = self._factory(self.settings)
        except (BusUnavailableError, CanConfigurationError) as error:
            self.failures["open"] += 1
            self._tell(False, str(error))
            self._stop.wait(self._back_off.wait())
            return False
        self._begin()
        return True

    def _begin(self) -> None:
        self.checker.restart()
        self.checker.counts.connects += 1
        self.trouble = ""
        self._drain()
        self._tell(True, f"{self.settings} is open")

    def _tell(self, up: bool, text: str) -> None:
        with contextlib.suppress(Exception):
            self._on_state(up, text)

    def _drain(self) -> None:
        # What waited is old. Bounded: a bus under full load never runs dry.
        end = time.monotonic() + RECEIVE_TIMEOUT_S
        while time.monotonic() < end and self._bus.recv(0) is not None:
            self.checker.counts.discarded += 1

    def _receive(self) -> None:
        garbled = 0
        before = self._clock()
        while not self._stop.is_set() and not self.trouble:
            try:
                message = self._bus.recv(RECEIVE_TIMEOUT_S)
            except (ValueError, TypeError):
                # Corrupted bytes of a serial adapter. Again and again means that more is broken.
                self.checker.counts.bad["decode"] += 1
                garbled += 1
                if garbled >= 20:
                    raise
                continue
            now = self._clock()
            if now - before > STANDSTILL_S:
                # This process stood still: the frame is the oldest of many that waited.
                self._drain()
                self.checker.restart()
                before = self._clock()
                continue
            before = now
            if message is not None:
                garbled = 0
                self._handle(message, now)

    def _handle(self, message: can.Message, now: float) -> None:
        if self._on_raw is not None:
            with contextlib.suppress(Exception):
                self._on_raw(message)
        reading = self.checker.check(message, now)
        if message.is_error_frame and message.arbitration_id & BUS_OFF:
            self.trouble = "the controller went bus-off"
        if reading is None:
            return
        self._back_off.reset()  # only now: an adapter that opens and fails at once is not well again
        try:
            self._on_reading(reading)
        except Exception as error:
            self.failures[f"publishing: {type(error).__name__}"] += 1
            return
        self.latencies.append(self._clock() - reading.steady)


def _plain(error: BaseException) -> str:
    return " ".join(str(error).split()) or type(error).__name__
