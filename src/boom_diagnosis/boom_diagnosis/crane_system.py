"""A crane and its recordings as the estimation takes them (``boom_estimation.system``)."""

from __future__ import annotations

import ctypes
from collections.abc import Iterable, Sequence
from copy import copy
from dataclasses import replace
from functools import cached_property
from math import exp, inf, log

import numpy as np
from numpy.typing import NDArray

from boom_diagnosis.bag_samples import PERIOD, Bag
from boom_diagnosis.coordinates import Coordinate, coordinates, starts
from boom_diagnosis.disturbances import noise_model
from boom_diagnosis.nuisances import GEOMETRY, Nuisance, closed, tolerances
from boom_diagnosis.prediction import CURRENT_NOISE, NUDGED_TOLERANCE, TOLERANCE
from boom_estimation.currents import driven
from boom_estimation.free_run import plant_for
from boom_estimation.numbers import Number
from boom_estimation.recursion import threads
from boom_estimation.score_test import SearchedEffect
from boom_estimation.system import Pass, Tangent, Values
from boom_input.channels import PREDICTED
from boom_model.catalogue import CATALOGUE, EFFECTS, check_effects
from boom_model.codegen.compiled import LANES
from boom_model.compiled_model import pointer
from boom_model.learned import DISCREPANCY, DISCREPANCY_TIME
from boom_model.machine import Machine
from boom_model.observer import (
    STANDSTILL,
    Job,
    Observed,
    Samples,
    linearise,
    observe_all,
    observe_groups,
    observer_ranges,
    output_jacobian,
)
from boom_model.plant import Plant
from boom_model.sensors import OUTPUTS, PRESSURES

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

NUDGE = 1e-3
"""Of a state's usual size, for differences."""
ONSETS = 15
"""Times at which an effect that begins is tried."""


def _carrying(machine: Machine, stateful: Iterable[str]) -> Machine:
    """The machine with all effects that need no state but the time at their neutral values, and the states of ``stateful`` ones."""
    effects: dict[str, dict[str, float]] = {}
    for effect in CATALOGUE:
        if machine.structure.has(effect.needs) and (effect.light or effect.moving or effect.id in stateful):
            effects[effect.id] = effect.at_nothing(moving=effect.id in stateful)
    return replace(machine, effects=check_effects(effects) | {k: dict(v) for k, v in machine.effects.items()})


def tolerance_numbers(nuisances: Sequence[Nuisance]) -> tuple[Number, ...]:
    """The machine's own numbers, moved in standard deviations of their tolerance."""
    return tuple(Number(n.name, float, *n.limits) for n in nuisances)


def effect_numbers(effect: str) -> tuple[Number, ...]:
    """The numbers of an effect; flat over the range in which they are searched."""
    return tuple(_effect_number(c) for c in coordinates(EFFECTS[effect]))


def _effect_number(c: Coordinate) -> Number:
    return Number(
        c.name, exp if c.positive else float, c.inner(c.low) if c.low > 0 or not c.positive else log(1e-30), c.inner(c.high),
        inf, 0.0, c.step,
    )  # fmt: skip


