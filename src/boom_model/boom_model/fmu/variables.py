"""The variables of an FMU: what the model takes and gives, by name, with unit, limits, start and meaning."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from math import inf
from typing import Literal

import numpy as np

from boom_input.channels import BY_NAME, PREDICTED
from boom_model.catalogue import EFFECTS
from boom_model.learned import PLACES
from boom_model.machine import Machine
from boom_model.plant import Plant
from boom_model.rest import START

Causality = Literal["independent", "input", "output", "local", "parameter"]
Variability = Literal["continuous", "fixed", "tunable"]

_MEANINGS = {
    "retract_current": "current of the solenoid that lowers the boom, i_+; held between communication points",
    "extend_current": "current of the solenoid that lifts the boom, i_-; held between communication points",
    "supply_pressure": "pressure of the supply (gauge), in place of the machine's constant",
    "tank_pressure": "pressure of the return line (gauge), in place of the machine's constant",
    "angle": "boom angle q_2 as its sensor shows it, without noise",
    "rate": "angular velocity of the boom as its sensor shows it, without noise",
    "hose_pressure": "pressure of the head-side hose p_h as its sensor shows it, without noise (gauge)",
    "rod_pressure": "rod-side pressure p_b as its sensor shows it, without noise (gauge)",
}
_INNER = {
    "head_flow": "flow into the head side", "hose_flow": "flow into the head-side hose", "rod_flow": "flow into the rod side",
    "piston_position": "piston position s_p", "jacobian": "lever arm of the cylinder, ds_p/dq_2",
    "piston_velocity": "piston velocity",
    "force": "force of the cylinder", "friction_torque": "friction torque", "gravity_torque": "torque of the weight",
    "pilot_pressure_difference": "pilot pressure that pushes the spool to retract, p_+ - p_-",
}  # fmt: skip
_POSE = {
    "pose.load": "load at the tip",
    "pose.D0": "moment of inertia of the moving parts about the boom joint, without load",
    "pose.Sx": "first moment of mass along the boom",
    "pose.Sy": "first moment of mass across the boom",
    "pose.tip.0": "position of the tip along the boom",
    "pose.tip.1": "position of the tip across the boom",
}
_SUPPLY = {"supply_pressure": "fluid.p_s", "tank_pressure": "fluid.p_t"}
LARGEST_PRESSURE = 1e8
"""Pa. Of a start; steel bursts long before."""


@dataclass(frozen=True)
class FmuVariable:
    """One variable of an FMU; its value reference is its place in the list.

    Attributes:
        start: None where the model computes it.
        nominal: size of its usual range.
        boolean: no number.
    """

    name: str
    causality: Causality
    variability: Variability
    unit: str
    meaning: str
    start: float | None = None
    minimum: float = -inf
    maximum: float = inf
    nominal: float | None = None
    boolean: bool = False

    @property
    def is_given(self) -> bool:
        """Whether the importer may set it."""
        return self.start is not None


def variables(plant: Plant, angle: float) -> list[FmuVariable]:
    """All variables in the order of the value references (``machine.c``).

    Args:
        plant: the machine in its pose.
        angle: boom angle at the start [rad].
    """
    m = plant.equations
    time = FmuVariable("time", "independent", "continuous", "s", "time")
    outputs = [FmuVariable(s.name, "output", "continuous", s.unit, _MEANINGS[s.name]) for s in PREDICTED]
    states = [
        FmuVariable(
            "state." + re.sub(r"\W", "_", s.name),
            "local",
            "continuous",
            s.unit,
            f"{s.symbol}: {s.name.replace('_', ' ')}",
            nominal=s.scale,
        )
        for s in m.states
    ]
    inner = [
        FmuVariable(name, "local", "continuous", unit, _INNER.get(name, name.replace("_", " ")))
        for name, (unit, _) in m.auxiliary.items()
    ]
    return [time, *_inputs(plant.machine), *outputs, *states, *inner, *_numbers(plant), *_start(plant.machine, angle)]


def _inputs(machine: Machine) -> list[FmuVariable]:
    rows = []
    for name in machine.structure.inputs:
        channel, key = BY_NAME[name], _SUPPLY.get(name, "")
        # A machine without a constant supply never runs out of pressure; neither does an input that nobody connects.
        start = machine.parameters[key].value[0] if key in machine.parameters else channel.high if key else 0.0
        low = max(channel.low, -1e5) if channel.is_pressure else 0.0
        rows.append(FmuVariable(name, "input", "continuous", channel.unit, _MEANINGS[name], start, low, channel.high))
    return rows


def _numbers(plant: Plant) -> list[FmuVariable]:
    """The parameter vector: numbers of the machine, the pose, the effects and the learnt terms."""
    machine, rows = plant.machine, []
    specifications = {c: spec for spec in machine.structure.specifications() for c in spec.components}
    fixed = {plant.parameter_names[k] for index in plant.delay_indices for k in index}
    for name, value in zip(plant.parameter_names, plant.p.tolist(), strict=True):
        spec = specifications.get(name)
        if name in _POSE:
            unit, meaning, low, high = spec.unit if spec else "-", _POSE[name], *_pose_limits(name)
        elif spec is not None:
            replaced = next((given for given in machine.structure.driven if _SUPPLY[given] == name), "")
            meaning = f"{spec.symbol}: {spec.meaning}" + (f"; not used, {replaced} is an input" if replaced else "")
            unit, low, high = _unit_of(spec.unit, name), spec.minimum, spec.maximum
        elif name.startswith("effects."):
            _, effect, key = name.split(".")
            row = next(row for row in EFFECTS[effect].parameters if row.name == key)
            unit, low, high = row.unit, min(row.minimum, row.neutral), max(row.maximum, row.neutral)
            meaning = f"{effect.replace('_', ' ')}: {row.meaning}"
            if effect in machine.still and key in EFFECTS[effect].moving:
                meaning += "; not used, neutral in this machine"
        else:
            _, term, factor = name.split(".")
            entry = machine.learned[int(term)]
            place, product = PLACES[entry.equation], entry.basis[int(factor)]
            unit, low, high = "-", -1e12, 1e12
            meaning = f"learnt term in {entry.equation}: coefficient of {product}, in {place.scale:g} {place.unit}"
        variability: Variability = "fixed" if name in fixed else "tunable"
        rows.append(FmuVariable(structured(name), "parameter", variability, unit, meaning, value, low, high))
    return rows


def _pose_limits(name: str) -> tuple[float, float]:
    if name == "pose.load":
        return 0.0, 1e5
    return (1e-3, 1e9) if name == "pose.D0" else (-1e9, 1e9)


def _start(machine: Machine, angle: float) -> list[FmuVariable]:
    """In the order of ``rest.START``."""
    low, high = machine.angle_limits
    rows = (
        ("rad", "boom angle at the start, at rest", angle, low, high),
        ("Pa", "hose pressure at the start (gauge), unless start.balanced", 0.0, -1e5, LARGEST_PRESSURE),
        ("Pa", "rod pressure at the start (gauge)", 1.0e6, -1e5, LARGEST_PRESSURE),
        ("-", "the hose pressure at the start is what carries the boom without friction", 1.0, 0.0, 1.0),
    )
    return [
        FmuVariable(f"start.{name}", "parameter", "fixed", *row, boolean=name == "balanced")
        for name, row in zip(START, rows, strict=True)
    ]


def structured(name: str) -> str:
    """A dotted key in FMI's structured naming convention: ``pilot_valves.h.0`` -> ``pilot_valves.h[1]``.

    The coefficients of learnt terms, ``learned.0.1``, become ``learned[1,2]``.
    """
    name = re.sub(r"\.(\d+)\.(\d+)", lambda match: "[{},{}]".format(*(int(k) + 1 for k in match.groups())), name)
    return re.sub(r"\.(\d+)", lambda match: f"[{int(match.group(1)) + 1}]", name)


def _unit_of(unit: str, name: str) -> str:
    """Unit of a component, where that of a triple is a list."""
    parts = [part.strip() for part in unit.split(",")]
    return parts[int(name.rsplit(".", 1)[1])] if len(parts) > 1 else unit


def c_array(name: str, values: Sequence[float | str | bool], kind: str = "double") -> str:
    """A constant table in C."""

    def text(value: float | str | bool) -> str:
        if isinstance(value, str):
            return '"' + value.replace("\\", "\\\\").replace('"', '\\"') + '"'
        if isinstance(value, bool | int):
            return str(int(value))
        return ("-" if value < 0 else "") + "HUGE_VAL" if np.isinf(value) else repr(float(value))

    return f"static const {kind} {name}[] = {{{', '.join(text(value) for value in values)}}};\n"
