"""The thesis' own accuracies, Tables 5.1 and 5.2, beside ours for orientation. Its measurements are others."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from boom_recording.recording import Configuration


@dataclass(frozen=True)
class ThesisTrajectory:
    """One row of Tables 5.1 and 5.2: pose, log in the gripper, mean angle errors (5.48) [rad]."""

    number: int
    outer_boom_angle: float
    telescope_length: float
    log: bool
    full_against_measurement: float
    reduced_against_full: float


TRAJECTORIES = (
    ThesisTrajectory(1, 4.59, 0.0, False, 0.019, 0.009),
    ThesisTrajectory(2, 4.59, 0.0, False, 0.021, 0.018),
    ThesisTrajectory(3, 0.28, 2.2, False, 0.035, 0.013),
    ThesisTrajectory(4, 0.28, 2.8, True, 0.037, 0.025),
)

MACHINE = "tz17"
"""The crane of the thesis."""
REMARK = (
    "The values of the thesis come from its own measurements of a real crane, in the same pose and with the same load; ours "
    "are other recordings, so they are for orientation only."
)


def alike(configuration: Configuration) -> list[ThesisTrajectory]:
    """The thesis' trajectories in the pose and with the kind of load of a recording."""
    return [
        t
        for t in TRAJECTORIES
        if abs(t.outer_boom_angle - configuration.outer_boom_angle) < 0.02
        and abs(t.telescope_length - configuration.telescope_length) < 0.05
        and t.log == (configuration.load_mass > 0)
    ]


def any_alike(machine: str, configurations: Iterable[Configuration]) -> bool:
    """Whether the thesis has a value beside one of these: of its own crane, in a pose that it had."""
    return machine == MACHINE and any(alike(c) for c in configurations)


def beside(configuration: Configuration, table: str) -> str:
    """Values [rad] of table "5.1" or "5.2" for this pose and load, and their trajectory: "0.019 (1), 0.021 (2)"."""
    return ", ".join(f"{value:.3f} ({number})" for number, value in _values(configuration, table))


def beside_short(configuration: Configuration, table: str) -> str:
    """The same without the trajectories: "0.019, 0.021"."""
    return ", ".join(f"{value:.3f}" for _, value in _values(configuration, table))


def _values(configuration: Configuration, table: str) -> list[tuple[int, float]]:
    full = table == "5.1"
    return [(t.number, t.full_against_measurement if full else t.reduced_against_full) for t in alike(configuration)]
