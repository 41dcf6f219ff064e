"""Friction torque of the cylinder from stationary points, (5.37), (5.38), Fig. 5.10.

    q_a = J q_2' A_a,   p_a = p_h - dp_ha(q_a),   tau_f = J (p_a A_a - p_b A_b) - g(q_2) - D q_2''

fitted by least squares with (3.7), each direction separately:

    tau_f = tau_C+- tanh(q_2' / sigma) + k_v+- q_2'

The torque also contains errors of areas, geometry, load and hose burst valve, as the thesis notes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from boom_identification import estimate
from boom_identification.estimate import Identified, NotDetermined
from boom_identification.stationary import Points
from boom_model.catalogue import load_holding_valve
from boom_model.component_numbers import component_parameters
from boom_model.components import cylinder
from boom_model.machine import Machine, Pose

Array = NDArray[np.float64]

SMALLEST_SPREAD = 0.05
"""rad/s. Speeds must differ at least by this to separate Coulomb and viscous friction."""
FEWEST_GROUPS = 4
_HOW = "(5.38), stationary points"


@dataclass(frozen=True)
class FrictionResult:
    """Points of Fig. 5.10 and the fit.

    Attributes:
        rate, torque: (n,) [rad/s], [N m] measured. fitted: (n,) [N m] by the estimates (prior values if not determined).
        residual: rms [N m].
        estimates, not_determined: of the four parameters.
    """

    rate: Array
    torque: Array
    fitted: Array
    residual: float
    estimates: tuple[Identified, ...]
    not_determined: tuple[NotDetermined, ...]


def head_pressure(points: Points, machine: Machine, pose: Pose) -> Array:
    """p_a (n,) [Pa] from p_h and the hose burst valve, (5.37), (5.38)."""
    p, e = component_parameters(machine, pose)
    flow = points.piston_velocity * p.cylinder.A_a
    drop = np.asarray(load_holding_valve.pressure_drop(machine, flow, p, e), float).ravel()
    return np.asarray(points.hose_pressure - drop, np.float64)


def friction_torque(points: Points, machine: Machine, pose: Pose) -> Array:
    """Measured tau_f (n,) [N m] by the balance of torques (3.4)."""
    p, _ = component_parameters(machine, pose)
    force = cylinder.force(head_pressure(points, machine, pose), points.rod_pressure, p)
    return np.asarray(
        points.jacobian * force - points.gravity_torque - points.inertia * points.acceleration, np.float64
    )


def identify_friction(points: Points, machine: Machine, pose: Pose) -> FrictionResult:
    """Coulomb and viscous friction of both directions; a direction without enough speeds is not determined.

    Behind a valve that holds the load, whose drop the flow does not tell, none is.
    """
    torque = friction_torque(points, machine, pose)
    sizes = machine.structure.friction.sizes
    values = {key: machine.parameters[key].value[0] for key in sizes}
    holds = machine.holds
    found: list[Identified] = []
    missing: list[NotDetermined] = []
    for sign, direction, keys in ((1.0, "lifting", sizes[0::2]), (-1.0, "lowering", sizes[1::2])):
        chosen = np.sign(points.rate) == sign
        try:
            if holds:
                raise ValueError("the pressure behind the load-holding valve is not measured")
            solution, covariance = _fit(points.where(chosen), torque[chosen], machine, pose, keys)
        except ValueError as error:
            missing += [NotDetermined(key, f"{direction}: {error}") for key in keys]
            continue
        for k, key in enumerate(keys):
            unit = machine.parameters[key].specification.unit
            bounds = estimate.interval(float(solution[k]), float(covariance[k, k]))
            new = Identified(key, float(solution[k]), unit, bounds, _HOW)
            values[key] = new.value
            why = estimate.too_wide(new, machine.parameters[new.key].tolerance)
            if why:
                missing.append(NotDetermined(new.key, why))
            else:
                found.append(new)
    fitted = _model(points, machine, pose, values)
    residual = float(np.sqrt(np.mean((torque - fitted) ** 2))) if len(torque) else float("nan")
    return FrictionResult(points.rate, torque, fitted, residual, tuple(found), tuple(missing))


def _fit(points: Points, torque: Array, machine: Machine, pose: Pose, keys: Sequence[str]) -> tuple[Array, Array]:
    if len(points) == 0 or len(np.unique(points.group)) < FEWEST_GROUPS:
        raise ValueError(f"{len(np.unique(points.group))} stationary stretches, {FEWEST_GROUPS} are needed")
    speed = np.abs(points.rate)
    low, high = np.percentile(speed, [5, 95])
    if high - low < SMALLEST_SPREAD:
        raise ValueError(f"speeds only between {low:.3f} and {high:.3f} rad/s")
    zero = dict.fromkeys(machine.structure.friction.sizes, 0.0)
    design = np.column_stack([_model(points, machine, pose, zero | {key: 1.0}) for key in keys])
    solution, covariance = estimate.least_squares(design, torque, points.group)
    if (solution < 0.0).any():
        raise ValueError("the best fit has a negative friction: load, areas or hose burst valve of the model are wrong")
    return solution, covariance


def _model(points: Points, machine: Machine, pose: Pose, values: dict[str, float]) -> Array:
    """(3.7) with other numbers, linear in all four."""
    p, e = component_parameters(machine, pose)
    for key, value in values.items():
        setattr(p.friction, key.partition(".")[2], value)
    return np.asarray(
        machine.structure.friction.torque(points.angle, points.rate, points.jacobian, p, e), float
    ).ravel()
