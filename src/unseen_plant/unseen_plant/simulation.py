"""The whole crane as one system of equations, and its integration by an extrapolated linearly implicit Euler method.

Each step is made with one, two and three equal parts of y += (1 - h J)^-1 h f(y); extrapolation to infinitely many parts has order
three, and the difference of its last two columns is the error that sets the step (Deuflhard, SIAM Review 27, 1985).
"""

from __future__ import annotations

import math

import numpy as np

from concealed_plant.compiling import compiled
from unseen_plant.curves import curve
from unseen_plant.hydraulics import accumulators, burst_flow, bush, leakage, relief, stiffness
from unseen_plant.layout import E_CUSHION, P_A, P_B, P_H, RATE, SEAT, STATES, U_THIN, CraneNumbers, EffectTable
from unseen_plant.mechanics import linkage, motion
from unseen_plant.valve import flows

Floats = np.ndarray
SMALLEST = 1.0 / 256.0
"""Smallest step over that of the grid: it is taken whatever its error."""
MOST_STEPS = 20_000
"""For one row: what jumps however small the step is would take for ever."""


@compiled
def _cushion(stroke: float, rate: float, e: EffectTable, c: CraneNumbers) -> tuple[float, float]:
    """Narrowing of the ways out of head and rod side near the ends of the stroke, relative to an open edge."""
    s = e[E_CUSHION]
    if s[0] <= 0.0:
        return 0.0, 0.0
    upper = 1.0 - (c.stroke - stroke) / s[2]
    lower = 1.0 - stroke / s[2]
    rod = s[1] * curve(s[0], upper, s[3]) if upper > 0.0 and rate > 0.0 else 0.0
    head = s[1] * curve(s[0], lower, s[3]) if lower > 0.0 and rate < 0.0 else 0.0
    return head, rod


@compiled
def rates(y: Floats, u: Floats, e: Floats, c: CraneNumbers, dy: Floats) -> None:
    """Time derivative of the state under the inputs and courses u, into dy."""
    dy[:] = 0.0
    stroke, lever = linkage(y[0], c)
    stroke += y[SEAT]
    force = y[P_A] * c.A_a - y[P_B] * c.A_b
    motion(y, dy, u, e, c, lever * force)
    speed = lever * y[RATE] + bush(force, y, dy, e)
    head, rod = _cushion(stroke, speed, e, c)
    q_h, q_b = flows(y, dy, u, e, c, head, rod)
    lost = leakage(y[P_A], y[P_B], stroke, e, c)
    stored = accumulators(y, dy, u, e, c)
    relieved = relief(y, dy, e, c)
    v_a = c.V_a + stroke * c.A_a
    swept = speed * c.A_a + lost
    dy[P_B] = stiffness(y[P_B], 1.0, e, c) / (c.V_b + (c.stroke - stroke) * c.A_b) * (q_b + speed * c.A_b + lost)
    if c.burst > 0.5:
        q_a = burst_flow(y, dy, u[U_THIN], e, c)
        dy[P_A] = stiffness(y[P_A], 0.0, e, c) / v_a * (q_a - swept)
        dy[P_H] = stiffness(y[P_H], 2.0, e, c) / c.V_h * (q_h - stored - relieved - q_a)
    else:
        dy[P_H] = stiffness(y[P_H], 2.0, e, c) / (v_a + c.V_h) * (q_h - stored - relieved - swept)
        dy[P_A] = dy[P_H]


@compiled
def _jacobian(
    y: Floats, u: Floats, e: Floats, c: CraneNumbers, own: Floats, near: Floats, f: Floats, g: Floats, J: Floats
) -> None:
    """Differences of the rates of the states ``own``; f: their rates at y, g: room for others."""
    for j in range(len(own)):
        k = own[j]
        kept = y[k]
        y[k] = kept + near[k]
        rates(y, u, e, c, g)
        y[k] = kept
        for i in range(len(own)):
            J[i, j] = (g[own[i]] - f[own[i]]) / near[k]


@compiled
def _factor(M: Floats, order: Floats) -> None:
    """LU factors of M in place, rows exchanged as told in ``order``."""
    n = len(order)
    for k in range(n):
        best = k
        for i in range(k + 1, n):
            if abs(M[i, k]) > abs(M[best, k]):
                best = i
        order[k] = best
        if best != k:
            for j in range(n):
                M[k, j], M[best, j] = M[best, j], M[k, j]
        for i in range(k + 1, n):
            M[i, k] /= M[k, k]
            for j in range(k + 1, n):
                M[i, j] -= M[i, k] * M[k, j]


