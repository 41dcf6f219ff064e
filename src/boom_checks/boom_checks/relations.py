"""Simple physics that a recording keeps whatever the machine's state of repair, each as a log-likelihood.

Each relation predicts one quantity from others with a few gains of known sign; with the gains at their best it leaves an error of
mean square s^2, and

    log L = -n / 2 log(s^2 + s_0^2),   n = number of seconds, s_0 = what sensors and simplicity leave in any case

An error lasts about as long as a motion: a second counts once, not as a hundred samples. Physics that the relations
leave out adds to s^2 under every reading of the recording alike, so it does not favour a wrong one.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from boom_checks.even_series import PERIOD, EvenSeries
from boom_checks.mechanics import ACCELERATION, MOVING, Mechanics
from boom_input.channels import AMBIENT_PRESSURE_PA

Array = NDArray[np.float64]
Relation = Callable[[EvenSeries, Mechanics], float]

RATE_FLOOR = 0.05
"""Share of the rms rate: a gyro's gain is off by as much, and an elastic boom swings."""
SPEED_FLOOR = 0.1
"""Share of the rms speed that a valve's curve and its load leave in a gain per direction."""
ANGLE_FLOOR = 0.05
"""rad. An inclinometer's mounting and the linkage's numbers."""
PRESSURE_FLOOR = 2.0e4
"""Pa. Noise and offset of a pressure transducer near zero."""
LARGEST_PRESSURE = 1.0e8
"""Pa. No valve, hose or cylinder of a crane bears 1000 bar."""
FORCE_FLOOR = 2.0e5
"""Pa. Noise, acceleration and geometry in the force balance."""
FORCE_PRIOR = np.array([5.0e5, 2.0e6, 0.3, 0.3])
"""Deviations in the force balance: offset [Pa], what follows the motion's sign (friction, a valve at the cylinder) [Pa], and the
logarithms of the factors on all loads and on the inertia [-]. A load may be a third more, but gravity does not vanish."""
CONTACT = 2.0e7
"""Pa. Deviation of what something that the boom leans on asks of the head side at most."""
CONTACTS = (0.1, 0.25, 0.5, 0.75, 0.9)
"""Quantiles of the angles at which such a contact may begin."""
CHANGE_FLOOR = 0.3
"""Deviations of a pressure's rate of change that do not follow the motion in any case."""
LARGEST_CURRENT = math.log(3.0)
"""Standard deviation of the logarithm: few recordings open the valve fully, and files are off by tens of per cent."""
TURNING = 0.01
"""rad/s. Width of the tanh that stands for the motion's sign."""
LAGS = range(0, 41, 2)
"""Samples by which the motion may be behind the command: dead time, pilot stage and spool."""
POWERS = (1.0, 1.5, 2.0, 3.0)
"""Exponents of a valve's curve."""
CONVERGED = 1e-6
"""Step of the force balance's gains, in deviations of their prior, after which nothing moves."""
_EVERY = 5


def kinematics(series: EvenSeries, _: Mechanics) -> float:
    """Rate = d(angle)/dt. The error counts relative to the rate: no reading is favoured for making both small."""
    rate = series.smooth("rate")
    return _log_likelihood((rate - series.smooth("angle", 1)) / _rms(rate), RATE_FLOOR)


def linkage(series: EvenSeries, boom: Mechanics) -> float:
    """The angle lies within the linkage's range."""
    angle = series.smooth("angle")
    return _log_likelihood(angle - np.clip(angle, boom.angle[0], boom.angle[-1]), ANGLE_FLOOR)


def pressure_range(series: EvenSeries, _: Mechanics) -> float:
    """No pressure is below vacuum or bursts hoses; each second counts by itself, as a pressure is that low for short times only."""
    total = 0.0
    for name in ("hose_pressure", "rod_pressure"):
        known = series.columns[name][np.isfinite(series.columns[name])]
        excess = known - np.clip(known, -AMBIENT_PRESSURE_PA, LARGEST_PRESSURE)
        total -= 0.5 * PERIOD * float(np.sum(np.log1p((excess / PRESSURE_FLOOR) ** 2)))
    return total


def command(series: EvenSeries, boom: Mechanics, lags: Sequence[int] = LAGS) -> float:
    """The extend current lifts, the retract current lowers; the error counts relative to the speed, as the gains are not known."""
    speed = boom.lever(series.smooth("angle")) * series.smooth("rate")
    return _log_likelihood(response(series.command, speed, lags).error / _rms(speed), SPEED_FLOOR, _EVERY)


