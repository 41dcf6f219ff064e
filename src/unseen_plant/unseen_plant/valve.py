"""Pilot stage, spool, metering edges, supply and return line (5.39l-u), with the effects that act there. SI."""

from __future__ import annotations

import math

from concealed_plant.compiling import compiled
from unseen_plant.curves import beyond, curve, root, step
from unseen_plant.layout import (
    E_CENTRE,
    E_DROOP,
    E_FLOW_FORCE,
    E_KINK,
    E_PLAY,
    E_POLE,
    E_PUMP,
    E_RETURN,
    E_SAG,
    E_SEEP,
    E_SOFT_EDGE,
    E_SPRING,
    E_STUCK_SPOOL,
    LAG_IN,
    LAG_OUT,
    P_B,
    P_H,
    PLAY,
    PLAY_2,
    RETURN,
    SPOOL,
    SPOOL_RATE,
    U_CENTRE,
    U_IN,
    U_OUT,
    U_POLE,
    U_SUPPLY,
    CraneNumbers,
    EffectTable,
    Values,
)  # fmt: skip

FULL_FLOW = 2.0e-3
"""m^3/s. The flow (120 l/min) to which forms of droop, flow force and return line are related."""


@compiled
def _lag(lag: float, current: float, coil: int, e: EffectTable, drift: float, c: CraneNumbers) -> float:
    """Rate of a pilot valve's state (5.39p,s)."""
    s = e[E_POLE]
    factor = 1.0 + drift
    if s[0] > 0.0 and s[0] < 1.5:
        factor = 1.0 / (1.0 + s[1])
    elif s[0] > 1.5 and s[0] < 2.5:  # other when the pressure falls
        falling = step(0.5 + (-c.pole * lag - current) / 0.05)
        factor = 1.0 / (1.0 + s[1] * (s[2] + (1.0 - s[2]) * falling))
    elif s[0] > 2.5 and s[0] < 3.5:  # slow where the current is small
        factor = 1.0 / (1.0 + s[1] * 2.0 * (1.0 - curve(s[3], min(current / 0.6, 1.0), s[2])))
    elif s[0] > 3.5 and s[0] < 4.5:  # more so in one coil
        factor = 1.0 / (1.0 + s[1] * (1.6 if coil == int(s[2] + 0.5) else 0.6))
    return factor * (c.pole * lag + current)


@compiled
def _pilot_pressure(lag: float, current: float, c: CraneNumbers) -> float:
    """(5.39q,r) [Pa]."""
    nu = c.feed * lag + c.through * current
    return 1.0e5 * ((c.h_2 * nu + c.h_1) * nu + c.h_0)


@compiled
def _spring(x: float, e: EffectTable) -> float:
    """Spring force over that of the nominal spring at the relative stroke x."""
    s = e[E_SPRING]
    if s[0] <= 0.0:
        return 1.0
    if s[0] < 1.5:
        return 1.0 + s[1]
    if s[0] < 2.5:
        return 1.0 + 2.0 * s[1] * curve(s[3], abs(x), s[2])
    if s[0] < 3.5:  # one of the two springs
        return 1.0 + s[1] * (1.0 + math.tanh((x if s[2] > 0.5 else -x) / 0.02))
    return 1.0 + s[1] * (0.7 + 0.8 * step((abs(x) - 0.3 - 0.3 * s[2]) / 0.1))  # a second spring sets in


@compiled
def _off_centre(x: float, u: Values, e: EffectTable) -> float:
    """Displacement of the spool's neutral position over full stroke."""
    s, off = e[E_CENTRE], u[U_CENTRE]
    if s[0] > 0.0 and s[0] < 1.5:
        off += s[1]
    elif s[0] > 1.5 and s[0] < 2.5:  # only near neutral
        off += s[1] / (1.0 + (x / (0.2 + 0.3 * s[2])) ** 4)
    elif s[0] > 2.5 and s[0] < 3.5:  # only on one side
        off += s[1] * 0.5 * (1.0 + math.tanh((x if s[2] > 0.5 else -x) / 0.03))
    return off