@compiled
def _solve(M: Floats, order: Floats, b: Floats) -> None:
    n = len(order)
    for k in range(n):
        b[k], b[order[k]] = b[order[k]], b[k]
    for k in range(n):
        for i in range(k + 1, n):
            b[i] -= M[i, k] * b[k]
    for k in range(n - 1, -1, -1):
        for j in range(k + 1, n):
            b[k] -= M[k, j] * b[j]
        b[k] /= M[k, k]


@compiled
def _parts(
    y: Floats, f: Floats, u: Floats, e: Floats, c: CraneNumbers, own: Floats, scale: Floats, h: float, parts: int, J: Floats,
    M: Floats, order: Floats, b: Floats, g: Floats, result: Floats,
) -> None:  # fmt: skip
    """``parts`` linearly implicit Euler steps of h / parts from y, into result."""
    n, part = len(own), h / parts
    for i in range(n):
        for j in range(n):
            M[i, j] = -part * J[i, j] * scale[own[j]] / scale[own[i]]
        M[i, i] += 1.0
    _factor(M, order)
    result[:] = y
    for k in range(parts):
        if k == 0:
            g[:] = f
        else:
            rates(result, u, e, c, g)
        for i in range(n):
            b[i] = part * g[own[i]] / scale[own[i]]
        _solve(M, order, b)
        for i in range(n):
            result[own[i]] += b[i] * scale[own[i]]


@compiled
def _fell(before: Floats, after: Floats) -> bool:
    """Whether a pressure fell past the point where a check valve opens: the Jacobian of the step did not know of it."""
    rod = before[P_B] > -5e3 and after[P_B] < -3e4
    return bool(rod or (before[P_H] > -5e3 and after[P_H] < -3e4))


@compiled
def integrate(
    y: Floats, courses: Floats, e: Floats, c: CraneNumbers, own: Floats, scale: Floats, period: float, tolerance: float
) -> tuple[Floats, int]:
    """States (n, STATES) at the end of each of the n rows of ``courses``, and how many rows were reached inside the linkage.

    None is reached that takes over ``MOST_STEPS``.

    y: state at the start. own: indices of the states that move. scale: what counts as little of each state.
    """
    count, n = len(courses), len(own)
    states = np.zeros((count, STATES))
    y = y.copy()
    f, g, b = np.zeros(STATES), np.zeros(STATES), np.zeros(n)
    one, two, three = np.zeros(STATES), np.zeros(STATES), np.zeros(STATES)
    J, M, order = np.zeros((n, n)), np.zeros((n, n)), np.zeros(n, np.int64)
    near = 1e-2 * scale
    h = period
    for k in range(count):
        u, done, left = courses[k], 0.0, MOST_STEPS
        while done < period * (1.0 - 1e-9):
            left -= 1
            h = min(h, period - done)
            rates(y, u, e, c, f)
            _jacobian(y, u, e, c, own, near, f, g, J)
            while True:
                _parts(y, f, u, e, c, own, scale, h, 1, J, M, order, b, g, one)
                _parts(y, f, u, e, c, own, scale, h, 2, J, M, order, b, g, two)
                _parts(y, f, u, e, c, own, scale, h, 3, J, M, order, b, g, three)
                error = 0.0
                for i in range(n):
                    j = own[i]
                    # Aitken-Neville: T22 and T32, and from them T33
                    second, third = 2.0 * two[j] - one[j], 3.0 * three[j] - 2.0 * two[j]
                    one[j] = third + 0.5 * (third - second)
                    error = max(error, abs(one[j] - third) / (tolerance * scale[j]))
                if _fell(y, one):
                    error = max(error, 8.0)
                if error <= 1.0 or h <= SMALLEST * period:
                    break
                h = max(h * max(0.2, 0.8 / error ** (1.0 / 3.0)), SMALLEST * period)
            if not (left and math.isfinite(error)):
                return states, k
            for i in range(n):
                y[own[i]] = one[own[i]]
            done += h
            h *= min(4.0, 0.8 / max(error, 1e-6) ** (1.0 / 3.0))
        states[k] = y
        if not (c.q_low < y[0] < c.q_high) or y[P_H] < -2e5 or y[P_B] < -2e5:
            return states, k
    return states, count
