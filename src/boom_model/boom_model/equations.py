"""The full model (5.39) and the reduced model (5.47): only connects the components.

Both come as :class:`Equations`: symbolic x' = f(x, u, p) and y = h(x, u, p) in CasADi, from which simulation, Jacobian and
sensitivities are derived. Order of arguments everywhere: state, input, parameters.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from math import inf
from types import SimpleNamespace
from typing import Any, Literal

import casadi as ca

from boom_model import joint_motion, sensors
from boom_model import learned as learned_terms
from boom_model.catalogue import EFFECTS
from boom_model.catalogue.terms import Terms
from boom_model.components import cylinder, equation_of_motion, neutral_position, oil, payload
from boom_model.errors import ModelError
from boom_model.learned import DISCREPANCY_TIME, PLACES, LearnedTerm, discrepancy_state
from boom_model.state import ELAPSED_TIME, State
from boom_model.structure import CURRENTS, DRIVING, Structure

Kind = Literal["full", "reduced"]

INPUTS = CURRENTS
"""u = (i_+, i_-) [A]; measured pressures that drive the model stand behind them (``Structure.inputs``)."""

LOWEST_PRESSURE = -oil.AMBIENT_PRESSURE
HIGHEST_PRESSURE = 1.0e8
"""Pa gauge: outside, a run ends with an error. Steel bursts long before the upper one; below the lower is nothing."""


def valve_holds(structure: Structure, effects: Iterable[str]) -> bool:
    """Whether a valve shuts the head side, of the structure or an effect: p_a carries the boom then, whatever p_h is."""
    return structure.hose_burst_valve.holds or any(EFFECTS[name].holds for name in effects)


def valve_separates(structure: Structure, effects: Iterable[str]) -> bool:
    """Whether hose and head side are two volumes: the structure has a valve between them, or an effect puts one there."""
    return structure.hose_burst_valve.separates or any(EFFECTS[name].holds for name in effects)


@dataclass(frozen=True, eq=False)
class Equations:
    """x' = derivative(x, u, p), y = outputs(x, u, p); all symbolic.

    Attributes:
        auxiliary: named inner quantities with their unit.
        valve: states of pilot stage and spool, which settle within a second under held currents.
    """

    kind: Kind
    structure: Structure
    effects: tuple[str, ...]
    states: tuple[State, ...]
    parameters: tuple[str, ...]
    x: Any
    u: Any
    p: Any
    derivative: Any
    outputs: Any
    auxiliary: dict[str, tuple[str, Any]]
    valve: tuple[str, ...]

    @property
    def state_names(self) -> tuple[str, ...]:
        """Names of the states in order."""
        return tuple(state.name for state in self.states)


def namespace(values: dict[str, Any]) -> SimpleNamespace:
    """Dotted names -> nested namespaces; ``.0 .1`` endings become tuples."""
    nodes: dict[str, SimpleNamespace] = {"": SimpleNamespace()}
    for (path, last, several), value in zip(_paths(tuple(values)), values.values(), strict=True):
        if path not in nodes:
            parent = nodes[""]
            for part in path.split("."):
                parent = parent.__dict__.setdefault(part, SimpleNamespace())
            nodes[path] = parent
        own = nodes[path].__dict__
        own[last] = (*own.get(last, ()), value) if several else value
    return nodes[""]


@lru_cache(maxsize=64)
def _paths(names: tuple[str, ...]) -> tuple[tuple[str, str, bool], ...]:
    """Of each dotted name the namespace, the name in it, and whether it is one number of a tuple."""
    result = []
    for name in names:
        path, _, last = name.rpartition(".")
        several = last.isdigit()
        if several:
            path, _, last = path.rpartition(".")
        result.append((path, last, several))
    return tuple(result)


def parameter_names(
    structure: Structure, effects: Iterable[str], learned: Sequence[LearnedTerm] = ()
) -> tuple[str, ...]:
    """Order of the parameter vector p: the machine's numbers, those of the active effects, those of learnt terms."""
    names = [c for spec in structure.specifications() for c in spec.components]
    names += [f"effects.{e}.{row.name}" for e in sorted(effects) for row in EFFECTS[e].parameters]
    names += [f"learned.{k}.{j}" for k, entry in enumerate(learned) for j in range(len(entry.basis))]
    return tuple(names)