@compiled
def _jet(x: float, in_flow: float, out_flow: float, out_drop: float, e: EffectTable, c: CraneNumbers) -> float:
    """Flow force towards neutral over the spring's at full stroke, unsigned; s[1] is about that at full flow."""
    s = e[E_FLOW_FORCE]
    a, b = abs(in_flow) / FULL_FLOW, abs(out_flow) / FULL_FLOW
    drop, in_drop = abs(out_drop) / 1e7, c.dp_c / 1e7
    if s[0] < 1.5:
        return s[1] * (a * math.sqrt(in_drop) + b * math.sqrt(drop))
    if s[0] < 2.5:
        return s[1] * (1.0 - 0.4 * min(abs(x), 1.0)) * b * math.sqrt(drop)  # the jet turns as the edge opens
    if s[0] < 3.5:
        return 0.5 * s[1] * curve(s[3], a, s[2])
    if s[0] < 4.5:
        return s[1] * max(abs(x) - c.x_ta, 0.0) * drop  # opening times drop
    return s[1] * b * b


@compiled
def _stuck_spool(x: float, e: EffectTable) -> float:
    """Dry friction of a spool that sticks, over the spring's force at full stroke."""
    s = e[E_STUCK_SPOOL]
    if s[0] <= 0.0:
        return 0.0
    if s[0] < 1.5:
        return s[1] / (1.0 + ((abs(x) - s[2]) / 0.08) ** 4)
    if s[0] < 2.5:
        return s[1] * step(1.0 - abs(x) / s[2])
    if s[0] < 3.5:
        return s[1] * (0.5 + 0.5 * math.tanh(x / 0.02))
    return s[1] * (0.6 + 0.4 * math.sin(25.0 * x))


@compiled
def _follow(y: Values, dy: Values, x: float, v: float, e: EffectTable) -> float:
    """Relative position at which the edges stand, which lags x (moving at v [1/s]) by a hysteresis; its states into dy."""
    s = e[E_PLAY]
    h = s[1]
    if s[0] <= 0.0:
        return x
    if s[0] < 1.5:  # play
        dy[PLAY] = 250.0 * beyond(x - y[PLAY], h)
        return float(y[PLAY])
    if s[0] < 2.5:  # Bouc-Wen
        z = y[PLAY]
        dy[PLAY] = v / (h * s[2]) * (1.0 - (step(abs(z)) if z * v > 0.0 else 0.0))
        return x - h * z
    if s[0] < 3.5:  # two plays in parallel (Prandtl-Ishlinskii)
        dy[PLAY] = 250.0 * beyond(x - y[PLAY], (0.4 + 0.4 * s[2]) * h)
        dy[PLAY_2] = 250.0 * beyond(x - y[PLAY_2], 2.0 * h)
        return float(0.5 * (y[PLAY] + y[PLAY_2]))
    # a force that turns with the direction, and fades near neutral
    dy[PLAY] = (math.tanh(v / 0.05) - y[PLAY]) * min(abs(v) / (s[2] * h) + 0.02, 400.0)
    return x - h * y[PLAY] * step(abs(x) / 0.2)


@compiled
def _opening(x: float, overlap: float, e: EffectTable, c: CraneNumbers) -> float:
    """Relative opening of an edge at the relative stroke x; with soft edges it begins before the overlap ends."""
    s = e[E_SOFT_EDGE]
    over = min(x, 1.2) - overlap
    if s[0] > 0.0:
        width = s[1]
        if s[0] > 1.5:  # rounded within the overlap
            over -= width
        if abs(over) < width:
            over = (over + width) ** 2 / (4.0 * width)
    return (over / (1.0 - overlap)) ** c.n_open if over > 0.0 else 0.0