def drive(series: EvenSeries, boom: Mechanics) -> float:
    """The largest current is about what opens the valve fully: its logarithm is normal about that."""
    top = series.largest_current
    if not (top > 0.0 and boom.full_current > 0.0):
        return 0.0
    return -0.5 * (math.log(top / boom.full_current) / LARGEST_CURRENT) ** 2


@dataclass(frozen=True)
class Response:
    """Speed of the piston that a command brings: k (c - c_0)^n beyond a dead zone on each side, c = i_- - i_+ of some time before.

    Attributes:
        error: (m,) what of the speed is left [m/s], at every ``_EVERY``-th sample.
        lifting, lowering: (k, c_0, n) with k >= 0 [m/s/A^n], [A], [-]. lag: [samples].
    """

    error: Array
    lifting: tuple[float, float, float]
    lowering: tuple[float, float, float]
    lag: int

    def speed(self, current: Array) -> Array:
        """The speed [m/s] that the currents c (n,) [A] bring."""
        return self._behind(np.concatenate((np.full(self.lag, np.nan), current[: len(current) - self.lag])))

    def _behind(self, late: Array) -> Array:
        (k, dead, n), (j, hole, m) = self.lifting, self.lowering
        return k * np.maximum(late - dead, 0.0) ** n - j * np.maximum(-late - hole, 0.0) ** m


def response(current: Array, speed: Array, lags: Sequence[int] = LAGS) -> Response:
    """The best response of the speed (n,) [m/s] to the command (n,) [A] at one of the lags [samples]."""
    top = float(np.nanmax(np.abs(current), initial=0.0))
    seen, nothing = speed[::_EVERY], (0.0, 0.0, 1.0)
    best, least = Response(seen, nothing, nothing, 0), np.inf
    for lag in lags:
        late = np.concatenate((np.full(lag, np.nan), current[: len(current) - lag]))[::_EVERY]
        known = np.isfinite(late) & np.isfinite(seen)
        c, v = np.where(known, late, 0.0), np.where(known, seen, 0.0)
        tried = Response(seen, _one_side(c, v, top), _one_side(-c, -v, top), lag)
        error = v - tried._behind(c)
        square = float(error @ error)
        if square < least:
            best, least = replace(tried, error=np.where(known, error, np.nan)), square
    return best


def _one_side(c: Array, v: Array, top: float) -> tuple[float, float, float]:
    """(k, c_0, n) of v = k max(c - c_0, 0)^n, k >= 0."""
    found, most = (0.0, 0.0, 1.0), 0.0
    on = c > 0.0
    c, v = c[on], v[on]  # the rest is nothing
    for dead in np.linspace(0.0, 0.6, 13) * top:
        beyond = np.maximum(c - dead, 0.0)
        twice = beyond * beyond  # products, as a power costs ten times as much
        for power, u in zip(POWERS, (beyond, beyond * np.sqrt(beyond), twice, twice * beyond), strict=True):
            square, product = float(u @ u), float(u @ v)
            if product > 0.0 and product**2 / square > most:
                found, most = (product / square, float(dead), power), product**2 / square
    return found


def force(series: EvenSeries, boom: Mechanics) -> float:
    """Head side minus rod side carry gravity and inertia.

    p_h - p_b A_b / A_a = b + exp(m) (g + exp(d) D q_2'') / (J A_a) + f sign(q_2'), b, m, d, f normal about 0 (``FORCE_PRIOR``).
    The error counts relative to how much the pressures vary: in a smaller unit they vary less and are not carried better. Behind a
    valve that holds the load the hose pressure is the cylinder's while the boom lifts steadily, and counts then. A boom that stands
    against its command leans on a stop, which carries with the pressures.
    """
    return _balance(series, boom)[0]


def contact_gain(series: EvenSeries, boom: Mechanics) -> float:
    """By how much the force balance holds better [nats] if something carries the boom below an angle, or holds it above one.

    Like a spring; of the likeliest such contact. That is no fault of the recording, but its force balance is as far off.
    """
    angle = series.smooth("angle")
    known = angle[np.isfinite(angle)]
    arm = boom.lever(angle) * boom.A_a
    found = [_balance(series, boom)[0]]
    for place in np.quantile(known, CONTACTS) if len(known) else ():
        for side in (1.0, -1.0):
            depth = np.maximum(side * (angle - place), 0.0) / arm
            likelihood, strength = _balance(series, boom, side * depth / max(float(np.nanmax(depth)), 1e-12))
            found += [likelihood] if strength > 0.0 else []
    return max(found) - found[0]


