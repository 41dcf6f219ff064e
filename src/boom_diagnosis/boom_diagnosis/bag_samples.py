"""A recording as the observer sees it: intervals of 10 ms, each channel's sample where in its interval it was taken."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from math import hypot, isnan, sqrt

import numpy as np
from numpy.typing import NDArray

from boom_diagnosis.recent import Recent
from boom_estimation.currents import HeldCurrents, driven, held_currents, held_inputs
from boom_estimation.initial_state import resting_start, stationary_guess
from boom_estimation.runs import EVAPORATES, at_an_end, evaporating
from boom_model.machine import Machine
from boom_model.observer import KalmanGains, Linearised, Samples
from boom_model.plant import Plant
from boom_model.prior import MOMENTS
from boom_model.sensors import OUTPUTS, PRESSURES
from boom_model.structure import CURRENTS
from boom_recording.measurement import without_repeats
from boom_recording.recording import Recording, Signal

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

PERIOD = 0.01
OTHER_POSE = "@"
"""Between the component and the number of another pose or load, in the name of a value that is that one's own."""
SETTLING = 1.5
"""s. Behind a gap in the currents the observer needs so long to find the state again."""
MOVING = 0.02
"""rad/s."""
GAINS, TRAJECTORIES = 16, 3
"""Kept per recording: some 4 and 25 MB each, of a recording of 60 s."""
BEGUN = 64
"""Plants whose initial state is kept."""
TIMING_NOISE = 1e-3
"""s. When a current changed is not known better than that."""
JITTER = 0.1
"""Of an interval, by which a stamp may be late."""
SMOOTHED = 5
KERNEL = np.ones(2 * SMOOTHED + 1) / (2 * SMOOTHED + 1)
"""Intervals to either side over which the angle is smoothed where there is no gyro."""
FIRST = 20
"""Intervals whose mean speed is the one at the start where there is no gyro."""
ANGLES = 200
"""At which the linkage is closed; between them the piston's position lies on lines."""
SLOPE = 0.01
"""s. To either side over which the slope of a channel is taken."""
EARLIEST = 0.05
"""Of an interval, that a sample is behind its beginning."""
BEGINNING = 0.3
"""s. At the beginning, where the boom rests."""


def at_stamps(signal: Signal, late: float | Array) -> Array:
    """Valid values of a channel as they were at their stamps, if each tells of ``late`` [s] before: y(t + T) = y + T dy/dt.

    The slope keeps the samples' noise; what lies between samples has less of it, and would be likelier half a sample off.
    """
    values = signal.values[signal.valid]
    return np.asarray(values + late * slopes(signal)) if np.any(late) else values


def slopes(signal: Signal) -> Array:
    """Dy/dt of the valid values of a channel at their stamps, over ``SLOPE`` and their next ones at least."""
    time, values = signal.time[signal.valid], signal.values[signal.valid]
    if len(time) < 2:
        return np.zeros_like(values)
    apart = max(SLOPE, float(np.median(np.diff(time))))
    before, after = (np.interp(time + side * apart, time, values) for side in (-1.0, 1.0))
    return np.asarray((after - before) / (2.0 * apart))


