"""The reference trajectories of the robustness test: recorded, drawn afresh, or held.

A name is that of a recording in a folder of bags, or one of

- ``fresh/POSE/N``: number N of the trajectories drawn in the pose of these recordings. Their numbers come from the recordings
  of the pose alone: angles between their least and largest, rates between nothing and their fastest, a way and a rest at a time.
- ``hold/POSE/ANGLE``: at rest at the angle [rad] in the pose, for ``HELD`` seconds.
"""

from __future__ import annotations

import zlib
from functools import lru_cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from boom_controller.references.trajectory_generator import TrajectoryGenerator
from boom_controller.types import Reference
from boom_recording.loading import load
from boom_trials.robustness.plants import TRAJECTORIES

Array = NDArray[np.float64]
PoseKey = tuple[float, float, float]
"""(q_3 [rad], q_4 [m], load [kg]) of the configuration."""

FRESH, HOLD = "fresh", "hold"
DURATION, HELD = 60.0, 5.0
"""s of a drawn trajectory, as long as those recorded; s of a held angle."""
LONGEST_REST = 5.0
"""s between two ways of a drawn trajectory."""
SMOOTHED = 0.2
"""s over which the rate of a recorded angle is taken, which is quantised."""


def fresh(seed: int, each: int = 3) -> tuple[str, ...]:
    """Names of the trajectories that a seed draws, ``each`` in each pose."""
    return tuple(f"{FRESH}/{pose}/{each * seed + k}" for pose in TRAJECTORIES for k in range(each))


def pose_of(bag: str) -> str:
    """The pose of a trajectory: a key of ``TRAJECTORIES``."""
    kind, _, rest = bag.partition("/")
    if kind in (FRESH, HOLD):
        return rest.split("/")[0]
    return next(pose for pose, bags in TRAJECTORIES.items() if bag in bags)


@lru_cache(maxsize=64)
def references_of(folder: str, bag: str, period: float, pole: float) -> tuple[list[Reference], PoseKey]:
    """Smooth references of a trajectory, one a ``period`` [s], and (q_3, q_4, load) of its configuration.

    Raises:
        RecordingError: a bag is missing or cannot be read.
    """
    wanted, pose = _wanted(folder, bag, period)
    generator = TrajectoryGenerator(pole, period)
    return [generator.reset(wanted[0]), *(generator.step(value) for value in wanted[:-1])], pose


def _wanted(folder: str, bag: str, period: float) -> tuple[list[float], PoseKey]:
    kind, _, rest = bag.partition("/")
    if kind not in (FRESH, HOLD):
        angle, pose = _recorded(folder, bag, period)
        return angle.tolist(), pose
    name, value = rest.split("/")
    recorded = [_recorded(folder, other, period) for other in TRAJECTORIES[name]]
    pose = recorded[0][1]
    if kind == HOLD:
        return [float(value)] * round(HELD / period), pose
    return _drawn([angle for angle, _ in recorded], np.random.default_rng(zlib.crc32(bag.encode())), period), pose


@lru_cache(maxsize=16)
def _recorded(folder: str, bag: str, period: float) -> tuple[Array, PoseKey]:
    recording = load(Path(folder) / bag)
    angle = recording.signals["angle"]
    grid = np.arange(int(recording.duration / period) + 1) * period
    c = recording.configuration
    wanted: Array = np.interp(grid, angle.time[angle.valid], angle.values[angle.valid])
    return wanted, (c.outer_boom_angle, c.telescope_length, c.load_mass)


def _drawn(recorded: list[Array], rng: np.random.Generator, period: float) -> list[float]:
    """Straight ways between drawn angles, each at its own rate, with rests: (n,) [rad]."""
    low, high = min(a.min() for a in recorded), max(a.max() for a in recorded)
    apart = round(SMOOTHED / period)
    fastest = max(float(np.abs(a[apart:] - a[:-apart]).max()) / SMOOTHED for a in recorded)
    time, angle = [0.0], [float(rng.uniform(low, high))]
    while time[-1] < DURATION:
        there = float(rng.uniform(low, high))
        rate = fastest * float(rng.uniform(0.1, 1.0))
        reached = time[-1] + abs(there - angle[-1]) / rate
        time += [reached, reached + float(rng.uniform(0.0, LONGEST_REST))]
        angle += [there, there]
    found: list[float] = np.interp(np.arange(int(DURATION / period) + 1) * period, time, angle).tolist()
    return found
