"""Linkage, friction, and the motion of boom, hanging load and bending boom (3.4-3.15, 5.39a,b), with the effects that act there.

States y and effects e are laid out as in ``layout``; u is the row of courses that holds now.
"""

from __future__ import annotations

import math

from concealed_plant.compiling import compiled
from unseen_plant.curves import beyond, curve, step
from unseen_plant.layout import (
    BASE,
    BASE_RATE,
    BEND,
    BEND_RATE,
    BRISTLE,
    BRISTLE_2,
    BRISTLE_3,
    E_BASE,
    E_BEND,
    E_BREAKAWAY,
    E_BRISTLE,
    E_GROUND,
    E_STOP,
    E_SWING,
    E_TIGHT,
    E_WARM,
    SWING,
    SWING_RATE,
    U_FRICTION,
    U_LOAD,
    U_THIN,
    U_TILT,
    WARMTH,
    CraneNumbers,
    EffectTable,
    Values,
)  # fmt: skip

REST = 0.004
"""rad/s. Below it a joint counts as at rest for what grows while it stands."""


@compiled
def linkage(q: float, c: CraneNumbers) -> tuple[float, float]:
    """Stroke s_p [m] and lever J = ds_p/dq [m/rad] by following the bars' velocities; triangle or four bars."""
    cq, sq = math.cos(q), math.sin(q)
    if c.bars < 0.5:
        pin = math.sqrt(c.side_a**2 + c.side_b**2 - 2.0 * c.side_a * c.side_b * math.cos(q + c.corner))
        return pin - c.l_min, c.side_a * c.side_b * math.sin(q + c.corner) / pin
    ax, ay = cq * c.att_x - sq * c.att_y, sq * c.att_x + cq * c.att_y
    dx, dy = ax - c.pivot_x, ay - c.pivot_y
    far = dx * dx + dy * dy
    along = (far + c.L1**2 - c.L2**2) / (2.0 * math.sqrt(far))
    across = -math.sqrt(max(c.L1**2 - along**2, 1e-12))
    ex, ey = dx / math.sqrt(far), dy / math.sqrt(far)
    bx, by = along * ex - across * ey, along * ey + across * ex  # knee, seen from the long bar's pivot
    lx, ly = bx - dx, by - dy  # the short bar
    turn = (lx * -ay + ly * ax) / (lx * -by + ly * bx)  # of the long bar per turn of the boom
    fx, fy = c.pivot_x + bx - c.foot_x, c.pivot_y + by - c.foot_y
    length = math.sqrt(fx * fx + fy * fy)
    return length - c.l_min, turn * (fx * -by + fy * bx) / length


@compiled
def _breakaway(w: float, form: float, width: float, n: float, rested: float) -> float:
    """Share by which friction is higher near rest."""
    x = abs(w) / width
    if form < 1.5:
        return math.exp(-(x**n))
    if form < 2.5:
        return 1.0 / (1.0 + math.pow(x, n))
    if form < 3.5:
        return 1.0 - step(0.5 * x)
    if form < 4.5:
        return math.exp(-x) if w > 0.0 else 0.4 * math.exp(-x)
    return rested * math.exp(-x)  # grows with the time at rest


@compiled
def _tight(q: float, form: float, at: float, width: float) -> float:
    """Profile of a tight spot over the boom angle."""
    x = (q - at) / width
    if form < 1.5:
        return 1.0 / (1.0 + x**4)
    if form < 2.5:
        return step(1.0 + x) * step(1.0 - x)
    if form < 3.5:
        return max(0.0, 1.0 - abs(x))
    if form < 4.5:
        return 0.5 * (1.0 + math.tanh(3.0 * x))  # stiff beyond an angle
    return 0.5 * (1.0 + math.sin(2.0 * x))  # an oval bush


@compiled
def _bristles(y: Values, form: float, share: float) -> float:
    """Friction of the bristles over that of full slip."""
    if form > 3.5 and form < 4.5:
        return share * y[BRISTLE] + (1.0 - share) * (0.6 * y[BRISTLE_2] + 0.4 * y[BRISTLE_3])
    return float(y[BRISTLE])


@compiled
def friction(y: Values, u: Values, e: EffectTable, c: CraneNumbers) -> float:
    """Friction torque (5.39b) with everything that acts on it [N m]."""
    q, w = y[0], y[1]
    slip = math.tanh(w / c.sigma)
    coulomb, viscous = (c.tau_up, c.k_up) if w >= 0.0 else (c.tau_down, c.k_down)
    if e[E_BREAKAWAY, 0] > 0.0:
        b = e[E_BREAKAWAY]
        coulomb *= 1.0 + b[1] * _breakaway(w, b[0], b[2], b[3], y[BRISTLE_3])
    if e[E_TIGHT, 0] > 0.0:
        t = e[E_TIGHT]
        coulomb *= 1.0 + t[1] * _tight(q, t[0], t[2], t[3])
    if e[E_BRISTLE, 0] > 0.0:
        b = e[E_BRISTLE]
        slip = (1.0 - b[2]) * slip + b[2] * _bristles(y, b[0], b[3])
    warm = 1.0 + e[E_WARM, 1] * curve(e[E_WARM, 2], y[WARMTH], e[E_WARM, 3]) if e[E_WARM, 0] > 0.0 else 1.0
    return (coulomb * slip + viscous * w / (1.0 + u[U_THIN])) * (1.0 + u[U_FRICTION]) * max(warm, 0.05)


