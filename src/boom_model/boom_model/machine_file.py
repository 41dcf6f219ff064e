"""Machine files: every number of a machine, with unit, source and confidence; checked key by key.

A missing, misspelt or impossible value is a :class:`MachineError` that names the key and the allowed range; nothing is
filled in silently. The components that a machine has (``type:`` keys) decide the structure of the equations; a section without
``type`` is the thesis' component. See docs/machine_file.md.
"""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from importlib.resources import files
from itertools import pairwise
from math import isfinite
from pathlib import Path
from typing import Any, cast

from boom_input.files import InputError, read_text
from boom_input.shown import quoted
from boom_input.yaml_text import line_of, parse_yaml
from boom_model import rigid_body, sensors
from boom_model.components.hose_burst_valve import smooth_node
from boom_model.effects import active_effects
from boom_model.errors import MachineError, nearest
from boom_model.learned import check_learned
from boom_model.machine import TOLERANCES, Confidence, Machine, Parameter, Pose, check_overlap, check_range, number
from boom_model.specification import Specification
from boom_model.structure import Structure

# Keys that a section may hold beside its parameters: for people, for other parts of the project, or derived from others.
_INFORMATION: dict[str, frozenset[str]] = {
    "meta": frozenset({"name", "version", "pressure_reference", "angle_q2"}),
    "constants": frozenset(),
    "fluid": frozenset({"p_s", "q_pump_max", "dp_c"}),
    "cylinder": frozenset({"D_piston", "d_rod"}),
    "kinematics": frozenset({"type", "q2_stroke_min", "q2_max", "q2_recommended", "s_p_poly6", "triangle_fit"}),
    "rigid_body": frozenset(
        {"convention", "configs", "m_total_moving", "m_log", "m_load_test", "links", "joint_limits", "planar"}
    ),
    "friction": frozenset(),
    "hose_burst_valve": frozenset({"type", "a22", "node", "a22_c1", "node_c1"}),
    "accumulators": frozenset({"type"}),
    "main_valve_spool": frozenset({"type", "d_spool", "p_max", "xi_s"}),
    "main_valve_orifices": frozenset(
        {"compensator", "A_0", "A_ta_law", "A_ta_law_soft", "A_ta_max", "anti_cavitation"}
    ),
    "pilot_valves": frozenset({"type", "i_range", "i_neutral"}),
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
_TOP = frozenset({*_INFORMATION, "effects", "learned"})
_NUMBER = r"([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)"
_METER_OUT = re.compile(rf"^\s*A_sb\s*/\s*\(\s*{_NUMBER}\s*([+-])\s*{_NUMBER}\s*\*\s*u\^2\s*\)\s*$")
_KEY = re.compile(r"\w+(?:\.\w+)*")
STROKE_SLACK = 1e-3
SMALLEST_CURVATURE = 1e-6
LONGEST_NAME = 100
LONGEST_MESSAGE = 500
LARGEST = 1e9
"""Of a first moment [kg m], an inertia [kg m^2], a place [m]: no crane comes near, and squares of it stay finite."""


def load_machine(source: str | Path) -> Machine:
    """Reads a machine file: the name of one that is shipped (``tz17``) or the path of a YAML file.

    Raises:
        MachineError: not found, not YAML, or a key that is missing, misspelt or impossible; with file and line.
    """
    machine, faults = check_machine(source)
    if machine is None:
        raise MachineError(faults[0])
    return machine


def shipped_machines() -> list[str]:
    """Names of the machine files that are shipped."""
    entries = files("boom_model").joinpath("machines").iterdir()
    return sorted(entry.name.removesuffix(".yaml") for entry in entries if entry.name.endswith(".yaml"))


def shipped_machine(name: str) -> Machine:
    """The machine of a name that came from outside, over a topic or in a bag: one that is shipped, never a path.

    Raises:
        MachineError: not shipped.
    """
    if name not in shipped_machines():
        raise MachineError(
            f"machine '{quoted(name, 60)}' is not shipped (there is {', '.join(shipped_machines())}): give its file with --machine"
        )
    return load_machine(name)


def machine_from(document: Any) -> Machine:
    """Checks a document in the form of a machine file.

    Raises:
        MachineError: names the first key that is missing, misspelt or impossible.
    """
    machine, faults = _check(document)
    if machine is None:
        raise MachineError(faults[0])
    return machine


def check_machine(source: str | Path) -> tuple[Machine | None, list[str]]:
    """A machine file, or all of its faults, each one line with file and line, in the order of the file.

    Raises:
        MachineError: it cannot be read, or is not YAML.
    """
    try:
        text, where = _read(source)
        document = parse_yaml(text, where)
    except InputError as error:
        raise MachineError(str(error)) from None
    machine, faults = _check(document)
    lines = {fault: _line(fault, text) for fault in faults}
    return machine, [_told(fault, where, lines[fault]) for fault in sorted(faults, key=lambda fault: lines[fault] or 0)]


# ---------------------------------------------------------------------------------------------- reading and checking


def _line(fault: str, text: str) -> int | None:
    """Where the key stands that a fault begins with; None where it is not there."""
    key = _KEY.match(fault)
    return line_of(text, key.group().split(".")) if key else None


def _told(fault: str, where: str, line: int | None) -> str:
    """A fault with file and line; whatever the file says of itself, it is one line of a length that can be read."""
    return quoted(f"{where}, line {line}: {fault}" if line else f"{where}: {fault}", LONGEST_MESSAGE)


class _Faults(list[str]):
    """What is wrong with a file; the first one ends nothing but the step that it is found in."""

    def of(self, step: Callable[..., Any], *arguments: Any) -> Any:
        """What a step gives; None, and one more fault, where it raises a MachineError."""
        try:
            return step(*arguments)
        except MachineError as error:
            self.append(str(error))
            return None


def _check(document: Any) -> tuple[Machine | None, list[str]]:
    if not isinstance(document, dict):
        return None, ["not a machine file: expected sections such as fluid, cylinder, kinematics"]
    faults = _Faults()
    sections = {}
    for name, section in document.items():
        if name not in _TOP:
            faults.append(f"{name}: no such section{nearest(str(name), _TOP)}")
        elif name not in ("effects", "learned") and not isinstance(section, dict):
            faults.append(f"{name}: expected keys with values below it")
        else:
            sections[name] = section
    always = ("meta", "constants", "fluid", "cylinder", "kinematics", "rigid_body", "friction")
    faults += [f"{name}: the section is missing" for name in always if name not in document]
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
    learned = faults.of(check_learned, sections.get("learned") or []) or ()
    if not structure.pilot_valves and any(entry.equation == "spool" or "spool" in entry.validity for entry in learned):
        faults.append("learned: this machine has no pilot stage, so that no term can use the spool")
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
    )
    for step in (_check_positions, _check_areas, _check_hose_burst_valve, _check_pilot_curve, _check_links):
        faults.of(step, machine)
    faults.of(check_overlap, machine.parameters, machine.effects)
    return (None if faults else machine), faults