@compiled
def _supplied(flow: float, p: float, u: Values, e: EffectTable) -> float:
    """What the supply lets through of the flow that the valve asks for, at the load pressure p [Pa]."""
    flow *= 1.0 + u[U_SUPPLY]
    d, r, g = e[E_DROOP], e[E_PUMP], e[E_SAG]
    if d[0] > 0.0:
        loss = d[1] * curve(d[2], flow / FULL_FLOW, d[3])
        if d[0] > 1.5 and d[0] < 2.5:
            loss *= 2.0 * step(max(p, 0.0) / 1.5e7)
        flow *= max(1.0 - loss, 0.1)
    if g[0] > 0.0:
        flow *= max(1.0 - g[1] * curve(g[2], max(p, 0.0) / 1e7, g[3]), 0.1)
    if r[0] > 0.0:
        flow = _pumped(flow, p, r)
    return flow


@compiled
def _pumped(flow: float, p: float, s: Values) -> float:
    """The pump's limit s[1] [m^3/s]."""
    limit = s[1]
    if s[0] > 1.5 and s[0] < 2.5:  # power
        limit *= 1.0 / (0.6 + 0.4 * max(p, 1e5) / 1e7)
    elif s[0] > 2.5 and s[0] < 3.5:  # slip
        limit *= 1.0 - s[2] * 0.15 * max(p, 0.0) / 1e7
    elif s[0] > 3.5:  # round
        return limit * math.tanh(flow / limit)
    return min(flow, limit)


@compiled
def _returned(y: Values, dy: Values, flow: float, e: EffectTable) -> None:
    """Rise of the tank pressure, which follows the flow to tank within some ten milliseconds."""
    s = e[E_RETURN]
    x = max(flow, 0.0) / FULL_FLOW
    if s[0] < 1.5:
        rise = s[1] * curve(1.0 if s[2] < 0.5 else 6.0, x, s[2])
    elif s[0] < 2.5:  # a filter whose bypass opens
        rise = s[1] * min(x, s[2] + 0.3 * (x - s[2])) if x > s[2] else s[1] * x
    elif s[0] < 3.5:
        rise = s[1] * x**1.75
    else:  # a check valve, and then a line
        rise = s[1] * (0.4 * math.tanh(x / 0.03) + 0.6 * x * x)
    dy[RETURN] = (rise - y[RETURN]) / s[3]


@compiled
def _kinked(area: float, widest: float, q: float, out: bool, e: EffectTable) -> float:
    """Area of an edge in series with a hose that is narrow where the boom bends it."""
    s = e[E_KINK]
    if s[0] <= 0.0 or not out:
        return area
    x = (q - s[2]) / s[3]
    if s[0] < 1.5:
        narrow = 1.0 / (1.0 + x**4)
    elif s[0] < 2.5:
        narrow = 0.5 * (1.0 + math.tanh(x))
    elif s[0] < 3.5:
        narrow = 0.5 * (1.0 - math.tanh(x))
    else:
        narrow = 1.0
    return area / math.sqrt(1.0 + (s[1] * narrow * area / widest) ** 2)


@compiled
def _seeping(p: float, e: EffectTable) -> float:
    """Flow out of the hose that no opening tells of: to tank, or (negative) from the supply."""
    s = e[E_SEEP]
    if s[0] <= 0.0:
        return 0.0
    if s[0] < 1.5:
        return s[1] * p / 1e7
    if s[0] < 2.5:
        return s[1] * root(p) / 3162.0
    if s[0] < 3.5:
        return 2.0 * s[1] * max(p - s[2], 0.0) / 1e7
    return -s[1] * (1.5 - p / 2e7)


