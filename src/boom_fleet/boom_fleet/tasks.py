"""What a worker does with one recording: check and screen it, find a machine's reference, diagnose it. All is passed by value.

A fault of a recording is a result: ``failure`` says what is wrong in one line. What is no fault of the recording (a store that does
not answer, too little memory) is raised: another attempt may succeed.
"""

from __future__ import annotations

import io
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from math import isnan
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from boom_fleet.scratch import scratch
from boom_fleet.store import FoundBag, StoreError, at_hand

if TYPE_CHECKING:
    from boom_model.machine import Machine
    from boom_recording.recording import Recording

NO_REFERENCE = "no sound recording of the machine to begin with"
Array = NDArray[np.float64]
Columns = dict[str, Any]
"""Columns of the table that a task knows, by name."""


class AttemptError(RuntimeError):
    """A recording was not worked off, through no fault of its own; one line that says why."""

    exit_status = 2


@dataclass(frozen=True)
class Task:
    """One recording with the machine file that it is compared with: a shipped name, or path or URL and text of a file."""

    bag: FoundBag
    shipped: str = ""
    text: bytes = b""
    file: str = ""


@dataclass(frozen=True)
class MachineReference:
    """A machine's reference: names of its numbers and where they were; the recording that it is from."""

    names: tuple[str, ...]
    point: Array
    recording: str


@dataclass(frozen=True)
class Screened:
    """Of one recording: columns of the table, and what the comparison needs (None where it was not screened)."""

    columns: Columns
    names: tuple[str, ...] = ()
    matrix: Array | None = None
    vector: Array | None = None


def take_reference(task: Task) -> tuple[MachineReference | None, str]:
    """The reference that a recording gives for its machine, or why it gives none."""
    from boom_fleet import screen

    def work(recording: Recording, machine: Machine) -> MachineReference | None:
        if not _sound(recording, machine):
            return None
        names, point = screen.reference(recording, machine)
        return MachineReference(names, point, task.bag.recording)

    done = _attempt(task, work)
    return done.result, done.failure


def screen_one(task: Task, reference: MachineReference | None) -> Screened:
    """Check and screen a recording; without a reference of its machine it is only checked."""
    from boom_checks.doubts import checks
    from boom_fleet import screen

    columns: Columns = {}
    found: list[Any] = []

    def work(recording: Recording, machine: Machine) -> None:
        columns.update(_facts(recording, machine))
        doubts = checks(recording, machine)
        columns["checks"] = [{"kind": c.kind, "sentence": c.sentence} for c in doubts]
        spoilt = next((c for c in doubts if c.spoils), None)
        if spoilt is not None:
            columns["refused"], columns["verdict"] = spoilt.sentence, "sensor_or_clock"
        elif reference is None:
            columns["refused"] = NO_REFERENCE
        else:
            result = screen.screened(recording, machine, dict(zip(reference.names, reference.point, strict=True)))
            columns.update(result.columns())
            found.append(result)

    done = _attempt(task, work)
    columns |= {"failure": done.failure, "screen_processor_s": done.seconds}
    if not found:
        return Screened(columns)
    return Screened(columns, found[0].names, found[0].matrix, found[0].vector)


def diagnose_one(task: Task, seed: int = 0) -> tuple[dict[str, Any], str, float]:
    """The verdict document of a recording (diagnosis.json), why there is none, and the processor time [s].

    A long one is searched where it tells most (``boom_diagnosis.stretches``).
    """
    from boom_diagnosis.run import diagnose

    def work(recording: Recording, machine: Machine) -> dict[str, Any]:
        return diagnose([recording], machine, seed=seed).document.document()

    done = _attempt(task, work)
    return done.result or {}, done.failure, done.seconds


@dataclass
class _Done:
    result: Any = None
    failure: str = ""
    seconds: float = field(default=0.0)


def _attempt(task: Task, work: Callable[[Recording, Machine], Any]) -> _Done:
    """Run on the loaded recording; what is wrong with it in one line.

    Raises:
        AttemptError: nothing is known to be wrong with it.
    """
    from boom_recording.loading import load

    begin = time.process_time()
    done, path = _Done(), None
    try:
        with at_hand(task.bag.url) as path:
            recording = load(path)
        done.result = work(recording, machine_of(task, recording.configuration.machine))
    except Exception as error:  # one recording must not end the night of all others
        said = str(error).replace(str(path), task.bag.url).partition("\n")[0]  # of a copy, too
        if isinstance(error, StoreError):
            raise AttemptError(said) from None
        known = isinstance(getattr(error, "exit_status", None), int)
        done.failure = said if known else f"{type(error).__name__}: {said}"
        if isinstance(error, (OSError, MemoryError)) or isinstance(error.__context__, (OSError, MemoryError)):
            raise AttemptError(done.failure) from None
    done.seconds = time.process_time() - begin
    return done


def machine_of(task: Task, named: str) -> Machine:
    """The machine of a task; ``named``: shipped one that the recording names.

    Raises:
        MachineError: the file cannot be used, or there is none of that name.
    """
    from boom_model.errors import MachineError
    from boom_model.machine_file import load_machine, shipped_machine

    if task.text:
        with scratch() as folder:
            path = folder / "machine.yaml"
            path.write_bytes(task.text)
            try:
                return load_machine(path)
            except MachineError as error:  # of the copy: the user knows another name
                raise MachineError(str(error).replace(str(path), task.file)) from None
    return shipped_machine(task.shipped or named)


def _sound(recording: Recording, machine: Machine) -> bool:
    from boom_checks.doubts import checks

    return not any(check.spoils for check in checks(recording, machine))


def _facts(recording: Recording, machine: Machine) -> Columns:
    c = recording.configuration
    return {
        "time_ns": recording.start_ns,
        "duration_s": recording.duration,
        "model": machine.name,
        "pose": [c.outer_boom_angle, c.telescope_length, 0.0 if isnan(c.load_mass) else c.load_mass],
        "defects": len(recording.events),
        "warnings": [*recording.warnings],
    }


def packed(arrays: dict[str, Any]) -> bytes:
    """Arrays and texts as one file (npz, without pickle)."""
    buffer = io.BytesIO()
    np.savez_compressed(buffer, **arrays)
    return buffer.getvalue()
