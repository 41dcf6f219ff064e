"""One-step predictions of many hypotheses for several recordings, whitened: what all decisions rest on.

The plant of a recording carries every effect without states, at its neutral value, so that one compiled model serves
nearly all hypotheses; effects that bring states are added when a hypothesis asks for them.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from threading import RLock

import numpy as np
from numpy.typing import NDArray

from boom_diagnosis.bag_samples import OTHER_POSE, Bag
from boom_diagnosis.directions import directions
from boom_diagnosis.disturbances import Values, noise_model
from boom_diagnosis.nuisances import CLOCKS, clocks_in
from boom_estimation.free_run import plant_for
from boom_input.channels import PREDICTED
from boom_model.catalogue import CATALOGUE, EFFECTS, check_effects
from boom_model.codegen.compiled import LANES
from boom_model.machine import Machine
from boom_model.observer import (
    Job,
    KalmanGains,
    Linearised,
    Observed,
    Samples,
    kalman,
    linearised,
    observe,
    observe_all,
    observe_groups,
)
from boom_model.plant import Plant
from boom_model.sensitivities import sensitivities_of
from boom_model.sensors import OUTPUTS

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

LARGEST = 50.0
"""Standard deviations. A whitened innovation counts as no more; a run that failed counts as that from there on."""
CLEARLY = 8.0
"""Standard deviations from which on it does not matter how far an innovation is off, where a mismatch is looked for in time."""
TOLERANCE = 2e-5
"""Of the integrator. Far from the model derivatives by differences are then good to 0.6 % in the median and 2 % in nine of ten; at
1e-4, a fifth faster, to 10 % and 50 %, and searches end in the wrong place."""
NUDGED_TOLERANCE = 1e-3
"""The same along the trajectory that gains are computed for. At 1e-2, a sixth of the time, the gains are others: a poppet that lags
90 ms (docs/diagnosis.md, lag_a) is found at 68 instead of 73."""
CURRENT_NOISE = 0.85e-3
"""A. Noise and quantisation of the measured currents, which drive the model."""
_BUILDING = RLock()
"""Threads that want the same plant get the same one: passes are joined by what it is, not by what it is like."""


def carrying(machine: Machine, stateful: Iterable[str] = ()) -> Machine:
    """The machine with all effects that need no state at their neutral values, and with the states of ``stateful`` ones."""
    effects: dict[str, dict[str, float]] = {}
    for effect in CATALOGUE:
        if machine.structure.has(effect.needs) and (not effect.stateful(()) or effect.id in stateful):
            effects[effect.id] = effect.at_nothing(moving=effect.id in stateful)
    return replace(machine, effects=check_effects(effects) | {k: dict(v) for k, v in machine.effects.items()})


@dataclass(frozen=True)
class Prediction:
    """Whitened innovations (n, NY) of a hypothesis for one recording, and the states (n, NX) it assumed."""

    whitened: Array
    states: Array


class Predictor:
    """Observers for several recordings of one machine, whose gains stay fixed.

    machine: as given, without what is found. tuned: numbers (effects included) at which the gains are computed.
    looseness: factor of the assumed disturbances. boost: state -> further factor of the disturbance of its derivative.
    """

    def __init__(
        self,
        machine: Machine,
        bags: Sequence[Bag],
        tuned: Values | None = None,
        looseness: float = 1.0,
        boost: Mapping[str, float] | None = None,
    ) -> None:
        self.machine = machine
        self.boost = dict(boost or {})
        self.looseness = looseness
        self.bags = tuple(bags)
        self.tuned = dict(tuned or {})
        self._samples = [lru_cache(maxsize=32)(bag.samples) for bag in self.bags]
        self.base: list[Plant] = [self.plant(i, ()) for i in range(len(self.bags))]
        self._given: list[KalmanGains] | None = None
        self._gain: dict[tuple[int, tuple[str, ...], tuple[int, ...]], Array] = {}
        self._filling = RLock()

    @property
    def gains(self) -> list[KalmanGains]:
        """Of every recording, computed when first needed."""
        with self._filling:
            if self._given is None:
                plants = [self.plant(i, with_states(self.tuned)) for i in range(len(self.bags))]
                self._given = [self._gains(i, plant, self.tuned) for i, plant in enumerate(plants)]
            return self._given

    def plant(self, bag: int, stateful: Iterable[str]) -> Plant:
        """The plant of a recording that carries these effects with states, too."""
        wanted, built = frozenset(stateful) - frozenset(self.machine.effects), self.bags[bag].plants
        with _BUILDING:
            for machine, effects, plant in built:
                if machine is self.machine and effects == wanted:
                    return plant
            plant = plant_for(self.bags[bag].recording, carrying(self.machine, wanted), "full")
            built.append((self.machine, wanted, plant))
            return plant

    def parameters(self, i: int, plant: Plant, values: Values) -> Array:
        """Parameter vector of recording ``i`` with these values."""
        p = plant.p.copy()
        for name, value in self.bags[i].own_values(values).items():
            if name.startswith(CLOCKS):
                continue
            p[plant.parameter_names.index(name)] = value
        return p

    def predict(self, hypotheses: Sequence[Values]) -> list[list[Prediction]]:
        """For each hypothesis (values of parameters), the prediction of every recording."""
        jobs = [self.job(i, values) for values in hypotheses for i in range(len(self.bags))]
        observed = observe_all(jobs, tolerance=TOLERANCE)
        rows = [
            self._prediction(k % len(self.bags), job, o) for k, (job, o) in enumerate(zip(jobs, observed, strict=True))
        ]
        return [rows[k : k + len(self.bags)] for k in range(0, len(rows), len(self.bags))]

    def changes(self, base: Values, moved: Sequence[Values]) -> list[list[Array]]:
        """For each of ``moved`` the change (n, NY) of the whitened innovations against ``base``, of every recording.

        Each is predicted together with ``base``, with the same steps of the integrator, so that small changes are not lost in
        its errors; one that moves a pressure's samples to other intervals, and with them the gains, alone.
        """
        width = LANES - 1
        parts = [moved[k : k + width] for k in range(0, len(moved), width)]
        groups = [[self.job(i, v) for v in (base, *part)] for part in parts for i in range(len(self.bags))]
        observed = observe_groups(groups, tolerance=TOLERANCE)
        result: list[list[Array]] = [[] for _ in moved]
        for k, (group, seen) in enumerate(zip(groups, observed, strict=True)):
            part, i = divmod(k, len(self.bags))
            first, *others = (self._prediction(i, job, o).whitened for job, o in zip(group, seen, strict=True))
            for j, w in enumerate(others):
                result[part * width + j].append(w - first)
        return result

    def derivatives(self, base: Values, moved: Sequence[Values], step: float) -> list[Array] | None:
        """(n, NY, M) of every recording: the derivatives of the whitened innovations towards each of ``moved``, ``step`` away.

        By the sensitivities of the model. None where the run fails.
        """
        wanted = []
        for i, bag in enumerate(self.bags):
            job = self.job(i, base)
            numbers = [self.parameters(i, job[0], values) for values in moved]
            clocks = [clocks_in(values) for values in (base, *moved)]
            wanted.append((job, directions(bag, job, numbers, clocks, step)))
        result = []
        for i, (observed, changes) in enumerate(sensitivities_of(wanted, tolerance=TOLERANCE)):
            if not (observed.complete and np.isfinite(changes).all()):
                return None
            w, late = self._prediction(i, wanted[i][0], observed).whitened, self._late(i, wanted[i][0])
            turned = np.einsum("nij,njm->nim", self.gains[i].whitening, _back(changes, late))
            turned[~self.bags[i].counted | (np.abs(w) >= LARGEST)] = 0.0
            result.append(turned)
        return result

    def _late(self, i: int, job: Job) -> tuple[int, ...]:
        """(NY,) intervals by which the samples of recording ``i`` arrive late in a pass."""
        plant, _, _, _, p = job
        return self.bags[i].pressure_shift(plant.delays(p)[1])

    def _prediction(self, i: int, job: Job, observed: Observed) -> Prediction:
        return Prediction(_whiten(observed, self.gains[i], self.bags[i], self._late(i, job)), observed.states)

    def job(self, i: int, values: Values) -> Job:
        """The observer's pass over recording ``i`` with these values."""
        plant = self.plant(i, with_states(values))
        p = self.parameters(i, plant, values)
        samples = self.samples(i, plant, p, clocks_in(values))
        late = self.bags[i].pressure_shift(plant.delays(p)[1])
        with self._filling:
            if (i, plant.state_names, late) not in self._gain:
                self._gain[i, plant.state_names, late] = _moved(self._gain_for(i, plant), late)
            gain = self._gain[i, plant.state_names, late]
        return plant, samples, self.bags[i].initial_state(plant, p), gain, p

    def noise(self) -> tuple[float, ...]:
        """Standard deviations of the measured channels that the observer assumes [SI]."""
        return noise_model(self.base[0], self.machine, self.base[0].p).outputs

    def samples(self, i: int, plant: Plant, p: Array, clocks: tuple[float, ...]) -> Samples:
        """The recording as this hypothesis' delays, and the clocks of its channels, have it."""
        with self._filling:
            return self._samples[i](*plant.delays(p), clocks)

    def _as_stamped(self, i: int, plant: Plant, p: Array) -> Samples:
        """The same with pressures in the intervals of their stamps, where gains are those of a channel that was measured."""
        with self._filling:
            return self._samples[i](plant.delays(p)[0])

    def _gain_for(self, i: int, plant: Plant) -> Array:
        """Of a plant with other states: as they are, and what is new is not corrected, but for what would be lost without."""
        base = self.plant(i, with_states(self.tuned))
        if not any(state.corrected for state in plant.equations.states if state.name not in base.state_names):
            return _for(plant, base, self.gains[i].gain)
        own = {name.partition(OTHER_POSE)[0] for name in self.tuned} & {*plant.parameter_names}
        known = {name: value for name, value in self.tuned.items() if name.partition(OTHER_POSE)[0] in own}
        return self._gains(i, plant, known | _at_first(plant)).gain

    def _gains(self, i: int, plant: Plant, values: Values) -> KalmanGains:
        p = self.parameters(i, plant, values)
        noise = noise_model(plant, self.machine, p, self.looseness, self.boost, self.bags[i].lacking)
        key = (plant, p.tobytes(), self.looseness, *sorted(self.boost.items()))
        return self.bags[i].gains.get(
            key, lambda: kalman(plant, self._as_stamped(i, plant, p), self._along(i, plant, p), noise)
        )

    def _along(self, i: int, plant: Plant, p: Array) -> Linearised:
        """The plant along the trajectory of a recording, however loose an observer is."""
        bag = self.bags[i]

        def made() -> Linearised:
            samples, nudging = self._as_stamped(i, plant, p), _nudging(plant, len(bag.grid) - 1)
            x0 = bag.initial_state(plant, p)
            states = observe(plant, samples, x0, nudging, parameters=p, tolerance=NUDGED_TOLERANCE).states
            return linearised(plant, samples, _filled(states), CURRENT_NOISE, bag.timing, p)

        return bag.trajectories.get((plant, p.tobytes()), made)