@dataclass(frozen=True)
class Bag:
    """One recording, prepared.

    Attributes:
        counted: (n, NY), True where an innovation tells about the machine: measured, not in or just behind a gap, oil all liquid.
        cavitating: (n,), where the oil of the head side evaporates, and until the observer has found the state again.
        ended: (n,), the same where the boom stands at an end of its range.
        start: first valid values of the channels, for the initial state.
        timing: standard deviation of when a current changed [s].
        places: component of the parameter vector that belongs to the pose or the load -> name under which hypotheses have its
            value, see :func:`by_pose`.
        plants: of a machine with some effects with states, built so far: building one costs as much as two passes.
        gains, trajectories: of the observers that were asked for last; the same are wanted again and again.
        begun: plant -> its initial state in a recording that begins in motion, whatever its numbers.
    """

    recording: Recording
    currents: HeldCurrents
    grid: Array
    counted: Flags
    cavitating: Flags
    ended: Flags
    resting: bool
    start: dict[str, float]
    timing: float = TIMING_NOISE
    places: Mapping[str, str] = field(default_factory=dict)
    plants: list[tuple[Machine, frozenset[str], Plant]] = field(default_factory=list, compare=False, repr=False)
    gains: Recent[KalmanGains] = field(default_factory=lambda: Recent(GAINS), compare=False, repr=False)
    trajectories: Recent[Linearised] = field(default_factory=lambda: Recent(TRAJECTORIES), compare=False, repr=False)
    begun: Recent[Array] = field(default_factory=lambda: Recent(BEGUN), compare=False, repr=False)
    taken: Recent[tuple[NDArray[np.int64], Array, Array, Array]] = field(
        default_factory=lambda: Recent(2 * len(OUTPUTS)), compare=False, repr=False
    )

    @property
    def name(self) -> str:
        """Of the recording."""
        return self.recording.name

    @property
    def load_told(self) -> float:
        """The load [kg] that its configuration tells."""
        told = self.recording.configuration.load_mass
        return 0.0 if isnan(told) else told

    @property
    def pose_end(self) -> str:
        """With which the names of the numbers of its pose end."""
        return self.places["pose.D0"].removeprefix("pose.D0")

    def own_values(self, values: Mapping[str, float]) -> dict[str, float]:
        """Of a hypothesis' ``values`` those of this recording, by component of the parameter vector."""
        result = {}
        for name, value in values.items():
            component = name.partition(OTHER_POSE)[0]
            if self.places.get(component, component) == name:
                result[component] = value
        return result

    def straying(self, by: float) -> Bag:
        """The recording, of whose currents the samples were taken so far [s] from their stamps (standard deviation)."""
        if not by:
            return self
        currents, timing = replace(self.currents, strays=by), hypot(self.timing, by)
        return replace(self, currents=currents, timing=timing, gains=Recent(GAINS), trajectories=Recent(TRAJECTORIES))

    @property
    def time(self) -> Array:
        """(n,) middle of the intervals [s]."""
        return self.grid[:-1] + 0.5 * PERIOD

    def samples(
        self, command_delay: float = 0.0, pressure_delay: float = 0.0, clocks: tuple[float, ...] = ()
    ) -> Samples:
        """What the observer takes, if commands act and pressures arrive late by so much [s], and clocks of channels beside.

        A pressure that arrives late tells of the state before: its sample moves to an earlier time. By the little that ``clocks``
        of all channels differ, (NY,) [s] late, a sample moves inside its interval, and beyond by the slope: none changes its
        interval, and the loss is smooth.
        """
        shape = (len(self.grid) - 1, len(OUTPUTS))
        share, measured = np.zeros(shape), np.full(shape, np.nan)
        for j, late in enumerate(clocks or (0.0,) * len(OUTPUTS)):
            k, lies, values, along = self._taken(j, pressure_delay if PRESSURES[j] else 0.0)
            share[k, j] = lies - np.clip(late / PERIOD, np.minimum(0.0, lies - 1.0), np.maximum(0.0, lies - EARLIEST))
            measured[k, j] = values + (late - PERIOD * (lies - share[k, j])) * along
        return Samples(self.grid, share, measured, self.grid[:-1], self._mean_currents(command_delay))

    def _taken(self, channel: int, delay: float) -> tuple[NDArray[np.int64], Array, Array, Array]:
        """Of the valid samples of a channel, ``delay`` [s] late: interval, where in it (0 to 1), value and slope."""

        def made() -> tuple[NDArray[np.int64], Array, Array, Array]:
            signal = self.recording.signals[OUTPUTS[channel]]
            time = signal.time[signal.valid] - delay
            k = self._numbered(time)
            inside = (k >= 0) & (k < len(self.grid) - 1)
            k = k[inside]
            lies = (time[inside] - self.grid[k]) / PERIOD
            return k, lies, signal.values[signal.valid][inside], slopes(signal)[inside]

        return self.taken.get((channel, delay), made)

    def _numbered(self, time: Array) -> NDArray[np.int64]:
        """Interval of each sample."""
        if self.grid[0] == 0.0:
            return _intervals(time)
        return np.asarray(np.ceil((time - self.grid[0]) / PERIOD - JITTER) - 1, dtype=np.int64)

    def _mean_currents(self, delay: float) -> Array:
        """(n, NU) mean of the held currents in each interval, if they act ``delay`` [s] late, and of the other inputs as they are.

        When between two samples a current changed is not known (``timing``); the mean moves it by less than that, and spares
        the model a step at every stamp.
        """
        knots, integral = self._integral
        late = [delay if k < len(CURRENTS) else 0.0 for k in range(integral.shape[1])]
        at = np.stack([np.interp(self.grid - by, knots, y) for by, y in zip(late, integral.T, strict=True)], axis=-1)
        return np.asarray(np.diff(at, axis=0) / np.diff(self.grid)[:, None])

    @cached_property
    def _integral(self) -> tuple[Array, Array]:
        """When the held currents and other inputs change [s], and their integrals (m + 1, NU) there.

        Held before their first sample and behind their last, as long again as the recording: longer than any delay.
        """
        time, values, around = self.currents.time, self.currents.values, self.grid[-1] - self.grid[0]
        begin, end = min(self.grid[0], time[0]) - around, max(self.grid[-1], time[-1]) + around
        knots = np.concatenate([[begin], time[1:], [end]])
        return knots, np.vstack((np.zeros_like(values[:1]), np.cumsum(np.diff(knots)[:, None] * values, axis=0)))

    @cached_property
    def lacking(self) -> frozenset[str]:
        """Channels that were not measured."""
        return frozenset(name for name in OUTPUTS if not self.recording.signals[name].valid.any())

    def speed(self) -> tuple[Array, Flags]:
        """(n,) rate [rad/s], between its samples by lines, and where it was measured; by the angle where there is no gyro."""
        measured = self.samples().measured
        values = measured[:, OUTPUTS.index("angle" if "rate" in self.lacking else "rate")]
        known = np.isfinite(values)
        if not known.any():
            return np.zeros(len(values)), known
        along = np.interp(self.time, self.time[known], values[known])
        if "rate" in self.lacking:
            along = np.gradient(np.convolve(np.pad(along, SMOOTHED, mode="edge"), KERNEL, mode="valid"), PERIOD)
        return along, known

    def moving(self) -> Flags:
        """(n,) Whether the boom moves."""
        return np.asarray(np.abs(self.speed()[0]) > MOVING)

    @cached_property
    def angles(self) -> tuple[float, float]:
        """Least and largest angle measured [rad]."""
        angle = self.samples().measured[:, OUTPUTS.index("angle")]
        return float(np.nanmin(angle)), float(np.nanmax(angle))

    def left_out(self) -> list[str]:
        """Sentences that say how long is left out, and why."""
        why = (
            (self.cavitating, f"the oil of the head side evaporates (hose pressure below {EVAPORATES / 1e5:g} bar), the model ends "
             "there, and free runs start again behind it"),
            (self.ended, "the boom stands at an end of its range with the lever held on, and the model has no stop; free runs "
             "start again where it has left it"),
        )  # fmt: skip
        return [f"{PERIOD * float(flags.sum()):.1f} s are left out: {text}" for flags, text in why if flags.any()]

    def stuck(self) -> list[str]:
        """Sentences that say which sensor stood still, and when."""
        since = dict[str, float]()  # what jumps away again and again is said once
        for event in self.recording.events:
            if event.kind == "stuck":
                since.setdefault(event.detail, event.start_s)
        return [
            f"{said}, from {start:.1f} s: left out, look at the sensor and at the logger"
            for said, start in since.items()
        ]

    def strokes(self, machine: Machine) -> Array:
        """(n,) piston position [m] at the measured angle, between its samples by lines."""
        angle = self.samples().measured[:, OUTPUTS.index("angle")]
        known = np.isfinite(angle)
        across = np.linspace(angle[known].min(), angle[known].max(), ANGLES)
        positions = np.array([machine.piston_position(float(q)) for q in across])
        return np.asarray(np.interp(np.interp(self.time, self.time[known], angle[known]), across, positions))

    def pressure_shift(self, delay: float) -> tuple[int, ...]:
        """(NY,) by how many intervals the samples of each channel move if pressures arrive late by ``delay`` [s].

        Each pressure by its own: where samples come less often than intervals, they lie at other places in these.
        """
        return tuple(
            self._moved(name, delay) if is_pressure and delay and name not in self.lacking else 0
            for name, is_pressure in zip(OUTPUTS, PRESSURES, strict=True)
        )

    def _moved(self, name: str, delay: float) -> int:
        signal = self.recording.signals[name]
        time = signal.time[signal.valid]
        return int(np.median(self._numbered(time) - self._numbered(time - delay)))

    def initial_state(self, plant: Plant, parameters: Array) -> Array:
        """Rest state of the measured values, or one with valve and accumulators at rest where the boom moves."""
        if self.resting:
            s = self.start
            acting = self.currents.at(0.0)
            return plant.rest_state_measured(s["angle"], s["hose_pressure"], s["rod_pressure"], parameters, acting)
        return self.begun.get(plant, lambda: self._in_motion(plant))

    def _in_motion(self, plant: Plant) -> Array:
        start = self.start | ({"rate": float(np.mean(self.speed()[0][:FIRST]))} if "rate" in self.lacking else {})
        return stationary_guess(plant, start, self.currents.at(0.0))