class _Wiring:
    """Symbols and the common parts of both models: kinematics, valve, spool, pilot stage, outputs."""

    def __init__(
        self,
        structure: Structure,
        effects: Iterable[str],
        learned: Sequence[LearnedTerm] = (),
        discrepancies: bool = False,
        guarded: Collection[str] = (),
        stateful: bool = True,
        still: Collection[str] = (),
    ) -> None:
        self.structure = structure
        self.learned = tuple(learned)
        self.discrepancies = discrepancies
        self.effects = tuple(sorted(effects))
        for name in self.effects:
            if not structure.has(EFFECTS[name].needs):
                raise ModelError(f"effects.{name}: this machine has {EFFECTS[name].lacking}")
        self.names = parameter_names(structure, self.effects, self.learned)
        self.p_vector = ca.SX.sym("p", len(self.names))
        symbols = {name: self.p_vector[i] for i, name in enumerate(self.names)}
        self.p = namespace({k: v for k, v in symbols.items() if not k.startswith(("effects.", "learned."))})
        self.coefficients = [
            [symbols[f"learned.{k}.{j}"] for j in range(len(entry.basis))] for k, entry in enumerate(self.learned)
        ]
        self.quantities: dict[str, Any] = {}
        numbers = {
            name: {row.name: symbols[f"effects.{name}.{row.name}"] for row in EFFECTS[name].parameters}
            for name in self.effects
        }
        self.e = Terms(numbers, self, guarded=guarded, stateful=stateful, still=still)
        self.states: list[State] = []
        self.symbols: dict[str, Any] = {}
        self.rates: dict[str, Any] = {}
        self.memories: set[str] = set()
        self.auxiliary: dict[str, tuple[str, Any]] = {}
        self.u = ca.SX.sym("u", len(structure.inputs))
        if hasattr(self.p.fluid, "p_s"):
            self.p.fluid.p_s = self.e.through("supply_pressure", self.p.fluid.p_s)
        for k, name in enumerate(structure.driven, start=len(CURRENTS)):
            section, key = DRIVING[name]
            setattr(getattr(self.p, section), key, self.u[k])
        self.moved: Any = None
        if structure.moving_joints:
            self.moved = joint_motion.apply(self.p, self.u[len(CURRENTS) + len(structure.driven) :])

    def add(self, name: str, symbol: str, unit: str, scale: float, low: float = -inf, high: float = inf) -> Any:
        return self.add_state(State(name, symbol, unit, scale, low, high))

    def add_state(self, state: State) -> Any:
        """The symbol of a state, which joins the equations if it is not there yet."""
        if state.name not in self.symbols:
            self.states.append(state)
            self.symbols[state.name] = ca.SX.sym(state.name)
        return self.symbols[state.name]

    def add_pressure(self, name: str, symbol: str) -> Any:
        return self.add(name, symbol, "Pa", 1e7, LOWEST_PRESSURE, HIGHEST_PRESSURE)

    def learnt(self, equation: str) -> Any:
        """Sum of the terms learnt from data for an equation, and its discrepancy, in its unit; 0 without any."""
        return self.learnt_terms(equation) + self.discrepancy(equation, PLACES[equation].scale)

    def learnt_terms(self, equation: str) -> Any:
        """The same without discrepancy."""
        total: Any = 0.0
        for entry, coefficients in zip(self.learned, self.coefficients, strict=True):
            if entry.equation == equation:
                total = total + learned_terms.term(entry, coefficients, self.quantities, self._memory)
        return total

    def discrepancy(self, place: str, scale: Any) -> Any:
        """What an observer may find missing at a place: d scale, T d' = -d; 0 where the equations have no discrepancies."""
        if not self.discrepancies:
            return 0.0
        state = discrepancy_state(place)
        d = self.add_state(state)
        self.rates[state.name] = -d / DISCREPANCY_TIME
        return scale * d

    def _memory(self, variable: str, time: float, value: Any) -> Any:
        name = f"memory_{variable}_{time:g}"
        if name not in self.symbols:
            self.memories.add(name)
            lagging = self.add(name, f"x_{variable}", "-", 1.0)
            self.rates[name] = (value - lagging) / time
        return self.symbols[name]

    def kinematics(self) -> None:
        self.angle = self.add("angle", "q_2", "rad", 1.0)
        self.rate = self.add("rate", "w", "rad/s", 0.3, -10.0, 10.0)
        self.position = self.structure.linkage.piston_position(self.angle, self.p)
        self.jacobian = ca.jacobian(self.position, self.angle)
        self.velocity = self.jacobian * self.rate

    def valve(self, hose_pressure: Any, rod_pressure: Any) -> tuple[Any, Any]:
        """Adds spool and pilot states; flows (q_h, q_b) into hose and rod side, anti-cavitation included."""
        p, e = self.p, self.e
        spool = self.add("spool_position", "s_s", "m", 5e-3, -1.0, 1.0)
        self.quantities["spool"] = spool / p.main_valve_spool.s_max
        s = self.structure
        metering = e.through("metering_position", spool + s.metering.neutral(p), p=p)
        cushions = cylinder.cushions_at_the_valve(self.position, p, e)
        vent = e.through("neutral_area", s.neutral.area(metering, p), position=metering, p=p)
        flows = s.metering.flows(metering, hose_pressure, rod_pressure, p, e, s.supply, cushions)
        before = len(self.states)
        s.spool.motion(self, spool, flows.force)
        own = [state.name for state in self.states[before:] if state.name not in self.memories]
        self.valve_states = ("spool_position", *own)
        head, rod = (
            flow + s.port_valves.flow(pressure, p) + neutral_position.flow(vent, pressure, p)
            + e.through("port_leakage", 0.0, port=port, pressure=pressure)
            for flow, pressure, port in ((flows.head, hose_pressure, "hose"), (flows.rod, rod_pressure, "rod"))
        )  # fmt: skip
        return head, rod

    def pilot_difference(self) -> Any:
        """p_+ - p_- [Pa] of the pilot stage, learnt terms included; adds its states."""
        difference = self.e.through("pilot_difference", self.structure.pilot_valves.difference(self)) + self.learnt(
            "spool"
        )
        self.auxiliary["pilot_pressure_difference"] = ("Pa", difference)
        return difference

    def motion(self, head_pressure: Any, rod_pressure: Any) -> None:
        """Equation of motion from the pressures that act on the piston."""
        p, e = self.p, self.e
        cushion = e.through("cushion", 0.0, distance=p.cylinder.l_p - self.position, way="r")
        drop = cylinder.cushion_drop(self.velocity, cushion, self._whole_return(), p)
        self.force = cylinder.force(head_pressure, rod_pressure + drop, p)
        friction = self.structure.friction.torque(self.angle, self.rate, self.jacobian, p, e)
        self.friction = friction - self.learnt("torque")
        steps = payload.mass(self.structure.steps, self._time, self.position, p)
        load = equation_of_motion.load_mass(p, e, self.position, steps)
        inertia = equation_of_motion.inertia(load, p)
        self.gravity = equation_of_motion.gravity_torque(self.angle, load, p, e)
        torque = equation_of_motion.torque(self.gravity, self.jacobian, self.force, self.friction)
        if self.moved is not None:
            torque = torque + joint_motion.torque(self.moved, self.angle, self.rate, load, p)
        self.rates["angle"] = self.rate
        self.rates["rate"] = e.through(
            "angular_acceleration", torque / inertia,
            angle=self.angle, rate=self.rate, inertia=inertia, torque=torque, drive=self.jacobian * self.force, p=p,
        )  # fmt: skip
        self.seen_angle = e.through("seen_angle", self.angle)
        self.seen_rate = e.through("seen_rate", self.rate)

    def through_valve(self, hose: Any, head: Any, rod: Any) -> Any:
        """q_a [m^3/s] from the hose into the head side at p_h, p_a, p_b [Pa]."""
        flow = self.structure.hose_burst_valve.flow(self, hose, head, rod)
        flow = self.e.through("valve_flow", flow, hose=hose, head=head, rod=rod)
        cushion = self.e.through("cushion", 0.0, distance=self.position, way="a")
        return cylinder.cushioned(flow, hose - head, cushion, self._whole_return(), self.p)

    def _whole_return(self) -> Any:
        """A_tb [m^2], fully open."""
        return self.structure.metering.areas(-self.p.main_valve_spool.s_max, self.p, self.e)[1]

    def _time(self) -> Any:
        self.rates[ELAPSED_TIME.name] = 1.0
        return self.add_state(ELAPSED_TIME)

    def rod_side(self, rod_pressure: Any, inflow: Any) -> None:
        beta = oil.bulk_modulus(rod_pressure, self.p, self.e)
        volume = cylinder.rod_volume(self.position, self.p)
        net = inflow + self.velocity * self.p.cylinder.A_b + self.learnt("rod_flow")
        self.rates["rod_pressure"] = cylinder.pressure_rate(beta, volume, net)

    def finish(
        self, kind: Kind, hose_pressure: Any, rod_pressure: Any, auxiliary: dict[str, tuple[str, Any]]
    ) -> Equations:
        auxiliary |= self.auxiliary | {
            "piston_position": ("m", self.position),
            "jacobian": ("m/rad", self.jacobian),
            "piston_velocity": ("m/s", self.velocity),
            "force": ("N", self.force),
            "friction_torque": ("N m", self.friction),
            "gravity_torque": ("N m", self.gravity),
        }
        outputs = sensors.measured(self.seen_angle, self.seen_rate, hose_pressure, rod_pressure, self.e)
        names = [state.name for state in self.states]
        return Equations(
            kind=kind,
            structure=self.structure,
            effects=self.effects,
            states=tuple(self.states),
            parameters=self.names,
            x=ca.vertcat(*(self.symbols[name] for name in names)),
            u=self.u,
            p=self.p_vector,
            derivative=ca.vertcat(*(self.rates[name] for name in names)),
            outputs=outputs,
            auxiliary=auxiliary,
            valve=self.valve_states,
        )


