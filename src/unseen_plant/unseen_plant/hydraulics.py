"""Oil, cylinder, hose burst valve and accumulators (5.39c-k), with the effects that act there. SI, pressures gauge."""

from __future__ import annotations

import math

from concealed_plant.compiling import compiled
from unseen_plant.curves import beyond, curve, odd, root, step
from unseen_plant.layout import (
    E_AIR,
    E_CAVITY,
    E_HEAT,
    E_HOLDING,
    E_LEAK,
    E_POPPET,
    E_RELIEF,
    E_RESTRICT,
    E_SEAT,
    E_SETTING,
    E_STICKING,
    GAS_1,
    GAS_2,
    LATCH,
    P_A,
    P_B,
    P_H,
    P_O1,
    P_O2,
    POPPET,
    POPPET_RATE,
    RELIEF,
    RELIEF_RATE,
    SEAT,
    U_PRECHARGE,
    WALL,
    CraneNumbers,
    EffectTable,
    Values,
)  # fmt: skip

AMBIENT = 101_325.0
BAR = 1.0e5
LITRES = 1.0e-3 / 60.0
"""m^3/s of one l/min."""


@compiled
def stiffness(p: float, volume: float, e: EffectTable, c: CraneNumbers) -> float:
    """Bulk modulus [Pa] of oil with what is dissolved, free or evaporated in it; volume 0: head, 1: rod, 2: hose."""
    soft = 1.0 / c.beta
    absolute = max(p, -0.9 * AMBIENT) + AMBIENT
    if e[E_AIR, 0] > 0.0:
        soft += _air(absolute, p, volume, e[E_AIR])
    if e[E_CAVITY, 0] > 0.0:
        v = e[E_CAVITY]
        depth = (v[2] - p) / BAR
        if v[0] > 3.5:
            soft += v[1] / c.beta * math.exp(min(2.0 * depth, 3.0))
        elif depth > 0.0:
            soft += v[1] / c.beta * curve(v[0], depth, v[3])
    return 1.0 / soft


@compiled
def _air(absolute: float, p: float, volume: float, a: Values) -> float:
    """Compressibility [1/Pa] of the share a[1] of free air, measured at ambient pressure."""
    if a[0] < 1.5:
        return a[1] * AMBIENT / absolute**2
    if a[0] < 2.5:
        return a[1] * math.pow(AMBIENT / absolute, 1.0 / a[2]) / (a[2] * absolute)
    if a[0] < 3.5:  # dissolves until a[3]
        return a[1] * AMBIENT / absolute**2 * (1.0 - step(p / a[3])) ** 2
    if a[0] < 4.5:  # trapped in one volume
        return 2.0 * a[1] * AMBIENT / absolute**2 if abs(volume - a[4]) < 0.5 else 0.0
    return a[1] / a[3] * math.exp(-max(p, 0.0) / a[3])


@compiled
def leakage(p_a: float, p_b: float, stroke: float, e: EffectTable, c: CraneNumbers) -> float:
    """Flow past the piston from a to b; e[.., 1] is that at 100 bar."""
    k = e[E_LEAK]
    if k[0] <= 0.0:
        return 0.0
    flow = k[1] * odd(k[2], (p_a - p_b) / 1e7, k[3])
    if k[0] > 1.5 and k[0] < 2.5:  # a scored barrel
        flow /= 1.0 + ((stroke / c.stroke - k[4]) / 0.15) ** 2
    elif k[0] > 2.5 and k[0] < 3.5 and p_a < p_b:  # a lip seal lifts one way
        flow *= k[4]
    elif k[0] > 3.5:  # the seal is pressed on
        flow /= 1.0 + k[4] * abs(p_a) / 1e7
    return flow


@compiled
def _limited(d: float, c: CraneNumbers) -> float:
    """Flow [l/min] into the cylinder at a drop of -d [bar], d > 0: a parabola, then the tangent to it that hits a30."""
    slope = c.a21 - c.a31
    node = -2.0 * c.a30 / slope
    if d < node:
        return -(c.a21 * d - slope**2 / (-4.0 * c.a30) * d * d)
    return c.a30 - c.a31 * d


