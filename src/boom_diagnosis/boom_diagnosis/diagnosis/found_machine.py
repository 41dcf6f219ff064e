"""The machine with what was found in it, as a file that every other command takes."""

from __future__ import annotations

import copy
from collections.abc import Mapping, Sequence
from datetime import date
from pathlib import Path
from typing import Any

import yaml

from boom_diagnosis.identification.estimate import Estimate as Identified
from boom_diagnosis.identification.machine_output import document_with, fits
from boom_model.learned import LearnedTerm
from boom_model.machine import Machine, Pose
from boom_model.machine_file import machine_from


def found_machine(
    machine: Machine,
    pose: Pose,
    numbers: Mapping[str, float],
    spreads: Mapping[str, float],
    learned: Sequence[LearnedTerm] = (),
) -> Machine:
    """The machine with other numbers (components of the parameter vector) and effects.

    The moments of mass in ``pose`` go to the tabulated configuration; those of other poses, and a load, stay.

    Args:
        machine: as given.
        pose: in which the recordings were made.
        numbers: component or ``effects.ID.NAME`` -> value.
        spreads: component -> half of its 90 % interval.
        learned: terms beside those that the machine has.
    """
    identified = []
    components = {c: p for p in machine.parameters.values() for c in p.specification.components}
    for name, value in numbers.items():
        if name not in components:
            continue
        spread = spreads.get(name, 0.0)
        entry = Identified(
            name,
            float(value),
            components[name].specification.unit,
            (value - spread, value + spread),
            "diagnosis, one-step errors",
        )
        if not fits(machine, entry):
            identified.append(entry)
    document: dict[str, Any] = document_with(machine, identified)
    if pose.tabulated and any(f"pose.{k}" in numbers for k in ("D0", "Sx", "Sy")):
        entry_ = copy.deepcopy(document["rigid_body"])
        row = entry_["configs"][pose.tabulated]
        for key in ("D0", "Sx", "Sy"):
            if f"pose.{key}" in numbers:
                row[key] = float(numbers[f"pose.{key}"])
        document["rigid_body"] = entry_
    effects = {k: dict(v) for k, v in machine.effects.items()}
    for name, value in numbers.items():
        if name.startswith("effects."):
            _, effect, parameter = name.split(".")
            effects.setdefault(effect, {})[parameter] = float(value)
    if effects:
        document["effects"] = effects
    if machine.learned or learned:
        document["learned"] = [entry.document() for entry in (*machine.learned, *learned)]
    return machine_from(document)


def write_machine(path: Path, machine: Machine, *, command: str) -> None:
    """Writes the file, whole or not at all.

    Raises:
        OSError: it cannot be written.
    """
    text = yaml.safe_dump(_plain(machine.document), sort_keys=False, allow_unicode=True, width=120)
    head = (
        f"# Diagnosed on {date.today().isoformat()} by: {command}\n"
        "# What does not say 'identified', and 'effects' beside, is as it was.\n"
    )
    temporary = path.with_name(path.name + ".new")
    try:
        temporary.write_text(head + text, encoding="utf-8")
        temporary.replace(path)
    finally:
        temporary.unlink(missing_ok=True)


def _plain(value: Any) -> Any:
    """Mappings and sequences as YAML knows them."""
    if isinstance(value, Mapping):
        return {k: _plain(v) for k, v in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(v) for v in value]
    return value