def full_model(
    structure: Structure,
    effects: Iterable[str] = (),
    learned: Sequence[LearnedTerm] = (),
    discrepancies: bool = False,
    guarded: Collection[str] = (),
    still: Collection[str] = (),
) -> Equations:
    """The full model (5.39a-u); 11 states (5.40) for the thesis' structure, fewer or more for others.

    discrepancies: with a further state for each place at which something may be missing (``discrepancy_state``). guarded: effects
    that cost next to nothing while they do nothing, still: those without their states; as in :class:`Terms`.

    Raises:
        ModelError: an effect needs a component that the structure does not have.
    """
    w = _Wiring(structure, effects, learned, discrepancies, guarded, still=still)
    p, e = w.p, w.e
    w.kinematics()
    p_a, p_b = w.add_pressure("head_pressure", "p_a"), w.add_pressure("rod_pressure", "p_b")
    separates = valve_separates(structure, w.effects)
    p_h = w.add_pressure("hose_pressure", "p_h") if separates else p_a
    w.quantities |= {"angle": w.angle, "rate": w.rate, "head_pressure": p_a, "rod_pressure": p_b, "hose_pressure": p_h}
    q_o = structure.accumulators.flow(w, p_h)
    q_h, q_b = w.valve(p_h, p_b)
    leakage = cylinder.leakage(p_a, p_b, e)
    w.motion(p_a, p_b)
    w.rod_side(p_b, q_b + leakage)
    beta_a = oil.bulk_modulus(p_a, p, e)
    if separates:
        q_a = w.through_valve(p_h, p_a, p_b)
        head, net = cylinder.head_volume(w.position, p), q_a
        w.rates["hose_pressure"] = cylinder.pressure_rate(
            oil.bulk_modulus(p_h, p, e), p.cylinder.V_h, q_h - q_o - q_a + w.learnt("hose_flow")
        )
    else:  # one volume has one state: no null component can take a state and its equation away
        q_a = q_h - q_o + w.learnt_terms("hose_flow")
        head, net = cylinder.head_volume(w.position, p) + p.cylinder.V_h, q_a
    net = net - w.velocity * p.cylinder.A_a - leakage + w.learnt("head_flow")
    w.rates["head_pressure"] = cylinder.pressure_rate(beta_a, head, net)
    auxiliary = {"head_flow": ("m^3/s", q_a), "hose_flow": ("m^3/s", q_h), "rod_flow": ("m^3/s", q_b)}
    return w.finish("full", p_h, p_b, auxiliary)