@compiled
def burst_curve(drop: float, thin: float, e: EffectTable, c: CraneNumbers) -> float:
    """Static flow [m^3/s] of the hose burst valve (5.39f) for p_h - p_a = drop [Pa]; ``thin``: how much thinner the oil is."""
    d = drop / BAR
    if d >= 0.0:
        return LITRES * ((1.0 + thin) * c.a11 * d + c.a12 * d / math.sqrt(d + c.d_lin))
    d = -d
    s = e[E_SETTING]
    if s[0] <= 0.0:
        return LITRES * _limited(d, c) * (1.0 + thin * math.exp(-d / 10.0))
    r = 1.0 + s[1]
    if s[0] < 1.5:
        flow = r * _limited(d / r, c)
    elif s[0] < 2.5:
        flow = r * _limited(d, c)
    elif s[0] < 3.5:
        flow = _limited(d, c) * (1.0 + s[1] * step(d / (20.0 + 20.0 * s[2])))
    else:
        flow = _limited(d, c) * (1.0 + s[1] * curve(s[3], d / 60.0, s[2]) / (1.0 + d / 60.0))
    return LITRES * flow


@compiled
def burst_flow(y: Values, dy: Values, thin: float, e: EffectTable, c: CraneNumbers) -> float:
    """Flow from hose to cylinder through the burst valve, its poppet, and what holds the load; poppet rates into dy."""
    drop = y[P_H] - y[P_A]
    flow = burst_curve(drop, thin, e, c)
    if e[E_POPPET, 0] > 0.0:
        flow = _late(drop, flow, y, dy, e[E_POPPET])
    if e[E_HOLDING, 0] > 0.0 and drop < 0.0:
        flow *= _held_open(y, dy, e[E_HOLDING])
    if e[E_STICKING, 0] > 0.0:
        flow *= _stuck(drop, y, dy, e[E_STICKING])
    return flow


@compiled
def _late(drop: float, flow: float, y: Values, dy: Values, s: Values) -> float:
    """Outwards, the conductance (relative to 1 l/min/bar) follows its static value; a check valve lets oil in at once."""
    conductance = min(abs(flow) / max(abs(drop), 100.0), 12.0 * LITRES / BAR) / (LITRES / BAR) if drop < 0.0 else 8.0
    g, tau = y[POPPET], s[1]
    if s[0] < 1.5:
        dy[POPPET] = (conductance - g) / tau
    elif s[0] < 2.5:
        omega = 2.0 / tau
        dy[POPPET], dy[POPPET_RATE] = y[POPPET_RATE], omega**2 * (conductance - g) - 2.0 * s[2] * omega * y[POPPET_RATE]
    elif s[0] < 3.5:  # moves at a rate
        dy[POPPET] = math.tanh((conductance - g) / 0.5) * 3.0 / tau
    elif s[0] < 4.5:  # closes quicker than it opens
        dy[POPPET] = (conductance - g) / (tau if conductance < g else s[3] * tau)
    else:
        dy[POPPET] = max(g, 0.05) * math.log(max(conductance, 0.05) / max(g, 0.05)) / tau
    return max(g, 0.0) * LITRES / BAR * drop if drop < 0.0 else flow


@compiled
def _held_open(y: Values, dy: Values, s: Values) -> float:
    """Opening of a valve that holds the load until p_a + R p_b exceeds its setting; s: size, setting, R, play."""
    over = (y[P_A] + s[3] * y[P_B] - s[2]) / s[4]
    if s[0] < 1.5:
        opening = min(max(over, 0.0), 1.0)
    elif s[0] < 2.5:
        opening = math.sqrt(step(over))
    elif s[0] < 3.5:
        opening = 0.5 * (1.0 + math.tanh(2.0 * over - 1.0))
    else:  # its poppet needs time
        dy[LATCH] = (step(over) - y[LATCH]) / s[5]
        opening = y[LATCH]
    return 1.0 - s[1] * (1.0 - opening)


@compiled
def _stuck(drop: float, y: Values, dy: Values, s: Values) -> float:
    """A poppet that sticks shut until the drop s[2] frees it, and shuts again below a part of that."""
    free = y[LATCH]
    against = -drop if s[0] < 3.5 else abs(drop)
    over = against / (s[2] * (1.0 - 0.8 * free)) - 1.0
    wanted = 0.5 * (1.0 + math.tanh(6.0 * over))
    if s[0] > 1.5 and s[0] < 2.5:
        wanted = wanted**3
    dy[LATCH] = (wanted - free) / (s[3] if wanted > free or s[0] < 2.5 else 20.0 * s[3])
    return 1.0 if drop > 0.0 and s[0] < 3.5 else 1.0 - s[1] * (1.0 - free)


