"""`./boom fleet` as a user types it, on short recordings of two machines: files, an s3 store, a dask scheduler started apart."""

from __future__ import annotations

import io
import subprocess
import sys
from contextlib import ExitStack, contextmanager, redirect_stdout
from dataclasses import replace
from pathlib import Path

import pytest

from boom_bringup import cli
from boom_recording import writing
from boom_recording.loading import load
from boom_recording.recording import part

ROOT = Path(__file__).resolve().parents[1]
DAY_NS = 86400 * 10**9


@pytest.fixture(scope="module")
def bags(tmp_path_factory):
    """Two machines of one kind: two recordings, and one with a file that is no bag beside it."""
    folder = tmp_path_factory.mktemp("fleet") / "bags"
    recording = load(ROOT / "bags/healthy/extended")
    for machine, start, day in (("north", 0.0, 0), ("north", 30.0, 30), ("south", 0.0, 0)):
        piece = part(recording, start, start + 6.0)
        moved = day * DAY_NS
        signals = {n: replace(s, stamps_ns=s.stamps_ns + moved) for n, s in piece.signals.items()}
        place = folder / machine / f"day_{day}"
        place.parent.mkdir(parents=True, exist_ok=True)
        writing.write(place, replace(piece, start_ns=piece.start_ns + moved, signals=signals))
    (folder / "south" / "cut.mcap").write_bytes(b"\x89MCAP0\r\n")
    return folder


def fleet(*words):
    """The command in this process, which has imported most of it already: status and what it printed."""
    out = io.StringIO()
    with redirect_stdout(out):
        status = cli.main(["fleet", *map(str, words), "--no-diagnosis", "--workers", "1"])
    return status, out.getvalue()


@pytest.fixture(scope="module")
def output(bags):
    """Results of a whole run; the screen only, for the diagnosis has tests of its own."""
    folder = bags.parent / "results"
    status, said = fleet(bags, "--output", folder, "--publish", folder.with_name("published"))
    assert status == 0
    assert "not screened: south/cut.mcap" in said and "0 changed; 1 recording failed" in said
    return folder


def table(folder):
    import duckdb

    rows = duckdb.sql(f"select * from read_parquet('{folder}/recordings/*.parquet') order by machine, time, recording")
    return rows.to_arrow_table().to_pylist()


def told(rows):
    return [{k: v for k, v in row.items() if k not in ("screen_processor_s", "url", "key")} for row in rows]


def test_duckdb_and_pandas_read_the_table_and_it_holds_every_recording(output):
    import pandas

    rows = table(output)
    assert [(row["machine"], row["recording"]) for row in rows] == [
        ("north", "day_0"), ("north", "day_30"), ("south", "day_0"), ("south", "cut.mcap")
    ]  # fmt: skip
    assert [bool(row["failure"]) for row in rows] == [False, False, False, True]
    assert all(row["unchanged"] > 0.5 and not row["raised"] for row in rows[:3])
    frame = pandas.read_parquet(output / "recordings")
    assert sorted(frame["machine"]) == ["north", "north", "south", "south"]
    assert frame["nats_hose_pressure_standing"].notna().sum() == 3


def test_the_page_and_the_diagnostics_tell_every_machine(output):
    from mcap.reader import make_reader

    page = (output / "report.html").read_text()
    assert "Fleet of 2 machines" in page and "south/cut.mcap" in page
    with next((output.with_name("published")).glob("*.mcap")).open("rb") as file:
        messages = [(channel.topic, message.data) for _, channel, message in make_reader(file).iter_messages()]
    assert {topic for topic, _ in messages} == {"/diagnostics"}
    assert len(messages) == 3 and sum(b"fleet: north" in data for _, data in messages) == 2


def test_a_run_that_lost_some_of_its_work_does_only_that_again_and_comes_to_the_same_table(bags, output):
    before, work = told(table(output)), output / "work"
    lost = min(work.glob("screen-*"), key=lambda path: path.stat().st_size)
    kept = {path: path.stat().st_mtime_ns for path in work.iterdir() if path != lost}
    lost.unlink()
    (output / "recordings" / "north.parquet").unlink()

    assert fleet(bags, "--output", output)[0] == 0

    assert told(table(output)) == before
    assert {path: path.stat().st_mtime_ns for path in work.iterdir() if path != lost} == kept


CLUSTER = """
import sys
from distributed import LocalCluster
options = {"processes": False, "host": "127.0.0.1", "protocol": "tcp", "dashboard_address": "127.0.0.1:0"}
with LocalCluster(1, threads_per_worker=1, **options) as cluster:
    print(cluster.scheduler_address, flush=True)
    sys.stdin.read()
"""


