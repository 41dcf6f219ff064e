"""The embedded bus as a process, joined by python-can's own remote interface."""

from __future__ import annotations

import contextlib
import os
import re
import signal
import socket
import subprocess
import sys
import threading
import urllib.error
import urllib.request
from collections.abc import Callable, Iterator

import can
import pytest

from boom_can_bridge.bus_server import LONGEST_WAIT, BusServer, Hub
from boom_can_bridge.connection import BusSettings, close_bus, open_bus

PATIENCE = 20.0


class Server:
    """A bus server process and its channel."""

    def __init__(self, port: int = 0) -> None:
        command = [sys.executable, "-m", "boom_can_bridge.bus_server", "--port", str(port)]
        self.process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
        assert self.process.stdout is not None
        found = re.search(r"ws://\S+", self.process.stdout.readline())
        assert found
        self.channel = found[0]
        self.port = int(self.channel.rstrip("/").rsplit(":", 1)[1])

    def stop(self, number: int = signal.SIGTERM) -> tuple[int, str]:
        self.process.send_signal(number)
        text, _ = self.process.communicate(timeout=PATIENCE)
        return self.process.returncode, text


@pytest.fixture
def server() -> Iterator[Server]:
    made = Server()
    yield made
    made.process.kill()
    made.process.wait(timeout=PATIENCE)


@pytest.fixture
def join(server: Server) -> Iterator[Callable[[], can.BusABC]]:
    buses: list[can.BusABC] = []

    def begin() -> can.BusABC:
        buses.append(can.Bus(interface="remote", channel=server.channel))
        return buses[-1]

    yield begin
    for bus in buses:
        with contextlib.suppress(OSError):
            bus.socket.close()
        bus._is_shutdown = True  # its own way to close waits for a server that the test has ended


def frame(number: int) -> can.Message:
    return can.Message(arbitration_id=number, is_extended_id=number > 0x7FF, data=number.to_bytes(8, "big"))


def received(bus: can.BusABC) -> can.Message:
    message = bus.recv(PATIENCE)
    assert message is not None, "nothing came"
    return message


def test_every_frame_reaches_every_other_participant_in_one_order(join: Callable[[], can.BusABC]) -> None:
    sender, first, second = join(), join(), join()
    for number in range(300):
        sender.send(frame(number * 1000))
        got = [received(first), received(second)]
        assert [m.arbitration_id for m in got] == [number * 1000] * 2
        assert [m.is_extended_id for m in got] == [number * 1000 > 0x7FF] * 2
        assert got[0].data == got[1].data == frame(number * 1000).data
        assert got[0].timestamp == got[1].timestamp > 1.5e9
    assert sender.recv(0.0) is None


def test_participant_that_wants_some_frames_is_spared_the_others(
    server: Server, join: Callable[[], can.BusABC]
) -> None:
    sender = join()
    few = open_bus(BusSettings("remote", server.channel, wanted=((0x102, False), (0x103, True))))
    try:
        for identifier, extended in ((0x101, False), (0x103, False), (0x103, True), (0x102, True), (0x102, False)):
            sender.send(can.Message(arbitration_id=identifier, is_extended_id=extended, data=b""))
        got = [received(few) for _ in range(2)]
        assert [(m.arbitration_id, m.is_extended_id) for m in got] == [(0x103, True), (0x102, False)]
    finally:
        close_bus(few)


def test_port_that_is_taken_is_one_line_and_status_2(server: Server) -> None:
    command = [sys.executable, "-m", "boom_can_bridge.bus_server", "--port", str(server.port)]
    result = subprocess.run(command, capture_output=True, text=True, timeout=PATIENCE, check=False)
    assert result.returncode == 2
    assert len(result.stderr.strip().splitlines()) == 1
    assert f"port {server.port} of 127.0.0.1 is taken" in result.stderr


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_signal_ends_it_cleanly_with_participants_still_there(
    number: int, server: Server, join: Callable[[], can.BusABC]
) -> None:
    join().send(frame(1))
    status, text = server.stop(number)
    assert status == 0
    assert "Traceback" not in text


