"""Loads of each recording as a machine file tells them, in place of an effect that has the times of one recording.

A load that came in one recording at 21 s came in another at 33 s: with the effect in the file, the other would be off by all of it.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Any

from boom_diagnosis.onset import neutral
from boom_model.catalogue import EFFECTS
from boom_model.components import payload
from boom_model.errors import MachineError
from boom_model.machine import Machine
from boom_model.machine_file import machine_from

if TYPE_CHECKING:
    from boom_diagnosis.proof import Proved

Values = Mapping[str, float]
Steps = list[dict[str, float]]

ONE_OF_SEVERAL = re.compile(r"/| \(\d+\)$")
"""In names of recordings that are told apart by more than the names that they have when they are read alone."""


def told_by_recording(case: Proved, machine: Machine) -> Machine:
    """The machine with ``payload.recordings`` where those held out have times or strokes of their own; else as it is."""
    recordings = [bag.recording.name for bag in (*case.bags, *case.proving)]
    if case.elsewhere or any(ONE_OF_SEVERAL.search(name) for name in recordings):
        return machine
    for effect in [effect for effect in machine.effects if EFFECTS[effect].load and EFFECTS[effect].onset]:
        mine = f"effects.{effect}."
        own = {name.removeprefix(mine): value for name, value in case.own.items() if name.startswith(mine)}
        fitted = machine.effects[effect]
        values = {bag.recording.name: fitted for bag in case.bags}
        values |= {bag.recording.name: {**fitted, **own} for bag in case.proving}
        steps = {name: load_steps(effect, told) for name, told in values.items()} if own else {}
        known = {name: told for name, told in steps.items() if told}
        if own and len(known) == len(steps):
            machine = _with_steps(machine, effect, known)
    return machine


def load_steps(effect: str, values: Values) -> Steps:
    """Steps of the load that do what the effect does with these values; none where a machine file cannot say it."""
    row = EFFECTS[effect]

    def told(name: str) -> float:
        return float(values.get(name, neutral(f"effects.{effect}.{name}")))

    def acts(name: str) -> bool:
        return told(name) != neutral(f"effects.{effect}.{name}")

    (mass, stroke), *others = row.steps
    lifted = [{"mass": told(m), "stroke": told(s)} for m, s in others if acts(m) and acts(s)]
    if not acts(stroke):
        steps = [{"mass": told(mass), "time": max(0.0, told(row.onset))}]
        steps += [{"mass": -told(mass), "time": told(row.release)}] if acts(row.release) else []
    elif told(row.onset) <= 0.0 and not acts(row.release):
        steps = [{"mass": told(mass), "stroke": told(stroke)}]
    else:  # grasped at a time from a stroke on
        return []
    return [*steps, *lifted]


def _with_steps(machine: Machine, effect: str, steps: Mapping[str, Steps]) -> Machine:
    document: dict[str, Any] = dict(machine.document)
    section = dict(document.get(payload.NAME) or {})
    recordings = dict(section.get("recordings") or {})
    for name, found in steps.items():
        recordings[name] = [*(recordings.get(name) or section.get("steps") or ()), *found]
    document[payload.NAME] = {**section, "recordings": recordings}
    document["effects"] = {name: values for name, values in document["effects"].items() if name != effect}
    try:
        return machine_from(document)
    except MachineError:  # a stroke below the boom's, more steps than a file may have
        return machine


def said_of_loads(given: Machine, before: Machine, after: Machine) -> Iterable[str]:
    """That the file has them, and loads that are others than told."""
    if after is not before:
        names = ", ".join(after.document[payload.NAME]["recordings"])
        yield f"machine.yaml tells the load of each recording, which has times of its own (payload.recordings: {names})"
    found = {told: load for told, load in after.loads.items() if given.loads.get(told, told) != load}
    if found:
        said = ", ".join(f"{load:.4g} kg where {told:g} kg is told" for told, load in found.items())
        yield f"loads that the recordings tell (machine.yaml has them as payload.told): {said}"
