"""What a worker does with a recording: the verdict of the diagnosis becomes columns, a fault becomes a line."""

import errno
from dataclasses import replace
from pathlib import Path

import fsspec
import pytest

from boom_fleet import store
from boom_fleet.run import verdict_columns
from boom_fleet.store import Store, StoreError, find_bags
from boom_fleet.tasks import AttemptError, Task, diagnose_one, screen_one
from boom_recording import writing
from boom_recording.loading import load
from boom_recording.recording import part

ROOT = Path(__file__).resolve().parents[3]


def task(folder, **machine):
    place = folder / "crane" / "short"
    place.parent.mkdir(parents=True)
    writing.write(place, part(load(ROOT / "bags/healthy/extended"), 0.0, 5.5))
    (bag,) = find_bags(str(folder))
    return Task(bag, **machine)


def test_the_verdict_of_a_recording_becomes_columns_of_the_table(tmp_path):
    columns = verdict_columns(*diagnose_one(task(tmp_path)))

    assert columns["verdict"] == "not_enough_excitation"
    assert columns["next_experiment"] and columns["diagnosis_failure"] == "" and columns["diagnosis_processor_s"] > 0


def test_a_finding_becomes_effect_size_interval_and_alternatives():
    size = {"value": 0.09, "unit": "s", "interval_90": [0.08, 0.1]}
    finding = {"effect": "hose_burst_valve_lag", "subsystem": "hose_burst_valve", "confidence": 0.97, "parameters": {"tau": size},
               "alternatives": [{"effect": "pilot_lag", "confidence": 0.02}], "evidence": "it lags"}  # fmt: skip
    columns = verdict_columns({"verdict": "identified", "findings": [finding]}, "", 20.0)

    assert (columns["effect"], columns["parameter"], columns["size"]) == ("hose_burst_valve_lag", "tau", 0.09)
    assert (columns["size_low"], columns["size_high"], columns["unit"]) == (0.08, 0.1, "s")
    assert columns["alternatives"] == [{"effect": "pilot_lag", "confidence": 0.02}]


def test_a_machine_file_that_does_not_fit_is_a_line_and_no_end_of_the_night(tmp_path):
    screened = screen_one(task(tmp_path, text=b"meta: {name: none}\n", file="s3://cranes/crane/machine.yaml"), None)

    assert screened.matrix is None
    failure = screened.columns["failure"]
    assert failure.startswith("s3://cranes/crane/machine.yaml") and "\n" not in failure
    assert "boom-fleet-" not in failure, "the name of a copy tells the user nothing"


def test_a_machine_that_a_recording_names_is_never_opened_as_a_path(tmp_path, monkeypatch):
    recording = part(load(ROOT / "bags/healthy/extended"), 0.0, 5.5)
    named = replace(recording, stored_configuration=replace(recording.configuration, machine="evil.yaml"))
    (tmp_path / "crane").mkdir()
    writing.write(tmp_path / "crane/short", named)
    (tmp_path / "evil.yaml").write_bytes((ROOT / "src/boom_model/boom_model/machines/tz17.yaml").read_bytes())
    monkeypatch.chdir(tmp_path)
    (bag,) = find_bags(str(tmp_path / "crane"))
    assert "'evil.yaml' is not shipped" in screen_one(Task(bag), None).columns["failure"]


def test_bags_below_the_folder_of_the_results_are_no_recordings_of_the_fleet(tmp_path):
    for place in ("crane/day", "results/crane/next_experiment"):
        (tmp_path / place).mkdir(parents=True)
        (tmp_path / place / "bag.mcap").write_bytes(b"\x89MCAP0\r\n")
    assert [bag.recording for bag in find_bags(str(tmp_path), str(tmp_path / "results"))] == ["day"]
    assert len(find_bags(str(tmp_path), str(tmp_path / "elsewhere"))) == 2
    assert len(find_bags(str(tmp_path / "crane"), str(tmp_path))) == 1  # results beside the recordings


def test_a_fault_of_a_bag_in_a_store_names_its_url_and_not_the_copy(tmp_path):
    fsspec.filesystem("memory").pipe_file("/fleet/crane/cut.mcap", b"\x89MCAP0\r\n")
    (bag,) = find_bags("memory://fleet")
    failure = screen_one(Task(bag), None).columns["failure"]
    assert failure.startswith("memory://") and "boom-fleet-" not in failure


def test_a_full_disk_is_a_plain_line_that_says_that_the_same_command_resumes(tmp_path, monkeypatch):
    def full(path, _):
        raise OSError(errno.ENOSPC, "No space left on device", str(path))

    monkeypatch.setattr(store, "write_whole", full)
    with pytest.raises(StoreError) as raised:
        Store(str(tmp_path)).write("kept/x", b"x")
    said = str(raised.value)
    assert said.startswith(f"{tmp_path}/kept/x: cannot be written: No space left on device") and "Errno" not in said
    assert "the same command again to resume" in said


def test_a_bag_that_a_store_does_not_hand_out_is_not_a_fault_of_the_bag(tmp_path):
    fsspec.filesystem("memory").pipe_file("/gone/crane/day.mcap", b"\x89MCAP0\r\n")
    (bag,) = find_bags("memory://gone")
    fsspec.filesystem("memory").rm("/gone", recursive=True)
    with pytest.raises(AttemptError, match=r"^memory:///gone/crane: cannot be fetched: there is no such file$"):
        screen_one(Task(bag), None)
