"""Recognises an oscillation that stands or grows: of force and speed together, half-wave by half-wave.

    y = e' + f~ w / K,   without what is slower than ``SLOWEST``

is the speed with which boom and oil spring swing against each other, whatever the share of the two. A half-wave counts if it is as
long as oscillations of a boom are, larger than ``oscillation_speed``, and not much smaller than the one before; one that does not
takes the count back to zero. A reference moves the boom once or twice, and rings down; ``HALF_WAVES`` in a row are an oscillation.

Then the gains are lowered to a safe set (``state_feedback``, ``load_observer``, ``flow_observer``) and stay so, unless the dead
time that the law predicts over is found to be another than it was then: with that the gains are tried again, once. A bending boom
rings for seconds whatever the gains are; what grows beyond ``GROWN`` times what it was then, or has not become less ``PATIENCE``
later, is a reason to stop.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import casadi as ca

from boom_model.regularisation import Expression

SLOWEST = 3.0
"""1/s, of the high-pass filter."""
SHORTEST, LONGEST = 0.03, 0.42
"""s, of a half-wave: 1.2 to 16 Hz."""
LEAST_SHARE = 0.85
"""Of a half-wave over the one before: what decays faster is damped."""
HALF_WAVES = 4
PATIENCE, CALM = 4.0, 1.0
"""s: until a calmed oscillation must be less than it was; at least until gains are raised again."""
GROWN = 2.0
LEARNT = 0.01
"""s. Another dead time than that with which the oscillation began."""


class OscillationState(NamedTuple):
    """Input and output of the high pass [m/s]; peak of this half-wave and of the last [m/s], its length [s], count of half-waves.

    Since when the gains are safe [s] (0: they are not), the peak then [m/s], the dead time then [s], whether they were raised
    again, whether it went on.
    """

    input: Expression = 0.0
    swing: Expression = 0.0
    peak: Expression = 0.0
    last_peak: Expression = 0.0
    elapsed: Expression = 0.0
    count: Expression = 0.0
    calmed: Expression = 0.0
    first_peak: Expression = 0.0
    dead_time: Expression = 0.0
    raised: Expression = 0.0
    unsettled: Expression = 0.0


def watch_oscillation(x: OscillationState, swing: Expression, dead_time: Expression, s: Any) -> OscillationState:
    """One sample time with y [m/s] before the high pass, the dead time that is predicted over [s] and the settings ``s``."""
    t = s.sample_time
    y = ca.exp(-SLOWEST * t) * (x.swing + swing - x.input)
    crossed = y * x.swing < 0
    elapsed = x.elapsed + t
    large = ca.logic_and(x.peak > s.oscillation_speed, x.peak > LEAST_SHARE * x.last_peak)
    timely = ca.logic_and(elapsed > SHORTEST, elapsed < LONGEST)
    counts = ca.logic_and(large, timely)
    count = ca.if_else(crossed, ca.if_else(counts, x.count + 1, 0.0), ca.if_else(elapsed > LONGEST, 0.0, x.count))
    seen = count >= HALF_WAVES
    begun = x.calmed > 0
    peak = ca.fmax(x.peak, x.last_peak)
    bound = ca.if_else(x.calmed > PATIENCE, x.first_peak, GROWN * x.first_peak)
    again = ca.logic_and(ca.logic_and(begun, seen), peak > bound)
    learnt = ca.logic_and(x.calmed > CALM, ca.fabs(dead_time - x.dead_time) > LEARNT)
    found = ca.logic_and(learnt, x.raised + x.unsettled + (count > 0) < 0.5)
    return OscillationState(
        swing, y,
        ca.if_else(crossed, ca.fabs(y), ca.fmax(x.peak, ca.fabs(y))),
        ca.if_else(crossed, x.peak, x.last_peak),
        ca.if_else(crossed, 0.0, elapsed),
        count,
        ca.if_else(found, 0.0, ca.if_else(ca.logic_or(begun, seen), x.calmed + t, 0.0)),
        ca.if_else(begun, x.first_peak, peak),
        ca.if_else(begun, x.dead_time, dead_time),
        ca.fmax(x.raised, found),
        ca.fmax(x.unsettled, again),
    )  # fmt: skip


NOTE = "an oscillation was recognised: the gains are lowered until the next start, or until the dead time behind it is known"
REASON = "the boom oscillates, and lower gains did not end it"
