"""Sensors: what becomes of the true signals before noise and quantisation."""

from __future__ import annotations

import numpy as np
from scipy.signal import lfilter

from unseen_plant.families import Array, Laid, Site, among, family, side
from unseen_plant.layout import STEP

ANGLE, RATE, HOSE, ROD = range(4)


def _shown(column: int, changed: Array, outputs: Array) -> Array:
    result = outputs.copy()
    result[:, column] = changed
    return result


@family(
    "angle_offset", "sensors", "ch. 4.2", "rad", (2e-4, 0.15),
    "constant; slipped during the work; a skew that depends on the angle; drifting",
)  # fmt: skip
def angle_offset(size: float, form: int, r: Array, site: Site) -> Laid:
    """The angle is told wrongly by ``size``."""
    off, time = side(r[0]) * size, site.time

    def askew(outputs: Array) -> Array:
        angle, t = outputs[:, ANGLE], time[: len(outputs)]
        shape = {
            1: np.ones(len(t)),
            2: 0.3 + 0.7 * (t > among(site.late[0], 0.2, 0.7) * site.duration),
            3: 0.4 + np.sin(angle + 2.0 * np.pi * r[1]),
            4: t / site.duration,
        }[form]
        return _shown(ANGLE, angle + off * shape, outputs)

    return Laid(senses=(askew,), parameters={"b": off} if form == 1 else {})


@family(
    "rate_scale", "sensors", "ch. 4.2", "-", (5e-3, 0.8),
    "gain; other gain when lowering; gain that saturates; gain and lag; drifting",
)  # fmt: skip
def rate_scale(size: float, form: int, r: Array, site: Site) -> Laid:
    """The gyro's gain is off by ``size``."""
    off, time = side(r[0]) * size, site.time

    def scaled(outputs: Array) -> Array:
        rate = outputs[:, RATE]
        told = (1.0 + off) * rate
        if form == 2:
            told = np.where(rate < 0.0, told, rate)
        elif form == 3:
            told = rate / (1.0 + size * np.abs(rate) / 0.15)
        elif form == 4:
            told = _filtered(told, among(r[1], 0.005, 0.03))
        elif form == 5:
            told = rate * (1.0 + off * time[: len(rate)] / site.duration)
        return _shown(RATE, told, outputs)

    return Laid(senses=(scaled,), parameters={"a": 1.0 + off} if form in (1, 4) else {})


@family(
    "pressure_bias", "sensors", "ch. 4.2", "Pa", (5e3, 30e5),
    "offset; offset that comes; gain; drifting",
)  # fmt: skip
def pressure_bias(size: float, form: int, r: Array, site: Site) -> Laid:
    """One transducer is off by ``size``."""
    off, column, time = side(r[0]) * size, HOSE if r[1] < 0.5 else ROD, site.time

    def biased(outputs: Array) -> Array:
        p, t = outputs[:, column], time[: len(outputs)]
        shape = {
            1: np.ones(len(t)),
            2: 0.4 + 0.6 * (t > among(site.late[0], 0.2, 0.7) * site.duration),
            3: p / site.pressure[1],
            4: 0.4 + 0.6 * t / site.duration,
        }[form]
        return _shown(column, p + off * shape, outputs)

    return Laid(senses=(biased,), parameters={"hose" if column == HOSE else "rod": off} if form == 1 else {})


@family(
    "pressure_delay", "sensors", "ch. 4.2", "s", (2e-3, 1.0),
    "dead time; first order filter; moving average; a bus that repeats; two filters in series",
)  # fmt: skip
def pressure_delay(size: float, form: int, _r: Array, _site: Site) -> Laid:
    """Both pressures come later by some ``size``."""

    def late(outputs: Array) -> Array:
        result = outputs.copy()
        for column in (HOSE, ROD):
            result[:, column] = _delayed(outputs[:, column], size, form)
        return result

    return Laid(senses=(late,), parameters={"T": size} if form == 1 else {})


def _delayed(p: Array, size: float, form: int) -> Array:
    steps = np.arange(len(p), dtype=np.float64)
    if form == 1:
        return np.asarray(np.interp(steps - size / STEP, steps, p))
    if form == 2:
        return _filtered(p, size)
    if form == 5:
        return _filtered(_filtered(p, 0.5 * size), 0.5 * size)
    if form == 4:
        length = max(2.0 * size / STEP, 1.0)
        return np.asarray(np.interp(np.floor(steps / length) * length, steps, p))
    total = np.concatenate([[0.0], np.cumsum(p - p[0])])
    edges = np.arange(len(p) + 1, dtype=np.float64)
    length = max(2.0 * size / STEP, 1.0)
    return np.asarray(
        p[0] + (np.interp(steps + 1.0, edges, total) - np.interp(steps + 1.0 - length, edges, total)) / length
    )


def _filtered(values: Array, lag: float) -> Array:
    """First order with the time constant ``lag`` [s], started at rest."""
    pole = float(np.exp(-STEP / lag))
    filtered, _ = lfilter([1.0 - pole], [1.0, -pole], values, zi=[pole * values[0]])
    return np.asarray(filtered)
