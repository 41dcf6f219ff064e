"""The slots of a machine, one interface each, and the register of the components that can take them.

A component is one file in ``boom_model/components``: its equations as functions, and a call of :func:`register` with its
name in the machine file, the numbers that it needs, and the functions of the slot's interface. Nothing else names it. The default
functions of an interface are neutral, so an absent component (``type: none``) gives only its name.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, ClassVar, Protocol, TypeVar

from boom_model.errors import MachineError
from boom_model.regularisation import Expression
from boom_model.specification import Specification

Name = str | bool
"""Name in the machine file, e.g. ``four_bar``, or true and false for a component that is present or not."""


class Wiring(Protocol):
    """Interface of the model for the equations of a component.

    Attributes:
        p: numbers of the machine by section, ``p.cylinder.A_a``. e: terms of the active effects, through which goes what they may
            change. u: (i_+, i_-) [A].
        rates: state -> its derivative; every state that a component adds needs one.
    """

    p: Any
    e: Any
    u: Any
    rates: dict[str, Any]

    def add(self, name: str, symbol: str, unit: str, scale: float, low: float = ..., high: float = ...) -> Any:
        """A new state: name, symbol, unit, size of its usual range, limits outside which a run ends."""

    def add_pressure(self, name: str, symbol: str) -> Any:
        """A new state that is a pressure [Pa gauge]."""

    def pilot_difference(self) -> Expression:
        """p_+ - p_- [Pa] of the machine's pilot stage, which pushes the spool; learnt terms included."""

    def discrepancy(self, place: str, scale: Any) -> Expression:
        """What may be missing at a place (``learned.PLACES``), where one of it is ``scale``; 0 in a model without discrepancies."""


def _zero(*_: Any) -> Any:
    return 0.0


def _none(*_: Any) -> Any:
    return ()


@dataclass(frozen=True, eq=False, kw_only=True)
class Component:
    """Common interface of the components of all slots.

    Attributes:
        name: name in the machine file.
        meaning: short phrase.
        term: its equation in symbols. equation: number of it in the thesis.
        specifications: numbers that the machine file must give.
        information: further keys that the section may hold.
        offers: what effects may need (``Effect.needs``).
        check: raises MachineError where numbers do not go together, given the numbers by section and the file's own section.
        data: rows (meaning, value) of what its numbers mean on a data sheet, given the numbers by section.
        rest: its states that are not zero at rest, for (states so far by name, p, e).
    """

    slot: ClassVar[str]
    """Field of ``boom_model.structure.Structure``."""
    key: ClassVar[tuple[str, ...]]
    """Place of the name in the machine file: a section, and the key below it."""
    default: ClassVar[Name | None] = None
    """The default component."""
    refusal: ClassVar[str] = "{value!r} is not one of {listed}"
    asked: ClassVar[tuple[str, ...]] = ()
    """Numbers that every component of the slot must specify, because others use them."""

    name: Name
    meaning: str
    term: str = ""
    equation: str = "-"
    specifications: tuple[Specification, ...] = ()
    information: frozenset[str] = frozenset()
    offers: frozenset[str] = frozenset()
    check: Callable[[Any, Mapping[str, Any]], None] = _zero
    data: Callable[[Any], tuple[tuple[str, str], ...]] = _none
    rest: Callable[[Mapping[str, Expression], Any, Any], Mapping[str, Expression]] = field(
        default=lambda states, p, e: {}
    )

    def __reduce__(self) -> tuple[Any, ...]:
        return component, (type(self), self.name)


@dataclass(frozen=True)
class Bar:
    """A straight part between two pins (x, y) [m] in the column frame: origin in the boom joint, x outward, y up."""

    start: tuple[Expression, Expression]
    end: tuple[Expression, Expression]


@dataclass(frozen=True, eq=False, kw_only=True)
class Linkage(Component):
    """From the boom angle to the piston.

    Attributes:
        piston_position: s_p [m] at q_2 [rad] with the numbers p; it must grow with q_2.
        bars: what a drawing shows of it at q_2 [rad] with the numbers p, the cylinder first.
    """

    slot, key, default = "linkage", ("kinematics", "type"), "four_bar"
    piston_position: Callable[[Expression, Any], Expression]
    bars: Callable[[Expression, Any], tuple[Bar, ...]] = _none


@dataclass(frozen=True, eq=False, kw_only=True)
class Friction(Component):
    """Friction of the boom's motion.

    Attributes:
        torque: tau_f [N m] at q_2 [rad] and q_2' [rad/s], for (q_2, q_2', J [m/rad], p, e).
        sizes: keys of the numbers that are proportional to it: Coulomb friction lifting and lowering, viscous friction so.
    """

    slot, key, default = "friction", ("friction", "type"), "joint"
    torque: Callable[[Expression, Expression, Expression, Any, Any], Expression]
    sizes: tuple[str, ...]