def _read(source: str | Path) -> tuple[str, str]:
    shipped = files("boom_model").joinpath("machines")
    known = shipped_machines()
    if not str(source).strip() or str(source) == ".":
        raise MachineError(f"no machine named; shipped are {', '.join(known)}, or give the path of a .yaml file")
    if str(source) in known:
        return shipped.joinpath(f"{source}.yaml").read_text(encoding="utf-8"), str(source)
    path = Path(source)
    if path.suffix in (".yaml", ".yml") or os.path.exists(path):
        return read_text(path), str(path)
    raise MachineError(
        f"{quoted(source)}: no such machine; shipped are {', '.join(known)}, or give the path of a .yaml file"
    )


def _structure(document: Mapping[str, Any]) -> Structure:
    def kind(section: str, allowed: tuple[str, ...]) -> str:
        if section not in document:
            raise MachineError(
                f"{section}: the section is missing; a machine without it says {section}: {{type: none}}"
            )
        value = document[section].get("type", allowed[0])
        if value not in allowed:
            raise MachineError(f"{section}.type: {value!r} is not one of {', '.join(allowed)}")
        return str(value)

    pilot = kind("pilot_valves", ("wiener", "none")) == "wiener"
    spool = kind("main_valve_spool", ("pilot_operated", "direct"))
    if pilot != (spool == "pilot_operated"):
        raise MachineError("pilot_valves.type: none goes with main_valve_spool.type: direct, and only with it")
    if "main_valve_orifices" not in document:
        raise MachineError("main_valve_orifices: the section is missing")
    orifices = document["main_valve_orifices"]
    compensator = orifices.get("compensator", True)
    if not isinstance(compensator, bool):
        raise MachineError(f"main_valve_orifices.compensator: {compensator!r} is not true or false")
    anti_cavitation = orifices.get("anti_cavitation")
    enabled = anti_cavitation.get("enabled") if isinstance(anti_cavitation, dict) else None
    if not isinstance(enabled, bool):
        raise MachineError("main_valve_orifices.anti_cavitation.enabled: say true or false")
    return Structure(
        linkage="four_bar" if kind("kinematics", ("four_bar", "triangle")) == "four_bar" else "triangle",
        accumulators=kind("accumulators", ("two_diaphragm", "none")) != "none",
        hose_burst_valve=kind("hose_burst_valve", ("flow_limiting", "none")) != "none",
        pilot_valves=pilot,
        compensator=compensator,
        anti_cavitation=enabled,
    )


