"""What is kept in work/ and what is done anew; the order of recordings of equal time."""

import json

import numpy as np
import pytest

import boom_fleet.run
from boom_fleet import table
from boom_fleet.run import FleetRun, Night
from boom_fleet.store import FoundBag, Store
from boom_fleet.tasks import NO_REFERENCE, MachineReference, Screened, Task, diagnose_one, screen_one, take_reference
from boom_recording.writing import START_NS

ANSWERS = {
    take_reference: (MachineReference(("a",), np.zeros(1), "one"), ""),
    screen_one: Screened({"failure": "it holds no messages", "time_ns": 10**18}),
    diagnose_one: ({"verdict": "identified"}, "", 1.0),
}


class FakeEngine:
    """Answers every call at once; where it has no answer the worker has died."""

    def __init__(self, answers):
        self.answers, self.called = answers, []

    def each(self, function, cases, arguments, done, failed=None):
        self.called += [function] * len(cases)
        for case in cases:
            if function in self.answers:
                done(case, self.answers[function])
            else:
                failed(case, "its worker process ended")


def tasks(*recordings):
    return [Task(FoundBag(f"bags/m/{name}", "m", name, f"key of {name}", ""), shipped="tz17") for name in recordings]


def run(folder, answers, *recordings):
    engine = FakeEngine(answers)
    return Night(tasks(*recordings), Store(str(folder)), engine, lambda *_: None, 0.05).run(), engine


def failures(result):
    return [columns.get("failure", "") for columns in result.columns.values()]


def test_a_worker_that_died_is_told_and_its_recording_is_done_at_the_next_start(tmp_path):
    died, _ = run(tmp_path, {}, "one")
    assert failures(died) == ["its worker process ended"] and not list(tmp_path.rglob("*.npz"))

    again, _ = run(tmp_path, ANSWERS, "one")
    assert failures(again) == ["it holds no messages"]
    kept, engine = run(tmp_path, {}, "one")
    assert failures(kept) == ["it holds no messages"] and engine.called == []


def test_a_recording_without_a_reference_is_done_again_when_there_may_be_one(tmp_path):
    refused = Screened({"failure": "", "refused": NO_REFERENCE})
    run(tmp_path, {screen_one: refused}, "one")
    _, engine = run(tmp_path, ANSWERS, "one")
    assert engine.called == [take_reference, screen_one]


@pytest.mark.parametrize(
    "damage", [lambda data: b"", lambda data: data[: len(data) // 2], lambda data: b"<html>busy</html>"]
)
def test_damaged_work_is_done_anew(tmp_path, damage):
    night = Night(tasks("one"), Store(str(tmp_path)), FakeEngine(ANSWERS), lambda *_: None, 0.05)
    night.run()
    (key,) = night.run().tasks
    assert night._verdicts([key])[key]["verdict"] == "identified"
    files = {path: path.read_bytes() for path in (tmp_path / "work").iterdir()}
    assert len(files) == 3
    for path, data in files.items():
        path.write_bytes(damage(data))

    engine = FakeEngine(ANSWERS)
    night = Night(tasks("one"), Store(str(tmp_path)), engine, lambda *_: None, 0.05)
    night.run()
    night._verdicts([key])

    assert engine.called == [take_reference, screen_one, diagnose_one]
    assert json.loads((tmp_path / f"work/verdict-{key}.json").read_text())[0] == {"verdict": "identified"}


def test_recordings_of_equal_time_are_in_the_order_of_their_names_and_the_table_says_so(tmp_path):
    names = [f"day_{k}" for k in range(6)]
    result, _ = run(tmp_path, ANSWERS, *reversed(names))
    rows = table.rows(result)
    assert [row["recording"] for row in rows] == names
    assert all(row["warnings"] == [table.EQUAL_TIME] for row in rows)


def test_a_recording_whose_file_had_no_date_says_that_its_place_is_a_guess(tmp_path):
    """A log with times of day begins within the fixed day of bags that no clock was running for."""
    times = {"of_1970": 3 * 10**9, "of_a_morning": START_NS + 28_000 * 10**9, "of_next_year": START_NS + 3 * 10**16}
    tasks = {name: Task(FoundBag(f"bags/{name}", "one", name, name, "")) for name in times}
    columns = {name: {"time_ns": time} for name, time in times.items()}
    warned = {row["recording"]: row.get("warnings", []) for row in table.rows(FleetRun(tasks, columns, {}, {}))}
    assert warned == {"of_1970": [], "of_a_morning": [table.NO_DATE], "of_next_year": []}


@pytest.mark.parametrize("machine", ["_north", ".north", "a/b", "n" * 255, "Kran ä 7", "50%", "*", "\udcff"])
def test_the_file_of_every_machine_is_read_by_every_reader(tmp_path, machine):
    from pyarrow import dataset

    bag = FoundBag("bags/x", machine, "x", "key", "")
    table.write(Store(str(tmp_path)), table.rows(FleetRun({"k": Task(bag)}, {"k": {}}, {}, {})))
    assert dataset.dataset(tmp_path / "recordings").count_rows() == 1
    assert table.file_of(machine).isascii() and table.file_of(machine) != table.file_of(machine + "-")
    assert table.file_of("north") == "recordings/north.parquet"


class EachItsOwn(FakeEngine):
    """Screens every recording to the answer of its own name."""

    def each(self, function, cases, arguments, done, failed=None):
        for case in cases:
            task = arguments(case)[0]
            done(case, self.answers[task.bag.recording] if function is screen_one else self.answers[function])


def screened(model, size, at):
    columns = {"time_ns": 10**18 + at * 10**15, "model": model, "pose": [0.28, 2.2, 0.0], "warnings": []}
    return Screened(columns, ("fluid.beta",), np.eye(1), np.array([size]))


def test_a_copy_counts_once_and_a_recording_of_another_machine_not_at_all(tmp_path, monkeypatch):
    compared = []
    monkeypatch.setattr(boom_fleet.run, "judge", lambda fleet, *_: compared.extend(fleet["m"]) or {})
    answers = ANSWERS | {
        "a": screened("tz17", 1.0, 0), "b": screened("tz17", 2.0, 1), "c": screened("tz17", 2.0, 1),
        "d": screened("loader_crane", 2.0, 2),
    }  # fmt: skip
    night = Night(tasks("a", "b", "c", "d"), Store(str(tmp_path)), EachItsOwn(answers), lambda *_: None, 0.05, False)
    rows = {row["recording"]: row for row in table.rows(night.run())}
    assert [kept.key for kept in compared] == [rows[name]["key"] for name in ("a", "b")]
    assert rows["c"]["refused"] == "is the same recording as b, and would count twice: take one of them away"
    assert rows["d"]["refused"].startswith("is of a loader_crane, a beside it of a tz17: two machines in one folder")
    assert "refused" not in rows["a"] and "refused" not in rows["b"]
