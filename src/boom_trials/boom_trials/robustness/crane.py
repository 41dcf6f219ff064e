"""The crane of ch. 6.4: full model and sensors, with a limited supply, a load that is grasped, and runs that are out of control."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from operator import attrgetter

import numpy as np
from numpy.typing import NDArray

from boom_controller.references.governor import Governor
from boom_controller.types import Controller, Reference
from boom_input.channels import PREDICTED
from boom_model.machine import Machine, Pose
from boom_model.plant import Plant, Stepper
from boom_model.sensors import OUTPUTS, PRESSURES, SensorNoise
from boom_sim.simulated_crane import CraneSample
from boom_trials import closed_loop

Array = NDArray[np.float64]

DIVERGED = 0.1
"""m. A piston further than that from its reference is out of control: the run ends and counts as diverged."""
SUBSTEP = 0.002
"""s. How often the supply's pressure limit is applied within a sample time."""
INSIDE = ("angle", "spool_position")
GIVEN = ("force_set_point", "feedforward_force", "estimated_load", "spool_position", "retract", "extend")


@dataclass(frozen=True)
class Grasp:
    """A load [kg] hangs at the tip from ``time`` [s] on, beyond that of the pose."""

    time: float
    load: float


@dataclass
class History:
    """A run: time (n,) [s], reference angle (n,) [rad], ``values`` name -> (n,) true outputs and those of the control law; SI.

    Attributes:
        diverged: why the run ended early; empty if it did not.
        stopped: (time [s], reason) when the controller asked to stop, with which the run ends; None if it did not.
        noted: time [s] from which the controller had a note for the operator; None if it never had.
        references: that were followed, one a period.
    """

    time: Array
    reference: Array
    values: dict[str, Array]
    diverged: str = ""
    stopped: tuple[float, str] | None = None
    noted: float | None = None
    references: Sequence[Reference] = ()


class TrialCrane:
    """A :class:`boom_trials.closed_loop.Crane` for so many periods.

    All noise is drawn at the beginning, and nothing is kept but the true outputs: many thousand runs are made of it.

    Args:
        plant: of the machine as it is, its load included.
        start: (NX,) state at time zero.
        periods: how many at most.
        noise: of the sensors.
        seed: of the noise.
        period: sample time [s].
        supply_pressure: the pump's [Pa]. The compensator keeps its margin as long as that allows, min(dp_c, p_s - p_port).
            The pump's flow is limited by the effect ``pump_flow_limit`` of the plant's machine.
        grasp: a load that is grasped on the way.

    Attributes:
        machine: the plant's.
        true: the outputs without noise, at time zero and after each period.
        inside: q_2 [rad] itself and s_s [m] at the same times, whatever the sensors make of it.
        command_delay: dead time [s] of the valve chain, an effect of the plant's machine.
        sample: what the sensors show now.
    """

    def __init__(
        self,
        plant: Plant,
        start: Array,
        periods: int,
        *,
        noise: SensorNoise,
        seed: int = 0,
        period: float = 0.01,
        supply_pressure: float = math.inf,
        grasp: Grasp | None = None,
    ) -> None:
        self.period, self._grasp = period, grasp
        self._plant = plant
        self.machine = plant.machine
        self._stepper = plant.stepper(start)
        limited = not math.isinf(supply_pressure)
        self._step = _Supply(plant, self._stepper, supply_pressure).step if limited else self._stepper.step
        self._draws = _draws(noise, np.random.default_rng(seed), periods + 1)
        self._quanta = tuple(noise.quantum(sensor) for sensor in PREDICTED)
        self._acting = self._next = (0.0, 0.0)
        self._from = -math.inf
        self.command_delay, self._late = plant.command_delay, plant.pressure_delay / period
        self._inside = [plant.state_names.index(name) for name in INSIDE]
        self.inside = [[float(start[k]) for k in self._inside]]
        self.true: list[list[float]] = [[float(v) for v in plant.outputs(start)]]
        self.sample = self._measure(0, self.true[0])

    def command(self, retract: float, extend: float, at: float | None = None) -> None:
        """Both currents [A] from ``at`` [s] on, within the period that follows; without it at once."""
        self._next, self._from = (retract, extend), -math.inf if at is None else at

    def advance(self) -> CraneSample:
        """One period.

        Raises:
            SimulationError: a state left its range.
        """
        now, period = self.sample.time, self.period
        if self._grasp and self._grasp.time <= now < self._grasp.time + period:
            pose = replace(self._plant.pose, load=self._plant.pose.load + self._grasp.load)
            self._stepper.change_parameters(self._plant.with_numbers(self._plant.machine, pose).p)
        if self._from > now:
            self._step(*self._acting, self._from - now)
            period -= self._from - now
        self._acting = self._next
        y = self._step(*self._acting, period).tolist()
        self.true.append(y)
        self.inside.append([float(self._stepper.state[k]) for k in self._inside])
        self.sample = sample = self._measure(len(self.true) - 1, self._delayed(y) if self._late else y)
        return sample

    def _delayed(self, y: list[float]) -> list[float]:
        """The outputs y with the pressures of some time ago."""
        place = max(len(self.true) - 1 - self._late, 0.0)
        before = int(place)
        older, newer = self.true[before], self.true[min(before + 1, len(self.true) - 1)]
        part = place - before
        return [
            (1 - part) * a + part * b if delayed else now
            for a, b, now, delayed in zip(older, newer, y, PRESSURES, strict=True)
        ]

    def _measure(self, k: int, y: list[float]) -> CraneSample:
        shown = [
            round((v + d) / s) * s if s else v + d for v, d, s in zip(y, self._draws[k], self._quanta, strict=True)
        ]
        return CraneSample(k * self.period, *shown)  # it begins with the outputs, in their order


