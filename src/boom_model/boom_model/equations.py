"""The full model (5.39) and the reduced model (5.47): nothing but wiring of the components.

Both come as :class:`Equations`: symbolic x' = f(x, u, p) and y = h(x, u, p) in CasADi, from which simulation, Jacobian and
sensitivities are derived. Order of arguments everywhere: state, input, parameters.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from math import inf
from types import SimpleNamespace
from typing import Any, Literal

import casadi as ca

from boom_model import learned as learned_terms
from boom_model import sensors
from boom_model.components import (
    accumulator,
    anti_cavitation,
    boom_flexibility,
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
    swinging_load,
    triangle_linkage,
)
from boom_model.effects import EFFECTS
from boom_model.errors import ModelError
from boom_model.learned import LearnedTerm
from boom_model.structure import Structure

Kind = Literal["full", "reduced"]

INPUTS = ("retract_current", "extend_current")
"""u = (i_+, i_-) [A]."""

LOWEST_PRESSURE = -1.0e5
HIGHEST_PRESSURE = 1.0e8
"""Pa gauge: outside, a run ends with an error. Steel bursts long before the upper one; the fluid boils at the lower."""


@dataclass(frozen=True)
class State:
    """One state: name, symbol, unit, size of its usual range (scales the error control), limits of meaning."""

    name: str
    symbol: str
    unit: str
    scale: float
    minimum: float = -inf
    maximum: float = inf


@dataclass(frozen=True, eq=False)
class Equations:
    """x' = derivative(x, u, p), y = outputs(x, u, p); all symbolic. ``auxiliary`` are named inner quantities."""

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

    @property
    def state_names(self) -> tuple[str, ...]:
        """Names of the states in order."""
        return tuple(state.name for state in self.states)


def namespace(values: dict[str, Any]) -> SimpleNamespace:
    """Dotted names -> nested namespaces; ``.0 .1`` endings become tuples."""
    root = SimpleNamespace()
    for name, value in values.items():
        *path, last = name.split(".")
        if last.isdigit():
            *path, last = path
        node = root
        for part in path:
            if not hasattr(node, part):
                setattr(node, part, SimpleNamespace())
            node = getattr(node, part)
        if name.split(".")[-1].isdigit():
            setattr(node, last, (*getattr(node, last, ()), value))
        else:
            setattr(node, last, value)
    return root


def parameter_names(
    structure: Structure, effects: Iterable[str], learned: Sequence[LearnedTerm] = ()
) -> tuple[str, ...]:
    """Order of the parameter vector p: the machine's numbers, those of the active effects, those of learnt terms."""
    names = [c for spec in structure.specifications() for c in spec.components]
    names += [f"effects.{e}.{row.name}" for e in sorted(effects) for row in EFFECTS[e].parameters]
    names += [f"learned.{k}.{j}" for k, entry in enumerate(learned) for j in range(len(entry.basis))]
    return tuple(names)


