"""Checks the document of a machine file key by key, and builds the machine from it."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Set
from itertools import pairwise
from math import isfinite, pi
from typing import Any, cast

from boom_model import rigid_body, sensors
from boom_model.catalogue import active_effects
from boom_model.errors import MachineError, nearest
from boom_model.learned import check_learned
from boom_model.machine import Confidence, Machine, Parameter, Pose, check_range, check_together
from boom_model.machine_payload import check_payload
from boom_model.slots import C, component, registered
from boom_model.specification import Specification, number
from boom_model.structure import SLOTS, Structure
from boom_model.tolerance import TOLERANCES, check_tolerance

TURN = 2.0 * pi
"""Largest angle of the outer boom [rad]: beyond a turn it is in degrees."""
SUPPLY, TANK = "fluid.p_s", "fluid.p_t"
LEAST_RANGE = 0.02
"""rad. Of the boom's angles; recordings that move less are not fitted."""

# Keys that a section may hold beside its parameters: for people, for other parts of the project, or derived from others. What
# names a component, and what components allow, is added.
_INFORMATION: dict[str, frozenset[str]] = {
    "meta": frozenset({"name", "version", "pressure_reference", "angle_q2"}),
    "constants": frozenset(),
    "fluid": frozenset({"p_s", "q_pump_max", "dp_c"}),
    "cylinder": frozenset({"D_piston", "d_rod"}),
    "kinematics": frozenset({"q2_stroke_min", "q2_max", "q2_recommended", "s_p_poly6", "triangle_fit"}),
    "rigid_body": frozenset(
        {"convention", "configs", "m_total_moving", "m_log", "m_load_test", "links", "joint_limits", "planar"}
    ),
    "friction": frozenset(),
    "hose_burst_valve": frozenset(),
    "accumulators": frozenset(),
    "main_valve_spool": frozenset({"d_spool", "p_max", "xi_s"}),
    "main_valve_orifices": frozenset(),
    "pilot_valves": frozenset({"i_range", "i_neutral"}),
    "control": frozenset(
        {
            *(s.key.split(".")[1] for s in sensors.SPECIFICATIONS),
            "pos_poles",
            "force_poles",
            "svf_poles",
            "perturbations",
        }
    ),
}
_FREE = ("effects", "learned", "payload")
"""Sections that are not checked by the parameters of components."""
_TOP = frozenset({*_INFORMATION, *_FREE})
_ALWAYS = ("meta", "constants", "fluid", "cylinder", "kinematics", "rigid_body", "friction")
"""Sections that every machine has, beside those that name a component."""
STROKE_SLACK = 1e-3
"""m."""
LONGEST_NAME = 100
LARGEST = 1e9
"""Limit of a first moment [kg m], an inertia [kg m^2], a position [m]: far beyond any crane, and its squares stay finite."""


class _Faults(list[str]):
    """The faults of a file; a fault ends only the step in which it is found."""

    def of(self, step: Callable[..., Any], *arguments: Any) -> Any:
        """The result of a step; None, and one more fault, if it raises a MachineError."""
        try:
            return step(*arguments)
        except MachineError as error:
            said = str(error)
            section = re.split(r"[.:\[]", said)[0]
            unread = any(fault.startswith((f"{section}: the section", f"{section}: expected keys")) for fault in self)
            if said not in self and not unread:  # one fault is told once
                self.append(said)
            return None


def check(document: Any) -> tuple[Machine | None, list[str]]:
    """The machine of a document in the form of a machine file, or all its faults, one line each."""
    if not isinstance(document, dict):
        return None, ["not a machine file: expected sections such as fluid, cylinder, kinematics"]
    faults = _Faults()
    sections = _sections(document, faults)
    structure = faults.of(_structure, sections)
    if structure is None:
        return None, faults
    name = faults.of(_name, sections.get("meta", {}))
    specifications = [s for s in structure.specifications() if not s.key.startswith("pose.")]
    faults += _wrong_keys(sections, specifications)
    there = [s for s in specifications if s.key.split(".")[0] in sections]
    parameters = {s.key: faults.of(_parameter, sections, s) for s in there}
    poses = faults.of(_tabulated, sections.get("rigid_body", {}))
    said = {s.key: faults.of(_parameter, sections, s) for s in sensors.SPECIFICATIONS if _given(sections, s)}
    kinematics = sections.get("kinematics", {})
    limits = faults.of(_limit, kinematics, "q2_stroke_min"), faults.of(_limit, kinematics, "q2_max")
    effects = faults.of(active_effects, sections.get("effects") or {}, structure.has)
    payloads = faults.of(check_payload, sections.get("payload") or {})
    learned = faults.of(check_learned, sections.get("learned") or []) or ()
    if not structure.spool.piloted and any(entry.equation == "spool" for entry in learned):
        faults.append("learned: this machine has no pilot stage, to whose pressure a term of equation spool is added")
    if faults:
        return None, faults
    machine = Machine(
        name,
        structure,
        parameters,
        limits,
        effects,
        poses,
        {key.split(".")[1]: parameter.value[0] for key, parameter in said.items()},
        document,
        learned,
        *payloads,
    )
    machine = faults.of(machine.carrying) or machine
    for step in (_check_pressures, _check_positions, _check_areas, _check_links, check_together):
        faults.of(step, machine)
    for part in structure:
        faults.of(part.check, machine.numbers, document.get(part.key[0], {}))
    return (None if faults else machine), faults


