"""Machine files: every number of a machine, with unit, source and confidence; checked key by key.

A missing, misspelt or impossible value is a :class:`MachineError` that names the key and the allowed range; nothing is
filled in silently. The components that a machine has (``type:`` keys) decide the structure of the equations; a section without
``type`` is the thesis' component. See docs/machine_file.md.
"""

from __future__ import annotations

import difflib
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from importlib.resources import files
from math import isfinite
from pathlib import Path
from types import SimpleNamespace
from typing import Any, Literal

import yaml

from boom_model import four_bar_linkage, triangle_linkage
from boom_model.effects import check_effects, is_neutral
from boom_model.errors import MachineError
from boom_model.hose_burst_valve import smooth_node
from boom_model.rigid_body import locked_inertia
from boom_model.sensors import SensorNoise
from boom_model.specification import Specification
from boom_model.structure import Structure

Confidence = Literal["high", "medium", "low", ""]
TOLERANCES = {"high": 0.03, "medium": 0.10, "low": 0.30, "": 0.15}
"""How far a number may be off before it is no longer the same machine (machine notes)."""

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
        {"Ts", "pos_poles", "force_poles", "svf_poles", "q2_quant", "p_quant", "p_noise_psd", "perturbations"}
    ),
}
_TOP = frozenset({*_INFORMATION, "effects"})
_METER_OUT = re.compile(r"^\s*A_sb\s*/\s*\(\s*([0-9.eE+-]+?)\s*([+-])\s*([0-9.eE+-]+?)\s*\*\s*u\^2\s*\)\s*$")
_STROKE_SLACK = 1e-3


@dataclass(frozen=True)
class Parameter:
    """One number (or pair, triple) of a machine file with where it comes from and how sure it is."""

    specification: Specification
    value: tuple[float, ...]
    source: str = ""
    confidence: Confidence = ""
    note: str = ""

    @property
    def tolerance(self) -> float:
        """Relative tolerance within which it is still the same machine."""
        if self.source.startswith("thesis"):
            return TOLERANCES["high"]
        return TOLERANCES[self.confidence]


@dataclass(frozen=True)
class Pose:
    """The locked joints and what follows from them: q_3 [rad], q_4 [m], load [kg], D_0, S_x, S_y, tip."""

    outer_boom_angle: float
    telescope_length: float
    load: float
    D0: float
    Sx: float
    Sy: float
    tip: tuple[float, float]
    tabulated: str = ""

    def values(self) -> dict[str, float]:
        """Components of the model's section ``pose``."""
        return {
            "pose.D0": self.D0, "pose.Sx": self.Sx, "pose.Sy": self.Sy,
            "pose.tip.0": self.tip[0], "pose.tip.1": self.tip[1], "pose.load": self.load,
        }  # fmt: skip