@dataclass(frozen=True, eq=False, kw_only=True)
class Accumulators(Component):
    """Gas behind orifices at the hose of the head side.

    Attributes:
        flow: q_o [m^3/s] out of the hose at p_h [Pa]; adds its states to the full model.
        compliances: dV/dp [m^3/Pa] of each at rest with the line, at the pressure [Pa] and bulk modulus [Pa]; (p, beta, p, e).
        cells: pre-charge [Pa] and orifice diameter [m] of each, for (p, e).
        precharges: keys of the pre-charge pressures.
    """

    slot, key, default = "accumulators", ("accumulators", "type"), "two_diaphragm"
    flow: Callable[[Wiring, Expression], Expression] = _zero
    compliances: Callable[[Expression, Expression, Any, Any], tuple[Expression, ...]] = _none
    cells: Callable[[Any, Any], tuple[tuple[Expression, Expression], ...]] = _none
    precharges: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False, kw_only=True)
class HoseBurstValve(Component):
    """Between the hose and the head side.

    Attributes:
        separates: hose and head side are two volumes. Otherwise they are one, whose pressure p_h = p_a is one state.
        holds: it shuts the head side, whose pressure p_a then carries the boom whatever the hose's is. Both models then keep
            both volumes.
        flow: q_a [m^3/s] into the head side at p_h, p_a, p_b [Pa]; may add states.
        pressure_drop: p_h - p_a [Pa] that drives the flow q_a [m^3/s], for (q_a, p, e): the reduced model's.
        conductance: of one that holds, q_a / sqrt(p_a - p_h) to lower and the largest there is [m^3/s/Pa^0.5], for
            (p_a, p_b, p, e).
    """

    slot, key, default = "hose_burst_valve", ("hose_burst_valve", "type"), "flow_limiting"
    separates: bool = True
    holds: bool = False
    flow: Callable[[Wiring, Expression, Expression, Expression], Expression] = _zero
    pressure_drop: Callable[[Expression, Any, Any], Expression] = _zero
    conductance: Callable[[Expression, Expression, Any, Any], tuple[Expression, Expression]] = lambda *_: (0.0, 1.0)


@dataclass(frozen=True, eq=False, kw_only=True)
class PilotStage(Component):
    """From the two currents to the pressures that push the spool.

    Attributes:
        present: whether there is one.
        invertible: the controller's inverse (6.25), (6.26) is that of this stage.
        difference: p_+ - p_- [Pa]; adds its states.
        pressure: stationary pressure [Pa] of a current [A], for (i, p). current: its inverse, for (pressure, p).
        settling: time constant [s], for (p, e).
    """

    slot, key, default = "pilot_valves", ("pilot_valves", "type"), "wiener"
    present: bool = True
    invertible: bool = False
    difference: Callable[[Wiring], Expression] = _zero
    pressure: Callable[[Expression, Any], Expression] = _zero
    current: Callable[[Expression, Any], Expression] = _zero
    settling: Callable[[Any, Any], float] = _zero


@dataclass(frozen=True, eq=False, kw_only=True)
class Spool(Component):
    """Spool of the main valve. Its position s_s is the state ``spool_position``, its stroke ``main_valve_spool.s_max``.

    Attributes:
        piloted: pushed by a pilot stage, which the machine must have; without, the machine must have none.
        invertible: the controller's inverse (6.24) is that of this spool.
        motion: sets the rate of ``spool_position`` from s_s [m] and the force [N] with which the flow closes it; may add states.
        position: stationary s_s [m] of the currents i_+, i_- (n,) [A], for (i_+, i_-, p, pilot stage).
        current: current [A] that holds |s_s| [m], for (s_s, p, pilot stage).
        settling: lag [s] behind changing currents, for (p, e, pilot stage).
    """

    slot, key, default = "spool", ("main_valve_spool", "type"), "pilot_operated"
    asked = ("main_valve_spool.s_max",)
    piloted: bool = False
    invertible: bool = False
    motion: Callable[[Wiring, Expression, Expression], None]
    position: Callable[[Any, Any, Any, PilotStage], Any]
    current: Callable[[float, Any, PilotStage], float]
    settling: Callable[[Any, Any, PilotStage], float]


