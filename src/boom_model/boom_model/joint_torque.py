"""The torque that the motion of the other joints asks of the boom beyond its configured pose, evaluated without a run.

dM = (D - D_c) q_2'' + D' q_2' + H' + g(q_2) - g_c(q_2) - W^2 C      (``joint_motion``; c: as configured)
"""

from __future__ import annotations

from copy import deepcopy

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from boom_model import joint_motion
from boom_model.component_numbers import component_parameters
from boom_model.components import equation_of_motion
from boom_model.machine import Machine, Pose

Array = NDArray[np.float64]


def joint_torque(machine: Machine, pose: Pose, inputs: Array, boom: Array) -> Array:
    """dM (n,) [N m] from ``joint_motion.inputs`` (n, len(INPUTS)) and q_2 [rad], q_2', q_2'' (n, 3)."""
    u, x = ca.SX.sym("u", len(joint_motion.INPUTS)), ca.SX.sym("x", 3)
    angle, rate, acceleration = x[0], x[1], x[2]
    p, e = component_parameters(machine, pose)
    load = equation_of_motion.load_mass(p, e)
    moved = deepcopy(p)
    named = joint_motion.apply(moved, u)
    inertia = equation_of_motion.inertia(load, moved) - equation_of_motion.inertia(load, p)
    gravity = equation_of_motion.gravity_torque(angle, load, moved, e)
    gravity -= equation_of_motion.gravity_torque(angle, load, p, e)
    asked = inertia * acceleration + gravity - joint_motion.torque(named, angle, rate, load, moved)
    function = ca.Function("joint_torque", [u, x], [asked])
    return np.asarray(function.map(len(boom))(inputs.T, boom.T), dtype=float).ravel()