class CraneModel:
    """One recording with the equations of some effects; ``boom_estimation.system.Model``."""

    memory = DISCREPANCY_TIME

    def __init__(self, machine: Machine, bag: Bag, stateful: Iterable[str]) -> None:
        self.machine, self.bag = machine, bag
        self._closed: dict[tuple[tuple[str, float], ...], dict[str, float]] = {}
        self.name = bag.name
        self.interval = PERIOD
        pose = plant_for(bag.recording, machine, "full").pose
        self.plant = Plant(_carrying(driven(machine, bag.recording), stateful), pose, "full", discrepancies=True)
        names = self.state_names = self.plant.state_names
        self.counted = np.asarray(bag.counted.any(axis=1))
        self.places = tuple(sorted(n.removeprefix(DISCREPANCY) for n in names if n.startswith(DISCREPANCY)))
        self.discrepancies = np.array([names.index(DISCREPANCY + place) for place in self.places], dtype=np.int64)
        self._noise = noise_model(self.plant, machine, self.plant.p, lacking=bag.lacking)
        self.variance = np.square(np.array(self._noise.outputs))
        self.spread = np.array([self._noise.initial.get(name, 0.0) for name in names])
        self._kept: dict[tuple[float, float], Samples] = {}

    def parameters(self, values: Values) -> Array:
        """Parameter vector of the plant; numbers with a tolerance are given in its standard deviations."""
        moved: dict[str, float] = {}
        p = self.plant.p.copy()
        for name, value in values.items():
            nuisance = self._nuisances.get(name)
            if nuisance is None:
                if name in self._index:
                    p[self._index[name]] = value
            elif value != 0.0:
                moved |= {n: nuisance.value(float(self.plant.p[self._index[n]]), value) for n in nuisance.components}
        for name, value in self._closing(moved).items():
            p[self._index[name]] = value
        return p

    def _closing(self, moved: dict[str, float]) -> dict[str, float]:
        """With what follows from them; the geometry is worth remembering."""
        key = tuple(item for item in sorted(moved.items()) if item[0].startswith(GEOMETRY))
        if key not in self._closed:
            if len(self._closed) > 512:
                self._closed.clear()
            self._closed[key] = closed(self.machine, dict(key))
        others = {name: value for name, value in moved.items() if not name.startswith(GEOMETRY)}
        return closed(self.machine, others) | self._closed[key]

    @cached_property
    def _nuisances(self) -> dict[str, Nuisance]:
        return {n.name: n for n in tolerances(self.machine, self.plant.pose) if not n.difference}

    @cached_property
    def _index(self) -> dict[str, int]:
        return {name: k for k, name in enumerate(self.plant.parameter_names)}

    def samples(self, p: Array) -> Samples:
        """The recording, as the delays among the parameters have it."""
        delays = self.plant.delays(p)
        if delays not in self._kept:
            if len(self._kept) > 8:
                self._kept.clear()
            self._kept[delays] = self.bag.samples(*delays)
        return self._kept[delays]

    def first_gain(self) -> Array:
        """Each measured state is pulled to its measurement."""
        names, n = self.plant.state_names, len(self.bag.grid) - 1
        gain = np.zeros((len(names), len(OUTPUTS)))
        for j, sensor in enumerate(PREDICTED):
            if sensor.name in names:
                gain[names.index(sensor.name), j] = 0.4 if sensor.is_pressure else 0.2
        gain[names.index("head_pressure"), OUTPUTS.index("hose_pressure")] = 0.3
        return np.broadcast_to(gain, (n, *gain.shape)).copy()

    def observe(self, values: Values, gain: Array, *, coarse: bool = False) -> Pass:
        """A pass of the compiled observer."""
        job = self._job(values, gain)
        return self._pass(job[1], observe_all([job], tolerance=NUDGED_TOLERANCE if coarse else TOLERANCE)[0])

    def beside(self, values: Values, others: Sequence[Values], gain: Array) -> list[tuple[Pass, Pass]]:
        """Passes of the compiled observer side by side, with the same steps of the integrator.

        A pressure that arrives later is predicted from the slope of the pass, y(t - T) = y(t) - T y'(t): shifted samples would
        differ by their noise.
        """
        base, width = self._job(values, gain), LANES - 1
        jobs, later = [], []
        for other in others:
            p = self.parameters(other)
            later.append(self.plant.delays(p)[1] - self.plant.delays(base[4])[1])
            p[self._pressure_delays] = base[4][self._pressure_delays]
            jobs.append((self.plant, self.samples(p), self.bag.initial_state(self.plant, p), gain, p))
        groups = [[base, *jobs[k : k + width]] for k in range(0, len(jobs), width)]
        found = []
        for group, seen in zip(groups, observe_groups(groups, tolerance=TOLERANCE), strict=True):
            first, *rest = (self._pass(job[1], o) for job, o in zip(group, seen, strict=True))
            found += [(first, other) for other in rest]
        return [
            (first, self._later(first, other, time, base[4])) if time else (first, other)
            for (first, other), time in zip(found, later, strict=True)
        ]  # fmt: skip

    def _later(self, first: Pass, other: Pass, time: float, p: Array) -> Pass:
        y = first.states @ output_jacobian(self.plant, first.states[0], p).T
        slope = np.where(PRESSURES, np.gradient(y, PERIOD, axis=0), 0.0)
        return replace(other, beside=time * slope)

    @cached_property
    def _pressure_delays(self) -> list[int]:
        names = [f"effects.{e.id}.{e.parameters[0].name}" for e in CATALOGUE if e.delays == "pressures"]
        return [self._index[name] for name in names if name in self._index]

    def _job(self, values: Values, gain: Array) -> Job:
        p = self.parameters(values)
        return self.plant, self.samples(p), self.bag.initial_state(self.plant, p), gain, p

    def _pass(self, samples: Samples, observed: Observed) -> Pass:
        valid = np.isfinite(samples.measured)
        states = observed.states
        bad = ~np.isfinite(states).all(axis=1)
        if bad.any():
            first = max(int(np.argmax(bad)), 1)
            states = states.copy()
            states[first:] = states[first - 1]
        innovations = np.where(valid, np.nan_to_num(observed.innovations), 0.0)
        return Pass(
            np.ascontiguousarray(states), np.ascontiguousarray(innovations), valid, samples.share, observed.complete
        )

    def tangent(self, values: Values, along: Pass) -> Tangent:
        """The equations linearised, the currents' noise, and white noise on torque and flows as a healthy machine has it."""
        p = self.parameters(values)
        samples = self.samples(p)
        held, names = samples.held, self.plant.state_names
        f0, jacobian = linearise(self.plant, along.states, held, p)
        columns, delta = [], 1e-3
        for j in range(2):
            shifted = held.copy()
            shifted[:, j] += delta
            change = np.abs(np.gradient(held[:, j])) * self.bag.timing / PERIOD
            columns.append(
                (self._rates(along.states, shifted, p) - f0) / delta * np.hypot(CURRENT_NOISE, change)[:, None]
            )
        noise = noise_model(self.plant, self.machine, p)
        density = np.array([noise.disturbance.get(name, 0.0) ** 2 for name in names])
        resting = np.array([noise.resting.get(name, 0.0) ** 2 for name in names])
        still = np.abs(along.states[:, names.index("rate")]) < STANDSTILL
        return Tangent(
            jacobian, np.stack(columns, axis=-1), density[None] + still[:, None] * resting[None],
            output_jacobian(self.plant, along.states[0], p),
        )  # fmt: skip

    def transitions(self, values: Values, along: Pass) -> Array:
        """Differences of predictions over each interval, side by side."""
        p = self.parameters(values)
        samples, (n, nx) = self.samples(p), along.states.shape
        numbers = np.ascontiguousarray(np.repeat(p[:, None], LANES, axis=1))
        currents = np.ascontiguousarray(np.repeat(samples.currents[:, :, None], LANES, axis=2))
        result, nudge = np.empty((n, nx, nx)), NUDGE * self.plant.scale
        minimum, maximum = self._ranges
        library = self.plant.abreast

        def part(first: int) -> None:
            own = range(first, min(first + LANES - 1, nx))
            move = np.zeros((nx, LANES))
            for lane, j in enumerate(own, 1):
                move[j, lane] = nudge[j]
            end, y = np.empty((n, nx, LANES)), np.empty((2, n, len(OUTPUTS), LANES))
            failed = library.boom_intervals(
                pointer(numbers), pointer(along.states), pointer(move), pointer(samples.grid), ctypes.c_long(n),
                pointer(samples.input_time), pointer(currents), ctypes.c_long(len(samples.input_time)),
                ctypes.c_double(TOLERANCE), ctypes.c_int(3), pointer(self.plant.scale), pointer(minimum), pointer(maximum),
                ctypes.c_double(1e-4), pointer(end), pointer(y[0]), pointer(y[1]),
            )  # fmt: skip
            if failed:
                raise FloatingPointError(f"{self.name}: the model cannot be run with these numbers")
            for lane, j in enumerate(own, 1):
                result[:, :, j] = (end[:, :, lane] - end[:, :, 0]) / nudge[j]

        list(threads().map(part, range(0, nx, LANES - 1)))
        return result

    @cached_property
    def _ranges(self) -> tuple[Array, Array]:
        return observer_ranges(self.plant)

    def _rates(self, states: Array, held: Array, p: Array) -> Array:
        """x' (n, NX) along states (n, NX)."""
        return linearise(self.plant, states, held, p)[0]