def _balance(series: EvenSeries, boom: Mechanics, contact: Array | None = None) -> tuple[float, float]:
    """Log-likelihood of the force balance, and the most that a ``contact``, (n,) up to 1, asks of the head side [Pa]."""
    angle, rate, acceleration = (
        series.smooth(name, order)[::_EVERY] for name, order in (("angle", 0), ("rate", 0), ("rate", 1))
    )
    measured = series.smooth("hose_pressure")[::_EVERY] - series.smooth("rod_pressure")[::_EVERY] * boom.A_b / boom.A_a
    carried = boom.static_need(angle) + boom.joints_need(series.time[::_EVERY], angle, rate, acceleration)
    loads = np.column_stack((carried, boom.dynamic_need(angle, acceleration)))
    beside = [] if contact is None else [contact[::_EVERY]]
    plain = np.column_stack((np.ones(len(angle)), np.tanh(rate / TURNING), *beside))
    k, prior = plain.shape[1], np.array([*FORCE_PRIOR[:2], *[CONTACT] * len(beside), *FORCE_PRIOR[2:]])
    known = np.isfinite(measured) & np.isfinite(loads).all(axis=1) & np.isfinite(plain).all(axis=1)
    known &= ~series.leaning[::_EVERY]
    if boom.holds:
        known &= (rate > MOVING) & (np.abs(acceleration) < ACCELERATION)
    if not known.any():
        return 0.0, 0.0
    extent = PRESSURE_FLOOR**2 + sum(
        float(np.var(series.smooth(name)[::_EVERY][known])) for name in ("hose_pressure", "rod_pressure")
    )
    y, loads, plain = measured[known], loads[known], plain[known]
    seconds = len(y) * _EVERY * PERIOD
    z = np.zeros(k + 2)
    for _ in range(25):  # Gauss-Newton, with the error's size at its best in each step
        carried = loads @ np.exp(np.array([z[k], z[k] + z[k + 1]]))
        error = y - plain @ z[:k] - carried
        square = float(np.mean(error**2)) + FORCE_FLOOR**2
        slope = np.column_stack((plain, carried, loads[:, 1] * np.exp(z[k] + z[k + 1])))
        weight = seconds / len(y) / square
        step = np.linalg.solve(weight * slope.T @ slope + np.diag(prior**-2.0), weight * slope.T @ error - z / prior**2)
        z = z + np.clip(step, -prior, prior)
        if np.all(np.abs(step) < CONVERGED * prior):
            break
    likelihood = -0.5 * seconds * float(np.log(square / extent)) - 0.5 * float(np.sum((z / prior) ** 2))
    return likelihood, float(z[2]) if beside else 0.0


def changes(series: EvenSeries, _: Mechanics) -> float:
    """Pressures change while the motion does: sqrt|p'| = c + k sqrt|q_2''| + l sqrt|q_2'''|, in units of the left's deviation.

    Of hose and rod side together. It tells when, whatever lies between cylinder and sensor. The pressures of a boom that rings go
    with its acceleration and change with that: a quarter of a period earlier.
    """
    motion = np.sqrt(np.abs(np.column_stack([series.smooth("rate", order) for order in (1, 2)])))[::_EVERY]
    total = 0.0
    for name in ("hose_pressure", "rod_pressure"):
        steep = np.sqrt(np.abs(series.smooth(name, 1)))[::_EVERY]
        known = np.isfinite(motion).all(axis=1) & np.isfinite(steep)
        if not known.any():
            continue
        y = steep[known] / max(float(np.std(steep[known])), 1e-9)
        columns = np.column_stack((np.ones(len(y)), motion[known]))
        gains = np.linalg.lstsq(columns, y, rcond=None)[0]
        total += _log_likelihood(y - columns @ gains, CHANGE_FLOOR, _EVERY)
    return total


MOTION, PRESSURES, CURRENTS = (
    {"angle", "rate"},
    {"hose_pressure", "rod_pressure"},
    {"retract_current", "extend_current"},
)
RELATIONS: tuple[tuple[Relation, set[str]], ...] = (
    (kinematics, MOTION), (linkage, MOTION), (pressure_range, PRESSURES), (command, MOTION | CURRENTS), (drive, CURRENTS),
    (force, MOTION | PRESSURES)
)  # fmt: skip
"""Each with the signals that it looks at."""


def _rms(values: Array) -> float:
    known = values[np.isfinite(values)]
    return max(float(np.sqrt(np.mean(known**2))), 1e-9) if len(known) else 1.0


def _log_likelihood(error: Array, floor: float, every: int = 1) -> float:
    known = error[np.isfinite(error)]
    if len(known) == 0:
        return 0.0
    return -0.5 * len(known) * every * PERIOD * float(np.log(np.mean(known**2) + floor**2))
