"""Runs an ECU on a bus: one thread that keeps the 10 ms cycle, receives, sends, and reopens a lost bus. No ROS.

The cycle continues with or without a bus: the valve closes by itself without commands.
"""

from __future__ import annotations

import contextlib
import threading
import time
from collections.abc import Callable

from boom_can_bridge.python_can import can
from boom_sim.ecu import Ecu
from boom_sim.ecu_faults import FaultSettings, FaultyLine, Frame
from boom_sim.simulated_crane import PERIOD, SimulatedCrane

FIRST_WAIT, LONGEST_WAIT = 0.1, 2.0
"""s. Between attempts to open the bus: doubled from the first to the longest."""
STANDSTILL = 0.05
"""s. After so long without running, frames that wait to be received are old and dropped."""
_SEND_TIMEOUT = 0.05
_DRAIN_LIMIT = 20_000

# Backends raise can.CanError, OSError, ValueError, TypeError, and the remote one exceptions of its own that derive from
# nothing narrower; whatever it is, the bus is closed and opened again.
BUS_FAILURES = (Exception,)


class EcuLoop:
    """The thread around an :class:`Ecu`.

    Args:
        ecu: the thread uses it only while holding ``lock``; other users must hold it too.
        open_bus: opens the bus or raises.
        seed: seed of the faults.

    Attributes:
        connection: "connected", or why not.
        skipped: cycles that were left out because the process stood still.
        error: the error that ended the thread, or None.
        sent, received: frames over the bus. unsent: frames that could not be sent, dropped.
    """

    def __init__(self, ecu: Ecu, open_bus: Callable[[], can.BusABC], *, seed: int = 0) -> None:
        self.ecu = ecu
        self.lock = threading.RLock()
        self.connection = "not connected yet"
        self.skipped = self.sent = self.received = self.unsent = 0
        self.to_bus = FaultyLine(2 * seed)
        self.from_bus = FaultyLine(2 * seed + 1)
        self.error: BaseException | None = None
        self._open_bus = open_bus
        self._bus: can.BusABC | None = None
        self._opener: _Opener | None = None
        self._retry_at = 0.0
        self._wait = FIRST_WAIT
        self._silent_until = 0.0
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, name="ecu", daemon=True)

    def begin(self) -> None:
        """Starts the thread."""
        self._thread.start()

    def end(self) -> None:
        """Stops it and closes the bus."""
        self._stop.set()
        if self._thread.ident is not None:
            self._thread.join()

    # --------------------------------------------------------------------------------------------------------- faults

    def set_faults(self, settings: FaultSettings, direction: str = "both", *, frozen_counter: bool = False) -> None:
        """Faults from now on; ``direction``: both, from_ecu or to_ecu."""
        with self.lock:
            neutral = FaultSettings()
            self.to_bus.settings = settings if direction != "to_ecu" else neutral
            self.from_bus.settings = settings if direction != "from_ecu" else neutral
            self.ecu.frozen_counter = frozen_counter

    def bus_off(self, duration: float) -> None:
        """Neither send nor receive for ``duration`` [s]; the ECU continues."""
        with self.lock:
            self._silent_until = time.monotonic() + duration
            self.to_bus.clear()
            self.from_bus.clear()

    def restart(self, duration: float) -> None:
        """Restart the ECU: valve closed, counters at zero, silent for ``duration`` [s]. The crane stays where it is."""
        with self.lock:
            self.bus_off(duration)
            self.ecu.start(self._now())

    def reset(self, crane: SimulatedCrane) -> None:
        """Restart the ECU with a new crane."""
        with self.lock:
            self.to_bus.clear()
            self.from_bus.clear()
            self.ecu.reset(self._now(), crane)
            self.ecu.start(self._now())  # in lockstep the new crane's time

    # ----------------------------------------------------------------------------------------------------------- loop

    def _now(self) -> float:
        return self.ecu.crane.time if self.ecu.lockstep else time.monotonic()

    def _run(self) -> None:
        try:
            self._turn()
        except BaseException as error:
            self.error = error
            raise
        finally:
            self._close()

    def _turn(self) -> None:
        with self.lock:
            self.ecu.start(self._now())
        next_tick = last_turn = time.monotonic()
        while not self._stop.is_set():
            now = time.monotonic()
            if now - last_turn > STANDSTILL and not self.ecu.lockstep:  # in lockstep no time has passed
                self._drain()
                now = time.monotonic()
            last_turn = now
            self._keep_connected(now)
            if not self.ecu.lockstep and now >= next_tick:
                late = int((now - next_tick) / PERIOD)
                if late > 5:
                    self.skipped += late
                    next_tick += late * PERIOD
                next_tick += PERIOD
                self._tick(now)
            self._deliver(time.monotonic())
            until = min(
                next_tick if not self.ecu.lockstep else now + 0.05, self.to_bus.next_time(), self.from_bus.next_time()
            )
            self._receive(max(0.0, min(until - time.monotonic(), 0.05)))

    def _tick(self, now: float) -> None:
        with self.lock:
            self._put(self.ecu.tick(self._now()), now)

    def _put(self, frames: list[Frame], now: float) -> None:
        for frame in frames:
            if now >= self._silent_until:
                self.to_bus.put(frame, now)

    def _deliver(self, now: float) -> None:
        """Deliver the frames that are due, to the bus and from it to the ECU."""
        with self.lock:
            outgoing, incoming = self.to_bus.due(now), self.from_bus.due(now)
            for frame in incoming:
                if self.ecu.receive(frame, self._now()) and self.ecu.lockstep:
                    self._put(self.ecu.answer if self.ecu.asked_again else self.ecu.tick(self._now()), now)
                    outgoing += self.to_bus.due(now)
        for frame in outgoing:
            self._send(frame)

    def _send(self, frame: Frame) -> None:
        if self._bus is None:
            self.unsent += 1
            return
        message = can.Message(
            arbitration_id=frame.arbitration_id, is_extended_id=frame.extended, data=frame.data, check=False
        )
        try:
            self._bus.send(message, timeout=0.0)
            self.sent += 1
        except BUS_FAILURES as error:
            self.unsent += 1
            self._lost(error)

    def _receive(self, timeout: float) -> None:
        if self._bus is None:
            self._stop.wait(timeout)
            return
        try:
            message = self._bus.recv(timeout)
            while message is not None:
                now = time.monotonic()
                self.received += 1
                data_frame = not (message.is_error_frame or message.is_remote_frame or message.is_fd)
                if data_frame and now >= self._silent_until:
                    frame = Frame(message.arbitration_id, message.is_extended_id, bytes(message.data))
                    with self.lock:
                        self.from_bus.put(frame, now)
                message = self._bus.recv(0.0) if self.from_bus.next_time() > now else None
        except BUS_FAILURES as error:
            self._lost(error)
        self._deliver(time.monotonic())

    def _drain(self) -> None:
        if self._bus is None:
            return
        try:
            for _ in range(_DRAIN_LIMIT):
                if self._bus.recv(0.0) is None:
                    return
        except BUS_FAILURES as error:
            self._lost(error)

    # ----------------------------------------------------------------------------------------------------- connection

    def _keep_connected(self, now: float) -> None:
        if self._bus is not None:
            return
        if self._opener is None:
            if now >= self._retry_at:
                self._opener = _Opener(self._open_bus)  # opening may block for seconds, and the cycle must go on
            return
        if not self._opener.done:
            return
        opener, self._opener = self._opener, None
        if opener.bus is not None:
            self._bus, self._wait = opener.bus, FIRST_WAIT
            self.connection = "connected"
            sock = getattr(self._bus, "socket", None)
            if sock is not None and hasattr(sock, "settimeout"):
                sock.settimeout(_SEND_TIMEOUT)  # a server that stands still must not hold the cycle
            self._drain()
        else:
            self.connection = f"no bus: {describe(opener.error)}"
            self._back_off(now)

    def _lost(self, error: BaseException) -> None:
        self._close()
        self.connection = f"bus lost: {describe(error)}"
        self._back_off(time.monotonic())

    def _back_off(self, now: float) -> None:
        self._retry_at = now + self._wait
        self._wait = min(2 * self._wait, LONGEST_WAIT)

    def _close(self) -> None:
        bus, self._bus = self._bus, None
        if bus is not None:
            close_bus(bus)


class _Opener:
    """Opens the bus in a separate thread."""

    def __init__(self, open_bus: Callable[[], can.BusABC]) -> None:
        self.bus: can.BusABC | None = None
        self.error: BaseException = RuntimeError("no answer")
        self.done = False
        self._open_bus = open_bus
        threading.Thread(target=self._run, name="ecu bus", daemon=True).start()

    def _run(self) -> None:
        try:
            self.bus = self._open_bus()
        except BUS_FAILURES as error:
            self.error = error
        self.done = True


def close_bus(bus: can.BusABC) -> None:
    """Close a bus that may be dead. The remote one would wait for a last answer of its server."""
    sock = getattr(bus, "socket", None)
    if sock is not None and hasattr(sock, "close"):
        with contextlib.suppress(OSError):
            sock.close()
        bus._is_shutdown = True
        return
    with contextlib.suppress(*BUS_FAILURES):
        bus.shutdown()


def describe(error: BaseException) -> str:
    """An error of a bus in one line."""
    text = " ".join(str(error).split())
    return text or type(error).__name__