@compiled
def _slip_rate(z: float, w: float, width: float, form: float, a: float) -> float:
    """Rate of a bristle's relative deflection z in -1..1."""
    v = w / width
    if form < 1.5:  # Dahl
        return v * math.pow(max(1.0 - z * (1.0 if w >= 0.0 else -1.0), 0.0), 0.5 + 1.5 * a)
    if form < 2.5:  # LuGre, straight
        return v - abs(v) * z
    if form < 3.5:  # Bouc-Wen
        return v - abs(v) * math.pow(abs(z), a + 1.0) * z / (abs(z) + 1e-6)
    if form < 4.5:  # Jenkin elements: elastic, then sliding
        return v * (1.0 - step((z * (1.0 if w >= 0.0 else -1.0) - 0.9) * 10.0))
    return v * (1.0 - step((abs(z) - a) / (1.0 - a))) if z * w > 0.0 else v  # elastic up to a, then plastic


@compiled
def friction_rates(y: Values, dy: Values, e: EffectTable, torque: float) -> None:
    """Rates of bristles, of the time at rest and of the joint's warmth, into dy."""
    w = y[1]
    b = e[E_BRISTLE]
    if b[0] > 0.0:
        dy[BRISTLE] = _slip_rate(y[BRISTLE], w, b[1], b[0], b[3])
        dy[BRISTLE_2] = _slip_rate(y[BRISTLE_2], w, 3.0 * b[1], b[0], b[3])
        dy[BRISTLE_3] = _slip_rate(y[BRISTLE_3], w, 0.3 * b[1], b[0], b[3])
    elif e[E_BREAKAWAY, 0] > 4.5:
        rested = 1.0 / (1.0 + (w / REST) ** 2)
        dy[BRISTLE_3] = (rested - y[BRISTLE_3]) / (e[E_BREAKAWAY, 4] if rested > y[BRISTLE_3] else 0.05)
    if e[E_WARM, 0] > 0.0:
        dy[WARMTH] = abs(torque * w) / e[E_WARM, 4] - y[WARMTH] / e[E_WARM, 5]


@compiled
def _contact(depth: float, speed: float, form: float, stiffness: float, a: float) -> float:
    """Torque [N m] of something that is touched by ``depth`` [rad], entered with ``speed`` [rad/s]; it never pulls."""
    if depth <= 0.0:
        return 0.0
    if form < 1.5:
        torque = stiffness * depth * (1.0 + 2.0 * a * speed)
    elif form < 2.5:  # Hertz and Hunt-Crossley
        torque = stiffness * 5.0 * depth**1.5 * (1.0 + 4.0 * a * speed)
    elif form < 3.5:  # soft soil: firm going in, springing back little
        torque = stiffness * depth * (1.0 + (0.2 + 0.6 * a) * math.tanh(speed / 0.01))
    elif form < 4.5:  # rubber
        torque = stiffness * 0.1 * (math.exp(min(depth / 0.1, 3.0)) - 1.0)
    else:  # mud: a slow damper
        torque = stiffness * depth * max(0.3 + 20.0 * a * speed, 0.0)
    return max(torque, 0.0)


@compiled
def outer_torque(y: Values, u: Values, e: EffectTable, c: CraneNumbers) -> float:
    """Torque of weight, load, ground and stops on the boom [N m], positive lifting."""
    q, w = y[0], y[1]
    leaning = q + y[BASE] + u[U_TILT]
    cq, sq = math.cos(leaning), math.sin(leaning)
    added = u[U_LOAD]
    reach = added * c.load_reach
    sx = c.S_x + c.load * c.tip_x + reach * c.tip_x + added * c.load_off_x
    sy = c.S_y + c.load * c.tip_y + reach * c.tip_y + added * c.load_off_y
    torque = -c.g * (sx * cq - sy * sq)
    if e[E_GROUND, 0] > 0.0:
        s = e[E_GROUND]
        torque += _contact(s[2] - q, -w, s[0], s[1], s[3])
    if e[E_STOP, 0] > 0.0:
        s = e[E_STOP]
        torque -= _contact(q - s[2], w, s[0], s[1], s[3])
    return torque


