"""A machine: its components, its numbers with unit, source and confidence, its poses. Read by ``machine_file``."""

from __future__ import annotations

from collections.abc import Container, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from math import isfinite, isnan
from typing import Any, Literal

from boom_model.catalogue import EFFECTS, active_effects
from boom_model.components import payload
from boom_model.components.payload import Step
from boom_model.equations import namespace, valve_holds, valve_separates
from boom_model.errors import MachineError, nearest
from boom_model.learned import LearnedTerm
from boom_model.rigid_body import locked_inertia
from boom_model.sensors import SPECIFICATIONS, SensorNoise
from boom_model.specification import Specification
from boom_model.structure import Structure
from boom_model.tolerance import TOLERANCES, Tolerance

Confidence = Literal["high", "medium", "low", ""]
SAMPLE_TIME = 0.01
"""s. T_s of a file that does not state it."""


@dataclass(frozen=True)
class Parameter:
    """One number (or pair, triple) of a machine file with source and confidence."""

    specification: Specification
    value: tuple[float, ...]
    source: str = ""
    confidence: Confidence = ""
    note: str = ""
    tol: Tolerance | None = None

    @property
    def tolerance(self) -> float:
        """Relative tolerance within which it is still the same machine; of the largest number of a pair or triple."""
        if self.tol is not None:
            return self.tol.relative(max(self.value, key=abs))
        if self.source.startswith("thesis"):
            return TOLERANCES["high"]
        return TOLERANCES[self.confidence]


