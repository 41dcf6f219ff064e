"""The thread that sends commands: every period in any case, and at once when a new command arrives. Never queues."""

import threading
import time
from collections import Counter, deque
from collections.abc import Callable
from typing import Any

from boom_can_bridge.python_can import can

from .codec import Codec
from .command_gate import CommandGate, GatedCommand
from .connection import send_now
from .errors import FrameError

PERIOD_S = 0.01
SLACK_S = 0.002
"""How long after the expected command the timer fires on its own, to avoid two frames in a period."""
CLOSEST_S = 0.004
"""Shortest time between two frames, however fast commands come."""


class Pace:
    """When frames go out in real time: every period, and at once when a command arrives."""

    def __init__(self) -> None:
        self._slack = 0.0

    def clock(self) -> float:
        """Time for the gate's decisions [s]."""
        return time.monotonic()

    def sent(self, commanded: bool) -> None:
        """Note that a new frame goes out, for a command or by the timer."""
        # Commands at the same rate pull the frames along; the timer fills in where one is missing.
        self._slack = SLACK_S if commanded else 0.0

    def until(self, last: float, waiting: float | None) -> float:
        """When the next frame is due, on the steady clock [s].

        Args:
            last: when the last one went out [s]
            waiting: arrival of the command that has not gone out yet [s]; None = there is none
        """
        return last + (PERIOD_S + self._slack if waiting is None else CLOSEST_S)

    def repeats(self) -> bool:
        """Whether to repeat the last frame bit for bit instead of sending a new one."""
        return False


class CommandSender:
    """Sends the currents that the gate passes.

    Args:
        codec: of the machine
        gate: decides what to send; used under `lock`
        bus: returns the open bus or None
        on_broken: called with bus and error when sending fails permanently
        before: called under `lock` before every decision with the steady time [s]
        on_sent: called with every frame that went out (for a log)
        pace: when frames go out, and the clock of the gate
    """

    def __init__(
        self,
        codec: Codec,
        gate: CommandGate,
        bus: Callable[[], Any],
        on_broken: Callable[[Any, BaseException], None],
        before: Callable[[float], None] = lambda now: None,
        on_sent: Callable[[can.Message], None] | None = None,
        pace: Pace | None = None,
    ) -> None:
        self.lock = threading.RLock()
        self.sent = 0
        self.dropped = 0
        self.last = GatedCommand(0.0, 0.0, False, "not active")
        self.latencies: deque[float] = deque(maxlen=1000)
        self.failures: Counter[str] = Counter()
        self._codec = codec
        self._frame = codec.command
        self._gate = gate
        self._bus = bus
        self._on_broken = on_broken
        self._before = before
        self._on_sent = on_sent
        self._pace = pace or Pace()
        self._counter = 0
        self._message: can.Message | None = None
        self._wake = threading.Condition()
        self._waiting: float | None = None
        self._running = False
        self._thread: threading.Thread | None = None

    def command(self, retract: float, extend: float, age: float) -> bool:
        """A command from the topic, see `CommandGate.command`; it goes out at once."""
        with self.lock:
            accepted = self._gate.command(retract, extend, age, self._pace.clock())
        with self._wake:
            self._waiting = time.monotonic()
            self._wake.notify()
        return accepted

    def wake(self) -> None:
        """Wake the thread, because the next due time may have changed."""
        with self._wake:
            self._wake.notify()

    def start(self) -> None:
        """Start the thread."""
        self._running = True
        self._thread = threading.Thread(target=self._run, name="can-send", daemon=True)
        self._thread.start()

    def stop(self) -> None:
        """End the thread; its last frame is zero current."""
        with self._wake:
            self._running = False
            self._wake.notify()
        if self._thread is not None:
            self._thread.join(2.0)
            self._thread = None
        with self.lock:
            self._gate.enable(False)
        self._send()

    def _run(self) -> None:
        last = time.monotonic()
        while True:
            with self._wake:
                while self._running:
                    now = time.monotonic()
                    until = self._pace.until(last, self._waiting)
                    if now >= until:
                        break
                    self._wake.wait(until - now)
                if not self._running:
                    return
                again = self._pace.repeats()
                arrived = self._waiting
                self._waiting = arrived if again else None
            last = time.monotonic()
            try:
                if again:
                    self._put(self._message)
                elif self._send(arrived is not None) and arrived is not None:
                    self.latencies.append(time.monotonic() - arrived)
            except Exception as error:  # nothing may end this thread but `stop`: the ECU would wait for its time-out
                self.failures[type(error).__name__] += 1

    def _send(self, commanded: bool = False) -> bool:
        self._pace.sent(commanded)
        with self.lock:
            now = self._pace.clock()
            self._before(now)
            output = self._gate.output(now)
            self.last = output
        values = {"retract_current": output.retract, "extend_current": output.extend, "enable": float(output.enable)}
        self._counter += 1
        try:
            identifier, payload = self._codec.encode(self._frame.name, values, self._counter)
        except FrameError:
            # Less than the frame can hold is possible with another machine's file: then it is zero, never something else.
            self.failures["range"] += 1
            values = dict.fromkeys(values, 0.0)
            identifier, payload = self._codec.encode(self._frame.name, values, self._counter)
        self._message = can.Message(
            timestamp=time.time(),
            arbitration_id=identifier,
            data=payload,
            is_extended_id=self._frame.is_extended,
            is_rx=False,
        )
        return self._put(self._message)

    def _put(self, message: can.Message | None) -> bool:
        """Send a frame on the bus; False = it was not sent."""
        bus = self._bus()
        if bus is None or message is None:
            self.dropped += 1
            return False
        try:
            done = send_now(bus, message)
        except Exception as error:
            self.failures[type(error).__name__] += 1
            self._on_broken(bus, error)
            done = False
        if not done:
            self.dropped += 1
            return False
        self.sent += 1
        if self._on_sent is not None:
            self._on_sent(message)
        return True