class _Wiring:
    """Symbols and what both models share: kinematics, valve, spool, pilot stage, outputs."""

    def __init__(self, structure: Structure, effects: Iterable[str], learned: Sequence[LearnedTerm] = ()) -> None:
        self.structure = structure
        self.learned = tuple(learned)
        self.effects = tuple(sorted(effects))
        for name in self.effects:
            if not structure.has(EFFECTS[name].needs):
                raise ModelError(f"effects.{name}: this machine has no {EFFECTS[name].needs.replace('_', ' ')}")
        self.names = parameter_names(structure, self.effects, self.learned)
        self.p_vector = ca.SX.sym("p", len(self.names))
        symbols = {name: self.p_vector[i] for i, name in enumerate(self.names)}
        self.p = namespace({k: v for k, v in symbols.items() if not k.startswith(("effects.", "learned."))})
        self.coefficients = [
            [symbols[f"learned.{k}.{j}"] for j in range(len(entry.basis))] for k, entry in enumerate(self.learned)
        ]
        self.quantities: dict[str, Any] = {}
        values = {
            f"{effect.id}.{row.name}": symbols.get(f"effects.{effect.id}.{row.name}", row.neutral)
            for effect in EFFECTS.values()
            for row in effect.parameters
        }
        self.e = namespace(values)
        self.states: list[State] = []
        self.symbols: dict[str, Any] = {}
        self.rates: dict[str, Any] = {}
        self.u = ca.SX.sym("u", 2)

    def add(self, name: str, symbol: str, unit: str, scale: float, low: float = -inf, high: float = inf) -> Any:
        self.states.append(State(name, symbol, unit, scale, low, high))
        self.symbols[name] = ca.SX.sym(name)
        return self.symbols[name]

    def add_pressure(self, name: str, symbol: str) -> Any:
        return self.add(name, symbol, "Pa", 1e7, LOWEST_PRESSURE, HIGHEST_PRESSURE)

    def active(self, effect: str) -> bool:
        return effect in self.effects

    def elapsed(self) -> Any:
        """Time since the start of the run [s], a state that exists only where an effect needs it."""
        if not any("elapsed_time" in dict(EFFECTS[name].states) for name in self.effects):
            return 0.0
        if "elapsed_time" not in self.symbols:
            self.add("elapsed_time", "t", "s", 10.0)
            self.rates["elapsed_time"] = ca.SX(1.0)
        return self.symbols["elapsed_time"]

    def learnt(self, equation: str) -> Any:
        """Sum of the terms learnt from data for an equation, in its unit; 0 without any."""
        total: Any = 0.0
        for entry, coefficients in zip(self.learned, self.coefficients, strict=True):
            if entry.equation == equation:
                total = total + learned_terms.term(entry, coefficients, self.quantities, self._memory)
        return total

    def _memory(self, variable: str, time: float, value: Any) -> Any:
        name = f"memory_{variable}_{time:g}"
        if name not in self.symbols:
            lagging = self.add(name, f"x_{variable}", "-", 1.0)
            self.rates[name] = (value - lagging) / time
        return self.symbols[name]

    def kinematics(self) -> None:
        linkage = four_bar_linkage if self.structure.linkage == "four_bar" else triangle_linkage
        self.angle = self.add("angle", "q_2", "rad", 1.0)
        self.rate = self.add("rate", "w", "rad/s", 0.3, -10.0, 10.0)
        self.position = linkage.piston_position(self.angle, self.p)
        self.jacobian = ca.jacobian(self.position, self.angle)
        self.velocity = self.jacobian * self.rate

    def valve(self, hose_pressure: Any, rod_pressure: Any) -> tuple[Any, Any]:
        """Adds spool and pilot states; flows (q_h, q_b) into hose and rod side, anti-cavitation included."""
        p, e, u = self.p, self.e, self.u
        spool = self.add("spool_position", "s_s", "m", 5e-3, -1.0, 1.0)
        metering = spool
        if self.active("valve_hysteresis"):
            follower = self.add("metering_position", "x", "m", 5e-3, -1.0, 1.0)
            self.rates["metering_position"] = main_valve_orifices.play_rate(follower, spool, p, e)
            metering = main_valve_orifices.metering(follower, spool, e)
        passage = cylinder.cushion(p.cylinder.l_p - self.position, e)
        flows = main_valve_orifices.flows(metering, hose_pressure, rod_pressure, p, e, passage)
        if self.structure.pilot_valves:
            velocity = self.add("spool_velocity", "w_s", "m/s", 0.1, -10.0, 10.0)
            plus = self.add("pilot_retract", "lambda_+", "A s", 2e-2, -1.0, 1.0)
            minus = self.add("pilot_extend", "lambda_-", "A s", 2e-2, -1.0, 1.0)
            self.quantities["spool"] = spool / p.main_valve_spool.s_max
            difference = pilot_valve.pressure(plus, u[0], p, e) - pilot_valve.pressure(minus, u[1], p, e)
            difference = difference + self.learnt("spool")
            self.rates["spool_position"] = velocity
            self.rates["spool_velocity"] = main_valve_spool.acceleration(spool, velocity, difference, flows.force, p, e)
            self.rates["pilot_retract"] = pilot_valve.state_rate(plus, u[0], p, e)
            self.rates["pilot_extend"] = pilot_valve.state_rate(minus, u[1], p, e)
            self.pilot_difference = difference
        else:
            self.rates["spool_position"] = direct_spool.velocity(spool, u[0], u[1], p)
        self.spool = spool
        q_h, q_b = flows.head, flows.rod
        if self.structure.anti_cavitation:
            q_h = q_h + anti_cavitation.flow(hose_pressure, p)
            q_b = q_b + anti_cavitation.flow(rod_pressure, p)
        return q_h, q_b

    def motion(self, head_pressure: Any, rod_pressure: Any) -> None:
        """Equation of motion from the pressures that act on the piston."""
        p, e = self.p, self.e
        self.force = cylinder.force(head_pressure, rod_pressure, p)
        self.friction = self.friction_torque() - self.learnt("torque")
        load = equation_of_motion.load_mass(p, e, self.elapsed())
        inertia = equation_of_motion.inertia(load, p)
        self.gravity = equation_of_motion.gravity_torque(self.angle, load, p)
        self.rates["angle"] = self.rate
        if self.active("swinging_load"):
            swing = self.add("swing_angle", "theta", "rad", 0.1, -1.5, 1.5)
            swing_rate = self.add("swing_rate", "theta'", "rad/s", 0.3)
            torque = self.jacobian * self.force - self.friction - self.gravity
            self.rates["swing_angle"] = swing_rate
            self.rates["rate"], self.rates["swing_rate"] = swinging_load.accelerations(
                self.angle, self.rate, swing, swing_rate, inertia, torque, p, e
            )
        else:
            self.rates["rate"] = equation_of_motion.acceleration(
                inertia, self.gravity, self.jacobian, self.force, self.friction
            )
        self.seen_angle, self.seen_rate = self.angle, self.rate
        if self.active("boom_flexibility"):
            bend = self.add("bend", "x", "rad", 1e-2, -1.0, 1.0)
            bend_rate = self.add("bend_rate", "x'", "rad/s", 0.1)
            self.rates["bend"] = bend_rate
            self.rates["bend_rate"] = boom_flexibility.acceleration(bend, bend_rate, self.rates["rate"], e)
            self.seen_angle, self.seen_rate = self.angle + bend, self.rate + bend_rate

    def friction_torque(self) -> Any:
        p, e = self.p, self.e
        bristle = None
        if self.active("presliding_friction"):
            bristle = self.add("bristle_torque", "z", "N m", 4e3)
            self.rates["bristle_torque"] = friction.bristle_rate(self.angle, self.rate, bristle, p, e)
        return friction.drift(self.elapsed(), e) * friction.torque(self.angle, self.rate, p, e, bristle)

    def rod_side(self, rod_pressure: Any, inflow: Any) -> None:
        beta = oil.bulk_modulus(rod_pressure, self.p, self.e)
        volume = cylinder.rod_volume(self.position, self.p)
        net = inflow + self.velocity * self.p.cylinder.A_b + self.learnt("rod_flow")
        self.rates["rod_pressure"] = cylinder.pressure_rate(beta, volume, net)

    def finish(
        self, kind: Kind, hose_pressure: Any, rod_pressure: Any, auxiliary: dict[str, tuple[str, Any]]
    ) -> Equations:
        if self.structure.pilot_valves:
            auxiliary["pilot_pressure_difference"] = ("Pa", self.pilot_difference)
        auxiliary |= {
            "piston_position": ("m", self.position),
            "jacobian": ("m/rad", self.jacobian),
            "piston_velocity": ("m/s", self.velocity),
            "force": ("N", self.force),
            "friction_torque": ("N m", self.friction),
            "gravity_torque": ("N m", self.gravity),
        }
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
            outputs=sensors.measured(self.seen_angle, self.seen_rate, hose_pressure, rod_pressure, self.e),
            auxiliary=auxiliary,
        )


