"""The machine with what was found in it, as a file that every other command takes."""

from __future__ import annotations

import copy
from collections.abc import Mapping, Sequence
from datetime import date
from pathlib import Path
from types import MappingProxyType
from typing import Any

import yaml

from boom_diagnosis.bag_samples import OTHER_POSE
from boom_identification.estimate import Identified
from boom_identification.machine_output import document_with, effects_with, fits
from boom_input.whole import write_whole
from boom_model.catalogue import CATALOGUE
from boom_model.components import payload
from boom_model.errors import MachineError
from boom_model.learned import LearnedTerm
from boom_model.machine import Machine, Pose
from boom_model.machine_file import machine_from
from boom_model.prior import MOMENTS


def found_machine(
    machine: Machine,
    pose: Pose,
    numbers: Mapping[str, float],
    spreads: Mapping[str, float],
    learned: Sequence[LearnedTerm] = (),
    others: Mapping[str, Pose] = MappingProxyType({}),
) -> Machine:
    """The machine with other numbers (components of the parameter vector) and effects.

    The moments of mass in ``pose`` go to its tabulated configuration, or to a new one; a load stays.
    Numbers that a machine file cannot have together are brought back towards the machine's own, all by the same share, until
    it can; then those of effects towards doing nothing.

    Args:
        machine: as given.
        pose: in which the recordings were made.
        numbers: component or ``effects.ID.NAME`` -> value; ``TOLD`` and a load that configurations tell -> load [kg].
        spreads: component -> half of its 90 % interval.
        learned: terms beside those that the machine has.
        others: end of the names of another pose's numbers -> that pose.
    """
    for share in _SHARES:
        nearer = {name: _between(machine, name, value, share) for name, value in numbers.items()}
        try:
            return _found(machine, {"": pose, **others}, nearer, spreads, learned)
        except MachineError:
            continue
    for share in _SHARES:
        try:
            return _found(machine, {}, _less(numbers, share), {}, learned)
        except MachineError:
            continue
    return _found(machine, {}, _less(numbers, 0.0), {}, learned)


TOLD = f"{payload.NAME}.told."
"""Of names of loads where those of several recordings differ."""
_SHARES = (1.0, 0.75, 0.5, 0.25)


def _less(numbers: Mapping[str, float], share: float) -> dict[str, float]:
    """Numbers of the effects alone, part of the way from doing nothing: what no machine can have stands for something else."""
    rows = {f"effects.{e.id}.{row.name}": row for e in CATALOGUE for row in e.leading}
    return {
        name: rows[name].neutral + share * (value - rows[name].neutral) if name in rows else value
        for name, value in numbers.items()
        if name.startswith("effects.")
    }


def _between(machine: Machine, name: str, value: float, share: float) -> float:
    """A number of the machine part of the way to ``value``; those of effects and pose as they are."""
    for parameter in machine.parameters.values() if share < 1.0 else ():
        for component, own in zip(parameter.specification.components, parameter.value, strict=True):
            if component == name:
                return own + share * (value - own)
    return value


def _found(
    machine: Machine, poses: Mapping[str, Pose], numbers: Mapping[str, float], spreads: Mapping[str, float],
    learned: Sequence[LearnedTerm],
) -> Machine:  # fmt: skip
    """Raises MachineError where the numbers do not go together."""
    document: dict[str, Any] = document_with(machine, _identified(machine, numbers, spreads))
    for end, pose in poses.items():
        moments = {k: float(numbers[f"pose.{k}{end}"]) for k in MOMENTS if f"pose.{k}{end}" in numbers}
        if moments:
            body = copy.deepcopy(document["rigid_body"])
            name = pose.tabulated or _DIAGNOSED + end.replace(OTHER_POSE, "_")
            body["configs"].setdefault(name, _row(pose)).update(moments)
            document["rigid_body"] = body
    loads = {float(name.removeprefix(TOLD)): value for name, value in numbers.items() if name.startswith(TOLD)}
    told = {load: max(0.0, float(value)) for load, value in loads.items()}  # none lifts
    if told:
        section = document.get(payload.NAME) or {}
        document[payload.NAME] = {**section, "told": {**(section.get("told") or {}), **told}}
    effects = effects_with(machine, numbers)
    if effects:
        document["effects"] = effects
    if machine.learned or learned:
        document["learned"] = [entry.document() for entry in (*machine.learned, *learned)]
    return machine_from(document)


def _identified(machine: Machine, numbers: Mapping[str, float], spreads: Mapping[str, float]) -> list[Identified]:
    """The numbers of components that differ from the machine's."""
    components = {c: p for p in machine.parameters.values() for c in p.specification.components}
    entries = []
    for name in (name for name in numbers if name in components):
        value, spread = numbers[name], spreads.get(name, 0.0)
        interval = (value - spread, value + spread)
        unit = components[name].specification.unit
        entries.append(Identified(name, float(value), unit, interval, "diagnosis, one-step errors"))
    return [entry for entry in entries if not fits(machine, entry)]


_DIAGNOSED = "diagnosed_pose"


def _row(pose: Pose) -> dict[str, Any]:
    """A pose as a configuration of the machine file; the load is the recording's."""
    return {
        "q3": pose.outer_boom_angle, "q4": pose.telescope_length, "D0": pose.D0, "Sx": pose.Sx, "Sy": pose.Sy,
        "tip": [float(x) for x in pose.tip], "m_L": 0.0, "prov": "derived, and diagnosed", "conf": "medium",
    }  # fmt: skip


def write_machine(path: Path, machine: Machine, *, command: str) -> None:
    """Writes the file, whole or not at all.

    Raises:
        OSError: it cannot be written.
    """
    text = yaml.safe_dump(_plain(machine.document), sort_keys=False, allow_unicode=True, width=120)
    head = (
        f"# Diagnosed on {date.today().isoformat()} by: {command}\n"
        "# Found: what says 'identified', moments of mass of the recordings' pose, effects, loads of single recordings.\n"
        "# Effects that the report does not name are tolerances as fitted, of sensors, edges, air in the oil.\n"
        "# All else is as it was.\n"
    )
    write_whole(path, head + text)


def _plain(value: Any) -> Any:
    """Mappings and sequences as YAML knows them."""
    if isinstance(value, Mapping):
        return {k: _plain(v) for k, v in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(v) for v in value]
    return value
