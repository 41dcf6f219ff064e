"""Initial state of a free run from the measurements at its beginning.

A boom at rest determines it (machine notes): p_a = p_h, p_o,i = max(p_h, p_g0,i), spool and pilot states zero. After a
gap, or in a recording that begins in motion, the unmeasured states are estimated by least squares over the first second.
The prior is a guess with stationary pilot stage, spool and accumulators, with its uncertainty.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import sqrt

import numpy as np
from numpy.typing import NDArray

from boom_estimation.currents import HeldCurrents, held_currents
from boom_input.channels import BY_NAME
from boom_model.errors import SimulationError
from boom_model.plant import Plant
from boom_model.sensors import OUTPUTS
from boom_recording.recording import Recording

Array = NDArray[np.float64]

REST_WINDOW = 0.95
"""s. In recordings of the machine the boom rests at least this long before the first current."""
SHORTEST_REST = 0.15
CLOSED_CURRENT = 0.05
"""A. Below it the spool stays deep inside its dead zone whatever the current's noise."""
RESTING_RATE = 5e-3
"""rad/s. Mean rate below which the boom rests."""
SWINGING_RATE = 3.0 * RESTING_RATE
"""rad/s. Root mean square from which on it swings about a place: more than a gyro's noise is, where that is filtered."""
FIT_WINDOW = 1.0
DRIFT_WINDOW = 0.1
"""s over which the angle tells the rate where no gyro does."""

NOISE = {"rad": 4e-4, "rad/s": 1.5e-3, "Pa": 2e4}
"""By unit: weights of the channels in the fit (sensors of ch. 6.4)."""
UNCERTAINTY = {
    "angle": 1e-3, "rate": 1e-2, "head_pressure": 5e5, "rod_pressure": 5e5, "hose_pressure": 3e5,
    "accumulator_pressure_1": 1e6, "accumulator_pressure_2": 1e6, "spool_position": 1e-3, "spool_velocity": 1e-3,
    "pilot_retract": 3e-3, "pilot_extend": 3e-3,
}  # fmt: skip
"""How far the guess of a state in motion may be off (standard deviation, SI)."""


@dataclass(frozen=True)
class InitialState:
    """State (NX,) at ``time`` [s], and how it was found, in words for the report."""

    time: float
    state: Array
    how: str


def initial_state(
    recording: Recording, plant: Plant, currents: HeldCurrents, start: float, end: float
) -> InitialState | None:
    """Initial state of the run over [start, end] [s]; None if a channel has no valid sample there."""
    resting = rest_end(currents, start, end)
    means = means_at_rest(recording, start, resting)
    if means is not None:
        state = plant.rest_state_measured(
            means["angle"], means["hose_pressure"], means["rod_pressure"], inputs=currents.at(start)
        )
        return InitialState(start, state, f"at rest from {start:.2f} s to {resting:.2f} s")
    return _in_motion(recording, plant, currents, start, end)


def resting_start(recording: Recording, currents: HeldCurrents | None = None) -> dict[str, float] | None:
    """Mean of each output [SI] while the boom rests at the beginning of a recording; None if it does not."""
    currents = held_currents(recording) if currents is None else currents
    return means_at_rest(recording, 0.0, rest_end(currents, 0.0, recording.duration))


def rest_end(currents: HeldCurrents, start: float, end: float) -> float:
    """Time [s] until which the crane may rest at the beginning of [start, end]: no valve opened yet, no other joint moves."""
    opened = currents.first_above(CLOSED_CURRENT, start)
    return min(start + REST_WINDOW, opened, currents.joints_move_from(start), end)


def means_at_rest(recording: Recording, start: float, end: float) -> dict[str, float] | None:
    """Means of the outputs [SI] over [start, end] [s], NaN: not recorded; None where the boom moves or the time is too short."""
    if end - start < SHORTEST_REST:
        return None
    means = {name: _mean(recording, name, start, end) for name in OUTPUTS}
    there = {name for name in OUTPUTS if recording.signals[name].valid.any()}
    if "angle" not in there or not all(np.isfinite(means[name]) for name in there):
        return None
    rate = means["rate"] if "rate" in there else _drift(recording, start, end)
    swings = "rate" in there and _beyond_noise(_samples(recording, "rate", start, end)[1]) > SWINGING_RATE
    return means if abs(rate) < RESTING_RATE and not swings else None