class CraneSystem:
    """A machine and its recordings; ``boom_estimation.system.System``."""

    def __init__(self, machine: Machine, bags: Sequence[Bag]) -> None:
        self.machine, self.bags = machine, tuple(bags)
        self.experiments = tuple(bag.name for bag in bags)
        self._models: dict[frozenset[str], list[CraneModel]] = {}
        self._chosen: tuple[Flags, ...] = ()
        self.places = self.models(())[0].places

    def models(self, effects: Sequence[str]) -> list[CraneModel]:
        """One for each recording. Effects without states are there always, at their neutral values."""
        stateful = frozenset(e for e in effects if EFFECTS[e].moving or not EFFECTS[e].light)
        if stateful not in self._models:
            made = [CraneModel(self.machine, bag, stateful) for bag in self.bags]
            for model, chosen in zip(made, self._chosen, strict=False):
                model.counted = model.counted & chosen[: len(model.counted)].any(axis=1)
            self._models[stateful] = made
        return self._models[stateful]

    def counting(self, chosen: Sequence[Flags]) -> CraneSystem:
        """The same of which only some samples tell; chosen: (n, NY) for each recording."""
        other = copy(self)
        other._chosen, other._models = tuple(chosen), {}
        return other

    @cached_property
    def nuisances(self) -> tuple[Nuisance, ...]:
        """Numbers of the machine that have a tolerance."""
        return tuple(n for n in tolerances(self.machine, self.models(())[0].plant.pose) if not n.difference)