def full_model(structure: Structure, effects: Iterable[str] = (), learned: Sequence[LearnedTerm] = ()) -> Equations:
    """The full model (5.39a-u); 11 states (5.40) for the thesis' structure, fewer or more for others.

    Raises:
        ModelError: an effect needs a component that the structure does not have.
    """
    w = _Wiring(structure, effects, learned)
    p, e = w.p, w.e
    w.kinematics()
    p_a, p_b = w.add_pressure("head_pressure", "p_a"), w.add_pressure("rod_pressure", "p_b")
    p_h = w.add_pressure("hose_pressure", "p_h") if structure.hose_burst_valve else p_a
    w.quantities |= {"angle": w.angle, "rate": w.rate, "head_pressure": p_a, "rod_pressure": p_b, "hose_pressure": p_h}
    q_o: Any = 0
    if structure.accumulators:
        for i, precharge, diameter in (
            (1, p.accumulators.p_g0_1, p.accumulators.d_1),
            (2, p.accumulators.p_g0_2, p.accumulators.d_2),
        ):
            name = f"accumulator_pressure_{i}"
            p_o = w.add_pressure(name, f"p_o,{i}")
            precharge = precharge * e.accumulator_precharge.r
            diameter = diameter * e.accumulator_restrictor.r
            entropy_rate: Any = 0.0
            if w.active("accumulator_heat_loss"):
                entropy = w.add(f"accumulator_entropy_{i}", f"e_{i}", "-", 0.1)
                ambient = w.add(f"accumulator_ambient_{i}", f"T_a,{i}", "-", 1.0)
                entropy_rate = accumulator.entropy_rate(p_o, entropy, ambient, precharge, p, e)
                w.rates[f"accumulator_entropy_{i}"] = entropy_rate
                w.rates[f"accumulator_ambient_{i}"] = ca.SX(0.0)
                precharge = precharge * ca.exp(entropy)
            flow = accumulator.orifice_flow(p_h, p_o, precharge, diameter, p)
            w.rates[name] = accumulator.pressure_rate(p_o, flow, precharge, p.fluid.beta, p, entropy_rate)
            q_o = q_o + flow
    q_h, q_b = w.valve(p_h, p_b)
    leakage = cylinder.leakage(p_a, p_b, e)
    w.motion(p_a, p_b)
    w.rod_side(p_b, q_b + leakage)
    beta_a = oil.bulk_modulus(p_a, p, e)
    passage = cylinder.cushion(w.position, e)
    if structure.hose_burst_valve:
        if w.active("hose_burst_valve_lag"):
            g = w.add("hose_burst_valve_conductance", "G", "m^3/s/Pa", 1e-8, 2e-11)
            stationary = hose_burst_valve.limited_conductance(p_h - p_a, p, e)
            w.rates["hose_burst_valve_conductance"] = (stationary - g) / e.hose_burst_valve_lag.tau
            q_a = hose_burst_valve.flow(p_h - p_a, p, e, g)
        else:
            q_a = hose_burst_valve.flow(p_h - p_a, p, e)
        q_a = ca.if_else(q_a < 0, q_a * passage, q_a) if w.active("end_cushioning") else q_a
        head, net = cylinder.head_volume(w.position, p), q_a
        w.rates["hose_pressure"] = cylinder.pressure_rate(
            oil.bulk_modulus(p_h, p, e), p.cylinder.V_h, q_h - q_o - q_a + w.learnt("hose_flow")
        )
    else:
        q_a = q_h - q_o + w.learnt("hose_flow")
        head, net = cylinder.head_volume(w.position, p) + p.cylinder.V_h, q_a
    net = net - w.velocity * p.cylinder.A_a - leakage + w.learnt("head_flow")
    w.rates["head_pressure"] = cylinder.pressure_rate(beta_a, head, net)
    auxiliary = {"head_flow": ("m^3/s", q_a), "hose_flow": ("m^3/s", q_h), "rod_flow": ("m^3/s", q_b)}
    return w.finish("full", p_h, p_b, auxiliary)


