"""A CAN bus inside this computer, for demo and tests: programs join it with python-can's ``remote`` interface.

    python -m boom_can_bridge.bus_server --port 54701

and in every program that joins: interface ``remote``, channel ``ws://127.0.0.1:54701/``. It listens on 127.0.0.1
only. ``--port 0`` takes a free port and prints it.

The wire protocol is that of python-can-remote. This server avoids some behaviour of its server that a bus must not have:

- for a stalled participant it queues frames without limit and delivers them all later: here a frame that could not be
  delivered for 50 ms is dropped and counted, like in the full buffer of a CAN controller;
- the server itself may stall (a paused process, a suspended laptop): here frames that arrived meanwhile are dropped too;
- it serves files below its folder to anyone, and accepts frames from any web page that is open in a browser on this
  computer: here a client that sends an ``Origin`` (every browser does) or requests a page is rejected.
"""

# ruff: noqa: I001
from __future__ import annotations

from boom_node import early

if __name__ == "__main__":
    early.settle()  # a Ctrl-C during the imports ends it quietly

import argparse
import contextlib
import errno
import os
import signal
import socket
import socketserver
import sys
import threading
import time
from collections import deque
from http.server import ThreadingHTTPServer
from typing import Any, cast

from boom_can_bridge.python_can import can  # before can_remote, which would load all of python-can's file formats
from can_remote.protocol import RemoteProtocolBase
from can_remote.server import ClientRequestHandler, RemoteServerProtocol
from can_remote.websocket import WebSocket, get_accept_key
from boom_input.ending import ending_signals

ADDRESS = "127.0.0.1"
DEFAULT_PORT = 54701
LONGEST_WAIT = 0.05
"""s. A frame that has waited longer for its receiver is dropped."""
_STANDSTILL = 0.1
_BEAT = 0.02
_SEND_BUFFER = 4096
_PATIENCE = 5.0


class BusServerError(Exception):
    """The server cannot start; one line that says why and what to do."""

    exit_status = 2


class Hub:
    """The wire: every port receives what another port sends.

    Attributes:
        frames: sent so far. dropped: not delivered because its receiver, or the server, stood still.
    """

    def __init__(self) -> None:
        self._ports: list[Port] = []
        self._lock = threading.Lock()
        self._last_beat = time.monotonic()
        self._discard_until = 0.0
        self.frames = 0
        self.dropped = 0

    def beat(self) -> None:
        """To be called every 20 ms; a late call means that the process stalled, and frames that arrived meanwhile are old."""
        now = time.monotonic()
        if now - self._last_beat > _STANDSTILL:
            self._discard_until = now + _STANDSTILL
        self._last_beat = now

    def join(self, filters: Any = None) -> Port:
        """A new participant's port; ``filters`` as python-can has them (``can_id``, ``can_mask``, ``extended``)."""
        port = Port(self, filters)
        with self._lock:
            self._ports.append(port)
        return port

    def leave(self, port: Port) -> None:
        """Remove a participant; harmless if it has left before."""
        with self._lock:
            if port in self._ports:
                self._ports.remove(port)

    @property
    def participants(self) -> int:
        """Number of ports."""
        return len(self._ports)

    def pass_on(self, sender: Port, message: can.Message) -> None:
        """Pass the frame to all participants except its sender, with the time stamp of the bus [s since 1970]."""
        message.timestamp = time.time()
        now = time.monotonic()
        if now < self._discard_until or now - self._last_beat > _STANDSTILL:
            self.dropped += 1
            return
        with self._lock:  # held for all receivers: every participant sees the same order
            self.frames += 1
            for port in self._ports:
                if port is not sender:
                    self.dropped += port.put(message)


class Port:
    """One participant's end of the wire, with the frames that wait for it. Has the required methods of a python-can bus."""

    channel_info = "loopback bus"

    def __init__(self, hub: Hub, filters: Any = None) -> None:
        self._hub = hub
        self._filters = [(int(f["can_id"]), int(f["can_mask"]), f.get("extended")) for f in filters or ()]
        self._waiting: deque[tuple[float, can.Message]] = deque()
        self._arrived = threading.Condition()

    def send(self, message: can.Message) -> None:
        """Send a frame to the bus."""
        self._hub.pass_on(self, message)

    def put(self, message: can.Message) -> int:
        """Queue a frame for reception. Returns the number of older frames dropped because they waited too long."""
        if self._filters and not self._wanted(message):
            return 0
        now = time.monotonic()
        dropped = 0
        with self._arrived:
            while self._waiting and now - self._waiting[0][0] > LONGEST_WAIT:
                self._waiting.popleft()
                dropped += 1
            self._waiting.append((now, message))
            self._arrived.notify()
        return dropped

    def _wanted(self, message: can.Message) -> bool:
        return message.is_error_frame or any(
            extended in (None, message.is_extended_id) and (message.arbitration_id ^ can_id) & mask == 0
            for can_id, mask, extended in self._filters
        )

    def recv(self, timeout: float) -> can.Message | None:
        """The next frame, or None after ``timeout`` [s]."""
        with self._arrived:
            if not self._waiting and not self._arrived.wait_for(lambda: bool(self._waiting), timeout):
                return None
            return self._waiting.popleft()[1]

    def shutdown(self) -> None:
        """Leave the bus."""
        self._hub.leave(self)


