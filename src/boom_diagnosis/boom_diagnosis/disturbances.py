"""Noise that an observer assumes: of the sensors, and small white disturbances of torque and flows, or of one equation."""

from __future__ import annotations

from collections.abc import Container, Mapping
from math import hypot

import numpy as np
from numpy.typing import NDArray

from boom_input.channels import PREDICTED
from boom_model.machine import Machine
from boom_model.observer import NoiseModel
from boom_model.plant import Plant

Array = NDArray[np.float64]
Values = Mapping[str, float]
"""Component of the parameter vector -> value, where it differs from the machine's."""

FLOW_NOISE = 2e-8
"""m^3/s sqrt(s). White disturbance of each flow. With it the innovations of a healthy machine are white (measured)."""
TORQUE_NOISE = 6.0
"""N m sqrt(s)."""
SPOOL_NOISE = 2e-4
"""1/s sqrt(s), of the full stroke: white disturbance of the spool where one is allowed."""

UNMEASURED, SHOWN_BY = 3e6, {
    "head_pressure": "hose_pressure", "hose_pressure": "hose_pressure", "rod_pressure": "rod_pressure",
}  # fmt: skip
"""Pa. Standard deviation at the start of a pressure that no channel shows. State -> channel that shows it."""
PISTON = "piston"
"""In the place of a state: the piston's position, which is none."""


def noise_model(
    plant: Plant, machine: Machine, p: Array, looseness: float = 1.0, boost: Mapping[str, float] | None = None,
    lacking: Container[str] = (),
) -> NoiseModel:  # fmt: skip
    """Sensors' noise, and small white disturbances of torque and flows; of ``lacking`` channels little is known at the start."""
    torque, flow = looseness * TORQUE_NOISE, looseness * FLOW_NOISE
    sensors = machine.sensor_noise()
    number = dict(zip(plant.parameter_names, p, strict=True))
    disturbance = {
        name: (torque if name == "rate" else flow) / capacity for name, capacity in capacities(number).items()
    }
    if boost:
        spool = SPOOL_NOISE * number.get("main_valve_spool.s_max", 1.0)
        disturbance = {
            name: value * boost.get(name, 1.0)
            for name, value in (disturbance | ({"spool_position": spool} if "spool_position" in boost else {})).items()
        }
    joined = {}
    if boost and PISTON in boost:
        joined = {name: boost[PISTON] * flow * value for name, value in slipping(number).items()}
    initial = {
        "angle": 1e-3, "rate": 1e-2, "head_pressure": 5e5, "rod_pressure": 1e5, "hose_pressure": 1e5,
        "accumulator_pressure_1": 5e5, "accumulator_pressure_2": 5e5,
    }  # fmt: skip
    initial |= {state: UNMEASURED for state, channel in SHOWN_BY.items() if channel in lacking}
    angle = max(hypot(sensors.angle_sigma, 0.5 * sensors.angle_quantum), 1e-5)
    outputs = tuple(angle if sensor.name == "angle" else sensors.deviation(sensor) for sensor in PREDICTED)
    return NoiseModel(
        outputs, disturbance, initial,
        {state.name: state.standstill_noise for state in plant.equations.states if state.standstill_noise}, joined,
    )  # fmt: skip


def slipping(number: Values) -> dict[str, float]:
    """State -> how its derivative changes with a flow by which the piston moves on the head side and the boom does not."""
    capacity = capacities(number)
    share = number["cylinder.A_b"] / number["cylinder.A_a"]
    return {"head_pressure": -1.0 / capacity["head_pressure"], "rod_pressure": share / capacity["rod_pressure"]}


def capacities(number: Values) -> dict[str, float]:
    """State -> what its derivative times this is: a torque [N m], a flow [m^3/s]; volumes with the piston in the middle."""
    beta = number["fluid.beta"]
    return {
        "rate": number["pose.D0"] + number["pose.load"] * (number["pose.tip.0"] ** 2 + number["pose.tip.1"] ** 2),
        "hose_pressure": number["cylinder.V_h"] / beta,
        "head_pressure": 0.5 * number["cylinder.A_a"] * number["cylinder.l_p"] / beta,
        "rod_pressure": 0.5 * number["cylinder.A_b"] * number["cylinder.l_p"] / beta,
    }
