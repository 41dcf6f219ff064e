"""The closed loop of ch. 6.4 in one process: controller, full model, sensors, one sample time after the other."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from boom_controller.types import Controller, Measurement, Output, Reference
from boom_model.errors import SimulationError
from boom_model.machine import Machine, Pose
from boom_model.plant import Plant, Stepper
from boom_model.sensors import SensorNoise

Array = NDArray[np.float64]

DIVERGED = 0.1
"""m. A piston further than that from its reference is out of control: the run ends and counts as diverged."""
LOWEST_PRESSURE = -1.0e8
"""Pa."""
SUBSTEP = 0.002
"""s. How often the supply's pressure limit is applied within a sample time."""
RECORDED = (
    "angle", "rate", "hose_pressure", "rod_pressure", "force_set_point", "feedforward_force", "estimated_load", "spool_position",
    "retract", "extend",
)  # fmt: skip


@dataclass(frozen=True)
class Grasp:
    """A load [kg] hangs at the tip from ``time`` [s] on, beyond that of the pose."""

    time: float
    load: float


@dataclass
class History:
    """A run: time (n,) [s], reference angle (n,) [rad], ``values`` name -> (n,) true values and outputs; SI.

    Attributes:
        diverged: why the run ended early; empty if it did not.
        stopped: (time [s], reason) when the controller asked to stop, with which the run ends; None if it did not.
        final: (NX,) state at the end.
    """

    time: Array
    reference: Array
    values: dict[str, Array]
    diverged: str = ""
    stopped: tuple[float, str] | None = None
    final: Array = field(default_factory=lambda: np.empty(0))


def run(
    controller: Controller,
    plant: Plant,
    start: Array,
    references: list[Reference],
    *,
    noise: SensorNoise,
    seed: int = 0,
    period: float = 0.01,
    supply_pressure: float = math.inf,
    grasp: Grasp | None = None,
    delay: int = 0,
) -> History:
    """Runs the loop along the references, one each period [s].

    Args:
        controller: reset here, from what the sensors show at the start.
        plant: of the machine as it is, its load included.
        start: (NX,) state at time zero.
        references: one a period, the first at time zero.
        noise: of the sensors.
        seed: of the noise.
        period: sample time [s].
        supply_pressure: the pump's [Pa]. The compensator keeps its margin as long as that allows, min(dp_c, p_s - p_port).
            The pump's flow is limited by the effect ``pump_flow_limit`` of the plant's machine.
        grasp: a load that is grasped on the way.
        delay: dead time of the valve chain, in periods.
    """
    n = len(references)
    rows = np.full((n, len(RECORDED)), math.nan)
    draws = _draws(noise, np.random.default_rng(seed), n)
    plant = _tolerant(plant)
    stepper = plant.stepper(start)
    step = stepper.step if math.isinf(supply_pressure) else _Supply(plant, stepper, supply_pressure).step
    y = [float(v) for v in plant.outputs(start)]
    controller.reset(_measure(noise, draws[0], y, 0.0))
    waiting = [(0.0, 0.0)] * delay
    diverged, stopped = "", None
    length = _position_scale(plant)
    count = n
    for k, reference in enumerate(references):
        now = k * period
        if grasp and grasp.time <= now < grasp.time + period:
            pose = replace(plant.pose, load=plant.pose.load + grasp.load)
            stepper.change_parameters(plant.with_numbers(plant.machine, pose).p)
        out = controller.step(reference, _measure(noise, draws[k], y, now))
        rows[k] = _row(y, out)
        if out.reason:  # what the supervision would do: the valve is closed, and the run is over
            stopped = (now, out.reason)
            count = k + 1
            break
        waiting.append((out.retract, out.extend))
        retract, extend = waiting.pop(0)
        try:
            y = step(retract, extend, period).tolist()
        except SimulationError as error:
            diverged = str(error)
        if not diverged and abs(y[0] - reference.angle) * length > DIVERGED:
            diverged = f"at {now:.2f} s the piston was {DIVERGED * 1e3:.0f} mm from its reference"
        if diverged:
            count = k + 1
            break
    wanted = np.array([r.angle for r in references[:count]], np.float64)
    values = {name: rows[:count, i] for i, name in enumerate(RECORDED)}
    return History(np.arange(count, dtype=np.float64) * period, wanted, values, diverged, stopped, stepper.state.copy())


def start_state(plant: Plant, machine: Machine, pose: Pose, angle: float) -> Array:
    """Rest at the angle [rad] with the load of ``pose`` only: what is attached at the first instant is not carried yet."""
    return plant.with_numbers(machine, pose).equilibrium(angle)


class _Supply:
    """Steps with the compensator's drop cut to what the supply leaves."""

    def __init__(self, plant: Plant, stepper: Stepper, pressure: float) -> None:
        self._stepper, self._pressure, self._p = stepper, pressure, plant.p.copy()
        self._index = plant.parameter_names.index("main_valve_orifices.dp_c")
        self._margin = float(plant.p[self._index])
        names = plant.state_names
        self._spool, self._rod = names.index("spool_position"), names.index("rod_pressure")
        self._head = names.index("hose_pressure" if "hose_pressure" in names else "head_pressure")

    def step(self, retract: float, extend: float, period: float) -> Array:
        count = max(1, round(period / SUBSTEP))
        for _ in range(count):
            state = self._stepper.state
            port = state[self._head] if state[self._spool] < 0 else state[self._rod]
            self._p[self._index] = min(self._margin, max(self._pressure - port, 0.0))
            self._stepper.change_parameters(self._p)
            y = self._stepper.step(retract, extend, period / count)
        return y


def _draws(noise: SensorNoise, rng: np.random.Generator, n: int) -> list[list[float]]:
    """Noise to be added before quantisation, (n, 4): the sensors' own noise at y = 0 without quanta."""
    smooth = replace(noise, angle_quantum=0.0, pressure_quantum=0.0)
    draws: list[list[float]] = smooth.outputs(np.zeros((n, 4)), rng).tolist()
    return draws


def _measure(noise: SensorNoise, draw: list[float], y: list[float], time: float) -> Measurement:
    quanta = (noise.angle_quantum, 0.0, noise.pressure_quantum, noise.pressure_quantum)
    shown = [round((v + d) / s) * s if s else v + d for v, d, s in zip(y, draw, quanta, strict=True)]
    return Measurement(time, *shown)


def _row(y: list[float], out: Output) -> tuple[float, ...]:
    return (
        *y,
        out.force_set_point,
        out.feedforward_force,
        out.estimated_load,
        out.spool_position,
        out.retract,
        out.extend,
    )


def _tolerant(plant: Plant) -> Plant:
    """The same plant without the lower limit of the pressures.

    A heavy load that drops at the first instant sucks the rod side below -1 bar for some ms, anti-cavitation valve or not. The
    thesis' model has no such limit, and the comparison with its Table 6.3 must not end there.
    """
    other = plant.with_numbers(plant.machine, plant.pose)
    for i, name in enumerate(plant.state_names):
        if name.endswith("pressure"):
            other.minimum[i] = LOWEST_PRESSURE
    return other


def _position_scale(plant: Plant) -> float:
    """Largest J [m/rad] in the stroke: bounds the piston's error by the angle's."""
    low, high = plant.machine.angle_limits
    angles = np.linspace(low + 1e-3, high - 1e-3, 50)
    positions = np.array([plant.machine.piston_position(a) for a in angles])
    return float(np.max(np.diff(positions) / np.diff(angles)))
