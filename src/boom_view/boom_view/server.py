"""The server of the page: on the loopback only, two addresses, nothing that can be changed through it."""

from __future__ import annotations

import json
import sys
import threading
import time
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any

from boom_view.feed import Feed

HOST = "127.0.0.1"
DEFAULT_PORT = 8470
MOST_PAGES = 8
"""Streams at once; another page is refused."""
PERIOD = 1 / 30
"""s between two batches: the page interpolates between samples."""
_ALIVE = 5.0  # s after which a silent stream is tested, which shows whether the page is still there
_STUCK = 10.0  # s that a page may take nothing


class PortError(OSError):
    """The port cannot be had; one line that says what to do."""

    exit_status = 2


class ViewServer(ThreadingHTTPServer):
    """Serves one page, and the stream of a running machine.

    Args:
        page: HTML.
        feed: of the running machine; None for a recording.
        port: to listen on; None: the usual one, or any that is free.

    Raises:
        PortError: the port is in use.
    """

    daemon_threads = True
    block_on_close = False

    def __init__(self, page: str, feed: Feed | None = None, port: int | None = None) -> None:
        self.page, self.feed = page.encode(), feed
        self.streams = threading.BoundedSemaphore(MOST_PAGES)
        for wanted in (port,) if port is not None else (DEFAULT_PORT, 0):
            try:
                super().__init__((HOST, wanted), _PageHandler)
                break
            except OSError as error:
                if port is not None or wanted == 0:
                    raise PortError(f"port {wanted} cannot be used ({error.strerror}): give another --port") from None

    @property
    def url(self) -> str:
        """Where the page is."""
        return f"http://{HOST}:{self.server_address[1]}/"

    def handle_error(self, request: Any, client_address: Any) -> None:
        """Say nothing of a page that was closed while it was answered."""
        if not isinstance(sys.exception(), OSError):
            super().handle_error(request, client_address)

    def start(self) -> None:
        """Serve from a thread of its own until the process ends."""
        threading.Thread(target=self.serve_forever, name="view", daemon=True).start()


class _PageHandler(BaseHTTPRequestHandler):
    server: ViewServer
    protocol_version = "HTTP/1.1"
    timeout = _STUCK

    def do_GET(self) -> None:
        # Another site whose name leads to this computer (DNS rebinding) must not read the machine.
        host = self.headers.get("Host", "").rsplit(":", 1)[0]
        if host not in (HOST, "localhost"):
            self._answer(HTTPStatus.FORBIDDEN, b"only as http://127.0.0.1\n")
        elif self.path == "/":
            self._answer(HTTPStatus.OK, self.server.page, "text/html; charset=utf-8")
        elif self.path == "/stream" and self.headers.get("Sec-Fetch-Site") == "cross-site":
            # It could not read the stream, but would take the places of our pages.
            self._answer(HTTPStatus.FORBIDDEN, b"not for another site\n")
        elif self.path == "/stream" and self.server.feed is not None:
            self._stream(self.server.feed)
        else:
            self._answer(HTTPStatus.NOT_FOUND, b"not here: the page is at /\n")

    def _answer(self, status: HTTPStatus, body: bytes, kind: str = "text/plain; charset=utf-8") -> None:
        self.send_response(status)
        self._headers(kind)
        self.send_header("Content-Length", str(len(body)))
        self.end_headers()
        self.wfile.write(body)

    def _headers(self, kind: str) -> None:
        for name, value in (
            ("Content-Type", kind),
            ("Cache-Control", "no-store"),
            ("X-Content-Type-Options", "nosniff"),
        ):
            self.send_header(name, value)

    def _stream(self, feed: Feed) -> None:
        if not self.server.streams.acquire(blocking=False):
            self._answer(HTTPStatus.SERVICE_UNAVAILABLE, b"too many pages are open: close one\n")
            return
        try:
            self.close_connection = True
            self.send_response(HTTPStatus.OK)
            self._headers("text/event-stream")
            self.end_headers()
            reader = _Reader(feed)
            while True:
                self.wfile.write(reader.wait())
                time.sleep(PERIOD)
        finally:
            self.server.streams.release()

    def log_message(self, *_: Any) -> None:
        """Nothing is said of single requests."""


class _Reader:
    """What one page has been told, and what is new."""

    def __init__(self, feed: Feed) -> None:
        self._feed = feed
        self._scene = self._state = self._marks = ""
        self._run, self._count = -1, 0

    def wait(self) -> bytes:
        """The next events, at the latest after a few seconds an empty one."""
        feed, events = self._feed, []
        with feed.changed:
            feed.changed.wait_for(self._something, _ALIVE)
            if feed.run != self._run:
                self._run, self._count, self._marks = feed.run, feed.count - len(feed.rows), ""
            if feed.scene not in ("", self._scene):
                events.append(("scene", feed.scene))
            self._scene = feed.scene
            new = min(feed.count - self._count, len(feed.rows))
            rows = [feed.rows[i] for i in range(len(feed.rows) - new, len(feed.rows))]
            self._count = feed.count
            state, marks = feed.state, feed.marks
        if rows:
            events.append(("samples", json.dumps(rows, separators=(",", ":"), allow_nan=False)))
        if marks != self._marks:
            self._marks = marks
            events.append(("marks", marks))
        if state != self._state:
            self._state = state
            events.append(("state", json.dumps(state)))
        return "".join(f"event: {name}\ndata: {data}\n\n" for name, data in events).encode() or b": alive\n\n"

    def _something(self) -> bool:
        feed = self._feed
        return (feed.run, feed.count, feed.scene, feed.state, feed.marks) != (
            self._run,
            self._count,
            self._scene,
            self._state,
            self._marks,
        )
