"""The machine file of an identification: the old one with the identified numbers, their source and confidence."""

from __future__ import annotations

import copy
from collections.abc import Iterable, Mapping, Sequence
from datetime import date
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from boom_identification.estimate import Identified
from boom_input.whole import write_whole
from boom_model.components import hose_burst_valve, payload
from boom_model.machine import Machine, check_range
from boom_model.machine_check import STROKE_SLACK
from boom_model.machine_file import machine_from
from boom_model.specification import number
from boom_model.tolerance import TOLERANCES

EFFECTS = "effects."
"""Beginning of the names of an effect's numbers."""
_LAW = "main_valve_orifices.A_ta_law"
_GEOMETRY = ("kinematics.", "cylinder.l_")
_ANGLES = 401


def vector_values(machine: Machine, estimates: Iterable[Identified]) -> dict[str, float | tuple[float, ...]]:
    """Estimates of components (``pilot_valves.h.0``) as values of parameters (``pilot_valves.h``), by dotted key."""
    values: dict[str, float | tuple[float, ...]] = {}
    for found in (e for e in estimates if not e.key.startswith(EFFECTS)):
        parameter = machine.parameters.get(found.key)
        if parameter is not None:
            values[found.key] = found.value
            continue
        key, _, index = found.key.rpartition(".")
        whole = values.get(key, machine.parameters[key].value)
        assert isinstance(whole, tuple)
        values[key] = tuple(found.value if k == int(index) else v for k, v in enumerate(whole))
    return values


def effects_with(machine: Machine, numbers: Mapping[str, float]) -> dict[str, dict[str, float]]:
    """The machine's effects with the numbers among ``numbers`` whose name is ``effects.ID.NAME``."""
    effects = {k: dict(v) for k, v in machine.effects.items()}
    for name in (name for name in numbers if name.startswith(EFFECTS)):
        _, effect, parameter = name.split(".")
        effects.setdefault(effect, {})[parameter] = float(numbers[name])
    return effects


def machine_with(machine: Machine, estimates: Sequence[Identified]) -> Machine:
    """The machine with the estimates in it, those of effects included."""
    told = machine.with_values(vector_values(machine, estimates))
    effects = effects_with(machine, {e.key: e.value for e in estimates})
    return told.with_effects(effects) if effects != machine.effects else told


def fits(machine: Machine, found: Identified) -> str:
    """Why a machine file cannot hold this number; empty if it can."""
    if found.key.startswith(EFFECTS):
        return ""  # a search keeps to the catalogue's limits
    key = found.key if found.key in machine.parameters else found.key.rpartition(".")[0]
    try:
        check_range(machine.parameters[key].specification, (found.value,))
    except Exception as error:  # MachineError; its message names key and range
        return str(error)
    return ""


def document_with(machine: Machine, estimates: Iterable[Identified]) -> dict[str, Any]:
    """The machine's document with the estimates in it; everything else unchanged.

    Raises:
        MachineError: a value that a machine file cannot hold.
    """
    document = copy.deepcopy(dict(machine.document))
    found = {estimate.key: estimate for estimate in estimates}
    effects = effects_with(machine, {key: e.value for key, e in found.items()})
    if effects:
        document["effects"] = effects
    for key, value in vector_values(machine, found.values()).items():
        if key.startswith(_LAW):
            continue
        if key.startswith(payload.SECTION):
            _, name, k = key.split(".")
            step = document[payload.NAME]["steps"][int(k)]
            step["mass" if name == "mass" else machine.structure.steps[int(k)]] = value
            continue
        own = [e for name, e in found.items() if name == key or name.rpartition(".")[0] == key]
        section, name, *leaf = key.split(".")
        if leaf:  # a group of plain numbers with one source
            group = {k: v for k, v in document[section][name].items() if k != "tol"}
            before = {"value": group.get(leaf[0]), "prov": group.get("prov", "not told")}
            document[section][name] = {**group, leaf[0]: value, **_provenance(own, before)}
            continue
        old = document[section].get(name, {"value": machine.parameters[key].value[0], "unit": own[0].unit})
        entry = dict(old) if isinstance(old, Mapping) else {"unit": own[0].unit}
        entry["value"] = list(value) if isinstance(value, tuple) else value
        entry.pop("tol", None)  # what was believed before
        entry |= _provenance(own, old)
        document[section][name] = entry
    if any(key.startswith(_LAW) for key in found):
        _meter_out(document, machine, found)
    if any(key.startswith("hose_burst_valve.a") for key in found):
        _smooth(document)
    if any(key.startswith(_GEOMETRY) for key in found):
        _angle_range(document, machine.with_values(vector_values(machine, found.values())))
    machine_from(document)  # raises where the numbers do not go together
    return document