def _sections(document: Mapping[Any, Any], faults: list[str]) -> dict[str, Any]:
    """The readable sections; errors of the others are added to the faults."""
    sections = {}
    for name, section in document.items():
        if name not in _TOP:
            faults.append(f"{name}: no such section{nearest(str(name), _TOP)}")
        elif name not in _FREE and not isinstance(section, dict):
            optional = (
                "" if name in _ALWAYS or any(slot.key[0] == name for slot in SLOTS) else ", or leave the section out"
            )
            faults.append(f"{name}: expected keys with values below it{optional}")
        else:
            sections[name] = section
    faults += [f"{name}: the section is missing" for name in _ALWAYS if name not in document]
    return sections


def _structure(document: Mapping[str, Any]) -> Structure:
    chosen = Structure(**{slot.slot: _component(document, slot) for slot in SLOTS})  # type: ignore[arg-type]
    chosen.check()
    return chosen


def _component(document: Mapping[str, Any], slot: type[C]) -> C:
    """The component that the file names for a slot."""
    section, *path = slot.key
    if section not in document:
        may_lack = path == ["type"] and any(c.name == "none" for c in registered(slot))
        absent = f"; a machine without it says {section}: {{type: none}}" if may_lack else ""
        raise MachineError(f"{section}: the section is missing{absent}")
    value: Any = document[section]
    for key in path:
        value = value.get(key) if isinstance(value, dict) else None
    missing = value is None and path[0] not in document[section]
    return component(slot, slot.default if missing else value)


def _name(meta: Mapping[str, Any]) -> str:
    name = meta.get("name")
    if not isinstance(name, str) or not name.strip():
        raise MachineError("meta.name: missing" if name is None else f"meta.name: {name!r} is not a text")
    if len(name) > LONGEST_NAME or not name.isprintable() or name != name.strip():
        raise MachineError(
            f"meta.name: give one line of at most {LONGEST_NAME} printable characters, without blanks around them"
        )
    if meta.get("pressure_reference", "gauge") != "gauge":
        raise MachineError("meta.pressure_reference: only gauge is known; write all pressures as gauge pressures")
    return name


def _wrong_keys(document: Mapping[str, Any], specifications: Iterable[Specification]) -> Iterator[str]:
    wanted: dict[str, set[str]] = {}
    for spec in specifications:
        section, key = spec.key.split(".")[:2]
        wanted.setdefault(section, set()).add(key)
    for section, keys in document.items():
        if section in _FREE:
            continue
        allowed = wanted.get(section, set()) | _INFORMATION[section] | _component_keys(section)
        for key in keys:
            if key not in allowed:
                absent = "" if wanted.get(section) or document[section].get("type") != "none" else " (type: none)"
                yield f"{section}.{key}: no such key{absent}{nearest(str(key), allowed)}"


def _component_keys(section: str) -> set[str]:
    """Keys that name a component in a section, and those that one of its components allows."""
    slots = [slot for slot in SLOTS if slot.key[0] == section]
    return {slot.key[1] for slot in slots}.union(*(c.information for slot in slots for c in registered(slot)))


