"""A small blind trial through the command as anybody runs it: above a floor, without an open port, without anything left behind.

Few cases say little about shares: the floor is what a diagnosis that works does not miss in thousands of such trials, one that
is broken does. The shares themselves are in docs/proof.md. The seed is fixed: a fresh one would fail by chance some day.
"""

import json
import os
import select
import signal
import subprocess
import sys
import threading
from pathlib import Path

import pytest

from boom_bringup import cli, environment
from boom_trials.blind.scoring import CONFIDENT

CASES, SEED = 2, 2
MOST_SURE_AND_WRONG = 1
PATIENCE = 900
pytestmark = pytest.mark.process


def begin(folder: Path, *more: str) -> subprocess.Popen[str]:
    words = ["prove", "--seed", str(SEED), "--cases", str(CASES), "--workers", "2", "--output", str(folder), *more]
    command = [sys.executable, "-m", "boom_bringup.cli", *words]
    return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=dict(os.environ))


def below(pid: int) -> list[int]:
    """Process ids of all that a process started, and what these did."""
    found = []
    for task in Path(f"/proc/{pid}/task").glob("*/children"):
        try:
            own = [int(word) for word in task.read_text().split()]
        except OSError:  # it has just ended
            continue
        found += own + [pid for child in own for pid in below(child)]
    return found


def listening(pid: int) -> list[str]:
    """Names of the Unix sockets that a process listens at."""
    try:
        own = {os.readlink(entry.path) for entry in os.scandir(f"/proc/{pid}/fd")}
        rows = [line.split() for line in Path(f"/proc/{pid}/net/unix").read_text().splitlines()[1:]]
    except OSError:
        return []
    return [" ".join(row[7:]) for row in rows if row[3] == "00010000" and f"socket:[{row[6]}]" in own]


def test_a_blind_trial_stays_above_the_floor_opens_no_port_and_keeps_its_folder(tmp_path, capsys):
    score = tmp_path / "score.json"
    process = begin(tmp_path / "trial", "--json", str(score))
    sockets, seen, ended = set(), set(), threading.Event()

    def look():
        while not ended.wait(0.2):
            for pid in (process.pid, *below(process.pid)):
                seen.add(pid)
                sockets.update((*environment.bound_sockets(pid), *listening(pid)))

    looker = threading.Thread(target=look)
    looker.start()
    try:
        first = process.stdout.readline()
        assert cli.main(["prove", "--seed", str(SEED), "--cases", str(CASES), "--output", str(tmp_path / "trial")]) == 2
        refused = capsys.readouterr().err
        out, err = process.communicate(timeout=PATIENCE)
    finally:
        ended.set()
        looker.join()
    assert process.returncode == 0, err[-2000:]
    assert refused.count("\n") == 1 and "trial is in use by another ./boom" in refused
    assert len(seen) >= 2 + CASES, "the workers and their diagnoses were looked at"
    assert sockets == set()
    document = json.loads(score.read_text())
    told = f"repeat it with ./boom prove --seed {document['seed']} --cases {CASES}"
    assert document["sha256"] in (first + out).replace("\n", "")
    assert len(document["cases"]) == CASES
    logs = {p.parent.name: p.read_text()[-300:] for p in (tmp_path / "trial").glob("blind/*/diagnose.log")}
    failed = [logs[c["case"]] for c in document["cases"] if c["said"] == "failed"]
    assert not failed, f"{told}: no answer: {failed}"
    sure = [c for c in document["cases"] if (c["confidence"] or 0.0) >= CONFIDENT and not c["right_first"]]
    assert len(sure) <= MOST_SURE_AND_WRONG, f"{told}: sure and wrong: {sure}"
    worse = [c for c in document["cases"] if c["gap_closed"] is not None and c["gap_closed"] < -0.5]
    assert len(worse) <= 1, f"{told}: its model is worse than the nominal one on a recording it has not seen: {worse}"
    for name in ("proof.md", "report.html"):
        assert str(document["seed"]) in Path(tmp_path / "trial" / name).read_text()


@pytest.mark.parametrize(("number", "status"), [(signal.SIGINT, 130), (signal.SIGKILL, -signal.SIGKILL)])
def test_a_trial_that_is_stopped_leaves_no_process_and_no_lock(tmp_path, number, status):
    process = begin(tmp_path)
    assert process.stdout.readline()
    while len(started := below(process.pid)) < 2:
        assert process.poll() is None
    watched = [os.pidfd_open(pid) for pid in started]
    process.send_signal(number)
    assert process.wait(timeout=30) == status
    for descriptor in watched:  # readable when that process has ended
        assert select.select([descriptor], [], [], 30)[0], "a worker goes on"
        os.close(descriptor)
    process.communicate()
    from boom_input.whole import one_writer

    with one_writer(tmp_path):
        assert json.loads((tmp_path / "state.json").read_text())["seed"] == SEED