@contextmanager
def scheduler():
    """A dask scheduler with a worker in a process of its own, as whoever runs a cluster has it."""
    command = [sys.executable, "-c", CLUSTER]
    process = subprocess.Popen(
        command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True
    )
    try:
        assert process.stdout is not None
        yield process.stdout.readline().strip()
    finally:
        process.kill()
        process.communicate()


def test_a_cluster_and_an_s3_store_give_the_same_table(bags, output, tmp_path, monkeypatch):
    import fsspec
    from moto.server import ThreadedMotoServer

    server = ThreadedMotoServer(ip_address="127.0.0.1", port=0, verbose=False)
    with ExitStack() as stack:
        server.start()
        stack.callback(server.stop)
        host, port = server.get_host_and_port()
        for name, value in {
            "AWS_ENDPOINT_URL": f"http://{host}:{port}", "AWS_ACCESS_KEY_ID": "test", "AWS_SECRET_ACCESS_KEY": "test",
            "AWS_DEFAULT_REGION": "us-east-1",
        }.items():  # fmt: skip
            monkeypatch.setenv(name, value)
        store = fsspec.filesystem("s3")
        store.mkdir("cranes")
        store.put(str(bags / "south"), "cranes/bags/south", recursive=True)
        address = stack.enter_context(scheduler())

        assert fleet("s3://cranes/bags", "--output", "s3://cranes/results", "--scheduler", address)[0] == 0

        store.get("cranes/results/recordings", str(tmp_path / "results" / "recordings"), recursive=True)
    there, here = table(tmp_path / "results"), table(output)[2:]
    assert [row["recording"] for row in there] == ["day_0", "cut.mcap"]
    assert there[0]["url"] == "s3://cranes/bags/south/day_0" and "it holds no messages" in there[1]["failure"]
    same = [name for name in here[0] if name.startswith("nats_")]
    assert [there[0][name] for name in same] == pytest.approx([here[0][name] for name in same])


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["nowhere", "--output", "{tmp}"], "nowhere: there is no such folder, or it is empty"),
        (["{tmp}", "--output", "odd://x"], "odd://x: "),
        (["{bags}", "--output", "{tmp}/o", "--machines", "README.md"], "not a table of machines"),
        (["{bags}", "--output", "{tmp}/o", "--false-alarms", "0"], "not a positive number"),
        (["{bags}", "--output", "{tmp}/o", "--machine", "nope"], "nope: no such machine"),
        (
            ["{bags}", "--output", "{tmp}/o", "--machines", "{tmp}/table.csv"],
            "table.csv, line 2: nope: no such machine",
        ),
        (
            ["{bags}", "--output", "{tmp}/o", "--publish", "{tmp}/notes.txt/y"],
            "--publish {tmp}/notes.txt/y: there is no folder",
        ),
        (
            ["{bags}", "--output", "{tmp}/o", "--scheduler", "tls://127.0.0.1:1"],
            "--scheduler tls://127.0.0.1:1: no answer",
        ),
        (["{bags}", "--output", "generic://x"], "generic://x: cannot be read"),
        (["{bags}", "--output", "{tmp}/theirs"], "theirs/report.html: is not known to be of `boom fleet`"),
        (["{bags}/north", "--output", "{bags}/../results"], "/bags, which would be lost: give another --output"),
    ],
)
def test_wrong_input_is_one_line_and_status_2(bags, output, tmp_path, words, said, capsys, monkeypatch):
    monkeypatch.chdir(ROOT)
    (tmp_path / "notes.txt").write_text("nothing")
    (tmp_path / "table.csv").write_text("machine,file\nnorth,nope\n")
    (tmp_path / "theirs").mkdir()
    (tmp_path / "theirs" / "report.html").write_text("theirs")
    filled = [word.format(tmp=tmp_path, bags=bags) for word in words]
    if "odd" in said:
        filled[0] = str(bags)
    assert cli.main(["fleet", *filled]) == 2
    error = capsys.readouterr().err
    assert said.format(tmp=tmp_path) in error and error.count("\n") == 1
    assert not (tmp_path / "o").exists(), "refused before any work"
    assert (tmp_path / "theirs" / "report.html").read_text() == "theirs"


def test_the_folder_of_the_recordings_is_no_output(bags, capsys):
    assert cli.main(["fleet", str(bags), "--output", f"{bags}/."]) == 2
    assert "the recordings lie there" in capsys.readouterr().err
