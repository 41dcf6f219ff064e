"""An observer: the model predicts from sample to sample and is corrected by what was measured.

x_k+1 = F(x_k, u, p) + K_k e_k, e_k = y_k - h(x, p): the innovation. With fixed gains K_k, e is a smooth function of the
parameters p, and its derivatives show what a change of p would explain (prediction-error method). Errors do not accumulate
as in a free run. The gains come from the extended Kalman filter along a trajectory (:func:`kalman`).
"""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from boom_model.codegen.compiled import LANES
from boom_model.compiled_model import pointer
from boom_model.cores import usable_cores
from boom_model.errors import SimulationError
from boom_model.plant import Plant
from boom_model.sensors import OUTPUTS

Array = NDArray[np.float64]

BEYOND_STOPS = 0.02
"""rad. How far beyond the machine's stops the observer's angle may go before it is held: a model
without cushions predicts that a boom at its stops continues."""
WORTH_JOINING = 2
"""Number of passes from which they run side by side."""
STANDSTILL = 0.05
"""rad/s. Below this the flow is so small that a part at rest may be at any position."""


@dataclass(frozen=True)
class Samples:
    """A recording cut into intervals.

    Attributes:
        grid: (n + 1,) [s], between which the model predicts.
        share: (n, NY) when in the interval a channel was sampled, 0 = beginning .. 1 = end.
        measured: (n, NY) [SI], NaN where it was not.
        input_time: (m,) [s], from when each current acts. currents: (m, 2) [A].
    """

    grid: Array
    share: Array
    measured: Array
    input_time: Array
    currents: Array

    @property
    def held(self) -> Array:
        """(n, 2) currents [A] that act at the beginning of each interval."""
        return self.currents[np.maximum(np.searchsorted(self.input_time, self.grid[:-1], side="right") - 1, 0)]


@dataclass(frozen=True)
class Observed:
    """Innovations (n, NY) [SI], NaN where nothing was measured or the run failed; states (n, NX) at interval starts."""

    innovations: Array
    states: Array
    complete: bool


@dataclass(frozen=True)
class KalmanGains:
    """Kalman gains (n, NX, NY) and W (n, NY, NY): W e has unit variance if the noise is as assumed."""

    gain: Array
    whitening: Array


@dataclass(frozen=True)
class NoiseModel:
    """Noise that the filter assumes.

    Attributes:
        outputs: (NY,) standard deviation of the measured channels [SI].
        disturbance: state name -> intensity of white noise on its derivative [unit/s * sqrt(s)].
        resting: the same, added while the boom stands still, when the state of parts without flow is unknown.
        initial: state name -> uncertainty of the initial state.
        joined: state name -> intensity, with its sign, of one white noise that acts on the derivatives of several states at once.
    """

    outputs: tuple[float, ...]
    disturbance: dict[str, float]
    initial: dict[str, float]
    resting: dict[str, float] = field(default_factory=dict)
    joined: dict[str, float] = field(default_factory=dict)


def observe(
    plant: Plant,
    samples: Samples,
    initial_state: Array,
    gain: Array,
    *,
    parameters: Array | None = None,
    tolerance: float = 1e-5,
) -> Observed:
    """One pass of the observer over ``samples`` with given gains (n, NX, NY)."""
    n, nx = len(samples.grid) - 1, len(plant.state_names)
    x = np.array(initial_state, dtype=float)
    plant.set_time(x, samples.grid[0])
    p = plant.p if parameters is None else np.ascontiguousarray(parameters, dtype=float)
    innovations, states, report = np.full((n, len(OUTPUTS)), np.nan), np.full((n, nx), np.nan), np.zeros(8)
    g = np.ascontiguousarray(gain)
    plant._library.boom_observe(
        *arguments(plant, samples, p, x, sampled(samples), g, innovations, states, tolerance, report)
    )
    return Observed(innovations, states, int(report[0]) == 0)


Job = tuple[Plant, Samples, Array, Array, Array]
"""Plant, samples, initial state, gain, parameters of one pass."""