@dataclass(frozen=True)
class Pose:
    """The locked joints and the resulting quantities: q_3 [rad], q_4 [m], load [kg], D_0, S_x, S_y, tip."""

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
        structure: its components.
        parameters: dotted key -> parameter.
        angle_limits: (q_2 at s_p = 0, largest q_2) [rad].
        effects: active effects, id -> parameter -> value.
        tabulated: poses whose D_0, S_x, S_y and tip the file states, without load.
        sensors: numbers of the sensors, key of section ``control`` -> number.
        document: the file as it was read.
        learned: terms learnt from data.
        load_tolerance: of the load that a configuration tells, if the file states one.
        payloads: steps of the load by name of the recording, those of every other recording under "".
        loads: [kg] that a configuration tells -> that it is, where recordings told.
    """

    name: str
    structure: Structure
    parameters: Mapping[str, Parameter]
    angle_limits: tuple[float, float]
    effects: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    tabulated: tuple[Pose, ...] = ()
    sensors: Mapping[str, float] = field(default_factory=dict)
    document: Mapping[str, Any] = field(default_factory=dict)
    learned: tuple[LearnedTerm, ...] = ()
    load_tolerance: Tolerance | None = None
    payloads: Mapping[str, tuple[Step, ...]] = field(default_factory=dict)
    loads: Mapping[float, float] = field(default_factory=dict)

    def values(self, pose: Pose) -> dict[str, float]:
        """Every component of the parameter vector by name: machine, pose, effects."""
        result = pose.values()
        for parameter in self.parameters.values():
            result |= dict(zip(parameter.specification.components, parameter.value, strict=True))
        for effect, given in self.effects.items():
            result |= {f"effects.{effect}.{name}": value for name, value in given.items()}
        for k, entry in enumerate(self.learned):
            result |= {f"learned.{k}.{j}": value for j, value in enumerate(entry.coefficients)}
        return result

    def with_values(self, changed: Mapping[str, float | tuple[float, ...]]) -> Machine:
        """A machine with other numbers, by dotted key.

        Raises:
            MachineError: no such key, or a value outside its range.
        """
        parameters = dict(self.parameters)
        for key, value in changed.items():
            if key not in parameters:
                raise MachineError(f"{key}: no such parameter{nearest(key, parameters)}")
            vector = (float(value),) if isinstance(value, int | float) else tuple(float(v) for v in value)
            if len(vector) != len(parameters[key].value):
                raise MachineError(f"{key}: expected {len(parameters[key].value)} numbers, not {len(vector)}")
            check_range(parameters[key].specification, vector)
            parameters[key] = replace(parameters[key], value=vector)
        result = replace(self, parameters=parameters)
        check_together(result)
        return result

    def with_effects(self, effects: Mapping[str, Mapping[str, float]]) -> Machine:
        """A machine with these effects instead of its own; neutral ones are left out.

        Raises:
            MachineError: unknown effect or parameter, a value outside its limits, or a component that is not there.
        """
        result = replace(self, effects=active_effects(dict(effects), self.structure.has))
        check_together(result)
        return result

    def carrying(self, recording: str = "") -> Machine:
        """The machine with the steps of the load that it has in a recording of this name, with or without folders before it."""
        names = (recording, recording.rpartition("/")[2], "")
        steps = next((self.payloads[name] for name in names if name in self.payloads), ())
        parameters = {key: p for key, p in self.parameters.items() if not key.startswith(payload.SECTION)}
        for k, step in enumerate(steps):
            mass, at = payload.specifications(k, step.by)
            for spec, value, tol in ((mass, step.mass, step.tol), (at, step.at, None)):
                check_range(spec, (value,))
                parameters[spec.key] = Parameter(spec, (value,), tol=tol)
        structure = replace(self.structure, steps=tuple(step.by for step in steps))
        return replace(self, structure=structure, parameters=parameters)

    @property
    def still(self) -> frozenset[str]:
        """Active effects that have states, but none with the numbers that they have here."""
        rows = {
            name: [row.name for row in EFFECTS[name].parameters if given.get(row.name, row.neutral) != row.neutral]
            for name, given in self.effects.items()
        }
        return frozenset(
            name for name, moved in rows.items() if EFFECTS[name].states and not EFFECTS[name].stateful(moved)
        )

    @property
    def holds(self) -> bool:
        """As :func:`boom_model.equations.valve_holds`."""
        return valve_holds(self.structure, self.effects)

    @property
    def separates(self) -> bool:
        """As :func:`boom_model.equations.valve_separates`."""
        return valve_separates(self.structure, self.effects)

    def driven_by(self, measured: Container[str]) -> Machine:
        """The machine whose model is driven by those pressures of ``structure.DRIVING`` that are measured, not by its constants."""
        return replace(self, structure=self.structure.driven_by(measured))

    def with_sensors(self, numbers: Mapping[str, float]) -> Machine:
        """The machine with other numbers of its sensors, by key of section ``control`` [SI]."""
        units = {s.key.split(".")[1]: s.unit for s in SPECIFICATIONS}
        said = {
            k: {"value": float(v), "unit": units[k], "prov": "measured", "conf": "high"} for k, v in numbers.items()
        }
        document = {**self.document, "control": {**self.document.get("control", {}), **said}}
        return replace(self, sensors={**self.sensors, **numbers}, document=document)

    def with_moving_joints(self) -> Machine:
        """The machine whose model is driven by the motion of the other joints, too (``joint_motion``)."""
        return replace(self, structure=replace(self.structure, moving_joints=True))

    @property
    def only_pose(self) -> Pose | None:
        """The one tabulated pose of a machine without bodies, which has no other; None of any other machine."""
        return self.tabulated[0] if len(self.tabulated) == 1 and "planar" not in self.document["rigid_body"] else None

    def pose(self, outer_boom_angle: float, telescope_length: float, load: float = 0.0) -> Pose:
        """D_0, S and tip for locked joints q_3 [rad], q_4 [m] and the load [kg] that hangs at the tip.

        A tabulated configuration within 1 mrad and 1 mm is used as it stands, any other is computed (rigid_body).

        Raises:
            MachineError: joints outside their limits, a negative or missing load, or no data for other poses.
        """
        if not (isfinite(outer_boom_angle) and isfinite(telescope_length)):
            raise MachineError("pose: outer boom angle and telescope length must be finite numbers")
        if not (isfinite(load) and 0.0 <= load <= 1e5):
            raise MachineError(
                f"pose: load of {load} kg: give a number of 0 .. 100000 kg (effect payload for an unknown one)"
            )
        load = self.loads.get(load, load)
        for known_pose in self.tabulated:
            angle, length = known_pose.outer_boom_angle, known_pose.telescope_length
            if abs(angle - outer_boom_angle) < 1e-3 and abs(length - telescope_length) < 1e-3:
                return replace(
                    known_pose, outer_boom_angle=outer_boom_angle, telescope_length=telescope_length, load=load
                )
        body = self.document["rigid_body"]
        if "planar" not in body:
            known = "; ".join(f"q3 = {c.outer_boom_angle:g} rad, q4 = {c.telescope_length:g} m" for c in self.tabulated)
            raise MachineError(f"rigid_body.planar is missing, so that only the tabulated poses are known: {known}")
        locked = locked_inertia(body, outer_boom_angle, telescope_length)
        return Pose(outer_boom_angle, telescope_length, load, locked.D0, locked.Sx, locked.Sy, locked.tip)

    def piston_position(self, angle: float) -> float:
        """s_p [m] at the boom angle [rad] (NaN if the linkage cannot be assembled)."""
        return float(self.structure.linkage.piston_position(angle, self.numbers))

    @cached_property
    def numbers(self) -> Any:
        """The machine's numbers by section and name, ``numbers.cylinder.A_a``; created once, for thousands of positions."""
        values = (zip(p.specification.components, p.value, strict=True) for p in self.parameters.values())
        return namespace(dict(pair for pairs in values for pair in pairs))

    def with_resolution(self, angle: float, pressure: float) -> Machine:
        """A machine whose sensors have steps of at least ``angle`` [rad] and ``pressure`` [Pa]; its document stays."""
        noise = self.sensor_noise()
        steps = {"q2_quant": max(angle, noise.angle_quantum), "p_quant": max(pressure, noise.pressure_quantum)}
        return replace(self, sensors={**self.sensors, **steps})

    @property
    def sample_time(self) -> float:
        """T_s [s], in which its controller commands and its sensors measure."""
        return self.sensors.get("Ts", SAMPLE_TIME)

    def sensor_noise(self) -> SensorNoise:
        """Noise and quantisation of the machine's sensors; ch. 6.4 unless section ``control`` states them."""
        said, noise = self.sensors, SensorNoise()
        sigma = noise.pressure_sigma
        if "p_noise_psd" in said:
            sigma = (said["p_noise_psd"] / self.sample_time) ** 0.5
        return replace(
            noise,
            angle_sigma=said.get("q2_noise", noise.angle_sigma),
            angle_quantum=said.get("q2_quant", noise.angle_quantum),
            rate_sigma=said.get("rate_noise", noise.rate_sigma),
            pressure_quantum=said.get("p_quant", noise.pressure_quantum),
            pressure_sigma=sigma,
        )