@dataclass(frozen=True)
class Machine:
    """A checked machine file.

    Attributes:
        name: its ``meta.name``.
        structure: the components it has.
        parameters: dotted key -> parameter.
        angle_limits: (q_2 at s_p = 0, largest q_2) [rad].
        effects: active effects, id -> parameter -> value.
        document: the file as it was read.
    """

    name: str
    structure: Structure
    parameters: Mapping[str, Parameter]
    angle_limits: tuple[float, float]
    effects: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    document: Mapping[str, Any] = field(default_factory=dict)

    def values(self, pose: Pose) -> dict[str, float]:
        """Every component of the parameter vector by name: machine, pose, effects."""
        result = pose.values()
        for parameter in self.parameters.values():
            result |= dict(zip(parameter.specification.components, parameter.value, strict=True))
        for effect, given in self.effects.items():
            result |= {f"effects.{effect}.{name}": value for name, value in given.items()}
        return result

    def with_values(self, changed: Mapping[str, float | tuple[float, ...]]) -> Machine:
        """A machine with other numbers, by dotted key.

        Raises:
            MachineError: no such key, or a value outside its range.
        """
        parameters = dict(self.parameters)
        for key, value in changed.items():
            if key not in parameters:
                raise MachineError(f"{key}: no such parameter{_nearest(key, parameters)}")
            vector = (float(value),) if isinstance(value, int | float) else tuple(float(v) for v in value)
            if len(vector) != len(parameters[key].value):
                raise MachineError(f"{key}: expected {len(parameters[key].value)} numbers, not {len(vector)}")
            _check_range(parameters[key].specification, vector)
            parameters[key] = replace(parameters[key], value=vector)
        return replace(self, parameters=parameters)

    def with_effects(self, effects: Mapping[str, Mapping[str, float]]) -> Machine:
        """A machine with these effects instead of its own; neutral ones are left out.

        Raises:
            MachineError: unknown effect or parameter, a value outside its limits, or a component that is not there.
        """
        return replace(self, effects=_effects(dict(effects), self.structure))

    def pose(self, outer_boom_angle: float, telescope_length: float, load: float = 0.0) -> Pose:
        """D_0, S and tip for locked joints q_3 [rad], q_4 [m] and the load [kg] that hangs at the tip.

        A tabulated configuration within 1 mrad and 1 mm is used as it stands, any other is computed (rigid_body).

        Raises:
            MachineError: joints outside their limits, a negative or missing load, or no data for other poses.
        """
        if not (isfinite(outer_boom_angle) and isfinite(telescope_length)):
            raise MachineError("pose: outer boom angle and telescope length must be finite numbers")
        if not (isfinite(load) and 0.0 <= load <= 1e5):
            raise MachineError(f"pose: load of {load} kg: give a number of 0 .. 100000 kg (effect payload for an unknown one)")
        body = self.document["rigid_body"]
        for name, entry in body["configs"].items():
            if abs(entry["q3"] - outer_boom_angle) < 1e-3 and abs(entry["q4"] - telescope_length) < 1e-3:
                tip = (float(entry["tip"][0]), float(entry["tip"][1]))
                numbers = (float(entry["D0"]), float(entry["Sx"]), float(entry["Sy"]))
                return Pose(outer_boom_angle, telescope_length, load, *numbers, tip, name)
        if "planar" not in body:
            known = "; ".join(f"q3 = {c['q3']:g} rad, q4 = {c['q4']:g} m" for c in body["configs"].values())
            raise MachineError(f"rigid_body.planar is missing, so that only the tabulated poses are known: {known}")
        locked = locked_inertia(body, outer_boom_angle, telescope_length)
        return Pose(outer_boom_angle, telescope_length, load, locked.D0, locked.Sx, locked.Sy, locked.tip)

    def piston_position(self, angle: float) -> float:
        """s_p [m] at the boom angle [rad] (NaN where the linkage cannot be assembled)."""
        linkage = four_bar_linkage if self.structure.linkage == "four_bar" else triangle_linkage
        return float(linkage.piston_position(angle, _tree(self.parameters)))

    def sensor_noise(self) -> SensorNoise:
        """Noise and quantisation of the machine's sensors; ch. 6.4 where section ``control`` does not say."""
        control = self.document.get("control", {})
        noise = SensorNoise()
        period = _number(control["Ts"]) if "Ts" in control else 0.01
        return replace(
            noise,
            angle_quantum=_number(control["q2_quant"]) if "q2_quant" in control else noise.angle_quantum,
            pressure_quantum=_number(control["p_quant"]) if "p_quant" in control else noise.pressure_quantum,
            pressure_sigma=(
                (_number(control["p_noise_psd"]) / period) ** 0.5 if "p_noise_psd" in control else noise.pressure_sigma
            ),
        )


def load_machine(source: str | Path) -> Machine:
    """Reads a machine file: the name of one that is shipped (``tz17``) or the path of a YAML file.

    Raises:
        MachineError: not found, not YAML, or a key that is missing, misspelt or impossible.
    """
    text, where = _read(source)
    try:
        document = yaml.load(text, Loader=_UniqueKeys)
    except yaml.YAMLError as error:
        mark = getattr(error, "problem_mark", None)
        line = f", line {mark.line + 1}" if mark else ""
        raise MachineError(f"{where}{line}: not readable as YAML: {getattr(error, 'problem', error)}") from error
    try:
        return machine_from(document)
    except MachineError as error:
        raise MachineError(f"{where}: {error}") from None


