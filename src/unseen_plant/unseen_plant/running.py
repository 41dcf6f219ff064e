"""Runs of a crane: from rest, over given or decided currents, to what its sensors would see at every step of the grid."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from unseen_plant.layout import (
    ANGLE,
    BASE,
    BASE_RATE,
    BASIC,
    BEND,
    BEND_RATE,
    COURSES,
    E_BASE,
    E_BEND,
    LAG_IN,
    P_A,
    P_B,
    P_H,
    P_O1,
    P_O2,
    PLAY,
    RATE,
    SLOTS,
    SPOOL,
    STATES,
    STEP,
    U_IN,
    U_OUT,
    U_PRECHARGE,
    WIDTH,
    CraneNumbers,
)  # fmt: skip
from unseen_plant.mechanics import linkage, outer_torque
from unseen_plant.simulation import integrate, rates

Array = NDArray[np.float64]
TOLERANCE = 0.3
"""Of the integrator, in multiples of ``SCALE``."""
SETTLING = 1.5
"""s. A crane rests so long before anything is recorded."""
SCALE = np.full(STATES, 1e-3)
SCALE[[ANGLE, RATE]] = 2e-6, 2e-5
SCALE[[P_A, P_B, P_H, P_O1, P_O2]] = 1e3
SCALE[[SPOOL, SPOOL + 1, LAG_IN, LAG_IN + 1]] = 2e-6, 2e-4, 1e-5, 1e-5
SCALE[[BEND, BEND_RATE, BASE, BASE_RATE]] = 2e-6, 2e-5, 2e-6, 2e-5
SCALE[[25 + 2, 31]] = 1e-6, 1e3  # seat of the bush [m], rise of the return line [Pa]
"""What is little of each state."""


class OutOfRangeError(RuntimeError):
    """The crane left its linkage, or could not rest where it was put."""


@dataclass(frozen=True)
class Machinery:
    """A crane with what acts on it.

    Attributes:
        c: numbers.
        e: (SLOTS, WIDTH) effects.
        courses: columns of u -> one value per step of the recording (its first value holds before).
        moving: states that move beside the eleven.
        starts: their values at rest where that is not zero.
    """

    c: CraneNumbers
    e: Array = field(default_factory=lambda: np.zeros((SLOTS, WIDTH)))
    courses: Mapping[int, Array] = field(default_factory=dict)
    moving: tuple[int, ...] = ()
    starts: Mapping[int, float] = field(default_factory=dict)

    @property
    def own(self) -> NDArray[np.int64]:
        """Indices of the states that move."""
        return np.array([*BASIC, *sorted(set(self.moving))], dtype=np.int64)

    def inputs(self, count: int) -> Array:
        """(count, COURSES) with the courses filled in and no currents."""
        u = np.zeros((count, COURSES))
        for column, values in self.courses.items():
            u[:, column] = values[:count]
        return u

    def quiet(self) -> Machinery:
        """The same crane with its courses held at their first values."""
        held = {column: np.full_like(values, values[0]) for column, values in self.courses.items()}
        return replace(self, courses=held)


def rest(m: Machinery, angle: float, rod_pressure: float) -> Array:
    """State of the crane at rest at an angle [rad] with a rod pressure [Pa], settled for ``SETTLING``.

    Raises:
        OutOfRangeError: it leaves its linkage.
    """
    y = np.zeros(STATES)
    for state, value in m.starts.items():
        y[state] = value
    u = m.inputs(1)[0]
    y[ANGLE], y[P_B] = angle, rod_pressure
    dy = np.zeros(STATES)
    for _ in range(30):
        lever = linkage(y[ANGLE], m.c)[1]
        outer = outer_torque(y, u, m.e, m.c)
        y[P_A] = y[P_H] = (-outer / lever + rod_pressure * m.c.A_b) / m.c.A_a
        for k, filled in ((P_O1, m.c.p_1), (P_O2, m.c.p_2)):
            y[k] = max(y[P_H], filled * (1.0 + u[U_PRECHARGE])) if m.c.gas > 0.5 else filled
        rates(y, u, m.e, m.c, dy)
        if m.e[E_BEND, 0] > 0.0:
            y[BEND] += 0.5 * outer / m.e[E_BEND, 1] - 0.5 * y[BEND]
        if m.e[E_BASE, 0] > 0.0:
            y[BASE] += 0.5 * dy[BASE_RATE] / m.e[E_BASE, 2] ** 2
    if y[PLAY] == 0.0:
        y[PLAY] = u[6]
    rows = m.quiet().inputs(round(SETTLING / STEP))
    states, done = integrate(y, rows, m.e, m.c, m.own, SCALE, STEP, TOLERANCE)
    if done < len(rows):
        raise OutOfRangeError(f"it does not rest at {angle:.2f} rad")
    return np.asarray(states[-1])


def run(m: Machinery, start: Array, currents: Array) -> Array:
    """States (n, STATES) at the end of each step under currents (count, 2); n < count if the crane left its linkage."""
    u = m.inputs(len(currents))
    u[:, [U_IN, U_OUT]] = currents
    states, done = integrate(start, u, m.e, m.c, m.own, SCALE, STEP, TOLERANCE)
    return np.asarray(states[:done])


def seen(states: Array, sight: float = 1.0) -> Array:
    """Angle, rate, hose and rod pressure (n, 4) before the sensors; ``sight``: share of the boom's bending that the IMU sees."""
    angle = states[:, ANGLE] + sight * states[:, BEND] + states[:, BASE]
    rate = states[:, RATE] + sight * states[:, BEND_RATE] + states[:, BASE_RATE]
    return np.stack([angle, rate, states[:, P_H], states[:, P_B]], axis=-1)
