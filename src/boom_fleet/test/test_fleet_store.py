"""Folders by URL: what cannot be used is one plain line, what does not answer is given up."""

import socket

import fsspec
import pytest

from boom_fleet import store
from boom_fleet.engine import EngineError, workers
from boom_fleet.store import Store, StoreError, at_hand, find_bags, machine_table


@pytest.fixture
def s3_keys(monkeypatch):
    for name in ("AWS_ACCESS_KEY_ID", "AWS_SECRET_ACCESS_KEY"):
        monkeypatch.setenv(name, "test")
    monkeypatch.setenv("AWS_DEFAULT_REGION", "us-east-1")
    yield
    fsspec.get_filesystem_class("s3").clear_instance_cache()  # that address is gone


@pytest.fixture
def silent(s3_keys, monkeypatch):
    """Address of something that accepts connections and never says a word."""
    with socket.create_server(("127.0.0.1", 0)) as server:
        address = f"127.0.0.1:{server.getsockname()[1]}"
        monkeypatch.setenv("AWS_ENDPOINT_URL", f"http://{address}")
        monkeypatch.setattr(store, "PATIENCE", 0.5)
        yield address


def refused(action, *arguments):
    with pytest.raises(StoreError) as told:
        action(*arguments)
    assert "\n" not in str(told.value)
    return str(told.value)


@pytest.mark.parametrize(
    ("url", "said"),
    [
        ("reference://x", "reference://x: cannot be read: no folder can be told by a URL of this kind"),
        ("generic://x", "generic://x: cannot be read: no folder can be told by a URL of this kind"),
        ("jlab://x", "no folder can be told"),
        ("dbfs://x", "no folder can be told"),
        ("data://x", "no folder can be told"),
        ("zip:///recordings.zip", "zip:///recordings.zip: archives and chained URLs are not read: unpack it"),
        ("simplecache::zip://x", "archives and chained URLs"),
        ("http://127.0.0.1:1/x", "http://127.0.0.1:1/x: cannot be read: Connection refused"),
        ("ftp://127.0.0.1:1/x", "ftp://127.0.0.1:1/x: cannot be read: Connection refused"),
    ],
)
def test_a_folder_that_cannot_be_read_is_a_line_with_its_url(url, said):
    assert said in refused(find_bags, url)


def test_an_output_that_does_not_answer_is_a_line(s3_keys, monkeypatch):
    monkeypatch.setenv("AWS_ENDPOINT_URL", "http://127.0.0.1:1")
    assert refused(Store("s3://x/y").names, "work").startswith("s3://x/y: cannot be read: Could not connect")


@pytest.mark.parametrize("url", ["http://{}/x", "ftp://{}/x", "s3://x/y"])
def test_a_store_that_is_silent_is_given_up(silent, url):
    assert "cannot be read: " in refused(find_bags, url.format(silent))
    assert refused(lambda: at_hand(url.format(silent)).__enter__())


def test_a_scheduler_that_is_silent_or_wants_certificates_is_a_line(silent):
    for url, said in (
        (f"tcp://{silent}", "no answer .it says nothing"),
        ("tls://127.0.0.1:1", "no answer .TLS expects"),
    ):
        with pytest.raises(EngineError, match=f"--scheduler {url}: {said}"):
            workers(url, 1, patience=0.5).__enter__()


def test_blanks_in_a_table_of_machines_do_not_count(tmp_path):
    path = tmp_path / "table.csv"
    path.write_text(" machine , file \n north ,  own.yaml \n\nsouth, tz17\n")
    assert machine_table(str(path)) == {"north": f"{tmp_path}/own.yaml", "south": "tz17"}


@pytest.mark.parametrize(
    ("rows", "said"),
    [
        ("north", "line 2: the file is missing"),
        (",tz17", "line 2: the machine is missing"),
        ("north,tz17\nnorth,tz17", "line 3: machine north has a line already"),
        ("north,tz71", "line 2: tz71: no such machine; shipped are "),
        ("north," + "x" * 140000, "line 2: not a table of machines: field larger than field limit"),
    ],
)
def test_a_faulty_table_of_machines_is_a_line_before_any_work(tmp_path, rows, said):
    path = tmp_path / "table.csv"
    path.write_text(f"machine,file\n{rows}\n")
    assert refused(machine_table, str(path)).startswith(f"{path}, {said}")
