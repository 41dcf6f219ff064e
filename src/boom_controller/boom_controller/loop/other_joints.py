"""The joints that the control laws take as locked: whether they stand where the configuration says.

Outer boom and telescope change inertia and weight. A law has those of the configured pose, and its load observer makes up for the
weight; it does not use the joints' motion. So it is said where they differ by more than the numbers of a machine file may.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import hypot, isfinite

from boom_model.errors import ModelError
from boom_model.machine import Machine, Pose
from boom_model.tolerance import TOLERANCES

OUTER, TELESCOPE = "outer_boom_joint", "telescope_joint"


class OtherJoints:
    """Newest positions of the joints of /joint_states; ``warn`` gets a sentence when they are no longer where they should be."""

    def __init__(self, warn: Callable[[str], object]) -> None:
        self._warn, self._said = warn, False
        self._newest: tuple[Sequence[str], Sequence[float]] = (), ()

    def take(self, names: Sequence[str], positions: Sequence[float]) -> None:
        """Names and positions [rad, m] of a message; cheap, for every sample."""
        if len(names) > 1:
            self._newest = names, positions

    def moved(self, configuration: tuple[Machine, Pose] | None) -> str:
        """A sentence where the boom's first moment or inertia are not those of the pose; empty where they are, or nobody knows."""
        text = _moved(*configuration, dict(zip(*self._newest, strict=False))) if configuration else ""
        if text and not self._said:
            self._warn(text)
        self._said = bool(text)
        return text


def _moved(machine: Machine, pose: Pose, shown: dict[str, float]) -> str:
    outer, telescope = (
        value if isfinite(value) else locked
        for value, locked in (
            (shown.get(OUTER, pose.outer_boom_angle), pose.outer_boom_angle),
            (shown.get(TELESCOPE, pose.telescope_length), pose.telescope_length),
        )
    )
    if (outer, telescope) == (pose.outer_boom_angle, pose.telescope_length):
        return ""
    try:
        there = machine.pose(outer, telescope, pose.load)
    except ModelError:
        return ""
    moment = hypot(there.Sx - pose.Sx, there.Sy - pose.Sy) / hypot(pose.Sx, pose.Sy)
    if max(moment, abs(there.D0 / pose.D0 - 1.0)) <= TOLERANCES["high"]:
        return ""
    return (
        f"outer boom and telescope are at {outer:.2f} rad and {telescope:.2f} m, the configuration says "
        f"{pose.outer_boom_angle:.2f} rad and {pose.telescope_length:.2f} m: the control law takes them as locked there"
    )
