"""The components of a machine, which determine the form of the equations."""

from __future__ import annotations

from collections.abc import Container, Iterator
from dataclasses import dataclass, replace
from typing import Any

from boom_model import joint_motion
from boom_model.components import cylinder, equation_of_motion, oil, payload
from boom_model.errors import MachineError
from boom_model.slots import (
    Accumulators,
    Component,
    Friction,
    HoseBurstValve,
    Linkage,
    Metering,
    NeutralPosition,
    PilotStage,
    PortValves,
    Spool,
    Supply,
    component,
    registered,
)
from boom_model.specification import Specification

HOSE = (Specification("cylinder.V_h", "V_h", "m^3", "volume of the head-side hose", 1e-6, 0.1, "5.39i"),)
CURRENTS = ("retract_current", "extend_current")
"""i_+, i_- [A]: the inputs of every model."""
DRIVING = {"supply_pressure": ("fluid", "p_s"), "tank_pressure": ("fluid", "p_t")}
"""Optional channels that take the place of a number of the machine where they are recorded: section and key of it."""
SLOTS: tuple[type[Component], ...] = (
    Linkage, Friction, PilotStage, Spool, Supply, PortValves, NeutralPosition, Metering, Accumulators, HoseBurstValve,
)  # fmt: skip
"""In the order in which a machine file is read."""


@dataclass(frozen=True)
class Structure:
    """The component of each slot, ``boom_model.slots``, and what drives the model beside the currents.

    Attributes:
        driven: keys of ``DRIVING`` whose measurement is an input, in place of the constant.
        steps: of the load, each by ``time`` or by ``stroke``.
        moving_joints: whether the motion of the other joints is an input (``joint_motion``), too.
    """

    linkage: Linkage
    friction: Friction
    pilot_valves: PilotStage
    spool: Spool
    supply: Supply
    port_valves: PortValves
    neutral: NeutralPosition
    metering: Metering
    accumulators: Accumulators
    hose_burst_valve: HoseBurstValve
    driven: tuple[str, ...] = ()
    steps: tuple[payload.By, ...] = ()
    moving_joints: bool = False

    @property
    def inputs(self) -> tuple[str, ...]:
        """Names of the inputs u: the currents i_+, i_- [A], the pressures [Pa] that drive the model, the joints' motion."""
        return CURRENTS + self.driven + (joint_motion.INPUTS if self.moving_joints else ())

    def driven_by(self, measured: Container[str]) -> Structure:
        """The same, driven by those of ``DRIVING`` that are measured."""
        return replace(self, driven=tuple(name for name in DRIVING if name in measured))

    def __iter__(self) -> Iterator[Component]:
        return (getattr(self, slot.slot) for slot in SLOTS)

    def specifications(self) -> tuple[Specification, ...]:
        """All parameters that a machine of this structure needs, each once."""
        parts = (
            self.spool, self.metering, self.supply, self.accumulators, self.hose_burst_valve, self.pilot_valves, self.port_valves,
            self.neutral,
        )  # fmt: skip
        groups = (
            equation_of_motion.SPECIFICATIONS, self.linkage.specifications, self.friction.specifications, oil.SPECIFICATIONS,
            cylinder.SPECIFICATIONS, HOSE, *(part.specifications for part in parts),
            *(payload.specifications(k, by) for k, by in enumerate(self.steps)),
        )  # fmt: skip
        return tuple({spec.key: spec for group in groups for spec in group}.values())

    def has(self, need: str) -> bool:
        """Whether components provide all that an effect needs (``Effect.needs``); "no_" before a word: none does."""
        offered = frozenset[str]().union(*(c.offers for c in self))
        return all((word.removeprefix("no_") in offered) != word.startswith("no_") for word in need.split())

    def with_component(self, new: Component) -> Structure:
        """The same with another component in its slot; a pilot stage is added and removed with its spool."""
        changed = {new.slot: new}
        if isinstance(new, Spool):
            changed["pilot_valves"] = next(c for c in registered(PilotStage) if c.present == new.piloted)
        elif isinstance(new, PilotStage):
            changed["spool"] = next(c for c in registered(Spool) if c.piloted == new.present)
        return replace(self, **changed)  # type: ignore[arg-type]

    def check(self) -> None:
        """Refuse components that do not fit together.

        Raises:
            MachineError: a piloted spool without pilot stage, or the other way round.
        """
        if self.spool.piloted != self.pilot_valves.present:
            absent = " or ".join(str(c.name) for c in registered(PilotStage) if not c.present)
            direct = " or ".join(str(c.name) for c in registered(Spool) if not c.piloted)
            raise MachineError(
                f"pilot_valves.type: {absent} goes with main_valve_spool.type: {direct}, and only with it"
            )


def structure(**names: Any) -> Structure:
    """The structure of tz17 with other components in some slots, by name: ``structure(linkage="triangle")``."""
    chosen: dict[str, Any] = {
        slot.slot: component(slot, names.get(slot.slot, registered(slot)[0].name)) for slot in SLOTS
    }
    return Structure(**chosen)
