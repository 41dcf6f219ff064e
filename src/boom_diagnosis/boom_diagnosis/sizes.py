"""Ranges and starts of the catalogue in proportion to a machine: they are those of the crane of the thesis.

Pressures, times and shares are alike in cranes of all sizes. Flows go with the piston's area, as pistons are about as fast; torques
with the boom's moment of mass; loads with that over the radius of the tip. What an effect's number is, its unit says.
"""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from math import hypot
from typing import NamedTuple

from boom_model.catalogue.effect import Effect, EffectParameter
from boom_model.machine import Machine
from boom_model.machine_file import shipped_machine


class MachineSize(NamedTuple):
    """Flows, torques and loads of a machine over those of the crane of the thesis."""

    flow: float = 1.0
    torque: float = 1.0
    load: float = 1.0

    def of(self, unit: str) -> float:
        """The factor of a number with this unit."""
        if unit in ("m^2", "m^3/s/Pa", "m^3/s/Pa^0.5", "m^3/s/Pa^1.5"):
            return self.flow
        return {
            "Pa s/m^3": 1.0 / self.flow, "s/m^3": 1.0 / self.flow, "Pa s^2/m^6": self.flow**-2,
            "N m": self.torque, "N m/rad": self.torque, "N m s/rad": self.torque,
            "kg m": self.torque, "rad/(N m)": 1.0 / self.torque, "kg": self.load,
        }.get(unit, 1.0)  # fmt: skip


THESIS = MachineSize()


def size_of(machine: Machine) -> MachineSize:
    """Of a machine, by the pose of its file in which its moment of mass is largest; by the piston alone where it has none."""
    own, thesis = _scales(machine), _thesis()
    flow, torque, load = (a / b for a, b in zip(own, thesis, strict=True))
    return MachineSize(flow, torque, load) if machine.tabulated else MachineSize(flow, flow, flow)


@lru_cache(maxsize=256)
def sized(effect: Effect, size: MachineSize) -> Effect:
    """The effect with the ranges and starts of a machine of this size, inside the limits of what a machine file may say."""
    return effect if size == THESIS else replace(effect, parameters=tuple(_row(r, size) for r in effect.parameters))


def _row(row: EffectParameter, size: MachineSize) -> EffectParameter:
    factor = size.of(row.unit) * size.flow**row.flow_power

    def inside(value: float) -> float:
        return min(max(value * factor, row.minimum), row.maximum)

    low, high = inside(row.low), inside(row.high)
    if factor == 1.0 or not low < high:  # of a machine beyond what a file may say
        return row
    possible = row.possible[0] * factor, row.possible[1] * factor
    starts = tuple(map(inside, row.starts))
    accuracy, ordinary = row.accuracy * factor, row.ordinary * factor
    return replace(row, low=low, high=high, starts=starts, possible=possible, accuracy=accuracy, ordinary=ordinary)


def _scales(machine: Machine) -> tuple[float, float, float]:
    """Area of the piston [m^2], moment of mass [kg m], that over the radius of the tip [kg]."""
    moment, radius = max(((hypot(p.Sx, p.Sy), hypot(*p.tip)) for p in machine.tabulated), default=(1.0, 1.0))
    return machine.parameters["cylinder.A_a"].value[0], moment, moment / radius


@lru_cache(maxsize=1)
def _thesis() -> tuple[float, float, float]:
    return _scales(shipped_machine("tz17"))