def _parameter(document: Mapping[str, Any], spec: Specification) -> Parameter:
    entry = _entry(document, spec)
    unknown = set(entry) - {"value", "unit", "prov", "conf", "tol", "note"}
    if unknown:
        raise MachineError(f"{spec.key}.{sorted(unknown, key=str)[0]}: no such key; {_decimal_comma(entry, unknown)}")
    if str(entry.get("unit", "")).strip() != spec.unit:
        text = "" if isinstance(entry.get("unit", ""), str) else ", as one text"
        raise MachineError(f"{spec.key}.unit: {entry.get('unit', 'missing')!s}; expected {spec.unit}{text}")
    value = _value(entry, spec)
    check_range(spec, value, shown=entry["value"])
    tol = check_tolerance(entry["tol"], spec.key, value) if "tol" in entry else None
    if tol is not None and tol.word != "factor" and 2 * max(map(tol.sigma, value)) > spec.maximum - spec.minimum:
        raise MachineError(
            f"{spec.key}.tol: {tol} is wider than all that it may be, {spec.minimum:g} .. {spec.maximum:g} {spec.unit}"
        )
    return Parameter(spec, value, str(entry.get("prov", "")), _confidence(entry, spec), str(entry.get("note", "")), tol)


def _decimal_comma(entry: Mapping[str, Any], unknown: Set[Any]) -> str:
    """What is known of an entry; that ``870,5`` in braces are two things, a value 870 and a key 5 without one."""
    for key in unknown:
        if entry[key] is None and str(key).isdigit():
            return f"if {entry.get('value')},{key} is meant: decimals stand behind a point, {entry.get('value')}.{key}"
    return "known: value, unit, prov, conf, tol, note"


def _entry(document: Mapping[str, Any], spec: Specification) -> Mapping[str, Any]:
    section, name = spec.key.split(".")[:2]
    given = document.get(section, {})
    if spec.entry:
        return spec.entry(given, spec)
    if name not in given and spec.default is not None:
        return {"value": spec.default, "unit": spec.unit, "prov": "literature"}
    if name not in given:
        raise MachineError(
            f"{spec.key}: missing ({spec.meaning}); expected {spec.minimum:g} .. {spec.maximum:g} {spec.unit}"
        )
    entry = given[name]
    if not isinstance(entry, dict) or "value" not in entry:
        raise MachineError(f"{spec.key}: write {{value: ..., unit: {spec.unit}}}")
    return entry


def _value(entry: Mapping[str, Any], spec: Specification) -> tuple[float, ...]:
    if spec.shape == "scalar":
        return (number(entry),)
    listed, size = entry["value"], len(spec.components)
    if not isinstance(listed, list) or len(listed) != size:
        raise MachineError(f"{spec.key}: expected a list of {size} numbers [{spec.unit}]")
    return tuple(number(v) for v in listed)


def _confidence(entry: Mapping[str, Any], spec: Specification) -> Confidence:
    confidence = entry.get("conf", "")
    if not isinstance(confidence, str) or confidence not in TOLERANCES:
        raise MachineError(f"{spec.key}.conf: {confidence!r} is not high, medium or low")
    return cast(Confidence, confidence)


def _limit(section: Mapping[str, Any], key: str) -> float:
    if key not in section:
        raise MachineError(f"kinematics.{key}: missing (limit of the boom angle); expected -3.2 .. 3.2 rad")
    value = number(section[key])
    if not -3.2 <= value <= 3.2:
        raise MachineError(f"kinematics.{key}: {value} is outside -3.2 .. 3.2 rad")
    return value


def _given(document: Mapping[str, Any], spec: Specification) -> bool:
    section, key = spec.key.split(".")
    return key in document.get(section, {})


def _tabulated(section: Mapping[str, Any]) -> tuple[Pose, ...]:
    configs = section.get("configs")
    if not isinstance(configs, dict) or not configs:
        raise MachineError(
            "rigid_body.configs: missing; expected at least one configuration with q3, q4, D0, Sx, Sy, tip"
        )
    poses = []
    for name, entry in configs.items():
        for key in ("q3", "q4", "D0", "Sx", "Sy"):
            if not isinstance(entry, dict) or key not in entry:
                raise MachineError(f"rigid_body.configs.{name}.{key}: missing")
            if not abs(number(entry[key])) <= LARGEST:
                raise MachineError(f"rigid_body.configs.{name}.{key}: {entry[key]!r} is not a number up to {LARGEST:g}")
        q3, q4, D0, Sx, Sy = (number(entry[key]) for key in ("q3", "q4", "D0", "Sx", "Sy"))
        if not abs(q3) <= TURN:
            raise MachineError(f"rigid_body.configs.{name}.q3: {q3:g} rad is more than a turn: is it in degrees?")
        if not D0 > 0:
            raise MachineError(f"rigid_body.configs.{name}.D0: {D0:g} is not a positive inertia [kg m^2]")
        tip = entry.get("tip")
        if not isinstance(tip, list) or len(tip) != 2 or not all(abs(number(v)) <= LARGEST for v in tip):
            raise MachineError(f"rigid_body.configs.{name}.tip: expected [x, y] in m")
        if "tol" in entry:
            check_tolerance(entry["tol"], f"rigid_body.configs.{name}", (D0, Sx, Sy))
        poses.append(Pose(q3, q4, 0.0, D0, Sx, Sy, (number(tip[0]), number(tip[1])), str(name)))
    return tuple(poses)