def machine_from(document: Any) -> Machine:
    """Checks a document in the form of a machine file.

    Raises:
        MachineError: names the first key that is missing, misspelt or impossible.
    """
    if not isinstance(document, dict):
        raise MachineError("not a machine file: expected sections such as fluid, cylinder, kinematics")
    for section in document:
        if section == "learned":
            raise MachineError("learned: terms learnt from data cannot be simulated by this version; remove the section")
        if section not in _TOP:
            raise MachineError(f"{section}: no such section{_nearest(str(section), _TOP)}")
        if section != "effects" and not isinstance(document[section], dict):
            raise MachineError(f"{section}: expected keys with values below it")
    for section in ("meta", "constants", "fluid", "cylinder", "kinematics", "rigid_body", "friction"):
        if section not in document:
            raise MachineError(f"{section}: the section is missing")
    structure = _structure(document)
    name = document["meta"].get("name")
    if not isinstance(name, str) or not name:
        raise MachineError("meta.name: missing")
    if document["meta"].get("pressure_reference", "gauge") != "gauge":
        raise MachineError("meta.pressure_reference: only gauge is known; write all pressures as gauge pressures")
    specifications = [s for s in structure.specifications() if not s.key.startswith("pose.")]
    _check_keys(document, specifications, structure)
    parameters = {s.key: _parameter(document, s) for s in specifications}
    _check_rigid_body(document["rigid_body"])
    kinematics = document["kinematics"]
    limits = (_limit(kinematics, "q2_stroke_min"), _limit(kinematics, "q2_max"))
    machine = Machine(name, structure, parameters, limits, _effects(document.get("effects") or {}, structure), document)
    _check_consistency(machine)
    return machine


# ---------------------------------------------------------------------------------------------- reading and checking


class _UniqueKeys(yaml.SafeLoader):
    """YAML that refuses a key given twice, which would silently drop the first."""

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Any, Any]:
        seen: set[str] = set()
        for key, _ in node.value:
            if not isinstance(key, yaml.ScalarNode):
                raise yaml.constructor.ConstructorError(None, None, "a key must be a single word", key.start_mark)
            if key.value in seen:
                raise yaml.constructor.ConstructorError(None, None, f"{key.value} is given twice", key.start_mark)
            seen.add(key.value)
        return super().construct_mapping(node, deep)


def _read(source: str | Path) -> tuple[str, str]:
    shipped = files("boom_model").joinpath("machines")
    known = sorted(entry.name.removesuffix(".yaml") for entry in shipped.iterdir() if entry.name.endswith(".yaml"))
    if str(source) in known:
        return shipped.joinpath(f"{source}.yaml").read_text(encoding="utf-8"), str(source)
    path = Path(source)
    if path.suffix in (".yaml", ".yml") or path.exists():
        try:
            return path.read_text(encoding="utf-8"), str(path)
        except (OSError, UnicodeDecodeError) as error:
            reason = getattr(error, "strerror", None) or "not a text file"
            raise MachineError(f"{path}: cannot be read: {reason}") from error
    raise MachineError(f"{source}: no such machine; shipped are {', '.join(known)}, or give the path of a .yaml file")


def _structure(document: Mapping[str, Any]) -> Structure:
    def kind(section: str, allowed: tuple[str, ...]) -> str:
        if section not in document:
            raise MachineError(f"{section}: the section is missing; a machine without it says {section}: {{type: none}}")
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


def _check_keys(document: Mapping[str, Any], specifications: Iterable[Specification], structure: Structure) -> None:
    wanted: dict[str, set[str]] = {}
    for spec in specifications:
        section, key = spec.key.split(".")[:2]
        wanted.setdefault(section, set()).add(key)
    for section, keys in document.items():
        if section == "effects":
            continue
        allowed = wanted.get(section, set()) | _INFORMATION[section]
        for key in keys:
            if key not in allowed:
                absent = "" if wanted.get(section) or not document[section].get("type") == "none" else " (type: none)"
                raise MachineError(f"{section}.{key}: no such key{absent}{_nearest(str(key), allowed)}")


