"""The model of the control laws, at one measured and one reference point: the components of ``boom_model``, connected once.

Expressions, from which the control laws are built; ``at`` returns numbers. The reduced model (5.47) is the base:
tau~_f = tau_f + A_a J dp_ha(J q_2' A_a) of (5.41), chamber stiffness with the accumulators as in (6.18).
"""

from __future__ import annotations

from array import array
from typing import Any, NamedTuple

import casadi as ca

from boom_controller.blocks.buffers import on_buffers
from boom_controller.types import Measurement, Reference
from boom_input.channels import PREDICTED
from boom_model.catalogue import load_holding_valve
from boom_model.component_numbers import component_parameters
from boom_model.components import cylinder, equation_of_motion, oil
from boom_model.machine import Machine, Pose
from boom_model.regularisation import Expression
from boom_model.slots import NO_CUSHIONS
from boom_model.structure import Structure

SLOW, SHUT = 1e-3, 1e-3
"""m/s of the piston, and share of its opening, below which a valve that holds the load counts as shut."""
AS_SURE = 1.0e6
"""Pa. Drop over such a valve, known to some 60 % as its opening is to a third, that makes p_a as sure as friction leaves what the
boom needs: 6 bar."""

LATER = 0.15
"""Share by which the pressures that open such a valve may have to be higher than its numbers say. The hose empties before it opens,
and its pressure is then not the head side's."""


class OperatingPoint(NamedTuple):
    """Inputs of the model.

    Measured q_2 [rad], q_2' [rad/s], p_h, p_b [Pa]; reference q_2* and its derivatives; load beyond the pose's [kg]; friction over
    the machine file's [-].
    """

    angle: float
    rate: float
    hose_pressure: float
    rod_pressure: float
    reference_angle: float
    reference_rate: float
    reference_acceleration: float
    reference_jerk: float
    load: float
    friction: float = 1.0


class ModelQuantities(NamedTuple):
    """Quantities of the model at a point; SI.

    Attributes:
        force: f_p [N] from p_h and p_b.
        position, jacobian, inertia, gravity: s_p [m], J [m/rad], D [kg m^2], g(q_2) [N m].
        friction: tau~_f(q_2, q_2') [N m]; friction_wanted: tau~_f(q_2, q_2*'), at the measured angle and the wanted rate.
        stiffness_head, stiffness_rod: dp/dV of both chambers [Pa/m^3], hose excluded as in (5.47).
        stiffness_line: the head side's with its hose.
        extend_supply, extend_tank, retract_supply, retract_tank: flow per orifice area [m/s], positive into the port.
        reference_position, reference_jacobian, reference_gravity, reference_friction: s_p(q_2*), J(q_2*), g(q_2*), tau~_f(*).
        feedforward_force, feedforward_force_rate: f_p^f of (6.2) [N] and its time derivative along the reference [N/s].
        tip_gravity: dg/dm at q_2 [N m/kg]; tip_inertia: dD/dm [m^2].
        leakage: q_l [m^3/s]; rod_cushion, hose_cushion: (A_tb / A_c)^2 of throttles in their returns [-].
        sliding: tau_f(q_2, q_2') [N m] of the machine file.
    """

    force: float
    position: float
    jacobian: float
    inertia: float
    gravity: float
    friction: float
    friction_wanted: float
    stiffness_head: float
    stiffness_rod: float
    stiffness_line: float
    extend_supply: float
    extend_tank: float
    retract_supply: float
    retract_tank: float
    reference_position: float
    reference_jacobian: float
    reference_gravity: float
    reference_friction: float
    feedforward_force: float
    feedforward_force_rate: float
    tip_gravity: float
    tip_inertia: float
    leakage: float
    rod_cushion: float
    hose_cushion: float
    sliding: float


class Coming(NamedTuple):
    """Quantities that the reference needs at one of its points.

    s_p(q_2*) [m], J(q_2*) [m/rad], f_p^f of (6.2) [N] and its time derivative [N/s].
    """

    position: float
    jacobian: float
    force: float
    force_rate: float


