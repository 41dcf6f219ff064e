"""A whole night: find the bags, screen each once, judge the machines, diagnose what is raised, write the table. Resumable anywhere.

Everything that cost time is a file below ``work/`` of the output, named by what it came from (bag, machine file, version of the
screen), so that a run that is started again does only what is missing, and comes to the same table. What failed through no fault of
a recording is missing, and so is what is damaged.
"""

from __future__ import annotations

import hashlib
import io
import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np

from boom_fleet.engine import Engine
from boom_fleet.judging import Judgement, Kept, judge
from boom_fleet.numbers import TrackedQuantity, numbers_of, present
from boom_fleet.store import FoundBag, Store
from boom_fleet.tasks import (
    NO_REFERENCE,
    MachineReference,
    Screened,
    Task,
    diagnose_one,
    machine_of,
    packed,
    screen_one,
    take_reference,
)
from boom_input.shown import quoted
from boom_model.catalogue import CATALOGUE
from boom_model.machine_file import shipped_machines
from boom_model.plant import Plant

VERSION = hashlib.sha256(repr(("4", [(e.id, e.term, e.parameters) for e in CATALOGUE])).encode()).hexdigest()
"""Of the screen and its numbers: what an older one kept is not compared with what this one keeps."""
Kind = TypeVar("Kind")
Told = Callable[[str, int], None]
"""Called with what is being done and how many steps are done."""


@dataclass(frozen=True)
class FleetRun:
    """What a run found.

    Attributes:
        tasks: key -> recording, in the order of machine and time. columns: key -> columns of the table, of recording, screen and
            verdict. judgements: of each machine. quantities: machine -> what may change in it.
    """

    tasks: Mapping[str, Task]
    columns: Mapping[str, dict[str, Any]]
    judgements: Mapping[str, Judgement]
    quantities: Mapping[str, Mapping[str, TrackedQuantity]]


