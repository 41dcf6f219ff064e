"""Long recordings: screened whole by one-step predictions, searched in the stretches that tell most, proved on all the others.

A search costs time and memory with every sample that it looks at. A long recording is therefore cut into blocks of about a minute.
The given machine predicts each from sample to sample; where its innovations lose most against white noise the recording says most
about what the machine lacks, and there it is searched. What was found then runs freely through every block that nothing was fitted
to, from that block's own initial state (``proof``): the proof is that of the whole recording, the memory that of a block.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from boom_checks.even_series import seldom
from boom_diagnosis.bag_samples import PERIOD, Bag, prepare
from boom_diagnosis.document import DiagnosisResult
from boom_diagnosis.freerun import Elsewhere
from boom_diagnosis.parallel import in_parallel
from boom_diagnosis.prediction import Predictor, beyond
from boom_model.errors import SimulationError
from boom_model.machine import Machine
from boom_model.sensors import OUTPUTS
from boom_model.structure import CURRENTS
from boom_recording.recording import BLOCK, Recording, blocks

FIND, PROVE = 2, 1
"""Stretches of the only long recording that are searched, and that nothing is fitted to. One with no more blocks is short."""
LEAST_MOVING, LEAST_TRAVEL = 4.0, 0.02
"""s, rad: a recording that moves less says nothing about most of the machine."""
Told = Callable[[str, float], None]


def is_long(recording: Recording, machine: Machine) -> bool:
    """Whether a recording has more blocks than a search looks at, and none needs what came before it: no steps of the load."""
    steps = machine.payloads.get(recording.name, machine.payloads.get("", ()))
    return round(recording.duration / BLOCK) > FIND + PROVE and not steps


def excited(bag: Bag) -> bool:
    """Whether the boom moved long and far enough to tell anything, and was looked at often enough."""
    angle = bag.samples().measured[:, 0]
    moving = float(bag.moving().sum()) * PERIOD
    known = angle[np.isfinite(angle)]
    seen = moving >= LEAST_MOVING and len(known) > 0 and float(np.ptp(known)) >= LEAST_TRAVEL
    return seen and not seldom(bag.recording.signals["angle"])


def tells_nothing(recording: Recording, bag: Bag | None) -> str:
    """Why a recording tells nothing, in words; empty: it tells something. bag: as it was prepared, where it could be."""
    if bag is not None and excited(bag):
        return ""
    for name in ("angle", *CURRENTS):
        signal = recording.signals[name]
        if not signal.valid.any():
            words = name.replace("_", " ")
            broken = f"none of {len(signal.time)} samples of the {words} can be used: repair the logger"
            return broken if len(signal.time) else f"the {words} was not recorded"
    return seldom(recording.signals["angle"]) or "the boom hardly moves"


def lost(bag: Bag, machine: Machine) -> float:
    """What the machine's one-step predictions lose against white noise [nats]."""
    ((prediction,),) = Predictor(machine, [bag]).predict([{}])
    return float(np.sum(beyond(prediction.whitened, bag.counted, np.ones(len(OUTPUTS)))))


@dataclass(frozen=True)
class Stretches:
    """What is searched in the place of recordings, some of which may be long.

    Attributes:
        recordings, held_out: for the search; a short recording is itself.
        others: blocks of the long recordings that nothing is fitted to, in the order of time.
        begins: name of a block -> its recording's name, and where in it the block begins [s].
    """

    recordings: tuple[Recording, ...]
    held_out: tuple[Recording, ...]
    others: tuple[Recording, ...] = ()
    begins: Mapping[str, tuple[str, float]] = field(default_factory=dict)

    @property
    def elsewhere(self) -> tuple[Elsewhere, ...]:
        """The other blocks, placed in time against the first stretch that is searched."""
        first, found = self.begins.get(self.recordings[0].name, ("", 0.0))
        placed = ((b, *self.begins[b.name]) for b in self.others)
        return tuple(Elsewhere(b, begin - found if own == first else None) for b, own, begin in placed)

    def placed(self, result: DiagnosisResult) -> DiagnosisResult:
        """The answer with the times of its findings in the recording, not in its stretch."""
        if not self.others:
            return result
        _, begin = self.begins.get(self.recordings[0].name, ("", 0.0))
        findings = tuple(
            replace(f, intervals_s=tuple((a + begin, b + begin) for a, b in f.intervals_s))
            for f in result.document.findings
        )
        document = replace(result.document, findings=findings)
        return replace(result, searched=(*self.recordings, *self.held_out), document=document)


def stretches(
    recordings: Sequence[Recording],
    held_out: Sequence[Recording],
    machine: Machine,
    told: Told = lambda text, share: None,
) -> Stretches:
    """Long recordings by their stretches that tell most; without held-out recordings one of them is held out.

    told: called with what is being done and the share of all work that is done.

    Raises:
        MachineError: a pose or load that the machine cannot have.
    """
    everything = (*recordings, *held_out)
    if not any(is_long(r, machine) for r in everything):
        return Stretches(tuple(recordings), tuple(held_out))
    each = max(1, FIND // max(1, sum(is_long(r, machine) for r in recordings)))
    chosen: dict[bool, list[Recording]] = {True: [], False: []}
    others: list[Recording] = []
    begins: dict[str, tuple[str, float]] = {}
    for k, recording in enumerate(everything):
        fitted = k < len(recordings)
        if not is_long(recording, machine):
            chosen[fitted].append(recording)
            continue
        told(f"screening {recording.name}", 0.0)
        found = list(blocks(recording))
        begins |= {b.name: (recording.name, (b.start_ns - recording.start_ns) / 1e9) for b in found}
        ranked = sorted(found, key=_ranks(found, machine), reverse=True)
        count = each if fitted else PROVE
        chosen[fitted] += ranked[:count]
        if fitted and not held_out:
            chosen[False] += ranked[count : count + PROVE]
        used = {b.name for b in ranked[:count]} if fitted else set()
        others += [b for b in found if b.name not in used]
    return Stretches(tuple(chosen[True]), tuple(chosen[False]), tuple(others), begins)


def _ranks(found: Sequence[Recording], machine: Machine) -> Callable[[Recording], tuple[bool, float]]:
    """Of each block whether it tells anything, and how much."""

    def rank(block: Recording) -> tuple[bool, float]:
        bag = prepare(block, machine)
        if bag is None or not excited(bag):
            return False, 0.0
        try:
            return True, lost(bag, machine)
        except SimulationError:
            return False, 0.0

    by_name = dict(zip((b.name for b in found), in_parallel(rank, found), strict=True))
    return lambda block: by_name[block.name]