def reduced_model(structure: Structure, effects: Iterable[str] = (), learned: Sequence[LearnedTerm] = ()) -> Equations:
    """The reduced model (5.47); 8 states (5.46).

    V_h is dropped, the accumulators are part of the head volume (5.43), the hose burst valve is the torque
    A_a J dp_ha(q_2, q_2') of (5.41), and the hose pressure is p_a.

    Raises:
        ModelError: an effect needs a component that the structure does not have.
    """
    w = _Wiring(structure, [name for name in effects if not EFFECTS[name].states], learned)
    p, e = w.p, w.e
    w.kinematics()
    p_a, p_b = w.add_pressure("head_pressure", "p_a"), w.add_pressure("rod_pressure", "p_b")
    w.quantities |= {"angle": w.angle, "rate": w.rate, "head_pressure": p_a, "rod_pressure": p_b, "hose_pressure": p_a}
    q_a, q_b = w.valve(p_a, p_b)
    leakage = cylinder.leakage(p_a, p_b, e)
    drop: Any = 0.0
    if structure.hose_burst_valve:
        drop = hose_burst_valve.pressure_drop(w.velocity * p.cylinder.A_a, p, e)
    w.motion(p_a - drop, p_b)
    w.rod_side(p_b, q_b + leakage)
    net = q_a - w.velocity * p.cylinder.A_a - leakage + w.learnt("head_flow") + w.learnt("hose_flow")
    beta = oil.bulk_modulus(p_a, p, e)
    compliance = cylinder.head_volume(w.position, p) / beta
    if structure.accumulators:
        for precharge in (p.accumulators.p_g0_1, p.accumulators.p_g0_2):
            precharge = precharge * e.accumulator_precharge.r
            compliance = compliance + accumulator.compliance(p_a, precharge, beta, p)
    w.rates["head_pressure"] = net / compliance
    return w.finish("reduced", p_a, p_b, {"head_flow": ("m^3/s", q_a), "rod_flow": ("m^3/s", q_b)})