def test_server_that_was_paused_goes_on(server: Server, join: Callable[[], can.BusABC]) -> None:
    first, second = join(), join()
    server.process.send_signal(signal.SIGSTOP)
    first.send(frame(1))
    os.waitid(os.P_PID, server.process.pid, os.WSTOPPED)
    server.process.send_signal(signal.SIGCONT)
    got = None
    while got is None:  # what was sent around the pause may be dropped
        first.send(frame(2))
        got = second.recv(0.05)
    assert server.stop()[0] == 0


def test_killed_server_can_be_started_again_on_its_port(server: Server, join: Callable[[], can.BusABC]) -> None:
    bus = join()
    server.stop(signal.SIGKILL)
    with pytest.raises(Exception):  # noqa: B017  (the interface's own class, derived from nothing narrower)
        bus.recv(PATIENCE)
    again = Server(server.port)
    try:
        assert join().recv(0.0) is None
    finally:
        assert again.stop()[0] == 0


def test_it_listens_on_the_loopback_only() -> None:
    with BusServer(0) as server:
        assert server.socket.getsockname()[0] == "127.0.0.1"


@pytest.mark.parametrize("path", ["", "index.html", "../__init__.py"])
def test_web_pages_are_not_served(server: Server, path: str) -> None:
    with pytest.raises(urllib.error.HTTPError) as error:
        urllib.request.urlopen(server.channel.replace("ws:", "http:") + path, timeout=PATIENCE)
    assert error.value.code == 403
    error.value.close()


def test_web_page_in_a_browser_cannot_join(server: Server) -> None:
    with socket.create_connection(("127.0.0.1", server.port), PATIENCE) as link:
        link.sendall(
            b"GET / HTTP/1.1\r\nHost: 127.0.0.1\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
            b"Origin: http://example.com\r\nSec-WebSocket-Key: AAAA\r\nSec-WebSocket-Version: 13\r\n\r\n"
        )
        assert b" 403 " in link.recv(200)


def test_participant_that_sends_nonsense_costs_nobody_else(server: Server, join: Callable[[], can.BusABC]) -> None:
    first, second, bad = join(), join(), join()
    bad.socket.sendall(b"\x82\x05\x01abcd" + bytes(range(256)))
    with socket.create_connection(("127.0.0.1", server.port), PATIENCE) as link:
        link.sendall(b"\xff" * 500)
    first.send(frame(7))
    assert received(second).arbitration_id == 7


def test_frames_that_a_slow_receiver_left_waiting_are_dropped(monkeypatch: pytest.MonkeyPatch) -> None:
    now = [100.0]
    monkeypatch.setattr("boom_can_bridge.bus_server.time.monotonic", lambda: now[0])
    hub = Hub()
    sender, receiver = hub.join(), hub.join()
    for number in range(10):
        sender.send(frame(number))
    now[0] += LONGEST_WAIT + 0.01
    sender.send(frame(10))
    message = receiver.recv(0.0)
    assert message is not None
    assert message.arbitration_id == 10
    assert hub.dropped == 10


def test_what_arrived_while_the_server_stood_still_is_dropped(monkeypatch: pytest.MonkeyPatch) -> None:
    now = [100.0]
    monkeypatch.setattr("boom_can_bridge.bus_server.time.monotonic", lambda: now[0])
    hub = Hub()
    sender, receiver = hub.join(), hub.join()
    now[0] += 1.0  # a paused process: no beat
    sender.send(frame(1))
    hub.beat()
    sender.send(frame(2))
    now[0] += 0.08
    hub.beat()
    now[0] += 0.08
    hub.beat()
    sender.send(frame(3))
    message = receiver.recv(0.0)
    assert message is not None
    assert message.arbitration_id == 3


def test_receiver_is_woken_by_the_frame_it_waits_for() -> None:
    hub = Hub()
    sender, receiver = hub.join(), hub.join()
    got: list[can.Message | None] = []
    thread = threading.Thread(target=lambda: got.append(receiver.recv(PATIENCE)))
    thread.start()
    sender.send(frame(5))
    thread.join(PATIENCE)
    assert got[0] is not None
    assert got[0].arbitration_id == 5
