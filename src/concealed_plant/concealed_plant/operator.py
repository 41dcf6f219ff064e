"""An operator at the joystick: currents of every 10 ms that keep the boom inside its range.

The operator checks the boom before a motion and steers with ramps, steps, trembling hands and pauses of different length, after a
rest of more than a second. Manners: ``work`` moves and pauses, ``quick`` steps and turns without a pause, ``fine`` creeps near the
dead zone, ``joystick`` wanders, ``ends`` works up to the end of stroke, ``idle`` hardly moves at all. "" mixes the first four.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from concealed_plant.kernel import opening, pilot
from concealed_plant.machine import BoomLinkage
from concealed_plant.plant import Courses, InitialValues, per_millisecond, run
from concealed_plant.quantities import Quantities

Array = NDArray[np.float64]

PERIOD_S = 0.01
STRONGEST = 0.55
_MIX = ("work", "work", "quick", "fine", "joystick")
_RANGE, _ENDS = (0.05, 1.0), (0.95, 1.5)
"""rad. Range in which the operator keeps the boom."""
_LIGHT, _HIGHEST_LIGHT = 9000.0, 0.8
"""kg m^2, rad. Folded and steep, the head side carries next to nothing and would cavitate at a stop."""
_LOOK = 2.0
"""s. The operator checks the angle again after this time."""

_BY_EYE = 2
"""Steps of the plant per millisecond that suffice to know the angle."""


class Operator:
    """Drives one recording.

    Args:
        m: the machine as the operator knows it.
        linkage: of that machine.
        rng: the only source of randomness.
        courses: how the other joints move meanwhile.
    """

    def __init__(
        self, m: Quantities, linkage: BoomLinkage, rng: np.random.Generator, courses: Courses | None = None
    ) -> None:
        self._m, self._linkage, self._rng, self._courses = m, linkage, rng, courses or Courses()
        self._expected = [self._expectation(lifting) for lifting in (False, True)]

    def drive(self, duration: float, start: float, manner: str = "") -> tuple[Array, Array]:
        """Currents (k, 2) [A] of every 10 ms, and the times [s] at which motions begin.

        duration [s]; start: initial boom angle [rad].
        """
        count = round(duration / PERIOD_S)
        currents = np.zeros((count, 2))
        at, angle, starts = round(self._rng.uniform(1.0, 1.8) / PERIOD_S), start, []
        looked = at
        low, high = _ENDS if manner == "ends" else _RANGE
        if self._m.inertia < _LIGHT:
            high = min(high, _HIGHEST_LIGHT)
        low, high = min(low, start - 0.1), max(high, start + 0.1)
        end = count - round(self._rng.uniform(0.3, 1.5) / PERIOD_S)
        lifting = bool(self._rng.uniform() < (high - start) / (high - low))
        while at < end - 30:
            kind = manner if manner not in ("", "ends") else str(self._rng.choice(_MIX))
            shape = self._shape(kind)[: end - at]
            if (at - looked) * PERIOD_S > _LOOK:
                given = per_millisecond(currents[:at])
                seen = run(self._m, self._linkage, InitialValues(start), given, self._courses, steps=_BY_EYE)
                angle, looked = float(seen["angle"][-1]), at
                lifting = angle < low + 0.05 or (lifting and angle < high - 0.05)
            room = (high - angle) if lifting else (angle - low)
            travel = np.cumsum(self._speed(shape, lifting, angle)) * PERIOD_S
            beyond = int(np.searchsorted(travel, max(room, 0.0)))
            if beyond < len(shape):
                ramp = np.linspace(shape[max(beyond - 1, 0)], 0.2, 25)
                shape = np.concatenate((shape[:beyond], ramp))[: end - at]
                travel = np.cumsum(self._speed(shape, lifting, angle)) * PERIOD_S
            currents[at : at + len(shape), 1 if lifting else 0] = shape
            starts.append(at * PERIOD_S)
            at += len(shape) + self._pause(kind)
            angle += travel[-1] if lifting else -travel[-1]
            upwards = float(np.clip((high - angle) / (high - low), 0.03, 0.97))
            turn = upwards if not lifting else 1.0 - upwards
            if self._rng.uniform() < 0.35 + 0.65 * turn:
                lifting = not lifting
        return currents, np.array(starts)

    def _shape(self, kind: str) -> Array:
        """Current over the samples of one motion [A]."""
        rng = self._rng
        if kind == "quick":
            top, rise, hold, fall = (
                rng.uniform(0.42, STRONGEST),
                rng.integers(12, 22),
                rng.uniform(0.4, 2.0),
                rng.integers(18, 30),
            )
        elif kind == "fine":
            top, rise, hold, fall = (
                rng.uniform(0.33, 0.41),
                rng.integers(10, 60),
                rng.uniform(2.0, 6.0),
                rng.integers(5, 40),
            )
        elif kind == "idle":
            top, rise, hold, fall = (
                rng.uniform(0.1, 0.27),
                rng.integers(5, 40),
                rng.uniform(0.3, 1.0),
                rng.integers(5, 40),
            )
        else:
            top, rise, hold, fall = (
                rng.uniform(0.36, STRONGEST),
                rng.integers(14, 50),
                rng.uniform(0.8, 4.0),
                rng.integers(18, 60),
            )
        flat = np.full(round(hold / PERIOD_S), top)
        if kind == "joystick":
            steps = rng.standard_normal(len(flat))
            wander = np.zeros(len(flat))
            for k in range(1, len(flat)):
                wander[k] = 0.985 * wander[k - 1] + 0.008 * steps[k]
            flat = np.clip(flat + wander, 0.31, STRONGEST)
        else:
            slow = np.sin(np.arange(len(flat)) * PERIOD_S * rng.uniform(1.0, 9.0) + rng.uniform(0, 6.28))
            flat = np.minimum(flat + 0.003 * slow, STRONGEST)
        shape = np.concatenate((np.linspace(0.25, flat[0], int(rise)), flat, np.linspace(flat[-1], 0.22, int(fall))))
        return np.asarray(np.round(shape, 3), dtype=np.float64)

    def _pause(self, kind: str) -> int:
        """Samples without current after a motion."""
        longest = {"quick": 0.4, "fine": 1.5, "idle": 12.0}.get(kind, 2.5)
        return round(self._rng.uniform(0.0, longest) / PERIOD_S)

    def _speed(self, shape: Array, lifting: bool, angle: float) -> Array:
        """What the operator expects: angular speed [rad/s] of each sample."""
        lever = float(np.interp(angle, self._linkage.angles, self._linkage.levers))
        return np.asarray(np.interp(shape, *self._expected[int(lifting)]) / lever, dtype=np.float64)

    def _expectation(self, lifting: bool) -> tuple[Array, Array]:
        """Stationary curve of the valve: currents [A], speed of the piston [m/s]."""
        m = self._m
        root = m.discharge * np.sqrt(2.0 / m.density * m.margin)
        side, area, piston = (-1.0, m.edge_sa, m.area_a) if lifting else (1.0, m.edge_sb, m.area_b)
        currents = np.linspace(0.0, STRONGEST + 0.05, 121)
        spool = [side * (pilot(i, m) - pilot(0.0, m)) * m.spool_area / m.spring for i in currents]
        return currents, np.array([root * area * opening(s, m) / piston for s in spool])