def _origin(recording: Recording) -> float:
    """Where the intervals begin [s, up to 0]: behind the last of the samples that belong together.

    These then lie at the end of an interval, where a sample corrects the state; at its beginning it would correct it too late.
    """
    phases = []
    for signal in (recording.signals[name] for name in OUTPUTS):
        if signal.valid.any():
            turn = np.exp(2j * np.pi * signal.time[signal.valid] / PERIOD)
            phases.append(float(np.angle(np.mean(turn)) / (2 * np.pi) % 1.0))
    around = np.sort(np.array(phases))
    gaps = np.diff(np.append(around, around[0] + 1.0))
    return (float(around[int(np.argmax(gaps))]) % 1.0 - 1.0) * PERIOD


def visited(bags: Sequence[Bag]) -> tuple[float, float]:
    """Least and largest angle [rad] of all recordings."""
    least, largest = zip(*(bag.angles for bag in bags), strict=True)
    return min(least), max(largest)


def by_pose(bags: Sequence[Bag]) -> list[Bag]:
    """Recordings whose moments of mass are each pose's own, and whose loads are each load's own.

    Those of the first recording have the names of the components; of the k-th other pose or load ``OTHER_POSE`` and k follow.
    """
    poses, loads = list[object](), list[object]()
    result = []
    for bag in bags:
        c = bag.recording.configuration
        pose, load = (c.outer_boom_angle, c.telescope_length), bag.load_told
        for seen, own in ((poses, pose), (loads, load)):
            if own not in seen:
                seen.append(own)
        places = {f"pose.{name}": f"pose.{name}{_suffix(poses.index(pose))}" for name in MOMENTS}
        places["pose.load"] = f"pose.load{_suffix(loads.index(load))}"
        result.append(replace(bag, places=places))
    return result


