"""Dead time: what happened until the next command acts is computed from the commands that are on their way (Smith, 1957).

A sample is theta old when the command that answers it acts: its own age, the dead time of the valve chain, that of the pressures.
With Q the speed that the valve gives, held in each sample time, and f_0 the force under which the boom would not accelerate:

    v' = (f - f_0) / m,   f' = K (Q - v)

is an undamped oscillator, which is solved exactly (w = sqrt(K/m), u = v - Q):

    u+ = u cos wh + (f - f_0) / (m w) sin wh,   f+ = f_0 + (f - f_0) cos wh - (K/w) u sin wh
    s+ = s + Q h + u sin(wh) / w + (f - f_0) (1 - cos wh) / K

The feedback then is that of a plant without dead time, as far as the model is right; its gains leave room for what is not
(``state_feedback``).
"""

from __future__ import annotations

from math import ceil
from typing import NamedTuple

import casadi as ca

from boom_controller.types import Measurement, Reference
from boom_model.regularisation import Expression

LONGEST = 0.2
"""s. Dead time that can be bridged, all kinds together."""


def before(values: tuple[Expression, ...], samples: Expression) -> Expression:
    """The value so many sample times ago, newest first; in between on a straight line."""
    value = values[0]
    for k in range(len(values) - 1):
        value = value + ca.fmin(ca.fmax(samples - k, 0.0), 1.0) * (values[k + 1] - values[k])
    return value


class Past(NamedTuple):
    """s_s [m] and Q [m/s] when the next command acts, and one, two .. sample times before."""

    positions: tuple[Expression, ...]
    speeds: tuple[Expression, ...]

    @classmethod
    def steady(cls, position: float, speed: float, sample_time: float) -> Past:
        """Nothing has changed for long."""
        count = round(LONGEST / sample_time) + 1
        return cls((position,) * count, (speed,) * count)

    def with_next(self, position: Expression, speed: Expression) -> Past:
        """One sample time later."""
        return Past((position, *self.positions[:-1]), (speed, *self.speeds[:-1]))

    def position(self, dead_time: Expression, sample_time: float) -> Expression:
        """s_s [m] when the sample was taken."""
        return before(self.positions, dead_time / sample_time)


class Held(NamedTuple):
    """(q_2*, .. , q_2, q_2') of the last samples, held back as long as the pressures are late; nothing where they are not."""

    rows: tuple[tuple[Expression, ...], ...]

    @classmethod
    def of(cls, delay: float, sample_time: float) -> Held:
        """For pressures that are ``delay`` [s] late."""
        return cls(((0.0,) * (len(Reference._fields) + 2),) * ceil(delay / sample_time))

    def filled(self, wanted: Expression, m: Measurement) -> Held:
        """The boom has rested for long where it is wanted [rad] and shown."""
        return Held(((*Reference(wanted), m.angle, m.rate),) * len(self.rows))

    def with_next(
        self, r: Reference, m: Measurement, delay: float, sample_time: float
    ) -> tuple[Reference, Measurement, Held]:
        """Reference and measurement of the time at which the pressures were measured, and the rows one sample time later."""
        rows = ((*r, m.angle, m.rate), *self.rows)
        if not self.rows:
            return r, m, self
        part = delay / sample_time - (len(rows) - 2)
        *reference, angle, rate = [new + part * (old - new) for new, old in zip(rows[-2], rows[-1], strict=True)]
        return Reference(*reference), m._replace(angle=angle, rate=rate), Held(rows[:-1])


class Motion(NamedTuple):
    """s_p [m], v [m/s], f_p [N]."""

    position: Expression
    velocity: Expression
    force: Expression


def predicted(
    now: Motion, past: Past, missed: Expression, still: Expression, stiffness: Expression, frequency: Expression,
    dead_time: Expression, sample_time: float,
) -> Motion:  # fmt: skip
    """The motion after ``dead_time`` [s].

    missed: what the valve gives beyond its model [m/s]; still: f_0 [N]; stiffness: K [N/m]; frequency: w [rad/s].
    """
    position, v, f = now
    q = past.speeds
    for k in reversed(range(len(q) - 1)):
        h = ca.fmin(ca.fmax(dead_time - k * sample_time, 0.0), sample_time)
        given = 0.5 * (q[k] + q[k + 1]) + missed
        c, s = ca.cos(frequency * h), ca.sin(frequency * h)
        u, beyond = v - given, f - still
        position = position + given * h + u * s / frequency + beyond * (1.0 - c) / stiffness
        v = given + u * c + beyond * frequency / stiffness * s
        f = still + beyond * c - stiffness / frequency * u * s
    return Motion(position, v, f)
