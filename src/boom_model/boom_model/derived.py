"""Quantities that follow from the numbers of a machine and that data sheets state. For users, not for the model."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from boom_model.catalogue.terms import Terms
from boom_model.component_numbers import component_parameters
from boom_model.components import cylinder, equation_of_motion
from boom_model.equations import namespace
from boom_model.machine import Machine
from boom_model.prior import summary
from boom_model.specification import number

BAR, LPM, LITRE, MILLIMETRE, DEGREE = 1e5, 1 / 60_000.0, 1e-3, 1e-3, math.pi / 180.0
USUAL_PRESSURE = 240e5
"""Pa gauge in the head side, none in the rod side, for the load that can be held, where the file has no supply pressure."""
RETURN_PRESSURE = 10e5
"""Pa gauge in the rod side, assumed where a flow depends on it (valves without compensator)."""
FASTEST = 0.8
"""rad/s. No crane lifts faster in every position: flow and pressure drop of an edge do not belong together then."""
LARGEST_PRESSURE = 500e5
"""Pa gauge. No crane's cylinder holds more."""
HEAVIEST = 50e3
"""kg. No boom is as heavy: D_0 and S do not belong together then."""
STEPS = 100
_STEP = 1e-4  # rad, for the lever arm


@dataclass(frozen=True)
class Quantity:
    """One line of a table: name, value with unit, source in the file; ``fault``: why no machine has it, empty where one may."""

    meaning: str
    value: str
    source: str
    fault: str = ""


def quantities(machine: Machine) -> list[Quantity]:
    """The quantities of a machine; its effects and learned terms are left out."""
    machine = machine.with_effects({})
    p, e = component_parameters(machine, machine.tabulated[0])
    a, b = p.cylinder.A_a, p.cylinder.A_b
    low, high = machine.angle_limits
    begin, end = machine.piston_position(low), machine.piston_position(high)
    angles = _angles(machine)
    levers = [_lever(machine, angle) for angle in angles]
    level, most = angles.index(min(angles, key=abs)), _most(machine)

    def volumes(at: Any) -> str:
        return f"{at(begin, p) / LITRE:.2f} .. {at(end, p) / LITRE:.2f} l"

    rows = [
        Quantity("piston and rod diameter", f"{_diameter(a):.1f} mm, {_diameter(a - b):.1f} mm", "cylinder.A_a, A_b"),
        Quantity("area ratio", f"{a / b:.2f}", "cylinder.A_a, A_b"),
        Quantity("stroke", f"{p.cylinder.l_p / MILLIMETRE:.0f} mm", "cylinder.l_p"),
        Quantity("stroke that the boom uses", f"{abs(begin) / MILLIMETRE:.0f} .. {end / MILLIMETRE:.0f} mm", "kinematics"),
        Quantity("boom angle, 0 = level", f"{low / DEGREE:.1f} .. {high / DEGREE:.1f} deg", "kinematics.q2_*"),
        Quantity("lever arm of the cylinder", _between(levers, MILLIMETRE, "mm"), "kinematics"),
        Quantity("volume of the head side, in .. out", volumes(cylinder.head_volume), "cylinder"),
        Quantity("volume of the rod side, in .. out", volumes(cylinder.rod_volume), "cylinder"),
        Quantity(
            f"force at {most / BAR:.0f} bar, push and pull",
            f"{most * a / 1e3:.0f} kN, {most * b / 1e3:.0f} kN", "cylinder.A_a, A_b",
        ),
    ]  # fmt: skip
    rows += [Quantity(*row, part.key[0]) for part in machine.structure for row in part.data(p)]
    opened = valve_currents(machine)
    rows.append(
        Quantity(
            "current: the valve opens .. is open", "{:.2f} .. {:.2f} A".format(*opened), "pilot_valves, main_valve_*"
        )
    )
    for name, sign, area in (("lift", -1.0, a), ("lower", 1.0, b)):
        flow = _supply(machine, p, e, sign, _torque(p, angles[level], 0.0) / levers[level] / a)
        rates = [flow / area / lever for lever in levers]
        fast = "" if min(rates) < FASTEST else ": too fast for a crane; was that flow measured at that drop?"
        rows += [
            Quantity(f"{name}, valve fully open: flow", f"{flow / LPM:.0f} l/min", "main_valve_orifices, fluid"),
            Quantity(f"{name}: piston", f"{flow / area / MILLIMETRE:.0f} mm/s", "and cylinder"),
            Quantity(f"{name}: boom", _between(rates, 1.0, "rad/s", 2) + fast, "and kinematics"),
        ]
    for pose in machine.tabulated:
        where = f"rigid_body.configs.{pose.tabulated}"
        posed = namespace(machine.values(pose))
        pressure = _torque(posed, angles[level], 0.0) / levers[level] / a
        much = "more than any cylinder holds; are Sx and Sy in kg m?" if abs(pressure) > LARGEST_PRESSURE else ""
        least = (pose.Sx**2 + pose.Sy**2) / pose.D0  # of a mass m at r: S = m r, D_0 >= m r^2
        heavy = "too heavy for a boom; are D0 in kg m^2 and Sx, Sy in kg m?" if least > HEAVIEST else ""
        rows += [
            Quantity(f"{pose.tabulated}: mass, at least", f"{least:.0f} kg", where, heavy),
            Quantity(f"{pose.tabulated}: reach", f"{math.hypot(*pose.tip):.2f} m", f"{where}.tip"),
            Quantity(f"{pose.tabulated}: held level by", f"{pressure / BAR:.0f} bar", where, much),
            Quantity(
                f"{pose.tabulated}: {most / BAR:.0f} bar hold level",
                _load(posed, most, angles[level : level + 1], levers[level : level + 1]),
                where,
            ),
            Quantity(f"{pose.tabulated}: and in every angle", _load(posed, most, angles, levers), where),
        ]
    return rows + [Quantity(*row) for row in summary(machine.parameters.values())]


