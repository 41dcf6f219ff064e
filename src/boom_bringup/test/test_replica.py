"""What a recording tells of its crane, and what is said where it does not."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from boom_bringup import replica
from boom_recording.loading import load
from boom_recording.recording import Recording

BAGS = Path(__file__).parents[3] / "bags"


@pytest.fixture(scope="module")
def recording() -> Recording:
    return load(BAGS / "healthy" / "extended_log")


def named(recording: Recording, machine: str) -> Recording:
    return replace(recording, stored_configuration=replace(recording.configuration, machine=machine))


def test_the_crane_has_pose_load_and_rest_of_the_recording(recording: Recording) -> None:
    machine, source = replica.machine_of({"bag": recording})
    told = replica.simulation_parameters(recording, "bag", machine, source, 3)
    assert (told["machine"], told["telescope_length"], told["load_mass"], told["seed"]) == ("tz17", 2.8, 300.0, 3)
    first = np.mean(recording.signals["angle"].values[:20])
    assert told["initial_angle"] == pytest.approx(first, abs=2e-3)
    bridge = replica.bridge_parameters(told, machine)
    assert {bridge[name] == told[name] for name in ("outer_boom_angle", "telescope_length", "load_mass")} == {True}


def test_the_urdf_is_that_of_the_machine_or_none(recording: Recording) -> None:
    known, source = replica.machine_of({"bag": recording})
    assert Path(replica.simulation_parameters(recording, "bag", known, source, 0)["robot_description"]).is_file()
    other, source = replica.machine_of({"bag": recording}, "triangle_direct")
    assert replica.simulation_parameters(recording, "bag", other, source, 0)["robot_description"] == ""


@pytest.mark.parametrize(("machine", "told"), [("", "no machine named"), ("tz18", "for which no file is shipped")])
def test_a_recording_without_a_known_machine_asks_for_its_file(recording: Recording, machine: str, told: str) -> None:
    with pytest.raises(replica.ReplicaError, match=told):
        replica.machine_of({"bag": named(recording, machine)})


def test_an_empty_machine_option_is_not_the_default(recording: Recording) -> None:
    with pytest.raises(replica.ReplicaError, match="--machine is empty"):
        replica.machine_of({"bag": recording}, "")


def test_recordings_of_different_machines_are_told_apart(recording: Recording) -> None:
    with pytest.raises(replica.ReplicaError, match="tz17: a, c; other: b: run them separately"):
        replica.machine_of({"a": recording, "b": named(recording, "other"), "c": recording})