def _suffix(k: int) -> str:
    return f"{OTHER_POSE}{k}" if k else ""


def prepare(recording: Recording, machine: Machine | None = None, *, aligned: bool = False) -> Bag | None:
    """The recording for the observer, without repeated samples; None where the angle or the currents have no valid sample.

    machine: whose bodies the other joints move; without it they are locked.

    Raises:
        MachineError: other joints move, and the machine file does not tell the bodies.
    """
    recording = without_repeats(recording)
    currents = held_currents(recording) if machine is None else held_inputs(recording, driven(machine, recording))
    signals = [recording.signals[name] for name in OUTPUTS]
    if len(currents.time) == 0 or not signals[OUTPUTS.index("angle")].valid.any():
        return None
    count = int(np.floor(recording.duration / PERIOD + 1e-9))
    grid = np.asarray((_origin(recording) if aligned else 0.0) + np.arange(count + 1) * PERIOD, dtype=np.float64)
    time = grid[:-1]
    counted = np.ones((count, len(OUTPUTS)), dtype=bool)
    counted[time < BEGINNING] = False
    gaps = np.flatnonzero(np.diff(currents.time) > currents.gap)
    for begin, end in zip(currents.time[gaps], currents.time[gaps + 1], strict=True):
        counted[(time >= begin) & (time < end + SETTLING)] = False
    counted[(time < currents.time[0]) | (time > currents.time[-1] + currents.gap)] = False
    rest = resting_start(recording, currents)
    start = rest or {n: _first(s) for n, s in zip(OUTPUTS, signals, strict=True)}
    if rest is None:
        counted[time < SETTLING] = False
    cavitating, ended = (
        _within(part, time) for part in (evaporating(recording), at_an_end(recording, machine) if machine else [])
    )
    counted[cavitating | ended] = False
    timing = hypot(TIMING_NOISE, currents.late * sqrt((currents.late / PERIOD + 1.0) / 12.0))
    bag = Bag(recording, currents, grid, counted, cavitating, ended, rest is not None, start, timing)
    counted &= np.isfinite(bag.samples().measured)
    return bag


def _first(signal: Signal) -> float:
    """What a channel shows first; NaN where it was not measured."""
    return float(np.mean(signal.values[signal.valid][:3])) if signal.valid.any() else float("nan")


def _within(stretches: list[tuple[float, float]], time: Array) -> Flags:
    """(n,) Whether an interval lies in one of the stretches [s], or up to ``SETTLING`` behind."""
    result = np.zeros(len(time), dtype=bool)
    for first, last in stretches:
        result[(time > first - PERIOD) & (time < last + SETTLING)] = True
    return result


def _intervals(time: Array) -> NDArray[np.int64]:
    """Interval of each sample: by its number, so that jitter about the grid neither doubles nor drops one."""
    if len(time) == 0:
        return np.zeros(0, dtype=np.int64)
    turn = np.exp(2j * np.pi * time / PERIOD)
    phase = float(np.angle(np.mean(turn)) / (2 * np.pi) % 1.0) * PERIOD
    return np.asarray(np.round((time - phase) / PERIOD), dtype=np.int64)
