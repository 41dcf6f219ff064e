"""Runs of the concealed plant: from currents to the true values of the four channels at every millisecond."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from concealed_plant.kernel import MILLISECOND, NAMES, STEPS, simulate
from concealed_plant.machine import BoomLinkage
from concealed_plant.moving_body import COLUMNS, JointCourses, columns
from concealed_plant.quantities import Quantities

Array = NDArray[np.float64]

SETTLING = 3000
"""Milliseconds with closed valve before a recording begins: friction and pressures come to rest."""
PERIOD = 10
"""Milliseconds between two currents of the machine's controller."""


class RunError(ValueError):
    """The crane left the range in which the plant is valid."""


@dataclass(frozen=True)
class Courses:
    """Quantities that change over time, by millisecond of the recording (n,); None: constant."""

    load: Array | None = None
    warmth: Array | None = None
    supply: Array | None = None
    stuck: Array | None = None
    joints: JointCourses | None = None


@dataclass(frozen=True)
class InitialValues:
    """The boom rests at this angle [rad] with this rod pressure [Pa]; the head side carries it."""

    angle: float
    rod_pressure: float = 1.0e6


@dataclass(frozen=True)
class Run:
    """States over the milliseconds of the recording, (n, len(NAMES)); columns by name through ``__getitem__``."""

    values: Array = field(repr=False)

    def __getitem__(self, name: str) -> Array:
        return self.values[:, NAMES.index(name)]

    @property
    def outputs(self) -> Array:
        """(n, 4): angle [rad], rate [rad/s], hose and rod pressure [Pa], without sensors."""
        return self.values[:, :4]


def per_millisecond(currents: Array, late: Array | None = None) -> Array:
    """Currents (k, 2) of every 10 ms as held in each millisecond (10 k, 2); ``late`` (k,) [ms]: dead time of each."""
    count = len(currents) * PERIOD
    begins = np.arange(len(currents)) * PERIOD + (0 if late is None else np.rint(late).astype(np.int64))
    order = np.searchsorted(np.maximum.accumulate(begins), np.arange(count), side="right") - 1
    return np.asarray(np.where(order[:, None] >= 0, currents[np.maximum(order, 0)], 0.0), dtype=np.float64)


def run(
    m: Quantities,
    linkage: BoomLinkage,
    start: InitialValues,
    currents: Array,
    courses: Courses = Courses(),
    steps: int = STEPS,
) -> Run:
    """Free run over currents (n, 2) [A] in each millisecond, after the boom has settled under the first current.

    steps: per millisecond.

    Raises:
        RunError: a pressure below -1 bar or above 1000 bar, or an angle outside the range of the linkage.
    """
    n = len(currents)

    def course(given: Array | None, neutral: float) -> Array:
        values = np.full(n + SETTLING, neutral)
        if given is not None:
            values[:SETTLING], values[SETTLING:] = given[0], given
        return values

    held = np.vstack((np.repeat(currents[:1], SETTLING, axis=0), currents))
    loads = course(courses.load, 1.0)
    cell = int(np.searchsorted(linkage.angles, start.angle))
    mass = m.load + m.extra_load * loads[0] + m.pendulum_mass
    body = np.empty((0, len(COLUMNS)))
    moment_x, moment_y, tip_x, tip_y = m.moment_x, m.moment_y, m.tip_x, m.tip_y
    if courses.joints is not None:
        body = _moving(m, courses.joints, n)
        moment_x, moment_y, tip_x, tip_y = (float(body[0, COLUMNS.index(k)]) for k in COLUMNS[1:5])
    x, y = moment_x + mass * tip_x, moment_y + mass * tip_y
    torque = m.gravity * (x * np.cos(start.angle) - y * np.sin(start.angle))
    head = (torque / linkage.levers[cell] + start.rod_pressure * m.area_b) / m.area_a
    rod = start.rod_pressure
    if head < 0.0:
        head, rod = 1.0e5, (1.0e5 * m.area_a - torque / linkage.levers[cell]) / m.area_b
    values = simulate(
        m, linkage.angles, linkage.strokes, linkage.levers, held, loads, course(courses.warmth, 1.0),
        course(courses.supply, 1.0), course(courses.stuck, 0.0), np.array([start.angle, head, rod]), steps, body,
    )  # fmt: skip
    if not np.isfinite(values[-1]).all():
        at = float(np.argmax(~np.isfinite(values[:, 0]))) * MILLISECOND - SETTLING * MILLISECOND
        raise RunError(f"the crane left its range at {at:.2f} s")
    return Run(values[SETTLING:])


def _moving(m: Quantities, joints: JointCourses, n: int) -> Array:
    """The bodies' particles over the milliseconds, those of settling included.

    Raises:
        RunError: an effect whose parts hang on a tip or base that does not move in its equations.
    """
    if m.pendulum_mass > 0.0 or m.rock_compliance > 0.0:
        raise RunError("a load that swings, or a base that rocks, goes with locked joints only")
    table = columns(joints, m.moment_scale, m.inertia_scale)
    return np.ascontiguousarray(np.vstack((np.repeat(table[:1], SETTLING, axis=0), table[:n])))