def observe_all(jobs: Sequence[Job], *, tolerance: float = 1e-5, workers: int | None = None) -> list[Observed]:
    """Many passes on all cores, in the order of the jobs; those of the same plant, intervals and gains side by side."""
    alike: dict[tuple[int, int, int], list[int]] = {}
    for k, (plant, samples, _, gain, _) in enumerate(jobs):
        alike.setdefault((id(plant), id(samples.grid), id(gain)), []).append(k)
    groups = [found[i : i + LANES] for found in alike.values() for i in range(0, len(found), LANES)]
    observed = observe_groups([[jobs[k] for k in group] for group in groups], tolerance=tolerance, workers=workers)
    order = {k: o for group, row in zip(groups, observed, strict=True) for k, o in zip(group, row, strict=True)}
    return [order[k] for k in range(len(jobs))]


def observe_groups(
    groups: Sequence[Sequence[Job]], *, tolerance: float = 1e-5, workers: int | None = None
) -> list[list[Observed]]:
    """Groups of up to ``LANES`` passes on all cores. Passes of a group share the integrator's steps, if they can.

    They then differ smoothly with their parameters, and their differences are good derivatives. Passes with another plant,
    other intervals or other gains than the first of their group run alone; all passes of a group do if one fails. When in an
    interval a channel was sampled and a current changed is each pass' own.
    """
    for group in groups:
        if len(group) >= WORTH_JOINING:
            compile_abreast(group[0][0])  # here, once, and not in every thread
    return list(pool(workers or usable_cores()).map(lambda group: _together(group, tolerance), groups))


def compile_abreast(plant: Plant) -> None:
    """Compile the code for passes side by side, if not done yet."""
    if _joins(plant):
        _ = plant.abreast


def _joins(plant: Plant) -> bool:
    """False for a term learnt from data: it is compiled for one recording, which is not worth another compilation."""
    return not plant.machine.learned


def _alike(group: Sequence[Job]) -> list[int]:
    """Members of a group that can run side by side with its first."""
    plant, samples, _, gain, _ = group[0]
    if not _joins(plant):
        return []
    return [k for k, (p, s, _, g, _) in enumerate(group) if p is plant and g is gain and _at_same_times(s, samples)]


def _at_same_times(one: Samples, other: Samples) -> bool:
    """Whether two cuts of a recording have the same intervals, and inputs that change together."""
    return one is other or (one.grid is other.grid and np.array_equal(one.input_time, other.input_time))


def _together(group: Sequence[Job], tolerance: float) -> list[Observed]:
    joined = _alike(group)[:LANES]
    seen = _side_by_side([group[k] for k in joined], tolerance) if len(joined) >= WORTH_JOINING else None
    found = dict(zip(joined, seen, strict=True)) if seen else {}
    return [
        found[k] if k in found else observe(p, s, x, g, parameters=q, tolerance=tolerance)
        for k, (p, s, x, g, q) in enumerate(group)
    ]


def _side_by_side(group: Sequence[Job], tolerance: float) -> list[Observed] | None:
    """The passes of a group in one, with copies of the last one up to ``LANES``; None if one fails."""
    plant, samples, _, gain, _ = group[0]
    n, nx = len(samples.grid) - 1, len(plant.state_names)
    lanes = [group[min(i, len(group) - 1)] for i in range(LANES)]
    x = np.stack([job[2] for job in lanes], axis=-1)
    plant.set_time(x, samples.grid[0])
    p = np.stack([job[4] for job in lanes], axis=-1)
    own = [np.stack(arrays, axis=-1) for arrays in zip(*(sampled(job[1]) for job in lanes), strict=True)]
    innovations, states = np.full((n, len(OUTPUTS), LANES), np.nan), np.empty((n, nx, LANES))
    report = np.zeros(8)
    plant.abreast.boom_observe(*arguments(plant, samples, p, x, own, gain, innovations, states, tolerance, report))
    if int(report[0]) != 0:
        return None
    return [Observed(innovations[..., i], states[..., i], True) for i in range(len(group))]