def _beyond_noise(values: Array) -> float:
    """Root mean square of samples without what differs from one to the next: a boom that swings about a mean of 0 does not rest."""
    noise = float(np.mean(np.diff(values) ** 2)) / 2.0 if len(values) > 1 else 0.0
    return sqrt(max(float(np.mean(values**2)) - noise, 0.0))


def _drift(recording: Recording, start: float, end: float) -> float:
    """Mean rate [rad/s] over [start, end] [s] by the angle."""
    time, angle = _samples(recording, "angle", start, end)
    return float(np.polyfit(time, angle, 1)[0]) if len(time) > 2 else float("nan")


def _in_motion(
    recording: Recording, plant: Plant, currents: HeldCurrents, start: float, end: float
) -> InitialState | None:
    from scipy.optimize import least_squares  # takes a second to load, and most recordings begin at rest

    until = min(start + FIT_WINDOW, end)
    there = [name for name in OUTPUTS if recording.signals[name].valid.any()]
    samples = {name: _samples(recording, name, start, until) for name in there}
    if "angle" not in there or any(len(time) == 0 for time, _ in samples.values()):
        return None
    first = dict.fromkeys(OUTPUTS, float("nan"))
    first |= {name: float(np.mean(values[:3])) for name, (_, values) in samples.items()}
    if "rate" not in there:
        first["rate"] = _drift(recording, start, start + DRIFT_WINDOW)
    guess = stationary_guess(plant, first, currents.at(start))
    names = plant.state_names
    spread = np.array([UNCERTAINTY.get(name, max(abs(g), 1e-9)) for name, g in zip(names, guess, strict=True)])
    times = np.unique(np.concatenate([time for time, _ in samples.values()]))
    times = times[times >= start]
    where = {name: np.searchsorted(times, time) for name, (time, _) in samples.items()}

    def residuals(z: Array) -> Array:
        x0 = guess + z * spread
        try:
            run = plant.run(currents.time, currents.values, times, x0, start=start, tolerance=1e-6)
        except SimulationError:
            return np.full(sum(len(t) for t, _ in samples.values()) + len(z), 1e3)
        parts = [(run.output(n)[where[n]] - v) / NOISE[BY_NAME[n].unit] for n, (_, v) in samples.items()]
        return np.concatenate([*parts, z])

    fit = least_squares(residuals, np.zeros(len(guess)), diff_step=[1e-4], max_nfev=30)
    return InitialState(start, guess + fit.x * spread, f"in motion, fitted to {start:.2f} s to {until:.2f} s")


def stationary_guess(plant: Plant, measured: dict[str, float], current: tuple[float, ...]) -> Array:
    """State with pilot stage, spool and accumulators at rest under the currents [A] that act, and p_a = p_h."""
    state = plant.rest_state_measured(
        measured["angle"], measured["hose_pressure"], measured["rod_pressure"], inputs=current
    )
    index = {name: i for i, name in enumerate(plant.state_names)}
    state[index["rate"]] = measured["rate"]
    # the valve alone, followed for long enough under the held currents, is stationary; the rest of the state is put
    # back
    valve = [index[name] for name in plant.equations.valve]
    settled = state.copy()
    settled[index["rate"]] = 0.0
    for _ in range(200):
        f, jacobian = plant.derivative(settled, current)
        block = np.ix_(valve, valve)
        settled[valve] -= np.linalg.solve(jacobian[block] - np.eye(len(valve)) / 0.02, f[valve])
    state[valve] = settled[valve]
    return state


def _samples(recording: Recording, name: str, start: float, end: float) -> tuple[Array, Array]:
    signal = recording.signals[name]
    chosen = signal.valid & (signal.time >= start) & (signal.time <= end)
    return signal.time[chosen], signal.values[chosen]


def _mean(recording: Recording, name: str, start: float, end: float) -> float:
    _, values = _samples(recording, name, start, end)
    return float(np.mean(values)) if len(values) else float("nan")