class Night:
    """One run over a fleet.

    Args:
        tasks: the recordings with their machine files. store: of the results. engine: workers. told: progress.
        false_alarms: machines raised for nothing that are expected in a night of the fleet.
        diagnoses: whether raised recordings are diagnosed.
    """

    def __init__(
        self,
        tasks: Sequence[Task],
        store: Store,
        engine: Engine,
        told: Told,
        false_alarms: float,
        diagnoses: bool = True,
    ) -> None:
        self._tasks = {_key(task): task for task in tasks}
        self._store, self._engine, self._told = store, engine, told
        self._false_alarms, self._diagnoses = false_alarms, diagnoses
        self._there = store.names("work")

    @property
    def steps(self) -> int:
        """How many recordings there are."""
        return len(self._tasks)

    def run(self) -> FleetRun:
        """Do what is missing."""
        references = self._references()
        screened = self._screened(references)
        machines: dict[str, list[Kept]] = {}
        columns: dict[str, dict[str, Any]] = {}
        for key, task in sorted(self._tasks.items(), key=lambda row: self._name(row[0])):  # of equal time in this order
            found = screened[key]
            columns[key] = dict(found.columns)
            kept = machines.setdefault(task.bag.machine, [])
            if found.matrix is None or found.vector is None:
                continue
            own = Kept(key, found.columns["time_ns"] / 1e9, found.names, found.matrix, found.vector)
            if against := self._against(own, kept, columns):
                columns[key] |= {"refused": against}
            else:
                kept.append(own)
        self._told("comparing each machine with its own past", 0)
        quantities = {m: self._quantities(m, columns) for m, kept in machines.items() if kept}
        judgements = judge(
            {m: kept for m, kept in machines.items() if kept}, {m: tuple(q.values()) for m, q in quantities.items()},
            self._false_alarms,
        )  # fmt: skip
        raised = [key for j in judgements.values() for key in j.raised]
        if self._diagnoses:
            for key, row in self._verdicts(raised).items():
                columns[key] |= row
        order = sorted(
            self._tasks, key=lambda k: (self._tasks[k].bag.machine, columns[k].get("time_ns") or 0, *self._name(k))
        )
        return FleetRun({k: self._tasks[k] for k in order}, columns, judgements, quantities)

    def _against(self, own: Kept, kept: Sequence[Kept], columns: Mapping[str, Mapping[str, Any]]) -> str:
        """Why a recording is not compared with those of its machine: it is of another one, or one of them again; empty: it is."""
        for other in kept:
            name = self._tasks[other.key].bag.recording
            if columns[other.key]["model"] != columns[own.key]["model"]:
                return (
                    f"is of a {columns[own.key]['model']}, {name} beside it of a {columns[other.key]['model']}: two machines in "
                    "one folder cannot be compared; give each a folder of its own"
                )
            if own.time == other.time and np.array_equal(own.vector, other.vector):
                return f"is the same recording as {name}, and would count twice: take one of them away"
        return ""

    def _references(self) -> dict[str, MachineReference | None]:
        """Of every machine with one machine file: its first sound recording by name."""
        groups: dict[str, list[str]] = {}
        for key in sorted(self._tasks, key=self._name):
            groups.setdefault(_group(self._tasks[key]), []).append(key)
        found: dict[str, MachineReference | None] = {}
        for group in groups:
            kept = self._kept(f"reference-{group}.npz", _unpacked_reference)
            if kept is not None:
                found[group] = kept
        left = {group: list(keys) for group, keys in groups.items()}
        while missing := {group: keys.pop(0) for group, keys in left.items() if group not in found and keys}:
            self._take(missing, found)
        return {group: found.get(group) for group in groups}

    def _take(self, wanted: Mapping[str, str], found: dict[str, MachineReference | None]) -> None:
        """References from these recordings (group -> key), as far as they give one."""

        def done(group: str, result: tuple[MachineReference | None, str]) -> None:
            reference, _ = result
            if reference is not None:
                arrays = {
                    "names": np.array(reference.names), "point": reference.point, "recording": reference.recording
                }  # fmt: skip
                self._store.write(f"work/reference-{group}.npz", packed(arrays))
                found[group] = reference
            self._told("finding where each machine begins", 0)

        self._engine.each(
            take_reference, list(wanted), lambda group: (self._tasks[wanted[group]],), done,
            lambda group, why: done(group, (None, why)),
        )  # fmt: skip

    def _screened(self, references: Mapping[str, MachineReference | None]) -> dict[str, Screened]:
        found: dict[str, Screened] = {}
        missing = []
        for key in self._tasks:
            kept = self._kept(f"screen-{key}.npz", _unpacked)
            if kept is None:
                missing.append(key)
            else:
                found[key] = kept
        self._told(f"{len(found)} recordings were screened before" if found else "", len(found))

        def done(key: str, result: Screened) -> None:
            arrays: dict[str, Any] = {"columns": json.dumps(result.columns)}
            if result.matrix is not None:
                arrays |= {"names": np.array(result.names), "matrix": result.matrix, "vector": result.vector}
            if result.columns.get("refused") != NO_REFERENCE:  # another recording may give one
                self._store.write(f"work/screen-{key}.npz", packed(arrays))
            told(key, result)

        def failed(key: str, why: str) -> None:
            told(key, Screened({"failure": why, "screen_processor_s": 0.0}))

        def told(key: str, result: Screened) -> None:
            found[key] = result
            bag = self._tasks[key].bag
            self._told(quoted(f"screened {bag.machine}/{bag.recording}"), 1)

        def arguments(key: str) -> tuple[Any, ...]:
            return self._tasks[key], references[_group(self._tasks[key])]

        self._engine.each(screen_one, missing, arguments, done, failed)
        return found

    def _verdicts(self, raised: Sequence[str]) -> dict[str, dict[str, Any]]:
        found: dict[str, dict[str, Any]] = {}
        for key in raised:
            kept = self._kept(f"verdict-{key}.json", lambda data: verdict_columns(*json.loads(data)))
            if kept is not None:
                found[key] = kept

        def done(key: str, result: tuple[dict[str, Any], str, float]) -> None:
            self._store.write(f"work/verdict-{key}.json", json.dumps(result).encode())
            told(key, *result)

        def told(key: str, *result: Any) -> None:
            found[key] = verdict_columns(*result)
            bag = self._tasks[key].bag
            self._told(quoted(f"diagnosed {bag.machine}/{bag.recording}"), 0)

        missing = [key for key in raised if key not in found]
        self._engine.each(
            diagnose_one, missing, lambda key: (self._tasks[key],), done, lambda key, why: told(key, {}, why, 0.0)
        )
        return found

    def _kept(self, name: str, read: Callable[[bytes], Kind]) -> Kind | None:
        """What an earlier run left in a file; None where there is none, or a damaged one."""
        data = self._store.read(f"work/{name}") if name in self._there else None
        try:
            return None if data is None else read(data)
        except Exception:  # a damaged file may raise anything
            return None

    def _name(self, key: str) -> tuple[str, str, str]:
        """By which recordings are ordered where their times tell nothing."""
        return self._tasks[key].bag.machine, self._tasks[key].bag.recording, key

    def _quantities(self, machine: str, columns: Mapping[str, Mapping[str, Any]]) -> dict[str, TrackedQuantity]:
        """What may change in a machine; the same in every pose."""
        key = next(k for k, t in self._tasks.items() if t.bag.machine == machine and columns[k].get("pose"))
        model = machine_of(self._tasks[key], columns[key]["model"])
        pose = model.pose(*columns[key]["pose"])
        numbers = numbers_of(model, pose, Plant(present(model), pose, "full"))
        return {q.id: q for q in numbers.quantities}