def _name(meta: Mapping[str, Any]) -> str:
    name = meta.get("name")
    if not isinstance(name, str) or not name.strip():
        raise MachineError("meta.name: missing" if name is None else f"meta.name: {name!r} is not a text")
    if len(name) > LONGEST_NAME or not name.isprintable():
        raise MachineError(f"meta.name: give one line of at most {LONGEST_NAME} printable characters")
    if meta.get("pressure_reference", "gauge") != "gauge":
        raise MachineError("meta.pressure_reference: only gauge is known; write all pressures as gauge pressures")
    return name


def _wrong_keys(document: Mapping[str, Any], specifications: Iterable[Specification]) -> Iterator[str]:
    wanted: dict[str, set[str]] = {}
    for spec in specifications:
        section, key = spec.key.split(".")[:2]
        wanted.setdefault(section, set()).add(key)
    for section, keys in document.items():
        if section in ("effects", "learned"):
            continue
        allowed = wanted.get(section, set()) | _INFORMATION[section]
        for key in keys:
            if key not in allowed:
                absent = "" if wanted.get(section) or document[section].get("type") != "none" else " (type: none)"
                yield f"{section}.{key}: no such key{absent}{nearest(str(key), allowed)}"


def _parameter(document: Mapping[str, Any], spec: Specification) -> Parameter:
    path = spec.key.split(".")
    section = document.get(path[0], {})
    if path[1] == "A_ta_law":
        return _meter_out_law(section, spec)
    if path[1] == "anti_cavitation":
        group = section["anti_cavitation"]
        if path[2] not in group:
            raise MachineError(f"{spec.key}: missing ({spec.meaning}, {spec.unit})")
        entry: Any = {"value": group[path[2]], "unit": spec.unit, "prov": group.get("prov", "")}
    elif path[1] not in section:
        raise MachineError(
            f"{spec.key}: missing ({spec.meaning}); expected {spec.minimum:g} .. {spec.maximum:g} {spec.unit}"
        )
    else:
        entry = section[path[1]]
    if not isinstance(entry, dict) or "value" not in entry:
        raise MachineError(f"{spec.key}: write {{value: ..., unit: {spec.unit}}}")
    unknown = set(entry) - {"value", "unit", "prov", "conf", "note"}
    if unknown:
        raise MachineError(f"{spec.key}.{sorted(unknown)[0]}: no such key; known: value, unit, prov, conf, note")
    if str(entry.get("unit", "")).strip() != spec.unit:
        raise MachineError(f"{spec.key}.unit: {entry.get('unit', 'missing')!s}; expected {spec.unit}")
    if spec.shape == "scalar":
        value: tuple[float, ...] = (number(entry),)
    else:
        listed = entry["value"]
        size = len(spec.components)
        if not isinstance(listed, list) or len(listed) != size:
            raise MachineError(f"{spec.key}: expected a list of {size} numbers [{spec.unit}]")
        value = tuple(number(v) for v in listed)
    check_range(spec, value, shown=entry["value"])
    return Parameter(spec, value, str(entry.get("prov", "")), _confidence(entry, spec), str(entry.get("note", "")))


def _confidence(entry: Mapping[str, Any], spec: Specification) -> Confidence:
    confidence = entry.get("conf", "")
    if not isinstance(confidence, str) or confidence not in TOLERANCES:
        raise MachineError(f"{spec.key}.conf: {confidence!r} is not high, medium or low")
    return cast(Confidence, confidence)


def _meter_out_law(section: Mapping[str, Any], spec: Specification) -> Parameter:
    if "A_ta_law" not in section:
        raise MachineError('main_valve_orifices.A_ta_law: missing; expected e.g. {value: "A_sb/(2.27-0.7*u^2)"}')
    entry = section["A_ta_law"]
    text = entry.get("value") if isinstance(entry, dict) else entry
    match = _METER_OUT.match(str(text))
    if match is None:
        raise MachineError(f"main_valve_orifices.A_ta_law: {text!r} is not of the form A_sb/(2.27-0.7*u^2)")
    c0, c1 = float(match[1]), float(match[3]) * (1 if match[2] == "-" else -1)
    if c0 - max(c1, 0.0) * 1.3**2 <= 0.0:
        raise MachineError(f"main_valve_orifices.A_ta_law: {text!r} is not positive up to u = 1.3")
    value = (c0 if spec.key.endswith("c0") else c1,)
    check_range(spec, value)
    given = {"conf": "low", **entry} if isinstance(entry, dict) else {"conf": "low"}
    return Parameter(spec, value, str(given.get("prov", "")), _confidence(given, spec))


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
        if not D0 > 0:
            raise MachineError(f"rigid_body.configs.{name}.D0: {D0:g} is not a positive inertia [kg m^2]")
        tip = entry.get("tip")
        if not isinstance(tip, list) or len(tip) != 2 or not all(abs(number(v)) <= LARGEST for v in tip):
            raise MachineError(f"rigid_body.configs.{name}.tip: expected [x, y] in m")
        poses.append(Pose(q3, q4, 0.0, D0, Sx, Sy, (number(tip[0]), number(tip[1])), str(name)))
    return tuple(poses)