def catalogue_effects(machine: Machine, duration: float, log_odds: float) -> tuple[SearchedEffect, ...]:
    """The catalogue's effects that a machine can have and does not have yet; ``duration`` of the longest recording [s]."""
    return tuple(
        _search_effect(effect.id, duration, log_odds) for effect in CATALOGUE
        if machine.structure.has(effect.needs) and effect.id not in machine.effects and not effect.foreign
    )  # fmt: skip


def _search_effect(effect: str, duration: float, log_odds: float) -> SearchedEffect:
    entry = EFFECTS[effect]
    points = starts(entry, duration)
    prefix = f"effects.{effect}."
    if entry.onset:
        times = np.linspace(0.0, duration, ONSETS + 2)[1:-1]
        points = [{**points[0], prefix + entry.onset: float(t)} for t in times]
    ranges = {n.name: (n.value(n.low), n.value(n.high)) for n in effect_numbers(effect)}
    points += [
        {**point, prefix + row.name: min(max(row.neutral**2 / point[prefix + row.name], ranges[prefix + row.name][0]),
                                         ranges[prefix + row.name][1])}
        for point in list(points) for row in entry.leading
        if row.positive and row.neutral > 0.0  # a factor may be larger or smaller
    ]  # fmt: skip
    neutral = {prefix + row.name: row.neutral for row in entry.parameters}
    leading = tuple(prefix + row.name for row in entry.leading)
    return SearchedEffect(
        effect,
        effect_numbers(effect),
        tuple(points),
        neutral,
        leading,
        EFFECTS[effect].light and not EFFECTS[effect].moving,
        entry.subsystem != "sensors",
        log_odds,
    )
