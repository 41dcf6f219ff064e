"""Clocks that differ: the offset and the drift between topics at which simple physics holds best, with their intervals.

Pressures against motion by the force balance together with when they change, or, behind a valve that holds the load, by the latter
alone; currents against motion by the answer to the command. A delay of filter, bus or valve is physics or a sensor
(``pressure_delay``, ``command_delay``); what comes before its cause, or later than any of these, is a clock.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from math import ceil, hypot, inf

import numpy as np

from boom_checks.check import IntervalValue, RecordingCheck
from boom_checks.even_series import PERIOD, EvenSeries
from boom_checks.mechanics import Mechanics
from boom_checks.readings import PRIOR, moves
from boom_checks.relations import changes, command, force
from boom_input.channels import BY_NAME

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
DRIFTS = (0.06, 0.1, 0.16, 0.25, 0.4, 0.6, 0.9)
"""s over what is looked at, to either side; what filters and valves do is as late in the end as in the beginning."""
LAG = 0.3
"""Share to which pilot stage and spool are known: what tolerances and effects of the valve leave of a lag."""
BEGUN = 120.0
"""s of a longer recording that are looked at for a drift: in an hour a clock is off by more than any offset that is tried."""


def clock_checks(
    series: EvenSeries, boom: Mechanics, answer: Callable[[], EvenSeries | None] = lambda: None
) -> list[RecordingCheck]:
    """Topics whose clock differs from that of the joint states.

    answer: with the motion that the model makes of the recorded currents; by as much as it follows them the stamps are later.
    """
    if not moves(series):  # what stands still changes at no time
        return []
    found, begun = [], _begun(series)
    pressures = (PRESSURES, changes, CHANGING) if boom.holds else (PRESSURES, _carrying, CARRYING)
    for names, relation, allowed in (pressures, (CURRENTS, _at_once, COMMANDING)):
        measure, odds = offset(series, boom, names, relation, allowed)
        late = measure if begun is series else offset(begun, boom, names, relation, allowed)[0]
        running, gained = drift(begun, boom, names, relation, late.value)
        if gained > max(odds, -PRIOR):
            measure, odds = running, gained
            said = _runs(measure, "/joint_states", float(series.time[-1]))
        elif names is CURRENTS and odds + PRIOR > 0.0 and (modelled := answer()):
            own = offset(modelled, boom, names, relation, allowed)[0]
            if -FARTHEST < own.value <= allowed[1]:
                measure = _beyond(measure, own)
            if measure.interval_90[0] <= 0.0 <= measure.interval_90[1]:  # the file knows of a dead time
                continue
        if measure.name == "offset":
            way = "late" if measure.value > 0.0 else "early"
            said = f"the stamps are {way} against those of /joint_states by {abs(measure.value):.2f} s"
        if odds + PRIOR > 0.0:
            topics = ", ".join(dict.fromkeys(BY_NAME[name].topic for name in names))
            found.append(
                RecordingCheck(
                    "clock", topics, ((0.0, float(series.time[-1])),), _differ(said, measure), measure,
                    odds + PRIOR,
                )
            )  # fmt: skip
    return _one_clock(found)


def _beyond(measured: IntervalValue, modelled: IntervalValue) -> IntervalValue:
    """The offset beyond that of a model whose own lag is known to ``LAG``."""
    value = measured.value - modelled.value
    ends = [max(abs(end - m.value) for end in m.interval_90) for m in (measured, modelled)]
    spread = hypot(*ends, LAG * modelled.value)
    return replace(measured, value=value, interval_90=(value - spread, value + spread))


def _one_clock(found: list[RecordingCheck]) -> list[RecordingCheck]:
    """Where pressures and currents run alike against the joint states, it is the clock of these."""
    ends = [check.measure.interval_90 for check in found if check.measure.name == "drift"]
    if len(ends) < 2 or max(low for low, _ in ends) > min(high for _, high in ends):
        return found
    surest = max(found, key=lambda check: check.log_odds)
    other = surest.measure
    measure = replace(other, value=-other.value, interval_90=(-other.interval_90[1], -other.interval_90[0]))
    said = _differ(_runs(measure, "pressures and currents", surest.intervals_s[0][1]), measure)
    return [replace(surest, topic="/joint_states", sentence=said, measure=measure)]


def _runs(drift: IntervalValue, against: str, length: float) -> str:
    """That stamps drift [%] against others over a recording of this length [s]."""
    way, over = "fast" if drift.value > 0.0 else "slow", 0.01 * abs(drift.value) * length
    return f"the stamps run {way} against those of {against}, by {over:.2f} s over the recording"


def _differ(said: str, measure: IntervalValue) -> str:
    return f"{said} ({measure.text}): the clocks differ"


def drift(
    series: EvenSeries, boom: Mechanics, names: tuple[str, ...], relation: Callable[[EvenSeries, Mechanics], float], late: float
) -> tuple[IntervalValue, float]:  # fmt: skip
    """By how much the signals' clock runs fast [%] with its interval, and its log odds against an offset alone, about ``late`` [s].

    Offset in the middle of what is looked at and drift are sought together: the best offset alone is that of where the boom moves.
    """
    shares = np.linspace(-0.5, 0.5, len(series.time))

    def score(shift: int, over: int) -> float:
        """With the signals late by ``shift`` samples in the middle, and by ``over`` more in the end than in the beginning."""
        return relation(series.moved(names, np.round(shift + over * shares).astype(np.int64)), boom)

    middle = round(late / PERIOD)
    still = max(score(shift, 0) for shift in range(middle - 2 * FINE, middle + 2 * FINE + 1, FINE))

    def between(over: int, step: int) -> range:
        """Middles of a drift among whose offsets the best offset alone is."""
        reach = step * ceil(0.5 * abs(over) / step) + 2 * FINE
        return range(middle - reach, middle + reach + 1, step)

    drifts = [way * round(d / PERIOD) for d in DRIFTS for way in (-1, 1)]
    first, over, shift = max((score(shift, over), over, shift) for over in drifts for shift in between(over, COARSE))
    scale = 100.0 / len(series.time)
    if first < still and abs(over) == min(map(abs, drifts)):  # the smaller the better: there is none
        return IntervalValue("drift", 0.0, "%", (-scale * abs(over), scale * abs(over))), 0.0
    tried: dict[int, float] = {}
    best, most = over, max(drifts) + COARSE
    while best not in tried or (best in (min(tried), max(tried)) and abs(best) < most):
        for found in range(best - COARSE, best + COARSE + 1, FINE):
            near = set(range(shift - COARSE, shift + COARSE + 1, FINE)) & set(between(found, FINE))
            tried[found] = max((score(middle, found) for middle in near), default=-inf)
        best = max(tried, key=tried.__getitem__)
    inside = [over for over, value in tried.items() if value > tried[best] - DROP_90]
    value = IntervalValue("drift", scale * best, "%", (scale * (min(inside) - FINE), scale * (max(inside) + FINE)))
    large = abs(best) * PERIOD > 0.5 * DRIFTS[0]
    inner = min(tried) < best < max(tried)  # the largest value at an end is no maximum
    return value, tried[best] - still if large and inner else 0.0


def offset(
    series: EvenSeries, boom: Mechanics, names: tuple[str, ...], relation: Callable[[EvenSeries, Mechanics], float],
    within: tuple[float, float],
) -> tuple[IntervalValue, float]:  # fmt: skip
    """Lateness of the signals [s] with its interval, and the log odds that it lies outside ``within`` [s]."""

    def score(shift: int) -> float:
        return relation(series.moved(names, shift), boom)

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


def _begun(series: EvenSeries) -> EvenSeries:
    """The first ``BEGUN`` seconds in which the boom moves: clocks that drift have gone farther later."""
    count, rate = round(BEGUN / PERIOD), np.nan_to_num(np.abs(series.smooth("rate")))
    if len(series.time) <= count:
        return series
    first = min(int(np.argmax(rate > 0.2 * rate.max())), len(rate) - count)
    return EvenSeries(
        series.time[first : first + count], {n: v[first : first + count] for n, v in series.columns.items()}
    )


def _carrying(series: EvenSeries, boom: Mechanics) -> float:
    """The pressures carry the boom, and change when its motion does: levels and rates of change, which have little in common.

    Both, as a clock moves both: a valve at the cylinder of which the file does not know breaks the balance alone, and stamps
    that run away would seem to mend it.
    """
    return force(series, boom) + changes(series, boom)


def _at_once(series: EvenSeries, boom: Mechanics) -> float:
    return command(series, boom, lags=(0,))