def write_machine(path: Path, machine: Machine, estimates: Iterable[Identified], *, command: str) -> None:
    """Write the file completely or not at all.

    Raises:
        MachineError: a value that a machine file cannot hold.
        OSError: it cannot be written.
    """
    document = document_with(machine, estimates)
    text = yaml.safe_dump(document, sort_keys=False, allow_unicode=True, width=120)
    head = (
        f"# Identified on {date.today().isoformat()} by: {command}\n# Numbers not marked 'identified' are unchanged.\n"
    )
    write_whole(path, head + text)


def confidence(estimates: Iterable[Identified]) -> str:
    """``high``, ``medium`` or ``low``: the tolerance of the machine notes that covers the widest 90 % interval."""
    widest = max(max(abs(bound - e.value) for bound in e.interval_90) / max(abs(e.value), 1e-300) for e in estimates)
    return next((name for name in ("high", "medium") if widest <= TOLERANCES[name]), "low")


def _provenance(own: list[Identified], old: Any) -> dict[str, str]:
    before = old.get("value") if isinstance(old, Mapping) else old
    source = old.get("prov", "not told") if isinstance(old, Mapping) else "not told"
    bounds = ", ".join(f"{low:.5g} .. {high:.5g}" for low, high in (e.interval_90 for e in own))
    return {
        "prov": f"identified: {own[0].how}",
        "conf": confidence(own),
        "note": f"90 % interval {bounds}; before: {before} ({source})",
    }


def _meter_out(document: dict[str, Any], machine: Machine, found: Mapping[str, Identified]) -> None:
    """The law of A_ta is a text in the file: A_sb/(c0-c1*u^2)."""
    c0, c1 = (
        found[f"{_LAW}.{k}"].value if f"{_LAW}.{k}" in found else machine.parameters[f"{_LAW}.{k}"].value[0]
        for k in ("c0", "c1")
    )
    section = document["main_valve_orifices"]
    old = section["A_ta_law"]
    entry = dict(old) if isinstance(old, Mapping) else {}
    own = [e for key, e in found.items() if key.startswith(_LAW)]
    text = f"A_sb/({c0:.6g}{'-' if c1 >= 0 else '+'}{abs(c1):.6g}*u^2)"
    section["A_ta_law"] = entry | {"value": text, **_provenance(own, old)}


def _angle_range(document: dict[str, Any], machine: Machine) -> None:
    """q2_stroke_min .. q2_max end where the stroke of this geometry ends: the part of the old range that the linkage allows."""
    low, high = machine.angle_limits
    angles = np.linspace(low, high, _ANGLES)
    positions = np.array([machine.piston_position(float(angle)) for angle in angles])
    inside = np.isfinite(positions) & (positions >= -STROKE_SLACK)
    inside &= positions <= machine.parameters["cylinder.l_p"].value[0] + STROKE_SLACK
    inside &= np.append(np.diff(positions) > 0.0, True)
    if inside.all() or not inside[_ANGLES // 2]:
        return
    outside = np.flatnonzero(~inside)
    first = int(max(outside[outside < _ANGLES // 2], default=-1)) + 1
    last = int(min(outside[outside > _ANGLES // 2], default=_ANGLES)) - 1
    for key, k in (("q2_stroke_min", first), ("q2_max", last)):
        if k not in (0, _ANGLES - 1):
            entry = document["kinematics"][key]
            value = {
                "value": float(angles[k]),
                "prov": "derived",
                "note": "end of the stroke with the identified lengths",
            }
            document["kinematics"][key] = {**entry, **value} if isinstance(entry, Mapping) else value["value"]


def _smooth(document: dict[str, Any]) -> None:
    """a_22 and the node follow from the other coefficients (5.29); the stated values are adapted."""
    section = document["hose_burst_valve"]
    a22, node = hose_burst_valve.smooth_node(*(number(section[k]) for k in ("a21", "a30", "a31")))
    for key, value in (("a22", a22), ("a22_c1", a22), ("node", node), ("node_c1", node)):
        if key in section:
            entry = section[key]
            follows = {"value": float(value), "prov": "derived", "note": "follows from a21, a30, a31 (5.29)"}
            section[key] = {**entry, **follows} if isinstance(entry, Mapping) else float(value)