class ControlModel:
    """The model of a machine in a pose, for control. It includes the pose's load; a further load is an input."""

    def __init__(self, machine: Machine, pose: Pose) -> None:
        self.machine, self.pose = machine, pose
        self.p, self.e = component_parameters(machine, pose)
        self._in = array("d", [0.0] * len(OperatingPoint._fields))
        self._out = array("d", [0.0] * len(ModelQuantities._fields))
        self._whole, self._coming = _functions(machine, self.p, self.e)
        self._evaluate = on_buffers(self._whole, [self._in], [self._out])

    def sample(self, m: Measurement) -> Measurement:
        """What the sensors would show without the offsets and gains that the machine file tells of them (expressions)."""
        shown = {channel.name: getattr(m, channel.name) for channel in PREDICTED}
        for name, value in shown.items():
            offset, one = (self.e.through(f"measured_{name}", at) for at in (0.0, 1.0))
            shown[name] = (value - offset) / (one - offset)
        return m._replace(**shown)

    @property
    def command_delay(self) -> float:
        """Dead time [s] between command and valve, of the machine file."""
        return max(0.0, self.e.delay("command"))

    @property
    def pressure_delay(self) -> float:
        """Dead time [s] of both pressures, of the machine file."""
        return self.e.delay("pressures")

    def carried(
        self, q: ModelQuantities, m: Measurement, acceleration: Expression, lifting: Expression
    ) -> tuple[ModelQuantities, Expression]:
        """The quantities behind a valve that holds the load (expressions), with the force that carries the boom.

        Beside them how far what is measured tells of it, 0 to 1: not at all as long as the valve may be shut.

        Where the boom is lifted the oil comes through the hose, whose pressure is the head side's. Else two things tell f_p: what
        the boom needs at q_2*'' = ``acceleration`` [rad/s^2], and p_a = p_h + (q_a / G)^2 of the valve; the second by the square of
        its drop less.
        """
        area = self.p.cylinder.A_a
        needed = (q.inertia * acceleration + q.gravity + q.friction) / q.jacobian
        carried = (needed + m.rod_pressure * self.p.cylinder.A_b) / area
        opening, most = load_holding_valve.conductance(self.machine, carried, m.rod_pressure, self.p, self.e)
        sooner = (1 - LATER) * carried, (1 - LATER) * m.rod_pressure
        surely, _ = load_holding_valve.conductance(self.machine, *sooner, self.p, self.e)
        flow = area * ca.fmax(-q.jacobian * m.rate, SLOW)
        drop, largest = ((flow / ca.fmax(g, SHUT * most)) ** 2 for g in (opening, surely))
        seen = q.force + area * drop
        share = 1 / (1 + (largest / AS_SURE) ** 2)
        held = needed + share * (seen - needed)
        told = ca.if_else(lifting, 1.0, ca.if_else(surely > SHUT * most, share, 0.0))
        return q._replace(force=ca.if_else(lifting, q.force, ca.fmax(q.force, held))), told

    def resting_force(self, m: Measurement) -> float:
        """f_p [N] of a boom that rests: measured, or what it needs behind a valve that holds the load."""
        if not self.machine.holds:
            return float(cylinder.force(m.hose_pressure, m.rod_pressure, self.p))
        q = self.at(OperatingPoint(m.angle, 0.0, m.hose_pressure, m.rod_pressure, m.angle, 0.0, 0.0, 0.0, 0.0))
        return max(q.force, q.gravity / q.jacobian)

    def at(self, point: OperatingPoint) -> ModelQuantities:
        """All quantities at a point, numbers."""
        self._in[:] = array("d", point)
        self._evaluate()
        return ModelQuantities(*self._out)

    def expressions(self, point: OperatingPoint) -> ModelQuantities:
        """:meth:`at` for a point of expressions."""
        return ModelQuantities(*ca.vertsplit(self._whole(ca.vertcat(*point))))

    def coming(self, reference: Reference, load: Expression, friction: Expression = 1.0) -> Coming:
        """Quantities for a point of the reference: the part of :meth:`at` without sensors.

        Takes and returns expressions.
        """
        return Coming(*ca.vertsplit(self._coming(ca.vertcat(*reference, load, friction))))


_COMING_INPUTS = 6


