"""Work cycles in which outer boom, telescope and slewing move: the model against the concealed plant, and by its own simulation."""

from __future__ import annotations

import json
import subprocess
import sys
from dataclasses import replace
from importlib.resources import files
from pathlib import Path

import numpy as np
import pytest

from boom_bringup import cli
from boom_diagnosis.bag_samples import prepare
from boom_diagnosis.hypotheses import problem_at
from boom_diagnosis.nuisances import tolerances
from boom_estimation.free_run import plant_for, predict
from boom_input.channels import JOINTS
from boom_model.machine_file import load_machine
from boom_model.sensors import OUTPUTS, SensorNoise
from boom_recording import writing
from boom_recording.joint_motion import joint_motion, moving_joints, smoothed
from boom_recording.loading import load
from boom_recording.recording import Recording
from concealed_plant.joint_work import joint_courses, work_recording
from concealed_plant.machine import MachineFile, Posture

BAGS = Path(__file__).parents[1] / "bags"
POSE = Posture(0.6, 1.5, 0.0)
HIDDEN = 220.0
SEED = 2
"""Of a crane that stays in range at the first attempt."""


def recorded(changes: dict[str, float], seed: int) -> Recording:
    machine = MachineFile.read(str(files("boom_model").joinpath("machines", "tz17.yaml")))
    return work_recording("work", machine, POSE, changes, seed, duration=14.0)


@pytest.fixture(scope="module")
def healthy() -> Recording:
    return recorded({}, SEED)


def locked(recording: Recording) -> Recording:
    """The same as a recorder would have it that knows of no other joint."""
    own = {joint.name for joint in JOINTS}
    return replace(recording, signals={name: s for name, s in recording.signals.items() if name not in own})


def test_free_run_of_a_work_cycle_is_the_concealed_plant_within_1_mrad_and_half_a_bar(healthy: Recording) -> None:
    errors = predict(healthy, load_machine("tz17"), "full").metrics
    assert errors["angle_mae_rad"] < 1e-3
    noise = SensorNoise()
    floor = np.hypot(noise.pressure_sigma, noise.pressure_quantum / np.sqrt(12))
    for pressure in ("hose_pressure_rmse_pa", "rod_pressure_rmse_pa"):
        assert np.sqrt(errors[pressure] ** 2 - floor**2) < 0.5e5
    as_if_locked = predict(locked(healthy), load_machine("tz17"), "full").metrics
    assert as_if_locked["hose_pressure_rmse_pa"] > 1e5


def test_a_bag_tells_the_joints_by_the_names_that_are_given(healthy: Recording, tmp_path: Path) -> None:
    writing.write(tmp_path / "work", healthy)
    known = load(tmp_path / "work")
    assert {joint.name for joint in JOINTS} - set(known.signals) == {"telescope_rate"}
    assert moving_joints(known) == moving_joints(healthy)
    assert moving_joints(known).startswith("outer boom 0.")
    others = load(tmp_path / "work", joints=dict.fromkeys(("outer_boom", "telescope", "slewing"), "x"))
    assert joint_motion(others) is None


def test_joints_that_stand_still_change_no_digit() -> None:
    plain = load(BAGS / "healthy" / "folded_fast")
    beside = plain.signals["angle"]
    rng = np.random.default_rng(0)
    places = {"outer_boom_angle": 4.59}  # as configured; the others at zero
    standing = {
        joint.name: replace(beside, name=joint.name, values=np.full(len(beside.time), places.get(joint.name, 0.0)))
        for joint in JOINTS
    }
    noisy = standing["outer_boom_rate"]
    standing["outer_boom_rate"] = replace(noisy, values=1.5e-3 * rng.standard_normal(len(noisy.time)))
    with_joints = replace(plain, signals=plain.signals | standing)
    one, other = (predict(recording, load_machine("tz17"), "full").values for recording in (plain, with_joints))
    for name in OUTPUTS:
        np.testing.assert_array_equal(one[name], other[name])


def test_smoothing_tells_velocity_and_acceleration_of_a_joint(healthy: Recording) -> None:
    """The courses are those that the plant was given: the same seed, drawn first."""
    true = joint_courses(POSE, 14.0, np.random.default_rng([SEED, 0]))
    time = np.arange(0.0, 13.9, 0.01)
    grid = np.arange(1, len(true.slewing) + 1) / 1000.0
    for joint, limits in (("outer_boom", (2e-4, 5e-3, 0.1)), ("telescope", (4e-4, 1e-2, 0.2))):
        kind = "length" if joint == "telescope" else "angle"
        found = smoothed(time, healthy.signals[f"{joint}_{kind}"], healthy.signals.get(f"{joint}_rate"))
        course = getattr(true, joint)
        for k, limit in enumerate(limits):
            error = found[k][20:-20] - np.interp(time[20:-20], grid, course)
            assert np.sqrt(np.mean(error**2)) < limit, (joint, k)
            course = np.gradient(course, 1e-3)


def test_the_observer_of_a_diagnosis_needs_a_hidden_load_only_and_only_where_joints_move() -> None:
    machine, recording = load_machine("tz17"), recorded({"extra_load": HIDDEN}, 1)
    known = tolerances(machine, plant_for(recording, machine, "full").pose)[:1]
    losses = {}
    for name, bag in (("moving", prepare(recording, machine)), ("locked", prepare(locked(recording), machine))):
        assert bag is not None
        problem = problem_at(machine, [bag], [bag.counted], known, np.zeros(1), {}, 1.0)
        masses = ({}, {"effects.payload.mass": HIDDEN})
        losses[name] = [
            point.loss / int(point.used.sum()) for point in problem.points([(np.zeros(1), m) for m in masses])
        ]
    without, right = losses["moving"]
    assert right < 1.5 < without
    assert min(losses["locked"]) > 2.0 * right


def test_a_simulated_work_cycle_validates_at_noise_level(tmp_path: Path) -> None:
    words = ["simulate", str(BAGS / "healthy" / "extended"), "--output", "made", "--work-cycle", "--duration", "12"]
    command = [sys.executable, "-m", "boom_bringup.cli", *words]
    made = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False, timeout=60)
    assert made.returncode == 0, made.stderr
    assert "telescope_length" in made.stdout
    told = tmp_path / "told.json"
    assert cli.main(["validate", str(tmp_path / "made"), "--no-report", "--json", str(told)]) == 0
    errors = json.loads(told.read_text())["bags"][0]["full"]
    assert errors["angle_mae_rad"] < 1e-3
    assert errors["hose_pressure_rmse_pa"] < 0.25e5


def test_a_machine_without_bodies_refuses_in_one_line(
    healthy: Recording, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    writing.write(tmp_path / "work", healthy)
    document = load_machine("tz17").document
    del document["rigid_body"]["planar"]
    document["rigid_body"]["configs"]["here"] = {
        **document["rigid_body"]["configs"]["T3_extended"],
        "q3": 0.6,
        "q4": 1.5,
    }
    (tmp_path / "bare.yaml").write_text(json.dumps(document))
    status = cli.main(["validate", str(tmp_path / "work"), "--no-report", "--machine", str(tmp_path / "bare.yaml")])
    assert status == 2
    assert "add rigid_body.planar to the machine file" in capsys.readouterr().err