def _check_links(machine: Machine) -> None:
    """What places the bodies in any pose, tried in the middle of the joint's range, so that an error shows at once."""
    body = machine.document["rigid_body"]
    middle = machine.tabulated[0].outer_boom_angle
    if "joint_limits" in body:
        limits = rigid_body.vector(
            rigid_body.entry(body["joint_limits"], "rigid_body.joint_limits", "q3"), "rigid_body.joint_limits.q3", 2
        )
        if not limits[0] < limits[1]:
            raise MachineError(f"rigid_body.joint_limits.q3: {limits[0]:g} .. {limits[1]:g} rad is no range")
        middle = float(limits.mean())
    if "planar" in body:
        rigid_body.check_pose(body, middle, 0.0)
        placed = rigid_body.place_bodies(body, middle, 0.0)
        if not sum(part.mass * float(part.center @ part.center) + part.inertia for part in placed) > 0.0:
            raise MachineError("rigid_body.links: all bodies of the boom together have no inertia")


def _check_positions(machine: Machine) -> None:
    low, high = machine.angle_limits
    if low >= high:
        raise MachineError(f"kinematics.q2_max: {high:g} rad is not above q2_stroke_min, {low:g} rad")
    stroke = machine.parameters["cylinder.l_p"].value[0]
    steps = 40
    positions = [machine.piston_position(low + (high - low) * k / steps) for k in range(steps + 1)]
    if not all(isfinite(s) for s in positions):
        raise MachineError(f"kinematics: the linkage cannot be assembled everywhere in {low:g} .. {high:g} rad")
    if positions[0] < -STROKE_SLACK or positions[-1] > stroke + STROKE_SLACK:
        raise MachineError(
            f"kinematics: {low:g} .. {high:g} rad needs s_p = {positions[0]:.4f} .. {positions[-1]:.4f} m, "
            f"but the stroke cylinder.l_p is 0 .. {stroke:g} m"
        )
    if any(b <= a for a, b in pairwise(positions)):
        raise MachineError("kinematics: s_p must grow with q2 over the whole range")


def _check_areas(machine: Machine) -> None:
    areas = machine.parameters["cylinder.A_a"].value[0], machine.parameters["cylinder.A_b"].value[0]
    if areas[1] >= areas[0]:
        raise MachineError(f"cylinder.A_b: {areas[1]:g} m^2 is not smaller than A_a, {areas[0]:g} m^2 (single rod)")


def _check_pilot_curve(machine: Machine) -> None:
    """(5.6) is the rising branch of h."""
    if machine.structure.pilot_valves and not machine.parameters["pilot_valves.h"].value[0] >= SMALLEST_CURVATURE:
        raise MachineError(
            f"pilot_valves.h: the first number must be at least {SMALLEST_CURVATURE:g} bar/A^2, so that h rises"
        )


def _check_hose_burst_valve(machine: Machine) -> None:
    """a_22 and the node follow from the other coefficients (5.29); printed ones must agree with them."""
    if not machine.structure.hose_burst_valve:
        return
    a21, a30, a31 = (machine.parameters[f"hose_burst_valve.{k}"].value[0] for k in ("a21", "a30", "a31"))
    if a21 <= a31:
        raise MachineError(f"hose_burst_valve.a31: {a31:g} must be below a21, {a21:g} l/min/bar")
    a22, node = smooth_node(a21, a30, a31)
    section = machine.document["hose_burst_valve"]
    for key, value in (("a22", a22), ("a22_c1", a22), ("node", node), ("node_c1", node)):
        if key in section and not abs(number(section[key]) / value - 1) <= 0.02:
            raise MachineError(
                f"hose_burst_valve.{key}: {number(section[key]):g} does not fit a21, a30, a31, with which the branches "
                f"meet smoothly at {value:.4g} (5.29); correct it or leave it out"
            )
