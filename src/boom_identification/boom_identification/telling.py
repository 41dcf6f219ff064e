"""What recordings tell of numbers at the machine file's values, and the parts of long recordings that tell most.

With w the whitened innovations of the one-step predictions and D = dw/dz, a part of a recording tells A = sum D'D of the
unknowns z, which are standard normal beforehand. Parts are worked off one after the other, so that memory does not grow with the
recording, and chosen one after the other: the next is the one that gains most of log det(I + sum A), the information of all
together (a D-optimal choice; Fedorov 1972).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from boom_estimation.design import most_telling, sharpens
from boom_estimation.experiment import PreparedRecording, last_part, prepare
from boom_estimation.problem import EstimationProblem
from boom_estimation.unknown import Unknown
from boom_model.machine import Machine
from boom_model.sensors import OUTPUTS
from boom_recording.recording import Recording, blocks, part

Array = NDArray[np.float64]
Progress = Callable[[str], None]

LONGEST = 300.0
"""s. What a search looks at of all recordings together at most, and of one that is not cut; more of it only costs time."""
_MOTION, _SHORTEST_MOTION = 0.02, 2.0
"""rad/s, far above the gyro's noise; s."""
_MOVED_WITHIN = 0.1
"""s. Over which the angle's difference is the rate where no gyro is."""


@dataclass(frozen=True)
class Telling:
    """What a search looks at.

    Attributes:
        experiments: recordings and parts of them.
        recordings: in which the boom moves. information: (m, m) of all of them, by the unknowns asked.
        selected: names of the experiments where they are not all.
    """

    experiments: list[PreparedRecording]
    recordings: list[Recording]
    information: Array
    selected: tuple[str, ...]


def telling(
    recordings: Sequence[Recording], machine: Machine, asked: Sequence[Unknown], held_out: float, say: Progress
) -> Telling:
    """The experiments of a search: recordings in which the boom moves, of long ones the parts that tell most.

    held_out: share of each recording, at its end, that is not used.

    Raises:
        MachineError: a pose or load that the machine cannot have.
    """
    found: list[PreparedRecording] = []
    moving: dict[int, Recording] = {}
    told: list[Array] = []
    count = len(asked)
    for number, recording in enumerate(recordings):
        for piece, share in training(recording, held_out):
            say(f"what {piece.name} tells")
            one = prepare(piece, machine, held_out=last_part(piece, share), name=f"{number}:{piece.name}")
            if _moves(one):
                found.append(one)
                told.append(_information(one, asked))
                moving[number] = recording
    total = sum(told, np.zeros((count, count)))
    chosen = [found[k] for k in _chosen(told, [one.duration for one in found])]
    selected = tuple(one.recording.name for one in chosen) if len(chosen) < len(found) else ()
    return Telling(chosen, list(moving.values()), total, selected)


def training(recording: Recording, held_out: float) -> list[tuple[Recording, float]]:
    """Parts of a recording that may be fitted to, and the share at the end of each that may not; a short one is one part."""
    if recording.duration <= LONGEST:
        return [(recording, held_out)]
    return [(piece, 0.0) for piece in blocks(part(recording, 0.0, recording.duration * (1.0 - held_out)))]


def checking(recording: Recording, held_out: float) -> list[tuple[Recording, float]]:
    """Parts of a recording whose free runs check a fit, and the share at the end of each that does; a short one is one part."""
    if recording.duration <= LONGEST:
        return [(recording, held_out)]
    return [
        (piece, 1.0) for piece in blocks(part(recording, recording.duration * (1.0 - held_out), recording.duration))
    ]


def _information(experiment: PreparedRecording, asked: Sequence[Unknown]) -> Array:
    problem, m = EstimationProblem([experiment], asked), len(asked)
    z = np.zeros(m)
    gains = problem.gains(z, problem.first_gains())
    _, derivatives = problem.sensitivities(z, gains)
    rows = [g.whiten(d).reshape(-1, m) for g, d in zip(gains, derivatives, strict=True)]
    return sum((r.T @ r for r in rows), np.zeros((m, m)))


def _chosen(told: Sequence[Array], durations: Sequence[float]) -> list[int]:
    """Indices, in order, of the parts that a search looks at: all where they are no longer than ``LONGEST`` together."""
    if sum(durations) <= LONGEST or not told:
        return list(range(len(told)))
    chosen: list[int] = []
    known = 0.0
    for part_index, reached in most_telling(told):
        enough = sum(durations[k] for k in chosen) >= LONGEST
        if chosen and (enough or not sharpens(known, reached, len(told[0]))):
            break
        chosen.append(part_index)
        known = reached
    return sorted(chosen)


def _moves(experiment: PreparedRecording) -> bool:
    """Whether the boom moves long enough in the training data: a boom at rest shows only its sensors."""
    moving, apart = 0.0, max(1, round(_MOVED_WITHIN / experiment.period))
    for segment in experiment.segments:
        rate = segment.measured[segment.training, OUTPUTS.index("rate")]
        if not np.isfinite(rate).any():
            angle = segment.measured[segment.training, OUTPUTS.index("angle")]
            rate = (angle[apart:] - angle[:-apart]) / (apart * experiment.period)
        moving += experiment.period * np.count_nonzero(np.abs(rate[np.isfinite(rate)]) > _MOTION)
    return moving > _SHORTEST_MOTION
