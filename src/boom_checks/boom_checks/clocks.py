"""Clocks that differ: the offset between topics at which simple physics holds best, with its interval.

Pressures against motion by the force balance, or, behind a valve that holds the load, by when they change; currents against motion
by the answer to the command. A delay of filter, bus or valve is physics or a sensor (``pressure_delay``, ``command_delay``); what
comes before its cause, or later than any of these, is a clock.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from boom_checks.check import IntervalValue, RecordingCheck
from boom_checks.even_series import PERIOD, EvenSeries
from boom_checks.mechanics import Mechanics
from boom_checks.readings import PRIOR
from boom_checks.relations import changes, command, force
from boom_input.channels import BY_NAME

Array = NDArray[np.float64]

FARTHEST = 1.0
"""s. Offsets looked for to either side."""
COARSE, FINE = 10, 2
"""Samples of the grid between the offsets tried, first and around the best."""
DROP_90 = 1.353
"""By which a log-likelihood falls at the ends of an interval of 90 %: half the quantile of chi^2 with one degree of freedom."""
PRESSURES, CURRENTS = ("hose_pressure", "rod_pressure"), ("retract_current", "extend_current")
CARRYING, CHANGING, COMMANDING = (-0.03, 0.12), (-0.10, 0.20), (-0.40, 0.03)
"""s. Lateness that no clock makes: of pressures that carry the boom, filter and bus together; by when they change, as a valve opens
before the boom moves, and the oil swings after it; and of currents, which the motion follows after pilot stage and spool."""


def clock_checks(series: EvenSeries, boom: Mechanics) -> list[RecordingCheck]:
    """Topics whose clock differs from that of the joint states."""
    found = []
    pressures = (PRESSURES, changes, CHANGING) if boom.holds else (PRESSURES, force, CARRYING)
    for names, relation, allowed in (pressures, (CURRENTS, _at_once, COMMANDING)):
        measure, odds = offset(series, boom, names, relation, allowed)
        if odds + PRIOR > 0.0:
            topics = ", ".join(dict.fromkeys(BY_NAME[name].topic for name in names))
            way = "late" if measure.value > 0.0 else "early"
            sentence = (
                f"the stamps are {way} against those of /joint_states by {abs(measure.value):.2f} s ({measure.text}): the clocks "
                "differ"
            )
            found.append(
                RecordingCheck("clock", topics, ((0.0, float(series.time[-1])),), sentence, measure, odds + PRIOR)
            )
    return found


def offset(
    series: EvenSeries, boom: Mechanics, names: tuple[str, ...], relation: Callable[[EvenSeries, Mechanics], float],
    within: tuple[float, float],
) -> tuple[IntervalValue, float]:  # fmt: skip
    """Lateness of the signals [s] with its interval, and the log odds that it lies outside ``within`` [s]."""

    def score(shift: int) -> float:
        return relation(series.with_columns({name: _earlier(series.columns[name], shift) for name in names}), boom)

    reach = round(FARTHEST / PERIOD)
    tried = {shift: score(shift) for shift in range(-reach, reach + 1, COARSE)}
    middle = max(tried, key=tried.__getitem__)
    inner = abs(middle) < reach  # the largest value at an end is no maximum: something else drifts
    tried |= {shift: score(shift) for shift in range(middle - COARSE, middle + COARSE + 1, FINE)}
    low, high = within
    best = max(tried, key=tried.__getitem__)
    if not low <= best * PERIOD <= high:  # of a boom that hunts every quarter of a period fits; steps may miss the best
        near = range(best - FINE, best + FINE + 1)
        tried |= {shift: score(shift) for shift in {*near, *range(round(low / PERIOD), round(high / PERIOD) + 1)}}
    best = max(tried, key=tried.__getitem__)
    inside = [shift for shift, value in tried.items() if value > tried[best] - DROP_90]
    allowed = max(value for shift, value in tried.items() if low <= shift * PERIOD <= high)
    late = PERIOD * best
    interval = (PERIOD * (min(inside) - FINE / 2), PERIOD * (max(inside) + FINE / 2))
    return IntervalValue("offset", late, "s", interval), tried[best] - allowed if inner else 0.0


def _earlier(values: Array, shift: int) -> Array:
    """The values of ``shift`` samples later; the first or the last one where there is none, as a boom rests there."""
    return values[np.clip(np.arange(len(values)) + shift, 0, len(values) - 1)]


def _at_once(series: EvenSeries, boom: Mechanics) -> float:
    return command(series, boom, lags=(0,))