@compiled
def relief(y: Values, dy: Values, e: EffectTable, c: CraneNumbers) -> float:
    """Flow from the hose to tank through a relief valve that hunts."""
    s = e[E_RELIEF]
    if s[0] <= 0.0:
        return 0.0
    x, v = y[RELIEF], y[RELIEF_RATE]
    over = (y[P_H] - s[2]) / s[3]
    if s[0] > 1.5 and s[0] < 2.5:  # opens at once, shuts late
        over += 2.0 * step(2.0 * x)
    elif s[0] > 2.5 and s[0] < 3.5:  # the jet pulls it open
        over += 1.5 * min(max(x, 0.0), 1.0)
    elif s[0] > 3.5:
        over = beyond(over, 0.3)
    dy[RELIEF], dy[RELIEF_RATE] = v, s[4] ** 2 * (min(max(over, 0.0), 1.5) - x) - 2.0 * s[5] * s[4] * v
    return s[1] * min(max(x, 0.0), 1.5) * root(y[P_H] - c.p_t) / 3162.0


@compiled
def _mouth(p_h: float, p_o: float, d: float, p_g: float, e: EffectTable, c: CraneNumbers) -> float:
    """Flow into an accumulator through its orifice (5.39j,k)."""
    flow = c.C_d * 0.25 * math.pi * d * d * math.sqrt(2.0 / c.rho) * root(p_h - p_o)
    r = e[E_RESTRICT]
    if r[0] > 3.5 and r[0] < 4.5:  # a flap: other one way
        flow *= 1.0 + r[1] if flow > 0.0 else 1.0
    elif r[0] > 4.5:  # a long clogged bore: laminar
        flow *= (1.0 + r[1]) + (1.0 - (1.0 + r[1])) * step(abs(p_h - p_o) / r[2])
    if flow < 0.0:
        flow *= step((p_o - p_g) / 1.0e4 + 0.5)
    return flow


@compiled
def accumulators(y: Values, dy: Values, u: Values, e: EffectTable, c: CraneNumbers) -> float:
    """Flow from the hose into both accumulators; rates of gas and pressures (5.39g,h) into dy.

    The gas obeys p V^kappa = zeta exp(s) with the entropy s: V' = V / kappa (s' - p'/p), and the oil above it is compressible.
    """
    if c.gas < 0.5:
        return 0.0
    h = e[E_HEAT]
    total = 0.0
    for k in range(2):
        p, s = y[P_O1 + k], y[GAS_1 + k]
        filled = (c.p_1 if k == 0 else c.p_2) * (1.0 + u[U_PRECHARGE])
        flow = _mouth(y[P_H], p, c.d_1 if k == 0 else c.d_2, filled, e, c)
        volume = min(c.V_g * (filled * math.exp(s) / p) ** (1.0 / c.kappa), c.V_g)
        heat = 0.0
        if h[0] > 0.0 and (h[0] < 4.5 or k == int(h[4])):
            heat = _heating(p * volume / (filled * c.V_g), y[WALL], flow, h)
            dy[GAS_1 + k] = heat
        dy[P_O1 + k] = (flow + volume / c.kappa * heat) / (volume / (c.kappa * p) + (c.V_g - volume) / c.beta)
        total += flow
    if h[0] > 3.5 and h[0] < 4.5:
        hot = 0.5 * (y[P_O1] / c.p_1 * math.exp(-y[GAS_1]) + y[P_O2] / c.p_2 * math.exp(-y[GAS_2]))
        dy[WALL] = (0.3 * (hot ** (1.0 - 1.0 / c.kappa) - 1.0) - y[WALL]) / h[3]
    return total


@compiled
def _heating(warm: float, wall: float, flow: float, h: Values) -> float:
    """Rate of the gas' entropy [1/s] at the temperature ``warm`` over the ambient one; h[1] is one over the time constant."""
    rate = h[1]
    if h[0] > 1.5 and h[0] < 2.5:  # natural convection
        rate *= (abs(warm - 1.0) / 0.1) ** 0.33
    elif h[0] > 2.5 and h[0] < 3.5:  # stirred by the flow
        rate *= 0.3 + abs(flow) / (20.0 * LITRES)
    return rate * (1.0 + wall - warm) / warm


@compiled
def bush(force: float, y: Values, dy: Values, e: EffectTable) -> float:
    """Rate at which the linkage's bush gives way [m/s] to the cylinder force [N]; the stroke is longer by y[SEAT]."""
    s = e[E_SEAT]
    if s[0] <= 0.0:
        return 0.0
    x = (force - s[3]) / s[2]
    if s[0] < 1.5:
        seat = math.tanh(x)
    elif s[0] < 2.5:
        seat = min(max(x, -1.0), 1.0)
    elif s[0] < 3.5:
        seat = x / (1.0 + abs(x))
    else:
        seat = odd(1.0, x, 0.05)
    dy[SEAT] = (s[1] * seat - y[SEAT]) / 0.01
    return float(dy[SEAT])
