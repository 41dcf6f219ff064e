"""The simulated crane: the full model, advanced in fixed periods, with commands, load and sensors. No ROS.

Time begins at zero in the initial state. A command acts from its time until the next one; ``advance`` integrates one period
and returns the sensor values at its end. The same seed and the same commands give the same numbers, bit by bit.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from boom_model.errors import ModelError, SimulationError
from boom_model.machine import Machine, Pose
from boom_model.plant import Plant
from boom_model.sensors import OUTPUTS, PRESSURES, SensorNoise
from boom_recording.recording import Recording

Array = NDArray[np.float64]

PERIOD = 0.01
"""s. Sensors and commands run at 100 Hz (thesis ch. 4.2)."""
LARGEST_CURRENT = 3.0
"""A. No driver gives more; the valves are identified up to 0.55 A."""
TOLERANCE = 1e-5
_COINCIDENT = 1e-9


class CommandError(ModelError):
    """An impossible command; the message says why. It is ignored, and the previous one stays active."""


class EndedEarlyError(SimulationError):
    """A state left its range after some samples.

    Attributes:
        recording: the run up to that point.
    """

    def __init__(self, error: SimulationError, recording: Recording) -> None:
        super().__init__(str(error), error.time, error.state)
        self.recording = recording


@dataclass(frozen=True)
class CraneStart:
    """Rest state at the beginning: boom angle [rad]; pressures [Pa gauge], NaN = those that carry the boom (p_b 10 bar)."""

    angle: float
    hose_pressure: float = math.nan
    rod_pressure: float = math.nan

    def state(self, plant: Plant, inputs: Array | None = None) -> Array:
        """The state (NX,) of ``plant`` at this rest, where the inputs (NU,) tell that the other joints stand elsewhere.

        Raises:
            ModelError: an angle outside the stroke.
        """
        plant.check_angle(self.angle)
        rod = self.rod_pressure if math.isfinite(self.rod_pressure) else 1.0e6
        if math.isfinite(self.hose_pressure):
            return plant.rest_state(self.angle, self.hose_pressure, rod, inputs=inputs)
        return plant.equilibrium(self.angle, rod, inputs)


class CraneSample(NamedTuple):
    """What the sensors show; SI, pressures gauge.

    Attributes:
        time: of angle, rate and pressures [s].
        current_time: from when the measured currents act [s]: the beginning of the period that ended at ``time``, or, if the
            command came inside it, then. NaN in the first sample, before which no current acted.
        retract_current, extend_current: measured [A]; NaN where nobody measures.
    """

    time: float
    angle: float
    rate: float
    hose_pressure: float
    rod_pressure: float
    current_time: float = math.nan
    retract_current: float = math.nan
    extend_current: float = math.nan

    @property
    def outputs(self) -> dict[str, float]:
        """What the model predicts of it, by channel."""
        return {name: getattr(self, name) for name in OUTPUTS}


@dataclass
class _Commands:
    """Commands by the time from which they act; ``given`` is the last one of the solenoids, ``acting`` lags by the dead time."""

    waiting: deque[tuple[float, float, float]] = field(default_factory=deque)
    acting: tuple[float, float] = (0.0, 0.0)
    given: tuple[float, float, float] = (0.0, 0.0, 0.0)


class SimulatedCrane:
    """A crane in a pose, its boom moved by the full model.

    Args:
        machine: the machine with its effects.
        pose: locked joints and load at the beginning.
        start: the rest state at the beginning.
        noise: of the sensors; ``boom_model.sensors.IDEAL`` for none.
        seed: of the noise.

    Raises:
        BuildError: no C compiler.
        ModelError: a start outside the stroke.
    """

    period = PERIOD

    def __init__(self, machine: Machine, pose: Pose, start: CraneStart, noise: SensorNoise, seed: int = 0) -> None:
        self.machine = machine
        self._first_pose, self._start, self._noise, self._seed = pose, start, noise, seed
        self.reset()

    def reset(self) -> None:
        """Return to the initial state, load, time, noise and commands."""
        self.pose = self._first_pose
        self._plant = Plant(self.machine, self.pose)
        self._stepper = self._plant.stepper(self._start.state(self._plant), tolerance=TOLERANCE)
        self._rng = np.random.default_rng(self._seed)
        self._commands = _Commands()
        self._ticks = 0
        y = self._plant.outputs(self._stepper.state)
        self._past = deque([(-math.inf, y.copy())])  # (time [s], outputs), as far back as the pressures' delay reaches
        self._sample = self._measure(y)

    @property
    def time(self) -> float:
        """Simulated time [s]: whole periods since the beginning."""
        return self._ticks * PERIOD

    @property
    def sample(self) -> CraneSample:
        """The present sensor values."""
        return self._sample

    @property
    def truth(self) -> tuple[tuple[str, ...], Array, tuple[str, ...]]:
        """The present true states: names, values, units."""
        states = self._plant.equations.states
        return self._plant.state_names, self._stepper.state.copy(), tuple(s.unit for s in states)

    @property
    def load(self) -> float:
        """The load at the tip [kg]."""
        return self.pose.load

    def command(self, retract: float, extend: float, at: float | None = None) -> None:
        """Set both currents [A] from ``at`` [s] on.

        They act from now on without ``at``, or if it has passed or is more than two periods ahead (another clock). The solenoids
        are driven once in a period, as often as they are measured: of several commands for one the last counts.

        Raises:
            CommandError: a current that is not finite, negative, or larger than any driver delivers.
        """
        for name, value in (("retract", retract), ("extend", extend)):
            if not (math.isfinite(value) and -1e-9 <= value <= LARGEST_CURRENT):
                raise CommandError(
                    f"{name} current of {value} A: allowed is 0 .. {LARGEST_CURRENT:g} A; the command is ignored"
                )
        known = at is not None and self.time < at <= self.time + 2 * PERIOD
        begin = at if known and at is not None else self.time
        self._commands.given = (begin, max(retract, 0.0), max(extend, 0.0))
        delay, waiting = self._plant.command_delay, self._commands.waiting
        period = math.floor((begin + _COINCIDENT) / PERIOD) * PERIOD
        while (
            waiting and waiting[-1][0] > period + delay - _COINCIDENT
        ):  # what was to act later, or before it in its period
            waiting.pop()
        waiting.append((begin + delay, max(retract, 0.0), max(extend, 0.0)))

    def set_load(self, mass: float) -> None:
        """Attach a load [kg] to the tip, at the tip's speed; 0 = none.

        Raises:
            CommandError: not a finite mass of 0 kg or more.
        """
        if not (math.isfinite(mass) and 0.0 <= mass <= 1e5):
            raise CommandError(f"a load of {mass} kg: give a finite mass of 0 .. 100000 kg")
        self.pose = replace(self.pose, load=float(mass))
        values = self.machine.values(self.pose)
        self._stepper.change_parameters(np.array([values[name] for name in self._plant.parameter_names]))

    def advance(self) -> CraneSample:
        """Integrate one period and measure at its end.

        Raises:
            SimulationError: a state left its range; the message names it and the time. The crane keeps its state.
        """
        begin, end = self.time, (self._ticks + 1) * PERIOD
        state = self._stepper.state.copy()
        try:
            y = self._integrate(begin, end)
        except ModelError:
            self._stepper.state[:] = state
            raise
        self._ticks += 1
        self._sample = self._measure(y)
        return self._sample

    def _integrate(self, begin: float, end: float) -> Array:
        commands, delay = self._commands, self._plant.pressure_delay
        # a later tick shows the pressures of this moment: t - T for whole periods t falls inside (begin, end]
        phase = (-delay) % PERIOD
        recorded = (begin + phase if _COINCIDENT < phase < PERIOD - _COINCIDENT else end) if delay > 0 else math.inf
        time = self._stepper.time = begin
        while True:
            while commands.waiting and commands.waiting[0][0] <= time + _COINCIDENT:
                _, *currents = commands.waiting.popleft()
                commands.acting = (currents[0], currents[1])
            until = min(end, commands.waiting[0][0] if commands.waiting else end, recorded if recorded > time else end)
            y = self._stepper.step(*commands.acting, until - time)
            time = until
            if delay > 0 and abs(time - recorded) <= _COINCIDENT:
                self._past.append((time, y.copy()))
            if time >= end - _COINCIDENT:
                return y

    def _measure(self, y: Array) -> CraneSample:
        true = y
        if self._plant.pressure_delay > 0:
            wanted = self.time - self._plant.pressure_delay + _COINCIDENT
            while len(self._past) > 1 and self._past[1][0] <= wanted:
                self._past.popleft()
            true = np.where(PRESSURES, self._past[0][1], y)
        shown = dict(zip(OUTPUTS, self._noise.outputs(true, self._rng).tolist(), strict=True))
        since, *given = self._commands.given
        i_r, i_e = (float(v) for v in self._noise.currents(np.array(given), self._rng))
        current_time = max(since, self.time - PERIOD) if self._ticks else math.nan
        return CraneSample(time=self.time, current_time=current_time, retract_current=i_r, extend_current=i_e, **shown)
