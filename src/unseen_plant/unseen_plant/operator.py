"""Whoever moves the crane: six styles of work, each a law from time, angle and rate to the joystick's deflection."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from unseen_plant.layout import ANGLE, RATE, STEP, U_IN, U_OUT, CraneNumbers
from unseen_plant.running import SCALE, TOLERANCE, Machinery, OutOfRangeError
from unseen_plant.simulation import integrate

Array = NDArray[np.float64]
Law = Callable[[float, float, float], float]
"""(time [s], angle [rad], rate [rad/s]) -> wanted deflection in -1..1, positive lifting."""
QUIET = 1.6
"""s. Nobody touches the joystick before."""
STYLES = ("joystick", "positioning", "rocking", "controller", "rests", "ends")


def current(c: CraneNumbers, x: float) -> float:
    """Current [A] that holds the spool at the relative stroke x >= 0."""
    if c.piloted < 0.5:
        return x * c.s_max / c.K_i
    pressure = x * c.k_s * c.s_max / c.A_s / 1.0e5
    return float((-c.h_1 + np.sqrt(c.h_1**2 + 4.0 * c.h_2 * pressure)) / (2.0 * c.h_2))


def _targets(
    rng: np.random.Generator,
    low: float,
    high: float,
    pace: tuple[float, float],
    pause: tuple[float, float],
    span: float,
) -> Law:
    """Goes from target to target at some deflection, brakes before it and waits there."""
    state = {"target": 0.0, "pace": 0.0, "until": 0.0, "side": 1.0 if rng.uniform() < 0.5 else -1.0}
    moving = False

    def law(t: float, q: float, w: float) -> float:
        nonlocal moving
        if not moving:
            if t < state["until"]:
                return 0.0
            state["side"] = -state["side"] if rng.uniform() < 0.8 else state["side"]
            middle = np.clip(q + state["side"] * span * rng.uniform(0.3, 1.0), low, high)
            state["target"], state["pace"] = float(middle), float(rng.uniform(*pace))
            state["until"] = t + 12.0
            moving = True
        gap = state["target"] - q
        if abs(gap) < 0.02 + 0.15 * abs(w) or t > state["until"]:
            moving = False
            state["until"] = t + float(rng.uniform(*pause))
            return 0.0
        return float(np.sign(gap) * state["pace"] * min(1.0, 0.25 + abs(gap) / 0.15))

    return law


def _rocking(rng: np.random.Generator, low: float, high: float) -> Law:
    """Swings the stick about some angle."""
    middle, size = rng.uniform(low + 0.2, high - 0.2), rng.uniform(0.25, 0.8)
    frequency, drift = rng.uniform(0.15, 0.7), rng.uniform(0.6, 1.0)

    def law(t: float, q: float, _w: float) -> float:
        phase = frequency * (t - QUIET + 3.0 * np.sin(0.13 * t))  # between 0.6 and 1.4 times the frequency
        return float(size * np.sin(2.0 * np.pi * phase) + drift * (middle - q))

    return law


def _controller(rng: np.random.Generator, low: float, high: float) -> Law:
    """A proportional controller with a dead band behind ramps to random angles."""
    gain, band, speed = rng.uniform(3.0, 9.0), rng.uniform(0.002, 0.008), rng.uniform(0.08, 0.28)
    reference, target, until = None, 0.0, 0.0

    def law(t: float, q: float, _w: float) -> float:
        nonlocal reference, target, until
        reference = q if reference is None else reference
        if t >= until:
            target, until = rng.uniform(low, high), t + rng.uniform(2.0, 7.0)
        reference += float(np.clip(target - reference, -speed * 0.01, speed * 0.01))
        error = reference - q
        return 0.0 if abs(error) < band else float(gain * error)

    return law


def law_of(style: str, rng: np.random.Generator, low: float, high: float) -> Law:
    """The law of a style of work between two angles [rad].

    Raises:
        KeyError: there is no such style.
    """
    span = high - low
    makers: dict[str, Callable[[], Law]] = {
        "joystick": lambda: _targets(rng, low, high, (0.35, 1.0), (0.1, 1.5), span),
        "positioning": lambda: _targets(rng, low, high, (0.12, 0.45), (0.4, 2.5), 0.3 * span),
        "rocking": lambda: _rocking(rng, low, high),
        "controller": lambda: _controller(rng, low, high),
        "rests": lambda: _targets(rng, low, high, (0.2, 0.9), (5.0, 11.0), 0.7 * span),
        "ends": lambda: _targets(rng, low, high, (0.6, 1.0), (0.3, 1.5), 3.0 * span),
    }
    return makers[style]()


def drive(
    m: Machinery, start: Array, style: str, limits: tuple[float, float], duration: float, rng: np.random.Generator
) -> tuple[Array, Array]:
    """The operator works the crane: currents (n, 2) [A] and states (n, STATES).

    Raises:
        OutOfRangeError: the crane leaves its linkage all the same, or jumps so that it cannot be integrated.
    """
    count, every = round(duration / STEP), 2
    c, u, states = m.c, m.inputs(count), np.empty((count, len(start)))
    law, ramp = law_of(style, rng, *limits), STEP * every / rng.uniform(0.15, 0.7)
    begin, full = current(c, 0.93 * c.x_sa), current(c, 0.97)
    y, stick = start, 0.0
    for k in range(0, count, every):
        t, rows = k * STEP, slice(k, min(k + every, count))
        wanted = law(t, float(y[ANGLE]), float(y[RATE])) if t >= QUIET else 0.0
        wanted = _kept(wanted, float(y[ANGLE]), limits)
        stick += float(np.clip(wanted - stick, -ramp, ramp))
        if abs(stick) > 1e-3:
            u[rows, U_OUT if stick > 0.0 else U_IN] = begin + min(abs(stick), 1.0) * (full - begin)
        part, done = integrate(y, u[rows], m.e, c, m.own, SCALE, STEP, TOLERANCE)
        if done < len(part):
            raise OutOfRangeError(f"the boom left its linkage or jumps, at {t:.1f} s")
        states[rows] = part
        y = part[-1]
    return u[:, [U_IN, U_OUT]], states


def _kept(wanted: float, q: float, limits: tuple[float, float]) -> float:
    """Nobody drives on beyond the limits."""
    if q > limits[1] and wanted > 0.0:
        return 0.0
    return 0.0 if q < limits[0] and wanted < 0.0 else wanted