def with_states(values: Values) -> frozenset[str]:
    """Effects with states among the values."""
    named = dict[str, list[str]]()
    for _, effect, number in (name.split(".") for name in values if name.startswith("effects.")):
        named.setdefault(effect, []).append(number)
    return frozenset(effect for effect, numbers in named.items() if EFFECTS[effect].stateful(numbers))


def _at_first(plant: Plant) -> dict[str, float]:
    """Numbers of the plant's effects of which nothing is known yet, for the gains of an observer."""
    rows = ((effect, row) for effect in plant.equations.effects for row in EFFECTS[effect].parameters)
    return {f"effects.{effect}.{row.name}": row.gains for effect, row in rows if row.gains is not None}


def _nudging(plant: Plant, n: int) -> Array:
    """Gains that follow any machine: each measured state is pulled to its measurement."""
    names = plant.state_names
    gain = np.zeros((len(names), len(OUTPUTS)))
    for j, sensor in enumerate(PREDICTED):
        if sensor.name in names:
            gain[names.index(sensor.name), j] = 0.4 if sensor.is_pressure else 0.2
    gain[names.index("head_pressure"), OUTPUTS.index("hose_pressure")] = 0.3
    return np.broadcast_to(gain, (n, *gain.shape)).copy()


def _filled(states: Array) -> Array:
    """States with the last known one behind a failure."""
    bad = ~np.isfinite(states).all(axis=1)
    if not bad.any():
        return states
    first = int(np.argmax(bad))
    filled = states.copy()
    filled[first:] = states[max(first - 1, 0)]
    return np.nan_to_num(filled)


