"""How far a number of a machine may be off: its ``tol`` or its confidence, read here and nowhere else.

A tolerance is two standard deviations of the number's prior. ``tol`` of an entry is one of

    0.1                relative: sigma = 0.1 |value| / 2
    {abs: 0.03}        in the unit of the number: sigma = 0.03 / 2
    {factor: 3}        log-normal: sigma of ln(value) is ln(3) / 2
    {range: [a, b]}    sigma = (b - a) / 4, and nothing outside a .. b

Without it ``conf`` decides (``tolerance.TOLERANCES``), pre-charge pressures are known to 5 %,
loads to 5 % or 20 kg (machine notes).
The lengths of a linkage can be measured with a rule: the prior of one ends at its tolerance.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from math import exp
from typing import TYPE_CHECKING, Literal

from boom_model.errors import MachineError, nearest
from boom_model.tolerance import TOLERANCES, Tolerance, check_tolerance

if TYPE_CHECKING:
    from boom_model.machine import Machine, Parameter, Pose

Kind = Literal["normal", "log_normal"]

PRECHARGE = 0.05
"""Relative tolerance of a pre-charge pressure of which neither ``tol`` nor ``conf`` is told."""
LOAD, LOAD_KG = 0.05, 20.0
"""Tolerance of a load: the larger one of a share and of kilograms."""
LINKAGE = ("kinematics.", "cylinder.l_min")
MOMENTS = ("D0", "Sx", "Sy")
FEW = 4
"""Numbers of one tolerance by ``conf`` that a table names; more are counted."""


@dataclass(frozen=True)
class Prior:
    """Prior of one number.

    Attributes:
        kind: ``normal`` about the value of the file, or ``log_normal``.
        sigma: standard deviation [unit of the number], of ln(value) if log-normal; 0: the number is known.
        low, high: it is not outside these.
    """

    kind: Kind
    sigma: float
    low: float
    high: float

    def away(self, value: float, z: float) -> float:
        """The number that is ``z`` standard deviations from the ``value`` of the file."""
        return value * exp(self.sigma * z) if self.kind == "log_normal" else value + self.sigma * z


def prior_of(machine: Machine, name: str, pose: Pose | None = None) -> Prior:
    """Prior of a component of the parameter vector: ``fluid.beta``, ``pilot_valves.h.0``, ``pose.D0``, ``pose.load``.

    pose: needed for the names that begin with ``pose.``.

    Raises:
        MachineError: this machine has no such number.
    """
    if name.startswith("pose."):
        if pose is None or name not in pose.values():
            raise MachineError(f"{name}: no such number of the pose")
        return _of_pose(machine, name, pose)
    for parameter in machine.parameters.values():
        components = parameter.specification.components
        if name in components:
            return _of_number(parameter, parameter.value[components.index(name)])
    known = [c for p in machine.parameters.values() for c in p.specification.components]
    raise MachineError(f"{name}: no such parameter{nearest(name, known)}")


def tolerance_of(parameter: Parameter) -> Tolerance:
    """The tolerance of a number: its ``tol``, else by its confidence."""
    if parameter.tol is not None:
        return parameter.tol
    if parameter.specification.key.startswith("accumulators.p_g0") and not parameter.confidence:
        return Tolerance("relative", (PRECHARGE,))
    return Tolerance("relative", (parameter.tolerance,))


def _of_number(parameter: Parameter, value: float) -> Prior:
    spec, tolerance = parameter.specification, tolerance_of(parameter)
    low, high = spec.minimum, spec.maximum
    if tolerance.word == "range":
        low, high = max(low, tolerance.numbers[0]), min(high, tolerance.numbers[1])
    elif spec.key.startswith(LINKAGE):
        most = tolerance.relative(value) * abs(value)
        low, high = max(low, value - most), min(high, value + most)
    return _prior(tolerance, value, low, high)


def _of_pose(machine: Machine, name: str, pose: Pose) -> Prior:
    value, key = pose.values()[name], name.removeprefix("pose.")
    if key == "load":
        said = machine.load_tolerance
        if said is None:
            return Prior("normal", max(LOAD * value, LOAD_KG) / 2 if value else 0.0, 0.0, 1e5)
        return _prior(said, value, 0.0, 1e5)
    if key not in MOMENTS:  # where the load hangs is a length
        return Prior("normal", 0.0, value, value)
    entry = machine.document["rigid_body"]["configs"].get(pose.tabulated, {})
    own = Tolerance("relative", (TOLERANCES.get(entry.get("conf", "medium"), TOLERANCES[""]),))
    if "tol" in entry:
        own = check_tolerance(entry["tol"], f"rigid_body.configs.{pose.tabulated}", (value,))
    return _prior(own, value, *((1.0, 1e7) if key == "D0" else (-1e6, 1e6)))


def _prior(tolerance: Tolerance, value: float, low: float, high: float) -> Prior:
    kind: Kind = "log_normal" if tolerance.word == "factor" else "normal"
    return Prior(kind, tolerance.sigma(value), low, high)


def summary(parameters: Iterable[Parameter]) -> list[tuple[str, str, str]]:
    """Rows (meaning, value, source) for a table: how far the numbers may be off, of many without a ``tol`` how many."""
    rows: dict[tuple[str, str], list[str]] = {}
    for parameter in parameters:
        own, unit = tolerance_of(parameter), parameter.specification.unit
        said = f"{own} {unit}" if own.word in ("abs", "range") and unit != "-" else str(own)
        rows.setdefault(("prov, conf" if parameter.tol is None else "tol", said), []).append(
            parameter.specification.key
        )
    return [
        (
            f"tolerance {said}",
            ", ".join(keys) if source == "tol" or len(keys) <= FEW else f"{len(keys)} numbers",
            source,
        )
        for (source, said), keys in sorted(rows.items(), key=lambda row: (row[0][0] == "tol", -len(row[1])))
    ]