def _check_links(machine: Machine) -> None:
    """Check the data that place the bodies in any pose, in the middle of the joint's range, so that an error shows at once."""
    body = machine.document["rigid_body"]
    middle = machine.tabulated[0].outer_boom_angle
    if "joint_limits" in body:
        limits = rigid_body.vector(
            rigid_body.entry(body["joint_limits"], "rigid_body.joint_limits", "q3"), "rigid_body.joint_limits.q3", 2
        )
        if not limits[0] < limits[1]:
            raise MachineError(f"rigid_body.joint_limits.q3: {limits[0]:g} .. {limits[1]:g} rad is no range")
        if not max(map(abs, limits)) <= TURN:
            raise MachineError(
                f"rigid_body.joint_limits.q3: {limits[0]:g} .. {limits[1]:g} rad is more than a turn: is it in degrees?"
            )
        middle = float(limits.mean())
    if "planar" in body:
        rigid_body.check_pose(body, middle, 0.0)
        placed = rigid_body.place_bodies(body, middle, 0.0)
        if not sum(part.mass * float(part.center @ part.center) + part.inertia for part in placed) > 0.0:
            raise MachineError("rigid_body.links: all bodies of the boom together have no inertia")


def _check_pressures(machine: Machine) -> None:
    if SUPPLY in machine.parameters:
        supply, tank = (machine.parameters[key].value[0] for key in (SUPPLY, TANK))
        if supply <= tank:
            raise MachineError(
                f"{SUPPLY}: {supply:g} Pa is not above the tank's, {TANK}: {tank:g} Pa: oil flows from one to the other"
            )


def _check_positions(machine: Machine) -> None:
    low, high = machine.angle_limits
    if low >= high:
        raise MachineError(f"kinematics.q2_max: {high:g} rad is not above q2_stroke_min, {low:g} rad")
    if high - low < LEAST_RANGE:
        raise MachineError(
            f"kinematics.q2_max: {high:g} rad is {high - low:.2g} rad above q2_stroke_min: no boom turns by less than "
            f"{LEAST_RANGE:g} rad"
        )
    stroke = machine.parameters["cylinder.l_p"].value[0]
    steps = 40
    positions = [machine.piston_position(low + (high - low) * k / steps) for k in range(steps + 1)]
    if not all(isfinite(s) for s in positions):
        raise MachineError(f"kinematics: the linkage cannot be assembled everywhere in {low:g} .. {high:g} rad")
    if positions[0] < -STROKE_SLACK or positions[-1] > stroke + STROKE_SLACK:
        raise MachineError(
            f"kinematics: {low:g} .. {high:g} rad needs s_p = {positions[0]:.4f} .. {positions[-1]:.4f} m, "
            f"but the stroke cylinder.l_p is 0 .. {stroke:g} m: correct cylinder.l_min (which shifts s_p), the pins, "
            f"or {' and '.join(_ends_beyond(positions, stroke))}"
        )
    if any(b <= a for a, b in pairwise(positions)):
        raise MachineError("kinematics: s_p must grow with q2 over the whole range")


def _ends_beyond(positions: list[float], stroke: float) -> list[str]:
    """The limits of the angle at which the piston would be beyond an end of its stroke."""
    beyond = {"q2_stroke_min": positions[0] < -STROKE_SLACK, "q2_max": positions[-1] > stroke + STROKE_SLACK}
    return [f"kinematics.{name}" for name, is_beyond in beyond.items() if is_beyond]


def _check_areas(machine: Machine) -> None:
    areas = machine.parameters["cylinder.A_a"].value[0], machine.parameters["cylinder.A_b"].value[0]
    if areas[1] >= areas[0]:
        raise MachineError(f"cylinder.A_b: {areas[1]:g} m^2 is not smaller than A_a, {areas[0]:g} m^2 (single rod)")
