"""Recordings of this plant at work with all joints: the operator also swings the outer boom, telescopes and slews.

A joint moves over d in the time T with the velocity d/T (1 - cos(2 pi t/T)). Its sensors are those of the boom: angles quantised
alike, rates with noise; the telescope's length in millimetres and without a rate.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from boom_input.channels import BY_NAME
from boom_recording.recording import Configuration, Recording
from concealed_plant.machine import BoomLinkage, MachineFile, Posture, linkage, quantities
from concealed_plant.moving_body import JointCourses
from concealed_plant.operator import Operator
from concealed_plant.plant import Courses, InitialValues, RunError, per_millisecond, run
from concealed_plant.quantities import Quantities
from concealed_plant.sensing import ANGLE_QUANTUM, RATE_SIGMA, Bus, record

Array = NDArray[np.float64]

REACH = {"outer_boom": (0.5, 0.25), "telescope": (0.9, 0.45), "slewing": (1.2, 0.45)}
"""How far from where it is configured a joint goes, and its peak velocity [rad, rad/s; m, m/s]."""
LENGTH_QUANTUM = 1e-3
ATTEMPTS = 20


def joint_courses(pose: Posture, duration: float, rng: np.random.Generator) -> JointCourses:
    """Where the joints are in each millisecond of a recording of ``duration`` [s]; they rest for the first 1.5 s."""
    n = round(duration * 1000)
    middle = {"outer_boom": pose.outer_boom_angle, "telescope": pose.telescope_length, "slewing": 0.0}
    return JointCourses(**{name: _course(n, middle[name], *REACH[name], rng) for name in REACH})


def _course(n: int, middle: float, reach: float, fastest: float, rng: np.random.Generator) -> Array:
    time = np.arange(n) / 1000.0
    course, place, at = np.full(n, middle), middle, 1.5 + rng.uniform(0.0, 2.0)
    while at < time[-1] - 1.0:
        goal = middle + reach * rng.uniform(-1.0, 1.0)
        lasts = max(2.0 * abs(goal - place) / fastest, 0.8)
        s = np.clip((time - at) / lasts, 0.0, 1.0)
        course += (goal - place) * (s - np.sin(2.0 * np.pi * s) / (2.0 * np.pi))
        at, place = at + lasts + rng.uniform(0.0, 2.5), goal
    return course


def work_recording(
    name: str, file: MachineFile, pose: Posture, changes: Mapping[str, float], seed: int, duration: float = 60.0, *,
    moving: bool = True,
) -> Recording:  # fmt: skip
    """A recording [``duration`` in s] of a crane whose numbers are the file's, but for the hidden ``changes`` of ``Quantities``.

    moving: the other joints, too; else they rest, and are not recorded.

    The configuration in it tells the pose at rest and the load of ``pose``. The same seed gives the same recording.

    Raises:
        RunError: the crane left its range, however it was driven.
    """
    for attempt in range(ATTEMPTS):
        try:
            return _driven(name, file, pose, changes, np.random.default_rng([seed, attempt]), duration, moving)
        except RunError as error:
            reason = error
    raise reason


def _driven(
    name: str, file: MachineFile, pose: Posture, changes: Mapping[str, float], rng: np.random.Generator, duration: float,
    moving: bool,
) -> Recording:  # fmt: skip
    told = quantities(file, pose)
    table: BoomLinkage = linkage(file)
    joints = joint_courses(pose, duration, rng) if moving else None
    start = InitialValues(float(rng.uniform(0.3, 0.6)))
    m: Quantities = told._replace(**dict(changes))
    currents, _ = Operator(m, table, rng, Courses(joints=joints)).drive(duration, start.angle)
    done = run(m, table, start, per_millisecond(currents), Courses(joints=joints))
    configuration = Configuration(file.name, pose.outer_boom_angle, pose.telescope_length, pose.load)
    result = record(name, done.outputs, per_millisecond(currents), configuration, Bus(), rng)
    return _with_joints(result, joints, rng) if joints else result


def _with_joints(recording: Recording, joints: JointCourses, rng: np.random.Generator) -> Recording:
    """The recording with what the other joints' sensors show, in the messages of the boom's own angle."""
    beside = recording.signals["angle"]
    grid = np.arange(1, len(joints.slewing) + 1) / 1000.0
    for joint, quantum in (("outer_boom", ANGLE_QUANTUM), ("telescope", LENGTH_QUANTUM), ("slewing", ANGLE_QUANTUM)):
        course = getattr(joints, joint)
        true, rate = (np.interp(beside.time, grid, values) for values in (course, np.gradient(course, 1e-3)))
        shown = {f"{joint}_{'length' if joint == 'telescope' else 'angle'}": np.round(true / quantum) * quantum}
        if joint != "telescope":
            shown[f"{joint}_rate"] = rate + RATE_SIGMA * rng.standard_normal(len(rate))
        for name, values in shown.items():
            recording.signals[name] = replace(beside, name=name, unit=BY_NAME[name].unit, values=values)
    return recording