class _Connection(RemoteServerProtocol):  # type: ignore[misc]  # python-can-remote has no type information
    """The connection of one participant, to the hub instead of a bus that the participant names."""

    def __init__(self, hub: Hub, websocket: WebSocket) -> None:
        RemoteProtocolBase.__init__(self, websocket)
        event = self.recv(_PATIENCE)
        if not isinstance(event, dict) or event.get("type") != "bus_request":
            raise ConnectionError("the participant did not ask for a bus")
        self.bus = hub.join(event.get("payload", {}).get("config", {}).get("can_filters"))
        self._send_tasks: dict[int, Any] = {}
        self.running = True
        self.send_bus_response(self.bus.channel_info)
        self._send_thread = threading.Thread(target=self._send_to_client, daemon=True)

    def _send_to_client(self) -> None:
        try:
            while self.running:
                message = self.bus.recv(0.5)
                if message is not None:
                    self.send_msg(message)
        except (OSError, ValueError):
            self.running = False  # the participant is gone: its reading end notices too

    def _receive_from_client(self) -> None:
        while self.running:
            event = self.recv(0.5)
            if isinstance(event, can.Message):
                self.bus.send(event)
            elif event is not None:
                self.send_error("frames only: this bus sends nothing periodically by itself")


class _Handler(ClientRequestHandler):  # type: ignore[misc]
    """Admits programs, rejects browsers."""

    def do_GET(self) -> None:
        if self.headers.get("Upgrade", "").lower() != "websocket" or "Origin" in self.headers:
            self.send_error(403, "this is a CAN bus for programs on this computer, not a web page")
            return
        self.start_websocket()

    def start_websocket(self) -> None:
        self.close_connection = True
        # A small buffer: what is in it reaches a participant that stood still, however late.
        self.request.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, _SEND_BUFFER)
        offered = [text.strip() for text in self.headers.get("Sec-WebSocket-Protocol", "").split(",")]
        spoken = "can.binary+json.v1" if "can.binary+json.v1" in offered else "can.json.v1"
        self.send_response(101)
        for name, value in (
            ("Upgrade", "WebSocket"),
            ("Connection", "Upgrade"),
            ("Sec-WebSocket-Accept", get_accept_key(self.headers.get("Sec-WebSocket-Key", ""))),
            ("Sec-WebSocket-Protocol", spoken),
        ):
            self.send_header(name, value)
        self.end_headers()
        self.wfile.flush()
        connection = None
        # Whatever a participant sends or however it goes, it costs its own connection and nothing else.
        with contextlib.suppress(Exception):
            connection = _Connection(cast(BusServer, self.server).hub, WebSocket(None, spoken, sock=self.request))
            connection.run()
        if connection is not None:
            connection.bus.shutdown()


class BusServer(ThreadingHTTPServer):
    """The server; ``serve_forever`` runs it, ``shutdown`` from another thread ends that, ``server_close`` frees the port.

    Args:
        port: to listen on at 127.0.0.1; 0 takes a free one, see ``server_port``.

    Raises:
        BusServerError: the port is taken or not allowed.
    """

    daemon_threads = True
    # A restarted server must get its port back while old connections still linger.
    allow_reuse_address = True

    def __init__(self, port: int = DEFAULT_PORT) -> None:
        self.hub = Hub()
        try:
            super().__init__((ADDRESS, port), _Handler)
        except OverflowError:
            raise BusServerError(f"port {port}: give one from 0 to 65535") from None
        except OSError as error:
            if error.errno == errno.EADDRINUSE:
                raise BusServerError(
                    f"port {port} of {ADDRESS} is taken: give another one with --port, or end what listens there"
                ) from None
            raise BusServerError(f"port {port} of {ADDRESS} cannot be used: {error.strerror}") from None

    @property
    def channel(self) -> str:
        """The channel for participants with the interface ``remote``."""
        return f"ws://{ADDRESS}:{self.server_port}/"

    def server_bind(self) -> None:
        """As the base class, without its look-up of the computer's name, which may ask a name server."""
        socketserver.TCPServer.server_bind(self)
        self.server_name, self.server_port = ADDRESS, int(self.server_address[1])

    def handle_error(self, request: Any, client_address: Any) -> None:
        """Ignore a broken connection: it concerns the participant only."""


def main(arguments: list[str] | None = None) -> int:
    """Runs the server until SIGINT or SIGTERM. Returns the exit status: 0, or 2 if it cannot start."""
    parser = argparse.ArgumentParser(prog="bus_server", description=(__doc__ or "").split("\n\n")[0])
    parser.add_argument(
        "--port", type=int, default=DEFAULT_PORT, help=f"TCP port on {ADDRESS}, 0 = a free one (default: %(default)s)"
    )
    options = parser.parse_args(arguments)
    try:
        server = BusServer(options.port)
    except BusServerError as error:
        print(f"bus_server: {error}", file=sys.stderr)
        return error.exit_status
    ended = threading.Event()
    for number in ending_signals():
        signal.signal(number, lambda *_: ended.set())
    thread = threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.1}, daemon=True)
    thread.start()
    print(f"CAN bus: interface remote, channel {server.channel}", flush=True)
    while not ended.wait(_BEAT):
        server.hub.beat()
    print(f"CAN bus closed: {server.hub.frames} frames, {server.hub.dropped} dropped for slow participants", flush=True)
    # Connections end with the process: their threads wait in reads that nothing would interrupt.
    sys.stdout.flush()
    server.server_close()
    os._exit(0)


if __name__ == "__main__":
    raise SystemExit(main())