def _functions(machine: Machine, p: Any, e: Any) -> tuple[Any, Any]:
    x = ca.SX.sym("x", len(OperatingPoint._fields))
    elements: Any = ca.vertsplit(x)
    v = OperatingPoint(*elements)
    a_a = p.cylinder.A_a
    load = equation_of_motion.load_mass(p, e) + v.load
    inertia = equation_of_motion.inertia(load, p)
    structure = machine.structure

    def kinematics(angle: Any) -> tuple[Any, Any]:
        position = structure.linkage.piston_position(angle, p)
        return position, ca.jacobian(position, angle)

    def torque(angle: Any, jacobian: Any, rate: Any) -> Any:
        """tau~_f, (5.41)."""
        drop = load_holding_valve.pressure_drop(machine, jacobian * rate * a_a, p, e)
        return v.friction * structure.friction.torque(angle, rate, jacobian, p, e) + a_a * jacobian * drop

    further: Any = v.load
    position, jacobian = kinematics(v.angle)
    reference_position, reference_jacobian = kinematics(v.reference_angle)
    gravity = equation_of_motion.gravity_torque(v.angle, load, p, e)
    reference_gravity = equation_of_motion.gravity_torque(v.reference_angle, load, p, e)
    reference_friction = torque(v.reference_angle, reference_jacobian, v.reference_rate)
    wanted = (inertia * v.reference_acceleration + reference_gravity + reference_friction) / reference_jacobian
    along = ca.vertcat(v.reference_rate, v.reference_acceleration, v.reference_jerk)
    wanted_rate = ca.jtimes(wanted, ca.vertcat(v.reference_angle, v.reference_rate, v.reference_acceleration), along)
    gas = structure.accumulators.compliances(v.hose_pressure, p.fluid.beta, p, e)
    compliance = sum(gas, cylinder.head_volume(position, p) / oil.bulk_modulus(v.hose_pressure, p, e))
    stiffness_rod = oil.bulk_modulus(v.rod_pressure, p, e) / cylinder.rod_volume(position, p)
    extend, retract = (_flow_per_area(structure, side, v, p, e) for side in (-1.0, 1.0))
    rod_cushion, hose_cushion = cylinder.cushions_at_the_valve(position, p, e)
    values = ModelQuantities(
        force=cylinder.force(v.hose_pressure, v.rod_pressure, p),
        position=position,
        jacobian=jacobian,
        inertia=inertia,
        gravity=gravity,
        friction=torque(v.angle, jacobian, v.rate),
        friction_wanted=torque(v.angle, jacobian, v.reference_rate),
        stiffness_head=1 / compliance,
        stiffness_rod=stiffness_rod,
        stiffness_line=1 / (compliance + p.cylinder.V_h / oil.bulk_modulus(v.hose_pressure, p, e)),
        extend_supply=extend[0],
        extend_tank=extend[1],
        retract_supply=retract[0],
        retract_tank=retract[1],
        reference_position=reference_position,
        reference_jacobian=reference_jacobian,
        reference_gravity=reference_gravity,
        reference_friction=reference_friction,
        feedforward_force=wanted,
        feedforward_force_rate=wanted_rate,
        tip_gravity=ca.jacobian(gravity, further),
        tip_inertia=ca.jacobian(inertia, further),
        leakage=cylinder.leakage(v.hose_pressure, v.rod_pressure, e),
        sliding=structure.friction.torque(v.angle, v.rate, jacobian, p, e),
        rod_cushion=rod_cushion,
        hose_cushion=hose_cushion,
    )
    coming = Coming(reference_position, reference_jacobian, wanted, wanted_rate)
    return (
        ca.Function("control_model", [x], [ca.cse(ca.densify(ca.vertcat(*values)))]),
        ca.Function("coming", [x[-_COMING_INPUTS:]], [ca.cse(ca.densify(ca.vertcat(*coming)))]),
    )


def _flow_per_area(structure: Structure, side: float, v: OperatingPoint, p: Any, e: Any) -> tuple[Any, Any]:
    """Flow per area [m/s] of the supply and of the tank edge at the ports' pressures; side -1 extends, 1 retracts."""
    full = side * p.main_valve_spool.s_max
    supply_area, tank_area = structure.metering.areas(full, p, e)
    flows = structure.metering.flows(full, v.hose_pressure, v.rod_pressure, p, e, structure.supply, NO_CUSHIONS)
    supply, tank = (flows.head, flows.rod) if side < 0 else (flows.rod, flows.head)
    return supply / supply_area, tank / tank_area
