"""The server of the page: on the loopback only, and nothing but the page and its stream."""

import http.client
import json
import socket
import threading

import pytest

from boom_model.machine_file import shipped_machine
from boom_view.feed import Feed
from boom_view.server import MOST_PAGES, PortError, ViewServer


@pytest.fixture
def served():
    feed = Feed()
    server = ViewServer("<p>page</p>", feed, 0)
    server.start()
    yield feed, server
    server.shutdown()
    server.server_close()


def get(server, path, **headers):
    connection = http.client.HTTPConnection(*server.server_address, timeout=20)
    connection.request("GET", path, headers=headers)
    return connection.getresponse()


def events(response, count):
    found = []
    while len(found) < count:
        line = response.fp.readline().decode()
        if line.startswith("event: "):
            data = response.fp.readline().decode().removeprefix("data: ")
            found.append((line.removeprefix("event: ").strip(), json.loads(data)))
    return found


def test_it_listens_on_the_loopback_and_answers_only_there(served):
    _, server = served
    assert server.server_address[0] == "127.0.0.1"
    assert get(server, "/").read() == b"<p>page</p>"
    assert get(server, "/", Host="crane.example:80").status == 403
    assert get(server, "/../etc/passwd").status == 404
    assert get(server, "/stream", **{"Sec-Fetch-Site": "cross-site"}).status == 403
    assert get(server, "/", Host="localhost:1").status == 200


def test_a_page_opened_late_gets_machine_samples_and_state(served):
    feed, server = served
    machine = shipped_machine("tz17")
    feed.configure(machine, machine.pose(0.28, 2.2))
    for k in range(20):
        feed.add(k * 0.01, angle=0.3, rate=0.0)
    feed.flush(0.0)
    told = dict(events(get(server, "/stream"), 3))
    assert told["scene"]["machine"] == "tz17"
    assert [row[:2] for row in told["samples"]][:2] == [[0.0, 0.3], [0.01, 0.3]]
    assert told["marks"] == []


def test_more_pages_than_it_serves_are_refused_and_a_closed_one_makes_room(served):
    _, server = served
    pages = [get(server, "/stream") for _ in range(MOST_PAGES)]
    for page in pages:
        events(page, 1)
    assert get(server, "/stream").status == 503


def test_a_page_that_is_closed_while_it_loads_leaves_no_word_and_the_server_goes_on(capfd):
    server = ViewServer("x" * 20_000_000, None, 0)
    ended = threading.Event()
    shutdown = server.shutdown_request
    server.shutdown_request = lambda request: (shutdown(request), ended.set())
    server.start()
    with socket.create_connection(server.server_address) as page:
        page.sendall(b"GET / HTTP/1.1\r\nHost: localhost\r\n\r\n")
        assert page.recv(10)
    assert ended.wait(20)
    assert get(server, "/other").status == 404
    server.shutdown()
    server.server_close()
    assert capfd.readouterr() == ("", "")


def test_a_port_in_use_is_told(served):
    _, server = served
    with pytest.raises(PortError, match="give another --port"):
        ViewServer("", None, server.server_address[1])