def reduced_model(structure: Structure, effects: Iterable[str] = (), learned: Sequence[LearnedTerm] = ()) -> Equations:
    """The reduced model (5.47); 8 states (5.46).

    V_h is dropped, the accumulators are part of the head volume (5.43), the hose burst valve is the torque
    A_a J dp_ha(q_2, q_2') of (5.41), and the hose pressure is p_a. A valve that shuts the head side cannot be a torque: there the
    hose keeps its volume, of which the accumulators are part.

    Raises:
        ModelError: an effect needs a component that the structure does not have.
    """
    kept = [name for name in effects if not EFFECTS[name].states or EFFECTS[name].stateless]
    w = _Wiring(structure, kept, learned, stateful=False)
    p, e, valve = w.p, w.e, structure.hose_burst_valve
    w.kinematics()
    p_a, p_b = w.add_pressure("head_pressure", "p_a"), w.add_pressure("rod_pressure", "p_b")
    p_h = w.add_pressure("hose_pressure", "p_h") if valve.holds else p_a
    w.quantities |= {"angle": w.angle, "rate": w.rate, "head_pressure": p_a, "rod_pressure": p_b, "hose_pressure": p_h}
    q_h, q_b = w.valve(p_h, p_b)
    leakage = cylinder.leakage(p_a, p_b, e)
    drop = 0.0 if valve.holds else valve.pressure_drop(w.velocity * p.cylinder.A_a, p, e)
    w.motion(p_a - drop, p_b)
    w.rod_side(p_b, q_b + leakage)
    q_a = w.through_valve(p_h, p_a, p_b) if valve.holds else q_h + w.learnt("hose_flow")
    net = q_a - w.velocity * p.cylinder.A_a - leakage + w.learnt("head_flow")
    beta, head = oil.bulk_modulus(p_a, p, e), cylinder.head_volume(w.position, p)
    if valve.holds:
        beta_h = oil.bulk_modulus(p_h, p, e)
        compliance = sum(structure.accumulators.compliances(p_h, beta_h, p, e), p.cylinder.V_h / beta_h)
        w.rates["hose_pressure"] = (q_h - q_a + w.learnt("hose_flow")) / compliance
        w.rates["head_pressure"] = cylinder.pressure_rate(beta, head, net)
    else:
        w.rates["head_pressure"] = net / sum(structure.accumulators.compliances(p_a, beta, p, e), head / beta)
    return w.finish("reduced", p_h, p_b, {"head_flow": ("m^3/s", q_a), "rod_flow": ("m^3/s", q_b)})
