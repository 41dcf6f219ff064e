"""What recordings can tell about the numbers of a machine, before anything is fitted.

Around the numbers of the file the one-step predictions of the recordings are linear in them. With W their whitened derivatives by
the numbers, in standard deviations of the prior, the information is W^T W and the covariance afterwards (1 + W^T W)^-1. The
square root of its diagonal is the share of the tolerance that stays. It is the best case: the physics is that of the file.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from boom_estimation.experiment import PreparedRecording, prepare
from boom_estimation.problem import EstimationProblem
from boom_estimation.uncertainty import TOGETHER
from boom_estimation.unknown import Unknown
from boom_model.machine import Machine, Pose
from boom_model.prior import prior_of
from boom_model.structure import DRIVING
from boom_recording.measurement import measurements
from boom_recording.recording import Recording

Array = NDArray[np.float64]
Word = Literal["told", "only together", "hardly", "not"]

WELL = 0.3
"""Share of the tolerance that stays, up to which a number counts as told."""
KNOWN = 1e-3
"""Relative standard deviation of the prior, below which a number is no question."""
NOTHING = 0.9
"""The same, from which the recordings tell nothing of it."""


@dataclass(frozen=True)
class NumberForesight:
    """What recordings can tell of one number.

    Attributes:
        name: component of the machine file, or of the pose.
        unit: of the number.
        value: as the file has it.
        stays: share of the tolerance that stays.
        alone: the same if all other numbers were known.
        partners: numbers with which it is told only together.
    """

    name: str
    unit: str
    value: float
    stays: float
    alone: float
    partners: tuple[str, ...]

    @property
    def word(self) -> Word:
        """In a word."""
        if self.stays <= WELL:
            return "told"
        if self.alone <= WELL:
            return "only together"
        return "hardly" if self.stays < NOTHING else "not"

    def document(self) -> dict[str, Any]:
        """As JSON."""
        return {
            "parameter": self.name, "unit": self.unit, "value": self.value, "told": self.word,
            "share_of_tolerance_left": self.stays,
            "share_left_if_others_were_known": self.alone, "together_with": list(self.partners),
        }  # fmt: skip


@dataclass(frozen=True)
class NumberInformation:
    """Information of recordings about unknowns with unit priors: W^T W (m, m)."""

    unknowns: tuple[Unknown, ...]
    matrix: Array

    def with_further(self, other: NumberInformation) -> NumberInformation:
        """That of both."""
        return NumberInformation(self.unknowns, self.matrix + other.matrix)

    @property
    def stays(self) -> Array:
        """(m,) share of the tolerance that stays."""
        return np.sqrt(np.diag(self._covariance))

    @property
    def open(self) -> float:
        """How much is not told yet, summed over the numbers: the share of each tolerance that stays above ``WELL``."""
        return float(np.maximum(self.stays - WELL, 0.0).sum())

    def document(self) -> list[dict[str, Any]]:
        """What is told of each number, as JSON."""
        return [row.document() for row in self.numbers()]

    @property
    def _covariance(self) -> Array:
        return np.asarray(np.linalg.inv(np.eye(len(self.matrix)) + self.matrix), dtype=np.float64)

    def numbers(self) -> tuple[NumberForesight, ...]:
        """What is told of each, best first."""
        covariance, stays = self._covariance, self.stays
        correlation = covariance / np.outer(stays, stays)
        alone = 1.0 / np.sqrt(1.0 + np.diag(self.matrix))
        rows = []
        for j, u in enumerate(self.unknowns):
            others = (k for k in range(len(stays)) if k != j and abs(correlation[j, k]) > TOGETHER)
            partners = tuple(self.unknowns[k].name for k in others) if stays[j] > WELL else ()
            rows.append(NumberForesight(u.name, u.unit, u.nominal, float(stays[j]), float(alone[j]), partners))
        return tuple(sorted(rows, key=lambda row: row.stays))


def sought(machine: Machine, pose: Pose | None) -> list[Unknown]:
    """The machine's numbers that have a tolerance and are not measured, and with a pose its moments."""
    measured = {".".join(DRIVING[name]) for name in machine.structure.driven}
    listed = [
        (c, p.specification.unit)
        for key, p in machine.parameters.items()
        if key not in measured
        for c in p.specification.components
    ]
    listed += [("pose.D0", "kg m^2"), ("pose.Sx", "kg m"), ("pose.Sy", "kg m")] if pose else []
    values = machine.values(pose or machine.tabulated[0])
    rows = []
    for name, unit in listed:
        prior = prior_of(machine, name, pose)
        if prior.sigma > KNOWN * abs(values[name]) and prior.low < prior.high:
            log = prior.kind == "log_normal"
            rows.append(Unknown(name, unit, values[name], prior.sigma, prior.low, prior.high, log))
    return rows


def information(recordings: Sequence[Recording], machine: Machine) -> NumberInformation:
    """Information of recordings of a machine about its numbers; a rate that is the angle's derivative tells nothing more.

    Raises:
        MachineError: a pose or load that the machine cannot have.
    """
    experiments = [prepare(_independent(r), machine, name=f"{k}:{r.name}") for k, r in enumerate(recordings)]
    driven = set.intersection(*(set(e.plant.machine.structure.driven) for e in experiments)) if experiments else set()
    unknowns = sought(machine.driven_by(driven), _common_pose(experiments))
    total = np.zeros((len(unknowns), len(unknowns)))
    problem = EstimationProblem(experiments, unknowns)
    if problem.segments:
        z = np.zeros(len(unknowns))
        gains = problem.gains(z, problem.first_gains())
        _, derivatives = problem.sensitivities(z, gains)
        for gain, derivative in zip(gains, derivatives, strict=True):
            flat = np.nan_to_num(gain.whiten(derivative)).reshape(-1, len(unknowns))
            total += flat.T @ flat
    return NumberInformation(tuple(unknowns), total)


def _independent(recording: Recording) -> Recording:
    """The recording without channels that are computed from others."""
    computed = [name for name, found in measurements(recording).items() if found.derived_from]
    return silenced(recording, computed)


def silenced(recording: Recording, channels: Sequence[str]) -> Recording:
    """The recording as if these channels had not been measured."""
    signals = dict(recording.signals)
    for name in channels:
        signals[name] = replace(signals[name], valid=np.zeros_like(signals[name].valid))
    return replace(recording, signals=signals)


def _common_pose(experiments: Sequence[PreparedRecording]) -> Pose | None:
    """The pose of all, if they have the same one."""
    poses = [e.plant.pose for e in experiments]
    same = {(p.D0, p.Sx, p.Sy) for p in poses}
    return poses[0] if len(same) == 1 else None