def _number(entry: Any) -> float:
    value = entry.get("value") if isinstance(entry, dict) else entry
    if isinstance(value, str):  # YAML 1.1 takes 2.5e7 for a text
        try:
            value = float(value)
        except ValueError:
            return float("nan")
    if isinstance(value, bool) or not isinstance(value, int | float):
        return float("nan")
    return float(value)


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
    confidence = entry.get("conf", "")
    if confidence not in TOLERANCES:
        raise MachineError(f"{spec.key}.conf: {confidence!r} is not high, medium or low")
    if spec.shape == "scalar":
        value: tuple[float, ...] = (_number(entry),)
    else:
        listed = entry["value"]
        size = len(spec.components)
        if not isinstance(listed, list) or len(listed) != size:
            raise MachineError(f"{spec.key}: expected a list of {size} numbers [{spec.unit}]")
        value = tuple(_number(v) for v in listed)
    _check_range(spec, value, shown=entry["value"])
    return Parameter(spec, value, str(entry.get("prov", "")), confidence, str(entry.get("note", "")))


def _check_range(spec: Specification, value: tuple[float, ...], shown: object = None) -> None:
    for number in value:
        if not spec.minimum <= number <= spec.maximum:
            text = number if shown is None or isfinite(number) else shown
            raise MachineError(f"{spec.key}: {text} is outside {spec.minimum:g} .. {spec.maximum:g} {spec.unit}")


def _meter_out_law(section: Mapping[str, Any], spec: Specification) -> Parameter:
    if "A_ta_law" not in section:
        raise MachineError("main_valve_orifices.A_ta_law: missing; expected e.g. {value: \"A_sb/(2.27-0.7*u^2)\"}")
    entry = section["A_ta_law"]
    text = entry.get("value") if isinstance(entry, dict) else entry
    match = _METER_OUT.match(str(text))
    if match is None:
        raise MachineError(f"main_valve_orifices.A_ta_law: {text!r} is not of the form A_sb/(2.27-0.7*u^2)")
    c0, c1 = float(match[1]), float(match[3]) * (1 if match[2] == "-" else -1)
    if c0 - max(c1, 0.0) * 1.3**2 <= 0.0:
        raise MachineError(f"main_valve_orifices.A_ta_law: {text!r} is not positive up to u = 1.3")
    value = (c0 if spec.key.endswith("c0") else c1,)
    _check_range(spec, value)
    prov = str(entry.get("prov", "")) if isinstance(entry, dict) else ""
    return Parameter(spec, value, prov, entry.get("conf", "low") if isinstance(entry, dict) else "low")


def _limit(section: Mapping[str, Any], key: str) -> float:
    if key not in section:
        raise MachineError(f"kinematics.{key}: missing (limit of the boom angle); expected -3.2 .. 3.2 rad")
    value = _number(section[key])
    if not -3.2 <= value <= 3.2:
        raise MachineError(f"kinematics.{key}: {value} is outside -3.2 .. 3.2 rad")
    return value


def _check_rigid_body(section: Mapping[str, Any]) -> None:
    configs = section.get("configs")
    if not isinstance(configs, dict) or not configs:
        raise MachineError("rigid_body.configs: missing; expected at least one configuration with q3, q4, D0, Sx, Sy, tip")
    for name, entry in configs.items():
        for key in ("q3", "q4", "D0", "Sx", "Sy"):
            if not isinstance(entry, dict) or key not in entry:
                raise MachineError(f"rigid_body.configs.{name}.{key}: missing")
            if not isfinite(_number(entry[key])):
                raise MachineError(f"rigid_body.configs.{name}.{key}: {entry[key]!r} is not a finite number")
        if not entry["D0"] > 0:
            raise MachineError(f"rigid_body.configs.{name}.D0: {entry['D0']} is not a positive inertia [kg m^2]")
        tip = entry.get("tip")
        if not isinstance(tip, list) or len(tip) != 2 or not all(isfinite(_number(v)) for v in tip):
            raise MachineError(f"rigid_body.configs.{name}.tip: expected [x, y] in m")