def observer_ranges(plant: Plant) -> tuple[Array, Array]:
    """Limits (NX,) at which an observer holds the states."""
    minimum, maximum = plant.lowest(), plant.maximum.copy()
    minimum[0], maximum[0] = minimum[0] - BEYOND_STOPS, maximum[0] + BEYOND_STOPS
    return minimum, maximum


def sampled(samples: Samples) -> tuple[Array, Array, Array]:
    """What passes side by side may have each for itself: currents, and when and what was measured."""
    return samples.currents, samples.share, samples.measured


def arguments(
    plant: Plant, samples: Samples, p: Array, x: Array, sampled: Sequence[Array], gain: Array, innovations: Array,
    states: Array, tolerance: float, report: Array,
) -> tuple[Any, ...]:  # fmt: skip
    """Arguments of ``boom_observe``; the arrays must live as long as its call."""
    minimum, maximum = observer_ranges(plant)
    currents, share, measured = sampled
    return (
        pointer(p), pointer(x), pointer(samples.grid), ctypes.c_long(len(samples.grid) - 1),
        pointer(samples.input_time), pointer(currents), ctypes.c_long(len(samples.input_time)),
        pointer(share), pointer(measured), pointer(gain), pointer(innovations), pointer(states),
        ctypes.c_double(tolerance), ctypes.c_int(3), pointer(plant.scale), pointer(minimum),
        pointer(maximum), ctypes.c_double(1e-4), pointer(report),
    )  # fmt: skip


@lru_cache(maxsize=4)
def pool(workers: int) -> ThreadPoolExecutor:
    """Persistent threads: starting them would cost as much as a short pass."""
    return ThreadPoolExecutor(workers)


def linearise(plant: Plant, states: Array, currents: Array, parameters: Array | None = None) -> tuple[Array, Array]:
    """X' (n, NX) and J = dx'/dx (n, NX, NX) along states (n, NX) with currents (n, 2)."""
    x, u = np.ascontiguousarray(states, dtype=float), np.ascontiguousarray(currents, dtype=float)
    n, nx = x.shape
    p = plant.p if parameters is None else np.ascontiguousarray(parameters, dtype=float)
    f, jacobian = np.empty((n, nx)), np.empty((n, nx, nx))
    plant._library.boom_derivatives(pointer(p), pointer(x), pointer(u), ctypes.c_long(n), pointer(f), pointer(jacobian))
    return f, jacobian


def transitions(jacobian: Array, step: Array) -> Array:
    """Exp(J h) for stacks J (n, NX, NX), h (n,): squared Pade (1, 2), L-stable as the stiff pressures need."""
    eye = np.eye(jacobian.shape[-1])
    z = jacobian * (step[:, None, None] / 2.0)
    half = np.linalg.solve(eye - z * (2.0 / 3.0) + z @ z / 6.0, eye + z / 3.0)
    return np.asarray(half @ half)


@dataclass(frozen=True)
class Linearised:
    """A plant linearised along its states, for the gains of observers with different process noise scales.

    Attributes:
        middle, transition: (n, NX, NX) of half an interval and of the whole.
        drive: (n, NX, NX) covariance that the noise of the currents adds in an interval.
        still: (n,) whether the boom stands. output: (NY, NX) dy/dx.
    """

    middle: Array
    transition: Array
    drive: Array
    still: NDArray[np.bool_]
    output: Array


def linearised(
    plant: Plant, samples: Samples, states: Array, currents: float, timing: float, parameters: Array | None = None
) -> Linearised:
    """The plant along ``states`` (n, NX); ``currents`` [A] and ``timing`` [s]: noise of the currents, and of when one changes."""
    held, step = samples.held, np.diff(samples.grid)
    f0, jacobian = linearise(plant, states, held, parameters)
    middle = transitions(jacobian, step / 2)
    # noise of the held currents acts over the whole interval, through the derivative's sensitivity to them
    delta = 1e-3
    columns = []
    for j in range(2):
        shifted = held.copy()
        shifted[:, j] += delta
        f1, _ = linearise(plant, states, shifted, parameters)
        change = np.abs(np.gradient(held[:, j])) * timing / step
        columns.append((f1 - f0) / delta * (np.hypot(currents, change) * step)[:, None])
    drive = middle @ np.stack(columns, axis=-1)
    still = np.abs(states[: len(step), plant.state_names.index("rate")]) < STANDSTILL
    return Linearised(
        middle, middle @ middle, drive @ drive.transpose(0, 2, 1), still, output_jacobian(plant, states[0], parameters)
    )


