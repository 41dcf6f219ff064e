"""Both measurement campaigns of chapter 4 with the simulated machine, so that chapter 5 can be repeated without a crane.

``pilot``: eleven traces of the pilot valves on the bench: sweeps, static and ramp signals, general shapes (ch. 4.1).
``cylinder``: recordings of the whole machine, moved by an operator with a joystick: staircases for identification, slow and
fast motions for validation, in three poses, one of them with a log (ch. 4.2). The operator watches the angle and reverses
before the ends of stroke.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from boom_model.errors import SimulationError
from boom_model.machine import Machine
from boom_model.sensors import OUTPUTS, SensorNoise
from boom_recording import writing
from boom_recording.oscilloscope import OscilloscopeTrace
from boom_recording.recording import Configuration, Recording
from boom_sim.pilot_bench import PWM_PERIOD, BenchNoise, measure
from boom_sim.simulated_crane import PERIOD, CraneSample, CraneStart, EndedEarlyError, SimulatedCrane

Array = NDArray[np.float64]

LEAST, MOST = 0.30, 0.55
"""A. Range of the joystick (ch. 5.1)."""
_EDGE = LEAST - 0.02
REST = 1.2
"""s. The boom rests for this time before the first command."""


@dataclass(frozen=True)
class PilotRun:
    """One trace: the valve and the shape of its current."""

    name: str
    valve: str
    shape: str


PILOT_RUNS = tuple(
    PilotRun(f"{valve}_{shape}", valve, shape.split("_")[0])
    for valve, shapes in (
        ("retract", ("chirp_1", "chirp_2", "static", "ramp", "general_1", "general_2")),
        ("extend", ("chirp", "static", "ramp", "general_1", "general_2")),
    )
    for shape in shapes
)
"""The eleven trajectories of ch. 4.1."""


@dataclass(frozen=True)
class CylinderRun:
    """One recording: pose, load and the motion of the joystick."""

    name: str
    outer_boom_angle: float
    telescope_length: float
    load: float
    shape: str


_POSES = (("folded", 4.59, 0.0, 0.0), ("extended", 0.28, 2.2, 0.0), ("log", 0.28, 2.8, 300.0))
CYLINDER_RUNS = tuple(
    CylinderRun(f"{pose}_{shape}", q3, q4, load, shape)
    for pose, q3, q4, load in _POSES
    for shape in ("staircase", "slow", "general", "fast")
)
CYLINDER_DURATION = 60.0
ATTEMPTS = 5
"""At one recording."""
LOW_ANGLE, HIGH_ANGLE = 0.05, 0.95
"""rad. The operator stays between these angles."""


def pilot_current(shape: str, rng: np.random.Generator) -> Array:
    """Wanted current [A] of each PWM period.

    shape: ``chirp`` (0.1 to 4 Hz), ``static`` (levels held), ``ramp`` (up and down), ``general`` (steps and slopes).
    """
    if shape == "chirp":
        time = np.arange(0.0, 16.65, PWM_PERIOD)
        low, high = 0.1, 4.0
        phase = 2 * math.pi * (low * time + 0.5 * (high - low) / time[-1] * time**2)
        centre, size = 0.5 * (LEAST + MOST), 0.5 * (MOST - LEAST) * rng.uniform(0.85, 0.98)
        return np.asarray(centre + size * np.sin(phase + rng.uniform(0, 2 * math.pi)), np.float64)
    if shape == "static":
        levels = np.concatenate((np.linspace(LEAST, MOST, 7), rng.uniform(LEAST, MOST, 3)))
        return np.repeat(levels, round(1.6 / PWM_PERIOD))
    if shape == "ramp":
        half = round(8.0 / PWM_PERIOD)
        return np.concatenate((np.linspace(0.28, 0.56, half), np.linspace(0.56, 0.28, half)))
    parts: list[Array] = []
    level = float(rng.uniform(LEAST, MOST))
    while sum(map(len, parts)) * PWM_PERIOD < 16.8:
        following = float(rng.uniform(LEAST, MOST))
        slope, hold = (max(1, round(float(t) / PWM_PERIOD)) for t in rng.uniform((0.02, 0.2), (0.4, 0.9)))
        parts += [np.linspace(level, following, slope, endpoint=False), np.full(hold, following)]
        level = following
    return np.concatenate(parts)


def pilot_campaign(machine: Machine, *, seed: int = 0, noise: BenchNoise | None = None) -> Iterator[OscilloscopeTrace]:
    """The eleven traces, one after the other."""
    body = next(iter(machine.document["rigid_body"]["configs"].values()))
    pose = machine.pose(float(body["q3"]), float(body["q4"]))
    for number, run in enumerate(PILOT_RUNS):
        rng = np.random.default_rng([seed, number])
        wanted = pilot_current(run.shape, rng)
        yield measure(
            machine, pose, run.valve, wanted, name=run.name, noise=noise or BenchNoise(), seed=int(rng.integers(2**31))
        )


def cylinder_campaign(
    machine: Machine, *, seed: int = 0, duration: float = CYLINDER_DURATION, noise: SensorNoise | None = None
) -> Iterator[Recording]:
    """The recordings of the whole machine, one after the other, each ``duration`` [s] long.

    noise: of the sensors; default: the machine's own.

    Raises:
        MachineError: this machine knows none of the poses.
        EndedEarlyError: the machine cannot perform a motion; carries the last attempt.
    """
    for number, run in enumerate(CYLINDER_RUNS):
        note = f"simulated: campaign cylinder, {run.shape}, seed {seed}"
        configuration = Configuration(machine.name, run.outer_boom_angle, run.telescope_length, run.load, note)
        for attempt in range(ATTEMPTS):
            rng = np.random.default_rng([seed, 100 + number, attempt])
            try:
                recording = _drive(
                    machine, configuration, run, rng, duration, noise or machine.sensor_noise(), 1.0 + attempt
                )
            except SimulationError:
                # An abrupt stop let the oil cavitate beyond what the model means: the operator is gentler next time.
                if attempt == ATTEMPTS - 1:
                    raise
                continue
            yield recording
            break


def _drive(
    machine: Machine,
    configuration: Configuration,
    run: CylinderRun,
    rng: np.random.Generator,
    duration: float,
    noise: SensorNoise,
    gentleness: float,
) -> Recording:
    pose = machine.pose(run.outer_boom_angle, run.telescope_length, run.load)
    start = CraneStart(float(rng.uniform(0.2, 0.4)))
    crane = SimulatedCrane(machine, pose, start, noise, int(rng.integers(2**31)))
    operator = CampaignOperator(run.shape, rng, gentleness)
    samples = [crane.sample]
    for _ in range(round(duration / PERIOD)):
        retract, extend = operator.currents(crane.time, crane.sample.angle)
        crane.command(retract, extend)
        try:
            crane.advance()
        except SimulationError as error:
            if len(samples) < 2:
                raise
            raise EndedEarlyError(error, _recording(run.name, samples, configuration)) from None
        samples.append(crane.sample)
    return _recording(run.name, samples, configuration)


def _recording(name: str, samples: list[CraneSample], configuration: Configuration) -> Recording:
    """The recording of the samples, as a recorder would make it: currents carry the stamp from which they act."""
    time = np.array([s.time for s in samples])
    columns = {output: np.array([getattr(s, output) for s in samples]) for output in OUTPUTS}
    result = writing.from_columns(name, time, columns, configuration)
    commanded = samples[1:]  # before the first one no current acted
    currents = {key: np.array([getattr(s, key) for s in commanded]) for key in ("retract_current", "extend_current")}
    since = np.array([s.current_time for s in commanded])
    result.signals.update(writing.from_columns(name, since, currents, configuration).signals)
    return result


_HOLD = {"staircase": (1.5, 3.5), "general": (0.6, 2.0), "fast": (0.3, 1.2)}
_PAUSE = {"staircase": (0.6, 1.0), "general": (0.4, 1.0), "fast": (0.2, 0.4)}
_RAMP = {"staircase": 0.25, "slow": 0.4, "general": 0.5, "fast": 0.15}
"""s. The joystick takes this time from the dead zone to its end, because an abrupt stop lets the oil cavitate."""


class CampaignOperator:
    """Moves the joystick: chooses a current and a direction, holds, ramps or reverses, and stays between two angles.

    Args:
        shape: ``staircase`` (levels held for seconds, with pauses), ``slow`` (a sinusoid of 20 s, Fig. 4.5), ``general``
            (ramps and pauses), ``fast`` (steps and reversals).
        rng: random numbers for the choices.
        gentleness: how many times slower than usual the joystick is moved.
    """

    def __init__(self, shape: str, rng: np.random.Generator, gentleness: float = 1.0) -> None:
        self._shape, self._rng, self._gentleness = shape, rng, gentleness
        self._wanted = 0.0  # > 0 retract, < 0 extend [A]
        self._given = 0.0
        self._until = REST

    def currents(self, time: float, angle: float) -> tuple[float, float]:
        """(retract, extend) [A] at a time [s] for the angle [rad] that the operator sees."""
        if time < REST:
            return 0.0, 0.0
        if self._shape == "slow":
            self._wanted = self._sinusoid(time)
        elif time >= self._until:
            self._change(time, angle)
        if (angle > HIGH_ANGLE and self._wanted < 0.0) or (angle < LOW_ANGLE and self._wanted > 0.0):
            self._wanted = 0.0
            self._until = min(self._until, time + 0.5)
        self._given = self._followed()
        return max(self._given, 0.0), max(-self._given, 0.0)

    @staticmethod
    def _sinusoid(time: float) -> float:
        wave = -math.sin(2 * math.pi * (time - REST) / 20.0)
        return math.copysign(0.26 + 0.20 * abs(wave), wave) if abs(wave) > 0.1 else 0.0

    def _change(self, time: float, angle: float) -> None:
        if self._wanted != 0.0 and self._rng.random() < 0.7:
            self._wanted = 0.0
            self._until = time + float(self._rng.uniform(*_PAUSE[self._shape]))
            return
        self._choose(angle)
        self._until = time + float(self._rng.uniform(*_HOLD[self._shape]))

    def _followed(self) -> float:
        """The joystick moves over its whole range in no less than the time of a ramp, and skips the valve's dead zone."""
        step = (MOST - LEAST) * PERIOD / (_RAMP[self._shape] * self._gentleness)
        given, wanted = self._given, self._wanted
        if given == 0.0:
            return math.copysign(_EDGE, wanted) if wanted != 0.0 else 0.0
        target = wanted if wanted * given > 0.0 else 0.0
        moved = given + max(-step, min(step, target - given))
        return 0.0 if target == 0.0 and abs(moved) < _EDGE else moved

    def _choose(self, angle: float) -> None:
        share = (angle - LOW_ANGLE) / (HIGH_ANGLE - LOW_ANGLE)
        direction = 1.0 if self._rng.random() < min(max(share, 0.1), 0.9) else -1.0
        self._wanted = direction * float(self._rng.uniform(LEAST + 0.02, MOST))