def _effects(given: dict[str, Any], structure: Structure) -> dict[str, dict[str, float]]:
    from boom_model.effects import EFFECTS

    if not isinstance(given, dict):
        raise MachineError("effects: expected effect ids with their parameters below")
    complete = check_effects(given)
    for name in complete:
        if not structure.has(EFFECTS[name].needs):
            raise MachineError(f"effects.{name}: this machine has no {EFFECTS[name].needs.replace('_', ' ')}")
    return {name: values for name, values in complete.items() if not is_neutral(name, values)}


def _check_consistency(machine: Machine) -> None:
    low, high = machine.angle_limits
    if low >= high:
        raise MachineError(f"kinematics.q2_max: {high:g} rad is not above q2_stroke_min, {low:g} rad")
    stroke = machine.parameters["cylinder.l_p"].value[0]
    steps = 40
    positions = [machine.piston_position(low + (high - low) * k / steps) for k in range(steps + 1)]
    if not all(isfinite(s) for s in positions):
        raise MachineError(f"kinematics: the linkage cannot be assembled everywhere in {low:g} .. {high:g} rad")
    if positions[0] < -_STROKE_SLACK or positions[-1] > stroke + _STROKE_SLACK:
        raise MachineError(
            f"kinematics: {low:g} .. {high:g} rad needs s_p = {positions[0]:.4f} .. {positions[-1]:.4f} m, "
            f"but the stroke cylinder.l_p is 0 .. {stroke:g} m"
        )
    if any(b <= a for a, b in zip(positions, positions[1:], strict=False)):
        raise MachineError("kinematics: s_p must grow with q2 over the whole range")
    if machine.structure.hose_burst_valve:
        _check_hose_burst_valve(machine)
    areas = machine.parameters["cylinder.A_a"].value[0], machine.parameters["cylinder.A_b"].value[0]
    if areas[1] >= areas[0]:
        raise MachineError(f"cylinder.A_b: {areas[1]:g} m^2 is not smaller than A_a, {areas[0]:g} m^2 (single rod)")


def _check_hose_burst_valve(machine: Machine) -> None:
    """a_22 and the node follow from the other coefficients (5.29); printed ones must agree with them."""
    a21, a30, a31 = (machine.parameters[f"hose_burst_valve.{k}"].value[0] for k in ("a21", "a30", "a31"))
    if a21 <= a31:
        raise MachineError(f"hose_burst_valve.a31: {a31:g} must be below a21, {a21:g} l/min/bar")
    a22, node = smooth_node(a21, a30, a31)
    section = machine.document["hose_burst_valve"]
    for key, value in (("a22", a22), ("a22_c1", a22), ("node", node), ("node_c1", node)):
        if key in section and abs(_number(section[key]) / value - 1) > 0.02:
            raise MachineError(
                f"hose_burst_valve.{key}: {_number(section[key]):g} does not fit a21, a30, a31, with which the branches "
                f"meet smoothly at {value:.4g} (5.29); correct it or leave it out"
            )


def _tree(parameters: Mapping[str, Parameter]) -> SimpleNamespace:
    root = SimpleNamespace()
    for key, parameter in parameters.items():
        section, name = key.split(".")[:2]
        if not hasattr(root, section):
            setattr(root, section, SimpleNamespace())
        value = parameter.value if len(parameter.value) > 1 else parameter.value[0]
        setattr(getattr(root, section), name, value)
    return root


def _nearest(name: str, names: Iterable[str]) -> str:
    known = sorted(names)
    close = difflib.get_close_matches(name, known, 1, 0.5)
    return f"; did you mean {close[0]}?" if close else f"; known: {', '.join(known)}"
