"""The boom as the force balance needs it: lever, gravity and inertia over the angle, from the machine file alone.

    p_a A_a - p_b A_b = (D q_2'' + g(q_2)) / J(q_2)        (3.15), (3.12), without friction

Friction and a valve at the cylinder, as the file knows them, are kept apart: what turns with the motion's direction is to be seen.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from boom_estimation.joint_torque import JointTorque, joint_torque
from boom_identification.stationary import pose_of
from boom_model.catalogue import load_holding_valve
from boom_model.component_numbers import component_parameters
from boom_model.components import equation_of_motion
from boom_model.machine import Machine
from boom_model.plant import Plant
from boom_model.tolerance import TOLERANCES
from boom_recording.recording import Recording

Array = NDArray[np.float64]

_POINTS = 801
_FASTEST = 2.0  # rad/s

RESTING, MOVING = 4.0e-3, 2.0e-2
"""rad/s. Below the first the boom rests, above the second it moves; between them friction has no direction."""
ACCELERATION = 0.15
"""rad/s^2. Below it the boom's inertia is a correction."""


@dataclass(frozen=True)
class Mechanics:
    """Lever and loads over the boom's angles.

    Attributes:
        angle: (m,) [rad], the range of the linkage.
        position: (m,) s_p [m]. jacobian: (m,) J [m/rad]. gravity: (m,) g [N m]. inertia: D [kg m^2].
        A_a, A_b: areas of the piston [m^2].
        tip: g-moment of 1 kg at the tip over the angle (m,) [m]: t_x cos q_2 - t_y sin q_2.
        tolerance: relative, of the masses, as the file rates them.
        rate, friction: (m,) [rad/s], torque of the file's friction [N m], effects of the file included.
        joints: torque that the motion of the other joints asks for; None: nothing is known of it.
        holds: a valve at the cylinder holds the load, by the file: the hose pressure carries the boom while it lifts only.
        full_current: that opens the valve fully [A], by the file.
        load: that hangs at the tip, as told [kg].
        flow, drop: (m,) [m^3/s] into the cylinder, p_h - p_a [Pa] of the file's valve at the cylinder; zero without one.
    """

    angle: Array
    position: Array
    jacobian: Array
    gravity: Array
    inertia: float
    A_a: float
    A_b: float
    tip: Array
    tolerance: float
    rate: Array
    friction: Array
    flow: Array
    drop: Array
    joints: JointTorque | None = None
    holds: bool = False
    full_current: float = math.nan
    load: float = 0.0

    def known_losses(self, angle: Array, rate: Array) -> Array:
        """Friction and valve at the cylinder as the file knows them (n,) [Pa on the head side]."""
        friction = np.interp(rate, self.rate, self.friction) / self.lever(angle) / self.A_a
        return friction + self.valve_drop(angle, rate)

    def valve_drop(self, angle: Array, rate: Array) -> Array:
        """p_h - p_a (n,) [Pa] of the file's valve at the cylinder."""
        return np.interp(self.lever(angle) * rate * self.A_a, self.flow, self.drop)

    def load_lever(self, angle: Array) -> Array:
        """Pressure on the head side per weight at the tip (n,) [Pa/N]: (t_x cos q_2 - t_y sin q_2) / (J A_a)."""
        return np.interp(angle, self.angle, self.tip) / self.lever(angle) / self.A_a

    def lever(self, angle: Array) -> Array:
        """J [m/rad] at the angles (n,) [rad]; beyond the linkage's range that of its end."""
        return np.interp(angle, self.angle, self.jacobian)

    def piston(self, angle: Array) -> Array:
        """s_p [m] at the angles (n,) [rad]."""
        return np.interp(angle, self.angle, self.position)

    def static_need(self, angle: Array) -> Array:
        """g / (J A_a) (n,) [Pa]: what gravity asks of the head side."""
        return np.interp(angle, self.angle, self.gravity) / self.lever(angle) / self.A_a

    def dynamic_need(self, angle: Array, acceleration: Array) -> Array:
        """D q_2'' / (J A_a) (n,) [Pa]: what the boom's inertia asks of the head side."""
        return self.inertia * acceleration / self.lever(angle) / self.A_a

    def joints_need(self, time: Array, angle: Array, rate: Array, acceleration: Array) -> Array:
        """(n,) [Pa]: what the motion of the other joints asks of the head side beyond the configured pose."""
        if self.joints is None:
            return np.zeros(len(time))
        return self.joints.at(time, angle, rate, acceleration) / self.lever(angle) / self.A_a

    def need(self, time: Array, angle: Array, rate: Array, acceleration: Array, rod_pressure: Array) -> Array:
        """p_a (n,) [Pa] that the boom needs without friction, given p_b (n,) [Pa]."""
        own = self.static_need(angle) + self.dynamic_need(angle, acceleration)
        return own + self.joints_need(time, angle, rate, acceleration) + rod_pressure * self.A_b / self.A_a


def mechanics(machine: Machine, recording: Recording) -> Mechanics:
    """The mechanics of a machine in the pose and with the load of a recording.

    Raises:
        MachineError: a pose or load that the machine cannot have.
    """
    pose = pose_of(recording, machine)
    plant = Plant(machine, pose)
    low, high = machine.angle_limits
    angle = np.linspace(low, high, _POINTS)
    states = np.tile(plant.rest_state(0.0, 1e6, 1e6), (_POINTS, 1))
    states[:, plant.state_names.index("angle")] = angle
    inner = plant.auxiliary(states, np.zeros((_POINTS, 2)))
    p, e = component_parameters(machine, pose)
    inertia = float(equation_of_motion.inertia(equation_of_motion.load_mass(p, e), p))
    arm = pose.tip[0] * np.cos(angle) - pose.tip[1] * np.sin(angle)
    rate = np.linspace(-_FASTEST, _FASTEST, _POINTS)
    states[:, plant.state_names.index("angle")] = angle[_POINTS // 2]
    states[:, plant.state_names.index("rate")] = rate
    flow = rate * float(np.max(inner["jacobian"])) * p.cylinder.A_a
    q = ca.SX.sym("q")
    drop = ca.Function("drop", [q], [load_holding_valve.pressure_drop(machine, q, p, e)])
    return Mechanics(
        angle, inner["piston_position"], inner["jacobian"], inner["gravity_torque"], inertia, p.cylinder.A_a, p.cylinder.A_b, arm,
        _tolerance(machine, pose.tabulated), rate, plant.auxiliary(states, np.zeros((_POINTS, 2)))["friction_torque"],
        flow, np.asarray(drop(flow[None, :]), float).ravel(), joint_torque(recording, machine, pose),
        machine.holds,
        full_current=float(machine.structure.spool.current(p.main_valve_spool.s_max, p, machine.structure.pilot_valves)),
        load=pose.load,
    )  # fmt: skip


def piston_only(head_area: float, rod_area: float) -> Mechanics:
    """A piston of which only the areas [m^2] are known: the "angle" is its position [m], and nothing is known of loads."""
    ends, nothing = np.array([-10.0, 10.0]), np.zeros(2)
    return Mechanics(
        ends, ends, np.ones(2), nothing, 0.0, head_area, rod_area, nothing, np.inf, ends, nothing, ends, nothing
    )


def _tolerance(machine: Machine, tabulated: str) -> float:
    """Relative tolerance of the masses: that of the tabulated pose, or of numbers that nobody rated."""
    body = machine.document["rigid_body"]
    entry = body.get("configs", {}).get(tabulated, {})
    return TOLERANCES[entry.get("conf", "") if entry.get("conf") in TOLERANCES else ""]