@dataclass(frozen=True, eq=False, kw_only=True)
class Supply(Component):
    """Drop over the edge from the supply to a port.

    Attributes:
        drop: [Pa] at the pressure of the port [Pa], for (pressure, p). root: its square root [Pa^0.5] with the sign of the drop.
    """

    slot, key, default = "supply", ("main_valve_orifices", "compensator"), True
    refusal = "{value!r} is not {either}"
    drop: Callable[[Expression, Any], Expression]
    root: Callable[[Expression, Any], Expression]


@dataclass(frozen=True, eq=False, kw_only=True)
class PortValves(Component):
    """Valves beside the spool at both ports.

    Attributes:
        flow: [m^3/s] into the port at its pressure [Pa], for (pressure, p).
    """

    slot, key = "port_valves", ("main_valve_orifices", "anti_cavitation", "enabled")
    refusal = "say {either}"
    flow: Callable[[Expression, Any], Expression] = _zero


@dataclass(frozen=True, eq=False, kw_only=True)
class NeutralPosition(Component):
    """What the spool does with its ports about neutral.

    Attributes:
        area: [m^2] from each port to the tank at s_s [m], for (s_s, p).
        vents: whether both ports fall to the tank's pressure at rest.
    """

    slot, key, default = "neutral", ("main_valve_orifices", "neutral"), "shut"
    area: Callable[[Expression, Any], Expression] = _zero
    vents: bool = False


NO_CUSHIONS = (0.0, 0.0)
"""Of the ways back of rod side and hose."""


@dataclass(frozen=True)
class ValveFlows:
    """Flows out of the valve into the hose of port a and into port b [m^3/s], closing force on the spool [N]."""

    head: Expression
    rod: Expression
    force: Expression


@dataclass(frozen=True, eq=False, kw_only=True)
class Metering(Component):
    """Edges of the spool: s_s < 0 opens supply to a and b to tank, s_s > 0 supply to b and a to tank.

    Attributes:
        flows: flows and closing force at s_s [m], p_h, p_b [Pa], for (s_s, p_h, p_b, p, e, supply, cushions in the ways back of
            the rod side and the hose, ``main_valve_orifices.behind_throttle``).
        areas: (supply, tank) [m^2] of the edges that are open at s_s [m], for (s_s, p, e).
        overlap: dead zone over full stroke on the side of s_s [m], for (s_s, p, e).
        largest_opening: |s_s| over full stroke beyond which no area grows.
        neutral: where the edges' middle is [m] of s_s, for p.
        overlaps: keys of the overlaps, all within the stroke.
        law: whether the areas follow the law of ch. 5.2, so that its numbers can be identified from stationary points.
    """

    slot, key, default = "metering", ("main_valve_orifices", "type"), "common_overlap"
    flows: Callable[[Expression, Expression, Expression, Any, Any, Supply, tuple[Expression, Expression]], ValveFlows]
    areas: Callable[[Expression, Any, Any], tuple[Expression, Expression]]
    overlap: Callable[[Expression, Any, Any], Expression]
    largest_opening: float
    neutral: Callable[[Any], Expression] = _zero
    overlaps: tuple[str, ...] = ()
    law: bool = False


C = TypeVar("C", bound=Component)

_REGISTER: dict[type[Component], list[Component]] = {}


def register(new: C) -> C:
    """Register a component, so that a machine file can name it.

    Raises:
        ValueError: the slot has one of this name, or a required number is not specified.
    """
    for key in set(new.asked) - {spec.key for spec in new.specifications}:
        raise ValueError(f"{'.'.join(new.key)}: {new.name} does not specify {key}")
    slot = _REGISTER.setdefault(type(new), [])
    if any(_same(new.name, other.name) for other in slot):
        raise ValueError(f"{'.'.join(new.key)}: two components are called {new.name}")
    slot.append(new)
    return new


def registered(slot: type[C]) -> list[C]:
    """The components of a slot, the default first."""
    known: list[Any] = _REGISTER.get(slot, [])
    return sorted(known, key=lambda c: not _same(c.name, slot.default))


def component(slot: type[C], name: Any) -> C:
    """The component of a slot that has this name.

    Raises:
        MachineError: there is none; the message lists all names.
    """
    for known in registered(slot):
        if _same(known.name, name):
            return known
    names = [str(c.name).lower() if isinstance(c.name, bool) else c.name for c in registered(slot)]
    listed, either = ", ".join(names), " or ".join(names)
    raise MachineError(f"{'.'.join(slot.key)}: {slot.refusal.format(value=name, listed=listed, either=either)}")


def _same(name: Any, other: Any) -> bool:
    """1 is not true, nor is the text "true"."""
    return type(name) is type(other) and bool(name == other)