def _most(machine: Machine) -> float:
    """Supply pressure of the file [Pa gauge], which the equations of some structures do not need."""
    given = number(machine.document.get("fluid", {}).get("p_s"))
    return given if math.isfinite(given) else USUAL_PRESSURE


def _angles(machine: Machine) -> list[float]:
    low, high = machine.angle_limits
    inside = [low + (high - low) * k / STEPS for k in range(1, STEPS)]
    return sorted([*inside, 0.0]) if low < 0.0 < high else inside


def _lever(machine: Machine, angle: float) -> float:
    """J = ds_p/dq_2 [m/rad]."""
    return (machine.piston_position(angle + _STEP) - machine.piston_position(angle - _STEP)) / (2 * _STEP)


def _torque(p: Any, angle: float, load: float) -> float:
    return float(equation_of_motion.gravity_torque(angle, load, p, Terms({})))


def _load(p: Any, pressure: float, angles: list[float], levers: list[float]) -> str:
    """The load [kg] that the head side holds at a pressure [Pa gauge] in all of these angles, without friction."""
    held = math.inf
    for angle, lever in zip(angles, levers, strict=True):
        own = _torque(p, angle, 0.0)
        per_kilogram = _torque(p, angle, 1.0) - own
        if per_kilogram > 0.0:  # else the load's weight lifts
            held = min(held, (pressure * p.cylinder.A_a * lever - own) / per_kilogram)
    if math.isinf(held):
        return "any"
    return f"{held:.0f} kg" if held > 0.0 else "none: more pressure is needed without load"


def _supply(machine: Machine, p: Any, e: Any, sign: float, head_pressure: float) -> float:
    """Flow [m^3/s] from the supply with the spool at its end; sign as that of s_s: -1 lifts, against the head pressure [Pa]."""
    area, _ = machine.structure.metering.areas(sign * p.main_valve_spool.s_max, p, e)
    drop = machine.structure.supply.drop(head_pressure if sign < 0.0 else RETURN_PRESSURE, p)
    return float(p.fluid.C_d * area * math.sqrt(2.0 / p.fluid.rho * max(drop, 0.0)))


def valve_currents(machine: Machine) -> tuple[float, float]:
    """Currents [A] at which the main valve opens, and is open, without effects."""
    p, e = component_parameters(machine.with_effects({}), machine.tabulated[0])
    s, stroke = machine.structure, p.main_valve_spool.s_max
    overlap = float(s.metering.overlap(-stroke, p, e))
    first, last = (float(s.spool.current(x * stroke, p, s.pilot_valves)) for x in (overlap, 1.0))
    return first, last


def _diameter(area: float) -> float:
    return math.sqrt(4.0 * area / math.pi) / MILLIMETRE


def _between(values: list[float], unit: float, name: str, digits: int = 0) -> str:
    return f"{min(values) / unit:.{digits}f} .. {max(values) / unit:.{digits}f} {name}"