def kalman(plant: Plant, samples: Samples, along: Linearised, noise: NoiseModel) -> KalmanGains:
    """Gains of the extended Kalman filter along a trajectory linearised with this noise of the currents."""
    names, step, middle = plant.state_names, np.diff(samples.grid), along.middle
    density = np.array([noise.disturbance.get(name, 0.0) ** 2 for name in names])[None, :].repeat(len(step), axis=0)
    density[along.still] += np.array([noise.resting.get(name, 0.0) ** 2 for name in names])
    process = along.drive + middle @ (density[:, :, None] * step[:, None, None] * middle.transpose(0, 2, 1))
    if noise.joined:
        together = middle @ np.array([noise.joined.get(name, 0.0) for name in names])
        process += together[:, :, None] * together[:, None, :] * step[:, None, None]
    variance = np.broadcast_to(np.square(np.array(noise.outputs)), samples.measured.shape)
    covariance = np.diag([noise.initial.get(name, 0.0) ** 2 for name in names])
    valid = np.isfinite(samples.measured)
    gain, innovation = riccati(plant, along.transition, process, along.output, valid, variance, covariance)
    if not np.isfinite(innovation).all():
        raise SimulationError("the covariance of the observer grew without bounds", float(samples.grid[0]), None)
    return KalmanGains(gain, np.linalg.inv(np.linalg.cholesky(innovation)))


def riccati(
    plant: Plant,
    transition: Array,
    process: Array,
    output: Array,
    valid: NDArray[np.bool_],
    variance: Array,
    covariance: Array,
) -> tuple[Array, Array]:
    """Kalman gains (n, NX, NY) and covariances of the innovations (n, NY, NY) by the recursion of Riccati.

    Args:
        plant: plant of the states, scaled or not.
        transition: (n, NX, NX) of each interval.
        process: (n, NX, NX) covariance of what is added in it.
        output: (NY, NX) dy/dx.
        valid: (n, NY) what was measured.
        variance: (n, NY) of its noise.
        covariance: (NX, NX) of the state at the beginning.
    """
    n, nx = len(transition), len(plant.state_names)
    gain, innovation = np.empty((n, nx, len(OUTPUTS))), np.empty((n, len(OUTPUTS), len(OUTPUTS)))
    measured = np.ascontiguousarray(valid, dtype=np.uint8)
    plant._library.boom_riccati(
        ctypes.c_long(n), pointer(np.ascontiguousarray(transition)), pointer(np.ascontiguousarray(process)),
        pointer(np.ascontiguousarray(output)), measured.ctypes.data_as(ctypes.POINTER(ctypes.c_ubyte)),
        pointer(np.ascontiguousarray(variance)), pointer(np.array(covariance)), pointer(gain), pointer(innovation),
    )  # fmt: skip
    return gain, innovation


def output_jacobian(plant: Plant, state: Array, parameters: Array | None = None) -> Array:
    """dy/dx (NY, NX): the outputs are linear in the states."""
    base = _outputs(plant, state, parameters)
    columns = []
    for i, scale in enumerate(plant.scale):
        moved = state.copy()
        moved[i] += scale
        columns.append((_outputs(plant, moved, parameters) - base) / scale)
    return np.stack(columns, axis=-1)


def _outputs(plant: Plant, state: Array, parameters: Array | None) -> Array:
    y, u = np.empty(len(OUTPUTS)), np.zeros(len(plant.machine.structure.inputs))
    p = plant.p if parameters is None else np.ascontiguousarray(parameters, dtype=float)
    x = np.ascontiguousarray(state, dtype=float)
    plant._library.boom_outputs(pointer(p), pointer(x), pointer(u), pointer(y))
    return y
