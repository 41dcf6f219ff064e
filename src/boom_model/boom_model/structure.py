"""Which components a machine has: what decides the shape of the equations, while numbers fill them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from boom_model.components import (
    accumulator,
    anti_cavitation,
    cylinder,
    direct_spool,
    equation_of_motion,
    four_bar_linkage,
    friction,
    hose_burst_valve,
    main_valve_orifices,
    main_valve_spool,
    oil,
    pilot_valve,
    triangle_linkage,
)
from boom_model.specification import Specification

HOSE = (Specification("cylinder.V_h", "V_h", "m^3", "volume of the head-side hose", 1e-6, 0.1, "5.39i"),)


@dataclass(frozen=True)
class Structure:
    """Components of a machine.

    Attributes:
        linkage: ``four_bar`` or ``triangle``.
        accumulators: two accumulators on the head side, or none.
        hose_burst_valve: between hose and head side; without it p_h = p_a and the hose belongs to the head volume.
        pilot_valves: pilot stage and spool dynamics (3.21); without it the currents command the spool directly.
        compensator: pressure-compensated orifices (3.25); without it (3.23) with a supply pressure.
        anti_cavitation: anti-cavitation valves at both ports.
    """

    linkage: Literal["four_bar", "triangle"] = "four_bar"
    accumulators: bool = True
    hose_burst_valve: bool = True
    pilot_valves: bool = True
    compensator: bool = True
    anti_cavitation: bool = True

    def specifications(self) -> tuple[Specification, ...]:
        """All parameters that a machine of this structure needs, each once."""
        linkage = four_bar_linkage if self.linkage == "four_bar" else triangle_linkage
        groups = [
            equation_of_motion.SPECIFICATIONS,
            linkage.SPECIFICATIONS,
            friction.SPECIFICATIONS,
            oil.SPECIFICATIONS,
            cylinder.SPECIFICATIONS,
            HOSE,
            main_valve_spool.SPECIFICATIONS if self.pilot_valves else direct_spool.SPECIFICATIONS,
            main_valve_orifices.SPECIFICATIONS,
            main_valve_orifices.COMPENSATED if self.compensator else main_valve_orifices.UNCOMPENSATED,
        ]
        if self.accumulators:
            groups.append(accumulator.SPECIFICATIONS)
        if self.hose_burst_valve:
            groups.append(hose_burst_valve.SPECIFICATIONS)
        if self.pilot_valves:
            groups.append(pilot_valve.SPECIFICATIONS)
        if self.anti_cavitation:
            groups.append(anti_cavitation.SPECIFICATIONS)
        return tuple(spec for group in groups for spec in group)

    def has(self, component: str) -> bool:
        """Whether the component that an effect needs (``Effect.needs``) is there; an empty name always is."""
        return component == "" or bool(getattr(self, component))

    @property
    def key(self) -> str:
        """Short text that tells structures apart."""
        flags = (self.accumulators, self.hose_burst_valve, self.pilot_valves, self.compensator, self.anti_cavitation)
        return self.linkage + "-" + "".join("1" if flag else "0" for flag in flags)