def check_range(spec: Specification, value: tuple[float, ...], shown: object = None) -> None:
    """Refuses numbers outside the range of a parameter; ``shown``: the text of the file, if it is not a number.

    Raises:
        MachineError: names the key and the range.
    """
    for number in value:
        if not spec.minimum <= number <= spec.maximum:
            if isinstance(shown, str):
                raise MachineError(
                    f"{spec.key}: {shown!r} is a text: write a number of {spec.minimum:g} .. {spec.maximum:g}, without quotes"
                )
            if isinstance(shown, bool):
                raise MachineError(
                    f"{spec.key}: {str(shown).lower()} is no number: write one of {spec.minimum:g} .. {spec.maximum:g}"
                )
            if isnan(number) and shown is None:
                raise MachineError(
                    f"{spec.key}: there is no number: write one of {spec.minimum:g} .. {spec.maximum:g} {spec.unit}".removesuffix(
                        " -"
                    )
                )
            text = number if shown is None or isfinite(number) else shown
            raise MachineError(
                f"{spec.key}: {text} is outside {spec.minimum:g} .. {spec.maximum:g} {spec.unit}".removesuffix(" -")
            )


def check_together(machine: Machine) -> None:
    """Refuses an effect that does not go together with the numbers of the machine.

    Raises:
        MachineError: names the effect's parameter and the range.
    """
    for name, values in machine.effects.items():
        check = EFFECTS[name].check
        if check:
            check(values, machine)
