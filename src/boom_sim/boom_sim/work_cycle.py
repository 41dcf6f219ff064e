"""A work cycle of the other joints: outer boom, telescope and slewing move to and fro about the configured pose.

Each joint waits, then moves to a drawn place, in a polynomial of degree five: velocity and acceleration are zero at both ends,

    q = q_0 + d (10 s^3 - 15 s^4 + 6 s^5),   s = t / T,   T = 1.875 d / v  at the peak velocity v

Not from a crane: ranges and velocities are those of a forester at work (about half of what the joints can do).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from boom_input.channels import JOINT_NAMES
from boom_model.rigid_body import entry, group, vector
from boom_model.sensors import SensorNoise
from boom_recording.joint_motion import PERIOD, JointMotion
from boom_recording.recording import Configuration

Array = NDArray[np.float64]

BEGINS = 1.5
"""s of rest, in which the boom's own rest is measured."""
SHORTEST = 1.0
"""s of a motion."""


@dataclass(frozen=True)
class _Range:
    """How far from the configured place a joint goes, its peak velocity, and its longest pause [s]; rad or m."""

    reach: float
    velocity: float
    pause: float


_RANGES = {
    "outer_boom": _Range(0.6, 0.2, 2.0),
    "telescope": _Range(1.0, 0.4, 3.0),
    "slewing": _Range(1.5, 0.4, 2.0),
}


def work_cycle(
    rigid_body: Mapping[str, Any], configuration: Configuration, duration: float, seed: int, joints: tuple[str, ...]
) -> JointMotion:
    """Motion of ``joints`` (keys of ``JOINT_NAMES``) over ``duration`` [s], within the machine's joint limits."""
    time = np.asarray(np.arange(np.ceil(duration / PERIOD) + 1) * PERIOD, np.float64)
    parts = np.zeros((3, len(time), len(JOINT_NAMES)))
    parts[0, :, 0], parts[0, :, 1] = configuration.outer_boom_angle, configuration.telescope_length
    limits = _limits(rigid_body)
    for k, name in enumerate(JOINT_NAMES):
        if name in joints:
            rng = np.random.default_rng([seed, k])
            parts[:, :, k] = _course(time, float(parts[0, 0, k]), limits[name], _RANGES[name], rng)
    return JointMotion(time, *parts)


def _limits(rigid_body: Mapping[str, Any]) -> dict[str, tuple[float, float]]:
    limits = group(rigid_body, "rigid_body", "joint_limits") if "joint_limits" in rigid_body else {}
    found = dict.fromkeys(JOINT_NAMES, (-np.inf, np.inf))
    for name, key, scale in (("outer_boom", "q3", 1.0), ("telescope", "q4_per_stage", 2.0), ("slewing", "q1", 1.0)):
        if key in limits:
            low, high = scale * vector(
                entry(limits, "rigid_body.joint_limits", key), f"rigid_body.joint_limits.{key}", 2
            )
            found[name] = (float(low), float(high))
    return found


def _course(time: Array, start: float, limits: tuple[float, float], range_: _Range, rng: np.random.Generator) -> Array:
    """Position, velocity, acceleration (3, n)."""
    low, high = max(limits[0], start - range_.reach), min(limits[1], start + range_.reach)
    course = np.zeros((3, len(time)))
    course[0], at, place = start, BEGINS + float(rng.uniform(0.0, range_.pause)), start
    while at < time[-1] - SHORTEST:
        target = float(rng.uniform(low, high))
        way = target - place
        length = max(1.875 * abs(way) / range_.velocity, SHORTEST)
        s = np.clip((time - at) / length, 0.0, 1.0)
        course[0] += way * s**3 * (10 - 15 * s + 6 * s**2)
        course[1] += way * 30 * s**2 * (1 - s) ** 2 / length
        course[2] += way * 60 * s * (1 - s) * (1 - 2 * s) / length**2
        at, place = at + length + float(rng.uniform(0.0, range_.pause)), target
    return course


def measured(motion: JointMotion, time: Array, noise: SensorNoise, rng: np.random.Generator) -> dict[str, Array]:
    """What sensors show of the joints at times (n,) [s], by channel: all quantised, rates of the angles alone, with noise."""
    position, velocity, _ = motion.at(time)
    columns = {}
    for k, (name, quantum, gyro) in enumerate((
        ("outer_boom", noise.angle_quantum, True), ("telescope", noise.length_quantum, False),
        ("slewing", noise.angle_quantum, True),
    )):  # fmt: skip
        kind = "length" if name == "telescope" else "angle"
        value = position[:, k]
        columns[f"{name}_{kind}"] = np.round(value / quantum) * quantum if quantum > 0.0 else value
        if gyro:
            columns[f"{name}_rate"] = velocity[:, k] + noise.rate_sigma * rng.standard_normal(len(time))
    return columns
