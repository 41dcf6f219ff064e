"""The machine's own numbers with their tolerance: what may be off without being another machine.

z is counted in standard deviations: value = nominal exp(sigma z). A tolerance is a bound, not a deviation; a value spread
evenly between -T and +T has the standard deviation T / sqrt(3).
"""

from __future__ import annotations

from dataclasses import dataclass
from math import exp, sqrt

from boom_model.machine import TOLERANCES, Machine, Pose

SPREAD = 1.0 / sqrt(3.0)
PRECHARGE = 0.05
"""Machine notes."""
LOAD, LOAD_KG = 0.05, 20.0
"""Machine notes: share of the configuration's load, or kg."""
_NOT_PHYSICS = ("constants.", "kinematics.", "hose_burst_valve.unit", "hose_burst_valve.dp_lin", "cylinder.l_")


@dataclass(frozen=True)
class Nuisance:
    """One number: component of the parameter vector, standard deviation (relative, or absolute where ``shift``)."""

    name: str
    sigma: float
    shift: bool = False

    def value(self, nominal: float, z: float) -> float:
        """Its value ``z`` standard deviations from the nominal one."""
        return nominal + self.sigma * z if self.shift else nominal * exp(self.sigma * z)


def tolerances(machine: Machine, pose: Pose) -> tuple[Nuisance, ...]:
    """All numbers that have a tolerance in this machine and pose."""
    result = []
    for key, parameter in machine.parameters.items():
        if key.startswith(_NOT_PHYSICS):
            continue
        tolerance = PRECHARGE if key.startswith("accumulators.p_g0") else parameter.tolerance
        for name, value in zip(parameter.specification.components, parameter.value, strict=True):
            if value != 0.0:
                result.append(Nuisance(name, tolerance * SPREAD))
    entry = machine.document["rigid_body"]["configs"].get(pose.tabulated, {})
    body = TOLERANCES.get(entry.get("conf", "medium"), 0.15)
    result += [Nuisance(f"pose.{name}", body * SPREAD) for name in ("D0", "Sx", "Sy")]
    if pose.load > 0.0:
        result.append(Nuisance("pose.load", max(LOAD * pose.load, LOAD_KG) * SPREAD, shift=True))
    return tuple(result)