@compiled
def flows(
    y: Values, dy: Values, u: Values, e: EffectTable, c: CraneNumbers, out_head: float, out_rod: float
) -> tuple[float, float]:
    """Flows q_h into the hose and q_b into the rod side [m^3/s] (5.39l,m); rates of pilot stage, spool, return line into dy.

    ``out_head``, ``out_rod``: factors in 0..1 by which cushions narrow the way out of each side.
    """
    x = _follow(y, dy, y[SPOOL] / c.s_max + _off_centre(y[SPOOL] / c.s_max, u, e), y[SPOOL_RATE] / c.s_max, e)
    metre = c.C_d * math.sqrt(2.0 / c.rho)
    tank, p_h, p_b = c.p_t + y[RETURN], y[P_H], y[P_B]
    if x < 0.0:
        opened = c.A_sa * _opening(-x, c.x_sa, e, c)
        area = c.A_tb * _opening(-x, c.x_tb, e, c)
        area /= math.sqrt(1.0 + (out_rod * area / c.A_tb) ** 2)
        wanted, load, out_drop = opened * _meter_in(p_h, c), p_h, p_b - tank
    else:
        opened = c.A_sb * _opening(x, c.x_sb, e, c)
        turned = _opening(x, c.x_ta, e, c)
        area = c.A_sb * turned / (c.out_0 - c.out_1 * min(turned, 1.3) ** 2)
        area = _kinked(area, c.A_sb / c.out_0, y[0], True, e)
        area /= math.sqrt(1.0 + (out_head * area * c.out_0 / c.A_sb) ** 2)
        wanted, load, out_drop = opened * _meter_in(p_b, c), p_b, p_h - tank
    supplied = _supplied(metre * wanted, load, u, e) if wanted > 0.0 else metre * wanted
    out = metre * area * root(out_drop)
    if e[E_RETURN, 0] > 0.0:
        _returned(y, dy, out, e)
    _spool(y, dy, u, e, c, x, supplied, out, out_drop)
    refill = metre * c.A_ac
    in_h, in_b = (supplied, -out) if x < 0.0 else (-out, supplied)
    q_h = in_h + refill * root(max(c.p_open - p_h, 0.0)) - _seeping(p_h, e)
    return q_h, in_b + refill * root(max(c.p_open - p_b, 0.0))


@compiled
def _meter_in(p: float, c: CraneNumbers) -> float:
    return math.sqrt(c.dp_c) if c.compensated > 0.5 else root(c.p_s - p)


@compiled
def _spool(
    y: Values,
    dy: Values,
    u: Values,
    e: EffectTable,
    c: CraneNumbers,
    x: float,
    supplied: float,
    out: float,
    drop: float,
) -> None:
    """Motion of pilot valves and spool (5.39n-u), or of a spool that follows its current, into dy."""
    full = c.k_s * c.s_max
    jet = _jet(x, supplied, out, drop, e, c) * math.tanh(x / 0.02) if e[E_FLOW_FORCE, 0] > 0.0 else 0.0
    relative = y[SPOOL] / c.s_max
    if c.piloted < 0.5:
        wanted = c.K_i * (u[U_IN] - u[U_OUT]) / _spring(relative, e) - jet * c.s_max
        dy[SPOOL] = (wanted - y[SPOOL]) / c.T_s
        dy[SPOOL_RATE] = (dy[SPOOL] - y[SPOOL_RATE]) / 1e-3
        return
    dy[LAG_IN] = _lag(y[LAG_IN], u[U_IN], 0, e, u[U_POLE], c)
    dy[LAG_OUT] = _lag(y[LAG_OUT], u[U_OUT], 1, e, u[U_POLE], c)
    push = (_pilot_pressure(y[LAG_IN], u[U_IN], c) - _pilot_pressure(y[LAG_OUT], u[U_OUT], c)) * c.A_s
    v = y[SPOOL_RATE]
    friction = c.d_v * v + c.f_c * math.tanh(v / c.sigma_s) + full * _stuck_spool(relative, e) * math.tanh(v / 2e-3)
    dy[SPOOL] = v
    dy[SPOOL_RATE] = (push - c.k_s * y[SPOOL] * _spring(relative, e) - friction - full * jet) / c.m_s
