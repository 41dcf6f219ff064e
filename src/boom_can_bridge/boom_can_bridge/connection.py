"""Opens a CAN interface of python-can, sends without blocking, closes without hanging; waits longer after each failure."""

import contextlib
import logging
import select
import socket
import threading
from dataclasses import dataclass
from typing import Any

from boom_can_bridge.python_can import can

from .errors import CanConfigurationError

SEND_BUFFER_BYTES = 4096  # of a TCP connection: what lies in it reaches a peer that stood still, however late
CLOSE_PATIENCE_S = 0.5


@dataclass(frozen=True)
class BusSettings:
    """Interface, channel and bitrate [bit/s] (0 = as the interface is set) in the form of python-can.

    wanted: (identifier, whether it has 29 bits) of the frames to receive, for drivers and servers that can filter; empty = all.
    Others deliver all frames.
    """

    interface: str
    channel: str
    bitrate: int = 0
    wanted: tuple[tuple[int, bool], ...] = ()

    def __str__(self) -> str:
        return f"{self.interface} {self.channel}".strip()


class BusUnavailableError(Exception):
    """The bus cannot be opened now; it may come back. One line that says why and what to do."""


def open_bus(settings: BusSettings) -> can.BusABC:
    """Open the bus.

    Raises:
        CanConfigurationError: it cannot open with these settings (unknown interface, missing driver, wrong settings)
        BusUnavailableError: it is busy, unplugged, down, or its server is missing
    """
    # What goes wrong is told by the exceptions; the driver's own lines beside them say it twice.
    logging.getLogger("can").setLevel(logging.CRITICAL)
    options: dict[str, Any] = {"bitrate": settings.bitrate} if settings.bitrate else {}
    if settings.wanted:
        options["can_filters"] = [
            {"can_id": identifier, "can_mask": 0x1FFFFFFF if extended else 0x7FF, "extended": extended}
            for identifier, extended in settings.wanted
        ]
    try:
        bus = can.Bus(interface=settings.interface, channel=settings.channel, **options)
    except can.CanInterfaceNotImplementedError:
        known = sorted(can.VALID_INTERFACES)
        raise CanConfigurationError(
            f"no CAN interface '{settings.interface}', or its driver is not installed: set interface to one of {', '.join(known)}"
        ) from None
    except (ImportError, TypeError, ValueError) as error:
        raise CanConfigurationError(
            f"{settings} cannot be opened: {_plain(error)}: check interface, channel and bitrate"
        ) from None
    except Exception as error:  # each driver has its own
        raise BusUnavailableError(f"{settings} cannot be opened: {_plain(error)}: {_advice(settings, error)}") from None
    if settings.interface == "remote":
        _read_ahead(bus)
    with contextlib.suppress(Exception):
        connection = getattr(bus, "socket", None)
        if connection is not None and connection.family in (socket.AF_INET, socket.AF_INET6):
            connection.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, SEND_BUFFER_BYTES)
            connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    return bus


class _ReadAhead:
    """Reads all waiting data from the socket of python-can-remote at once: its own reader calls the kernel four times per frame."""

    def __init__(self, connection: socket.socket) -> None:
        self._socket = connection
        self._buffer = bytearray()

    def wait(self, timeout: float | None = None) -> bool:
        """Whether something can be read."""
        return bool(self._buffer) or bool(select.select([self._socket], [], [], timeout)[0])

    def read_exactly(self, count: int) -> bytearray:
        """Exactly ``count`` bytes; waits for them."""
        while len(self._buffer) < count:
            received = self._socket.recv(65536)
            if not received:
                raise ConnectionResetError("the bus server closed the connection")
            self._buffer += received
        taken = self._buffer[:count]
        del self._buffer[:count]
        return taken


def _read_ahead(bus: Any) -> None:
    # The names are those of the locked version 0.3.0; another one is read its own way.
    reader = getattr(getattr(bus, "remote_protocol", None), "_ws", None)
    if reader is not None and hasattr(reader, "_read_exactly") and hasattr(reader, "wait"):
        ahead = _ReadAhead(bus.socket)
        reader._read_exactly, reader.wait = ahead.read_exactly, ahead.wait


def _plain(error: BaseException) -> str:
    return " ".join(str(error).split()) or type(error).__name__


def _advice(settings: BusSettings, error: BaseException) -> str:
    text = str(error).lower()
    if isinstance(error, ConnectionRefusedError) or "refused" in text:
        return "start the bus server, or set channel to where it listens"
    if "busy" in text or "in use" in text or "already" in text:
        return "another program has the channel: end it, or choose another channel"
    if settings.interface == "socketcan":
        return f"is {settings.channel} there and up (ip link set {settings.channel} up)?"
    return "is the adapter plugged in, free, and the channel right?"


def send_now(bus: can.BusABC, message: can.Message) -> bool:
    """Send a frame if the bus accepts it at once; False = dropped. Never waits.

    Raises:
        whatever the driver raises if the bus is broken
    """
    descriptor = -1
    with contextlib.suppress(Exception):  # drivers without a descriptor say so in different ways
        descriptor = bus.fileno()
    if descriptor >= 0 and not select.select([], [descriptor], [], 0)[1]:
        return False
    try:
        bus.send(message, timeout=0)
    except can.CanOperationError as error:
        # The queue of a SocketCAN interface is full (ENOBUFS): nobody acknowledges. That may pass.
        if "buffer" in str(error).lower() or "full" in str(error).lower():
            return False
        raise
    return True


def close_bus(bus: can.BusABC) -> None:
    """Close the bus; if its driver waits for an answer that does not come, cut its connection."""

    def shut() -> None:
        with contextlib.suppress(Exception):
            bus.shutdown()

    closing = threading.Thread(target=shut, name="can-close", daemon=True)
    closing.start()
    closing.join(CLOSE_PATIENCE_S)
    if closing.is_alive():
        with contextlib.suppress(Exception):
            bus.socket.shutdown(socket.SHUT_RDWR)  # type: ignore[attr-defined]
        with contextlib.suppress(Exception):
            bus.socket.close()  # type: ignore[attr-defined]
    # A shutdown that failed half way would be tried again, with a traceback, when the object is collected.
    bus._is_shutdown = True


class BackOff:
    """Waiting times between attempts: 0.1 s, doubled up to 2 s."""

    FIRST_S = 0.1
    LAST_S = 2.0

    def __init__(self) -> None:
        self._next = self.FIRST_S

    def wait(self) -> float:
        """Time to wait before the next attempt [s]."""
        now = self._next
        self._next = min(2 * now, self.LAST_S)
        return now

    def reset(self) -> None:
        """Start again with the shortest time, after a success."""
        self._next = self.FIRST_S