def carried_out(
    controller: Controller,
    crane: TrialCrane,
    references: Sequence[Reference],
    *,
    delay: int = 0,
    governor: Governor | None = None,
) -> History:
    """Runs the loop until its end, until the controller asks to stop, or until the piston is ``DIVERGED`` from its reference.

    Args:
        controller: reset here.
        crane: at time zero.
        references: one a period.
        delay: dead time of the valve chain, in periods.
        governor: as in :func:`boom_trials.closed_loop.run`.
    """
    length, true = _position_scale(crane.machine), crane.true
    done = closed_loop.run(
        controller, crane, references, dead_time=delay * crane.period + crane.command_delay, heed=True, governor=governor,
        astray=lambda wanted: abs(crane.inside[-1][0] - wanted) * length > DIVERGED,
    )  # fmt: skip
    n = len(done.outputs)
    rows = np.hstack([true[:n], list(map(attrgetter(*GIVEN), done.outputs))])
    values = dict(zip((*OUTPUTS, *GIVEN), rows.T, strict=True))
    values |= dict(zip(("true_angle", "true_spool"), np.array(crane.inside[:n]).T, strict=True))
    diverged = str(done.failed or "")
    if done.astray is not None:
        diverged = f"at {done.astray:.2f} s the piston was {DIVERGED * 1e3:.0f} mm from its reference"
    wanted = np.array([reference.angle for reference in done.references])
    noted = next((k * crane.period for k, output in enumerate(done.outputs) if output.note), None)
    return History(
        np.arange(n, dtype=np.float64) * crane.period, wanted, values, diverged, done.stopped, noted, done.references
    )


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
    """Noise to be added before quantisation, (n, NY): the sensors' own noise at y = 0 without quanta."""
    smooth = replace(noise, angle_quantum=0.0, pressure_quantum=0.0)
    draws: list[list[float]] = smooth.outputs(np.zeros((n, len(OUTPUTS))), rng).tolist()
    return draws


def _position_scale(machine: Machine) -> float:
    """Largest J [m/rad] in the stroke: bounds the piston's error by the angle's."""
    low, high = machine.angle_limits
    angles = np.linspace(low + 1e-3, high - 1e-3, 50)
    positions = np.array([machine.piston_position(a) for a in angles])
    return float(np.max(np.diff(positions) / np.diff(angles)))
