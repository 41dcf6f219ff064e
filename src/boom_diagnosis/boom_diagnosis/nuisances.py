"""The machine's own numbers with their tolerance: what may be off without being another machine.

z is counted in standard deviations: value = nominal exp(sigma z). A tolerance is a bound, not a deviation; a value spread
evenly between -T and +T has the standard deviation T / sqrt(3).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import exp, isfinite, log, sqrt

from boom_model.catalogue import CATALOGUE
from boom_model.machine import Machine, Pose
from boom_model.tolerance import TOLERANCES

LARGEST_Z = 4.0
"""Standard deviations a number may move: 2.3 times its tolerance."""
LEAST_SHARE = 0.05
"""Of its nominal value is left of a number at least."""
SPREAD = 1.0 / sqrt(3.0)
TWINS = frozenset(name for effect in CATALOGUE for name in effect.changes)
"""Numbers that an effect of the catalogue multiplies, shifts or adds to."""
TWIN_Z = 1.0 / SPREAD
"""Standard deviations that such a number may move: its tolerance."""
PRECHARGE = 0.05
"""Machine notes."""
LOAD, LOAD_KG = 0.05, 20.0
"""Machine notes: share of the configuration's load, or kg."""
GEOMETRY, SEEN = "kinematics.", 5e-3
"""m. A length of the linkage whose tolerance is less than this moves nothing that the sensors see."""
STROKE_ZERO = "cylinder.l_min"
"""Follows the geometry: at the lower end of the angle's range the cylinder is retracted, whatever the lengths are."""
ONE_FACTOR = (("main_valve_orifices.A_ta_law.c0", "main_valve_orifices.A_ta_law.c1"),)
"""Numbers that move together: an area as a whole."""
PILOT_POLE, PILOT_GAIN, PILOT_FEEDTHROUGH = "pilot_valves.a1_s", "pilot_valves.b0_s", "pilot_valves.b1_s"
"""The gain follows the two others: at rest nu is the current (5.2), and how much pressure a current gives is h alone."""
_NOT_PHYSICS = ("constants.", "hose_burst_valve.unit", "hose_burst_valve.dp_lin", "cylinder.l_")
_UNITS_OF_THE_SPOOL = ("main_valve_spool.A_s", "main_valve_spool.s_max")
"""Assumed, and everything else of the valve is known relative to them: the spring by (5.10), k = p_max A_s / s_max, the friction as
a pilot pressure, the areas over s / s_max. Were they off, those would be with them and nothing would change."""


@dataclass(frozen=True)
class Nuisance:
    """One number: component of the parameter vector, standard deviation (relative, or absolute where ``shift``).

    together: components that have the same factor.
    """

    name: str
    sigma: float
    shift: bool = False
    together: tuple[str, ...] = ()

    @property
    def components(self) -> tuple[str, ...]:
        """All that it moves."""
        return (self.name, *self.together)

    @property
    def limits(self) -> tuple[float, float]:
        """Least and largest z: as far as ``LARGEST_Z`` standard deviations go, counted straight.

        Where an effect of the catalogue is the number's being further off than its tolerance: as far as that.
        """
        most = TWIN_Z if self.name in TWINS else LARGEST_Z
        if self.shift:
            return -most, most
        return log(max(LEAST_SHARE, 1.0 - most * self.sigma)) / self.sigma, log(1.0 + most * self.sigma) / self.sigma

    def value(self, nominal: float, z: float) -> float:
        """Its value ``z`` standard deviations from the nominal one."""
        return nominal + self.sigma * z if self.shift else nominal * exp(self.sigma * z)


def tolerances(machine: Machine, pose: Pose) -> tuple[Nuisance, ...]:
    """All numbers that have a tolerance in this machine and pose."""
    result = []
    for key, parameter in machine.parameters.items():
        follows = key == PILOT_GAIN or any(key in row[1:] for row in ONE_FACTOR)
        if follows or key.startswith(_NOT_PHYSICS) or key in _UNITS_OF_THE_SPOOL:
            continue
        tolerance = PRECHARGE if key.startswith("accumulators.p_g0") else parameter.tolerance
        for name, value in zip(parameter.specification.components, parameter.value, strict=True):
            if value != 0.0 and not (key.startswith(GEOMETRY) and tolerance * abs(value) < SEEN):
                together = next((row[1:] for row in ONE_FACTOR if key == row[0]), ())
                result.append(Nuisance(name, tolerance * SPREAD, together=together))
    entry = machine.document["rigid_body"]["configs"].get(pose.tabulated, {})
    body = TOLERANCES.get(entry.get("conf", "medium"), 0.15)
    result += [Nuisance(f"pose.{name}", body * SPREAD) for name in ("D0", "Sx", "Sy")]
    if pose.load > 0.0:
        result.append(Nuisance("pose.load", max(LOAD * pose.load, LOAD_KG) * SPREAD, shift=True))
    return tuple(result)


def closed(machine: Machine, values: Mapping[str, float]) -> dict[str, float]:
    """``values`` (components of the parameter vector) with what follows from them.

    The gain of the pilot stage such that at rest nu / i stays what it is in ``machine`` (5.2), and the pin-to-pin length at
    s_p = 0 that the geometry asks for: l_min such that s_p(q_2 at the lower end of the angle's range) stays (3.13a). Where the
    linkage cannot be assembled there, l_min stays.
    """
    return _assembled(machine, _unit_gain(machine, values))


def _unit_gain(machine: Machine, values: Mapping[str, float]) -> dict[str, float]:
    """With b_0 = -a_1 (g - b_1) [1/s], where g = b_1 - b_0 / a_1 [-] is the machine's own gain at rest, one by (5.2)."""
    if PILOT_POLE not in values and PILOT_FEEDTHROUGH not in values:
        return dict(values)
    pole, gain, through = (machine.parameters[key].value[0] for key in (PILOT_POLE, PILOT_GAIN, PILOT_FEEDTHROUGH))
    lagging = through - gain / pole - values.get(PILOT_FEEDTHROUGH, through)
    return {**values, PILOT_GAIN: -values.get(PILOT_POLE, pole) * lagging}


def _assembled(machine: Machine, values: Mapping[str, float]) -> dict[str, float]:
    """With the l_min [m] that the geometry asks for (3.13a)."""
    moved = {name: value for name, value in values.items() if name.startswith(GEOMETRY)}
    if not moved:
        return dict(values)
    changed: dict[str, float | tuple[float, ...]] = {}
    for key, parameter in machine.parameters.items():
        components = parameter.specification.components
        if any(name in moved for name in components):
            changed[key] = tuple(moved.get(n, v) for n, v in zip(components, parameter.value, strict=True))
    low = machine.angle_limits[0]
    shift = machine.with_values(changed).piston_position(low) - machine.piston_position(low)
    length = machine.parameters[STROKE_ZERO].value[0]
    return {**values, STROKE_ZERO: length + shift if isfinite(shift) else length}