def mean_squares(parts: Sequence[Array], counted: Sequence[Flags]) -> Array:
    """(NY,) of the whitened innovations (n, NY) that count; 1, as of white noise, where none does."""
    squares = np.sum([np.sum(w**2, axis=0, where=s) for w, s in zip(parts, counted, strict=True)], axis=0)
    count = np.sum([s.sum(axis=0) for s in counted], axis=0)
    return np.where(count > 0, squares / np.maximum(count, 1), 1.0)


def beyond(parts: Array, counted: Flags, healthy: Array) -> Array:
    """(n,) loss [nats] of the whitened innovations (n, NY) that count over that of a healthy machine with these mean squares."""
    return np.asarray(0.5 * np.sum(_squares(parts) - healthy, axis=1, where=counted))


def gained(before: Sequence[Array], after: Sequence[Array]) -> list[Array]:
    """(n,) per recording: by how much the loss of each interval falls [nats]."""
    return [0.5 * np.sum(_squares(b) - _squares(a), axis=1) for b, a in zip(before, after, strict=True)]


def _squares(whitened: Array) -> Array:
    return np.asarray(np.minimum(np.abs(whitened), CLEARLY) ** 2)


def _for(plant: Plant, base: Plant, gain: Array) -> Array:
    """Gains of a plant with other states than those of ``base``: what ``base`` does not have is not corrected."""
    if plant.state_names == base.state_names:
        return gain
    result = np.zeros((len(gain), len(plant.state_names), len(OUTPUTS)))
    for i, name in enumerate(plant.state_names):
        if name in base.state_names:
            result[:, i] = gain[:, base.state_names.index(name)]
    return result


def _moved(gain: Array, late: Sequence[int]) -> Array:
    """Gains (n, NX, NY) with those of channels that arrive ``late`` intervals in the intervals that they tell of."""
    moved = gain.copy() if any(late) else gain
    for j, shift in enumerate(late):
        if shift:
            moved[:-shift, :, j] = gain[shift:, :, j]
    return moved


def _back(e: Array, late: Sequence[int]) -> Array:
    """What tells of pressures that arrive ``late`` intervals, (n, NY) or (n, NY, M), in the interval of their stamp."""
    for j, shift in enumerate(late):
        if shift:
            e[shift:, j] = e[:-shift, j].copy()
    return e


def _whiten(observed: Observed, gains: KalmanGains, bag: Bag, late: Sequence[int]) -> Array:
    """Whitened innovations; those of pressures that arrive ``late`` intervals go back to the interval of their stamp."""
    e = _back(np.where(np.isfinite(observed.innovations), observed.innovations, 0.0), late)
    w: Array = np.einsum("nij,nj->ni", gains.whitening, e)
    if not observed.complete:
        failed = ~np.isfinite(observed.states).all(axis=1)
        w[failed] = LARGEST
    w[~bag.counted] = 0.0
    return np.clip(w, -LARGEST, LARGEST)