def verdict_columns(document: Mapping[str, Any], failure: str, seconds: float) -> dict[str, Any]:
    """A verdict document (diagnosis.json) as columns of the table."""
    result: dict[str, Any] = {"diagnosis_processor_s": seconds, "diagnosis_failure": failure}
    if not document:
        return result
    result["verdict"] = document["verdict"]
    result["next_experiment"] = document.get("next_experiment") or ""
    findings = document.get("findings") or []
    if findings:
        first = findings[0]
        result |= {"effect": first.get("effect") or "unknown_physics", "subsystem": first.get("subsystem") or "",
                   "confidence": first.get("confidence"), "evidence": first.get("evidence") or ""}  # fmt: skip
        result["alternatives"] = [
            {"effect": a.get("effect") or "unknown_physics", "confidence": a.get("confidence")}
            for a in first.get("alternatives") or []
        ]
        for name, number in (first.get("parameters") or {}).items():
            low, high = number.get("interval_90") or (None, None)
            result |= {"parameter": name, "size": number.get("value"), "unit": number.get("unit") or "", "size_low": low,
                       "size_high": high}  # fmt: skip
            break
    return result


def _key(task: Task) -> str:
    """Of a recording compared with a machine file by a version of the screen."""
    return hashlib.sha256(f"{VERSION}|{task.bag.key}|{_group(task)}".encode()).hexdigest()[:16]


def _group(task: Task) -> str:
    words = f"{VERSION}|{task.bag.machine}|{task.shipped}|".encode("utf-8", "surrogateescape") + task.text
    return hashlib.sha256(words).hexdigest()[:16]


def _unpacked(data: bytes) -> Screened:
    with np.load(io.BytesIO(data)) as file:
        columns = dict(json.loads(str(file["columns"])))
        if "matrix" not in file:
            return Screened(columns)
        return Screened(columns, tuple(file["names"].tolist()), file["matrix"], file["vector"])


def _unpacked_reference(data: bytes) -> MachineReference:
    with np.load(io.BytesIO(data)) as file:
        return MachineReference(tuple(file["names"].tolist()), file["point"], str(file["recording"]))


def tasks_of(
    bags: Sequence[FoundBag], files: Mapping[str, str], default: str, text: Callable[[str], bytes]
) -> list[Task]:
    """Recordings with their machine files: by the table, the folder's own, the one for all, else the shipped one that it names.

    files: machine -> file or shipped name. default: file or shipped name for all others, may be empty. text: content of a file.
    """
    known: dict[str, bytes] = {}
    result = []
    for bag in bags:
        chosen = files.get(bag.machine) or bag.machine_file or default
        if chosen and chosen not in shipped_machines():
            if chosen not in known:
                known[chosen] = text(chosen)
            result.append(Task(bag, text=known[chosen], file=chosen))
        else:
            result.append(Task(bag, shipped=chosen))
    return result
