"""Dead time that nobody told, from the running system: which delay of the modelled flow fits the motion that follows it.

y is the displacement of the oil as measured, u as the valve's model gives it, F what the force compresses, behind the same high
pass twice; candidates theta_i lie 10 ms apart around the dead time that is told:

    y = g_i u(t - theta_i) - c_i F + noise,   y' = v,   u' = Q,   F = f_p / K

g, what the valve's gain, and c, what the oil's compliance is off by, are fitted for each candidate by least squares with their
prior (``GAIN``, ``COMPLIANCE``) and a memory of T seconds of motion, so that neither passes for dead time. The residual
sum chi_i^2 that is left of N independent samples, whose noise is known from nu others beforehand, and the prior give the posterior

    p_i ~ prior_i (nu + chi_i^2)^(-(nu + N) / 2),   theta^ = sum p_i theta_i

prior_i: as told with ``AS_TOLD``, else ~ exp(-|theta_i| / theta_0).

Nothing is learnt while the rod side may draw oil through its anti-cavitation valve. A lag passes for dead time, and is as good as
that to a law that predicts over it.
"""

from __future__ import annotations

from math import exp, log
from typing import Any, NamedTuple

import casadi as ca

from boom_controller.blocks.dead_time import LONGEST, before
from boom_model.regularisation import Expression

FORGETTING = 12.0
"""1/s, of the high passes: slower, errors of the flow last longer than the delay."""
NOISE, CORRELATED = 2.0e-4, 0.04
"""m and s: y is off by about so much, for so long at a time."""
GAIN, COMPLIANCE = 0.2, 0.5
"""Standard deviations of g and c about 1."""
AS_TOLD, AS_FOUND, USUAL = 0.9, 0.99, 0.03
"""Probability that the dead time is what is told: nothing, or what a machine file says; s, theta_0."""
LEAST_SPEED = 0.03
"""m/s of Q: faster, the memory fades."""
REMEMBERED = 6.0
"""s of motion, T."""
KNOWN = REMEMBERED / CORRELATED
"""nu: what is known of the noise beforehand counts as much as all that is remembered of the motion. Counting less, nu = 4, a clean
recording that fits within a third of the noise drew conclusions from differences of a hundredth of it."""
CANDIDATES = tuple(0.01 * k for k in range(-5, 11))
"""s, theta_i beyond what is told."""


class DelayFit(NamedTuple):
    """Of one candidate: information of g and c (three numbers), information times value (two), sum of squares."""

    gg: Expression = 0.0
    gc: Expression = 0.0
    cc: Expression = 0.0
    g: Expression = 0.0
    c: Expression = 0.0
    squares: Expression = 0.0

    def after(
        self, u: Expression, compressed: Expression, residual: Expression, keep: Expression, weight: Expression
    ) -> DelayFit:
        """Old information counts ``keep``, the residual y + F - u of this sample ``weight``."""
        rows = (
            u * u,
            -u * compressed,
            compressed * compressed,
            u * residual,
            -compressed * residual,
            residual * residual,
        )
        return DelayFit(*(keep * old + weight * new for old, new in zip(self, rows, strict=True)))

    @property
    def left(self) -> Expression:
        """chi^2 with the most probable g and c."""
        gg, cc = self.gg + 1.0 / GAIN**2, self.cc + 1.0 / COMPLIANCE**2
        explained = (cc * self.g**2 - 2.0 * self.gc * self.g * self.c + gg * self.c**2) / (gg * cc - self.gc**2)
        return self.squares - explained


class DeadTimeState(NamedTuple):
    """theta^ [s], N; y + F, F and u [m] behind one high pass, y + F and F behind both; f_p [N] of the sample before.

    u of the last samples behind both, newest first; a fit for each candidate.
    """

    delay: Expression = 0.0
    count: Expression = 0.0
    moved: Expression = 0.0
    compressed: Expression = 0.0
    given: Expression = 0.0
    y: Expression = 0.0
    f: Expression = 0.0
    force: Expression = 0.0
    u: tuple[Expression, ...] = ()
    fits: tuple[DelayFit, ...] = ()

    @classmethod
    def untold(cls, sample_time: float) -> DeadTimeState:
        """Nothing learnt yet."""
        return cls(u=(0.0,) * (round(LONGEST / sample_time) + 1), fits=(DelayFit(),) * len(CANDIDATES))


def prior(delay: float, found: bool) -> float:
    """Of a candidate; ``found``: the machine file tells a dead time."""
    told, others = AS_FOUND if found else AS_TOLD, sum(exp(-abs(other) / USUAL) for other in CANDIDATES if other)
    return (1.0 - told) * exp(-abs(delay) / USUAL) / others if delay else told


def observe_dead_time(
    x: DeadTimeState, velocity: Expression, acting: Expression, late: Expression, force: Expression, stiffness: Expression,
    shortest: Expression, trusted: Expression, s: Any, *, found: bool = False,
) -> DeadTimeState:  # fmt: skip
    """One sample time.

    velocity: v [m/s]; acting: Q [m/s] once the command before this sample acts; late: how long that takes by what is told [s];
    force: f_p [N]; stiffness: K [N/m]; shortest: the least theta^ [s]; not ``trusted``: it waits; settings ``s``;
    found: the machine file tells a dead time.
    """
    t = s.sample_time
    hold = exp(-FORGETTING * t)
    compressing = (force - x.force) / stiffness
    moved = hold * x.moved + t * velocity + compressing
    compressed, given = hold * x.compressed + compressing, hold * x.given + t * acting
    y, f = hold * x.y + moved - x.moved, hold * x.f + compressed - x.compressed
    u = (hold * x.u[0] + given - x.given, *x.u[:-1])
    moving = acting**2 / (acting**2 + LEAST_SPEED**2)
    keep = 1.0 - t / REMEMBERED * moving
    count = ca.if_else(trusted, keep * x.count + t / CORRELATED * moving, x.count)
    weight = t / (CORRELATED * NOISE**2)
    fits, logs = [], []
    for delay, fit in zip(CANDIDATES, x.fits, strict=True):
        shift = before(u, (late + delay) / t)
        after = fit.after(shift, f, y - shift, keep, weight)
        after = DelayFit(*(ca.if_else(trusted, new, old) for new, old in zip(after, fit, strict=True)))
        fits.append(after)
        logs.append(
            ca.if_else(
                delay < shortest - 1e-9,
                -1e9,
                log(prior(delay, found)) - 0.5 * (KNOWN + count) * ca.log(KNOWN + after.left),
            )
        )
    best = ca.mmax(ca.vertcat(*logs))
    shares = [ca.exp(value - best) for value in logs]
    total = sum(shares)
    mean = sum(share * delay for share, delay in zip(shares, CANDIDATES, strict=True)) / total
    return DeadTimeState(mean, count, moved, compressed, given, y, f, force, u, tuple(fits))