@compiled
def _inertia(u: Values, c: CraneNumbers) -> float:
    added, tx, ty = u[U_LOAD], c.load_reach * c.tip_x + c.load_off_x, c.load_reach * c.tip_y + c.load_off_y
    return c.inertia + c.load * (c.tip_x**2 + c.tip_y**2) + added * (tx * tx + ty * ty + c.load_gyration**2)


@compiled
def _swinging(y: Values, dy: Values, inertia: float, torque: float, s: Values, c: CraneNumbers) -> None:
    """Boom and a body that hangs at its tip: two equations of Lagrange for q and the body's angle from the vertical."""
    q, w, a, v = y[0], y[1], y[SWING], y[SWING_RATE]
    cq, sq, ca, sa = math.cos(q), math.sin(q), math.cos(a), math.sin(a)
    x, h = cq * c.tip_x - sq * c.tip_y, sq * c.tip_x + cq * c.tip_y
    mass, length, form = s[1], s[2], s[0]
    arm = mass * length
    m11 = inertia + mass * (x * x + h * h)
    m12 = arm * (-h * ca + x * sa)
    m22 = mass * (length**2 + (s[4] * length) ** 2)
    natural = math.sqrt(c.g / length)
    damping = 2.0 * s[3] * natural * m22
    resisting = damping * v
    if form > 1.5 and form < 2.5:
        resisting = damping * abs(v) * v / 0.15
    elif form > 2.5 and form < 3.5:
        resisting = damping * 0.15 * math.tanh(v / 0.02)
    elif form > 3.5:
        resisting += s[5] * arm * c.g * a  # a stiff rotator
    r1 = torque - mass * c.g * x - arm * (h * sa + x * ca) * v * v
    r2 = -arm * c.g * sa - resisting + arm * (x * ca + h * sa) * w * w
    det = m11 * m22 - m12 * m12
    dy[1], dy[SWING], dy[SWING_RATE] = (m22 * r1 - m12 * r2) / det, v, (m11 * r2 - m12 * r1) / det


@compiled
def _bending(y: Values, dy: Values, inertia: float, cylinder: float, torque: float, s: Values) -> None:
    """A root that the cylinder drives and an outer part behind a spring; the outer part weighs, and acts back on the cylinder."""
    x, v, form = y[BEND], y[BEND_RATE], s[0]
    outer = (1.0 - s[4]) * inertia
    stiffness = s[1]
    omega = math.sqrt(stiffness / outer)
    sag = x
    resisting = 2.0 * s[3] * omega * outer * v
    if form > 1.5 and form < 2.5:
        sag = x * (1.0 + (x / s[5]) ** 2)
    elif form > 2.5 and form < 3.5:
        sag = x / (1.0 + 0.5 * min(abs(x) / s[5], 2.0))
    elif form > 3.5 and form < 4.5:
        resisting *= 0.3 + abs(x) / s[5]
    elif form > 4.5:
        sag = beyond(x, 0.1 * s[5])  # play in the joint
    moment = stiffness * sag + resisting
    root_rate = (cylinder + moment) / (s[4] * inertia)
    dy[1] = root_rate
    dy[BEND], dy[BEND_RATE] = v, (torque - moment) / outer - root_rate


@compiled
def motion(y: Values, dy: Values, u: Values, e: EffectTable, c: CraneNumbers, drive: float) -> None:
    """Accelerations (5.39a) for the cylinder's torque ``drive`` [N m], and the rates of all that hangs on them, into dy."""
    resisting = friction(y, u, e, c)
    friction_rates(y, dy, e, resisting)
    outer, inertia = outer_torque(y, u, e, c), _inertia(u, c)
    dy[0] = y[1]
    if e[E_BASE, 0] > 0.0:
        _rocking(y, dy, drive, e[E_BASE])
        outer -= inertia * dy[BASE_RATE]
    if e[E_SWING, 0] > 0.0:
        _swinging(y, dy, inertia, drive - resisting + outer, e[E_SWING], c)
    elif e[E_BEND, 0] > 0.0:
        _bending(y, dy, inertia, drive - resisting, outer, e[E_BEND])
    else:
        dy[1] = (drive - resisting + outer) / inertia


@compiled
def _rocking(y: Values, dy: Values, drive: float, s: Values) -> None:
    """The base gives way to the cylinder's torque: compliance s[1] [rad/(N m)], about the torque s[4]."""
    x, v, form = y[BASE], y[BASE_RATE], s[0]
    wanted = -s[1] * (drive - s[4])
    if form > 1.5 and form < 2.5:
        wanted /= 1.0 + abs(wanted) / s[5]
    elif form > 2.5 and form < 3.5:
        wanted = beyond(wanted, 0.3 * s[5])
    elif form > 3.5:
        wanted *= 1.0 + abs(wanted) / s[5]
    dy[BASE], dy[BASE_RATE] = v, s[2] ** 2 * (wanted - x) - 2.0 * s[3] * s[2] * v
