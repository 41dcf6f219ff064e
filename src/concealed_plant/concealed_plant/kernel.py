"""The concealed plant over time: linearly implicit steps of fixed length, in machine code.

Order of one step: pilot stage (exact), spool (implicit in its friction), flows as conductances at the old pressures, all
pressures at once (implicit in the pressure differences), then the mechanics with the new pressures. Every conductance is a
secant, flow over drop, so that the step is stable for any of them. First order; the step is a tenth of the fastest time
constant that the sensors can resolve.

What the thesis' equations (5.39) say about the nominal machine is solved here in another way; what is concealed has other
functional forms than a catalogue would guess (``concealments`` tells them).

`simulate` is one function: divided into seven (pilot stage, spool, supply, return, hose burst valve, walls, friction) it is as fast
(0.92 to 1.19 of its time over 38 runs), but the compiler then rounds otherwise (1e-13 of a standard deviation), and the sealed
answers of docs/proof.md would have another checksum. To be divided with the next published trial.
"""

from __future__ import annotations

from math import cos, exp, pi, sin, sqrt, tanh
from typing import Any

import numpy as np
from numpy.typing import NDArray

from concealed_plant.compiling import compiled
from concealed_plant.quantities import Quantities

Array = NDArray[np.float64]

MILLISECOND = 1e-3
STEPS = 5
"""In a millisecond."""
CORNER = 1.0e6
"""Pa^2: square of the drop below which an orifice is laminar."""
AMBIENT = 101_325.0
LPM, BAR = 1.0 / 60_000.0, 1.0e5
FULL_FLOW = 2.0e-3
SLIDERS = 4
NAMES = ("angle", "rate", "hose", "rod", "head", "spool", "gas_1", "gas_2", "flow_head", "acceleration")


@compiled
def orifice(k: float, drop: float) -> float:
    """Conductance [m^3/s/Pa] of q = k sqrt(drop), laminar near zero."""
    return k / sqrt(sqrt(drop * drop + CORNER))


@compiled
def stiffness(pressure: float, m: Quantities) -> float:
    """1 / bulk modulus [1/Pa] of oil with air that goes into solution in proportion to pressure, isothermal (Henry)."""
    result = 1.0 / m.bulk
    if m.air > 0.0:
        absolute = max(pressure + AMBIENT, 2.0e4)
        free = m.air * max(0.0, 1.0 - absolute / m.air_dissolves)
        result += free * AMBIENT / (absolute * absolute)
        if free > 0.0:
            result += m.air * AMBIENT / (m.air_dissolves * absolute)
    return result


@compiled
def limiting_from(m: Quantities) -> float:
    """Difference [Pa] over the hose burst valve below which it limits the flow."""
    return 2.0 * m.hbv_30 * m.poppet_preload / (m.hbv_21 - m.hbv_31) * BAR


@compiled
def limited(drop: float, m: Quantities) -> float:
    """Conductance [m^3/s/Pa] of the hose burst valve for oil that leaves, drop = p_h - p_a <= 0 [Pa]; preloaded spring."""
    d = drop / BAR
    if drop >= limiting_from(m):
        bend = (m.hbv_21 - m.hbv_31) ** 2 / (-4.0 * m.hbv_30 * m.poppet_preload)
        return (m.hbv_21 + bend * d) * LPM / BAR
    return (m.hbv_31 + m.hbv_30 * m.poppet_preload / d) * LPM / BAR


@compiled
def opening(spool: float, m: Quantities) -> float:
    """Share of the largest area that the edges of this side leave open; an edge that was shifted is shifted bodily."""
    x = min(abs(spool) / m.spool_stroke, 1.2)
    shift = m.edge_shift_up if spool < 0.0 else m.edge_shift_down
    u = (x - m.overlap - shift) / (1.0 - m.overlap)
    if u <= 0.0:
        return 0.0
    return float(u**m.progression)


@compiled
def pilot(nu: float, m: Quantities) -> float:
    """Pilot pressure [Pa]."""
    return BAR * (m.curve_2 * nu * nu + m.curve_1 * nu + m.curve_0)


@compiled
def spear(distance: float, m: Quantities) -> float:
    """Resistance [Pa s/m^3] of the annular gap that is left for the oil near an end of stroke: laminar, longer overlap."""
    if m.spear_resistance == 0.0 or distance >= m.spear_length:
        return 0.0
    entered = 1.0 - max(distance, 0.0) / m.spear_length
    return m.spear_resistance * entered


@compiled
def simulate(
    m: Quantities, angles: Array, strokes: Array, levers: Array, currents: Array,
    load_course: Array, warmth: Array, supply: Array, stuck: Array, start: Array, steps: int, body: Array,
) -> Any:  # fmt: skip
    """One run.

    angles, strokes, levers: table of the linkage, equidistant: q_2 [rad], s_p [m], ds_p/dq_2 [m/rad].
    currents (n, 2): i_+ (lower), i_- (lift) [A] in each millisecond. load_course, warmth, supply, stuck (n,): share of the
    extra load that is attached, factor of the friction, factor of the supply flow, 1 while the spool sticks.
    start: q_2 [rad], p_a, p_b [Pa]. steps: in a millisecond.
    body (n, len(moving_body.COLUMNS)): where the other joints move, in each millisecond; (0, ...): they are locked.

    Returns (n, len(NAMES)): after each millisecond. NaN from where a pressure left -1 bar .. 1000 bar or the angle its table.
    """
    n = currents.shape[0]
    out = np.full((n, len(NAMES)), np.nan)
    h = MILLISECOND / steps
    spacing = angles[1] - angles[0]
    last = len(angles) - 2
    q, w, acc = start[0], 0.0, 0.0
    p_a, p_h, p_b = start[1], start[1], start[2]
    fill_1 = m.precharge_1 * m.gas_lost_1
    fill_2 = m.precharge_2 * m.gas_lost_2
    p_1, p_2 = max(p_h, fill_1), max(p_h, fill_2)
    v_1 = m.gas * (fill_1 / p_1) ** (1.0 / m.kappa)
    v_2 = m.gas * (fill_2 / p_2) ** (1.0 / m.kappa)
    wall_1 = warm_1 = p_1 * v_1
    wall_2 = warm_2 = p_2 * v_2
    s = ws = 0.0
    lam_p = lam_m = nu_p = nu_m = 0.0
    z_p = z_m = 0.0
    poppet = m.hbv_21 * LPM / BAR
    poppet_rate = 0.0
    slider = np.zeros(SLIDERS)
    swing = swing_rate = 0.0
    bend = bend_rate = 0.0
    rock = rock_rate = 0.0
    rocking = m.rock_compliance > 0.0
    slack = 0.0
    q_back = q_valve = 0.0
    root = m.discharge * sqrt(2.0 / m.density)
    k_1 = root * pi / 4.0 * (m.throat_1 * m.clogged) ** 2
    k_2 = root * pi / 4.0 * (m.throat_2 * m.clogged) ** 2
    rising, falling = exp(m.pole * h / m.slower_rising), exp(m.pole * h / m.slower_falling)
    swings, bends = m.pendulum_mass > 0.0, m.bend_share > 0.0
    omega_b = 2.0 * pi * m.bend_frequency
    omega_r = 2.0 * pi * m.rock_frequency
    moves = body.shape[0] > 0
    inertia, moment_x, moment_y, tip_x, tip_y = m.inertia, m.moment_x, m.moment_y, m.tip_x, m.tip_y
    if rocking:  # the base stands where gravity has put it
        rock = -m.rock_compliance * m.gravity * (m.moment_x + m.load * m.tip_x)
    for i in range(n):
        i_p, i_m = currents[i, 0], currents[i, 1]
        mass = m.load + m.extra_load * load_course[i]
        if moves:  # Newton's law for the particles of the bodies, about the boom joint: ``moving_body``
            moment_x, moment_y, tip_x, tip_y = body[i, 1], body[i, 2], body[i, 3], body[i, 4]
            inertia = body[i, 0]
            pushed = body[i, 5] + mass * (tip_x * body[i, 10] - tip_y * body[i, 9])
            carried = 2.0 * (body[i, 6] + mass * (tip_x * body[i, 7] + tip_y * body[i, 8]))
            whirl, shaft = body[i, 11] ** 2, body[i, 12]
            square_re = body[i, 13] + mass * (tip_x * tip_x - tip_y * tip_y)
            square_im = body[i, 14] + mass * 2.0 * tip_x * tip_y
        total = inertia + mass * (tip_x**2 + tip_y**2) + m.load_gyration * load_course[i]
        held = stuck[i] > 0.5
        for _ in range(steps):
            # ---- pilot stage: exact for a held current, faster or slower where it rises, then a coil with remanence
            end_p, end_m = -i_p / m.pole, -i_m / m.pole
            lam_p = end_p + (lam_p - end_p) * (rising if lam_p < end_p else falling)
            lam_m = end_m + (lam_m - end_m) * (rising if lam_m < end_m else falling)
            new_p = m.gain * lam_p + m.through * i_p
            new_m = m.gain * lam_m + m.through * i_m
            drive = pilot(new_p, m) - pilot(new_m, m)
            if m.remanence > 0.0:
                step_p, step_m = (new_p - nu_p) / m.remanence_width, (new_m - nu_m) / m.remanence_width
                z_p = (z_p + step_p) / (1.0 + abs(step_p))
                z_m = (z_m + step_m) / (1.0 + abs(step_m))
                drive -= m.remanence * (z_p - z_m)
            nu_p, nu_m = new_p, new_m
            # ---- spool
            if held:
                ws = 0.0
            else:
                x = s / m.spool_stroke
                spring = m.spring * m.spring_factor * (1.0 + m.spring_hardening * x * x)
                force = drive * m.spool_area - spring * s
                if m.jet > 0.0:
                    u = opening(s, m)
                    across = p_b - m.tank if s < 0.0 else p_h - m.tank
                    thrust = m.jet * u * (m.margin + max(across, 0.0)) * (0.36 + 0.3 * (1.0 - min(u, 1.0)))
                    force += thrust if s < 0.0 else -thrust
                rub = m.spool_damping
                rub += (
                    m.spool_coulomb / m.spool_slip if abs(ws) < 1e-9 else m.spool_coulomb * tanh(ws / m.spool_slip) / ws
                )
                ws = (m.spool_mass * ws + h * force) / (m.spool_mass + h * rub + h * h * spring)
                s += h * ws
            # ---- where the linkage stands
            place = (q - angles[0]) / spacing
            cell = int(place)
            if not 0 <= cell <= last:
                return out
            part = place - cell
            stroke = strokes[cell] + part * (strokes[cell + 1] - strokes[cell])
            lever = levers[cell] + part * (levers[cell + 1] - levers[cell])
            if m.play > 0.0:
                pull = p_a * m.area_a - p_b * m.area_b
                goal = 0.5 * m.play * pull / (abs(pull) + 3.0e3)
                slack_rate = (goal - slack) / (4.0e-3 + h)
                slack += h * slack_rate
            else:
                slack_rate = 0.0
            stroke += slack
            velocity = lever * w + slack_rate
            # ---- conductances at the old pressures
            u = opening(s, m)
            lifting = s < 0.0
            fed = root * (m.edge_sa if lifting else m.edge_sb) * u * sqrt(m.margin) * supply[i]
            against = p_h if lifting else p_b
            if m.sag > 0.0:
                fed *= sqrt(max(0.02, 1.0 - m.sag * fed / FULL_FLOW * (1.0 + max(against, 0.0) / 4.0e7)))
            if m.pump > 0.0:
                fed = min(fed, (1.0 - max(against, 0.0) / 2.0e8) / m.pump)
            if lifting:
                g_back = orifice(root * m.edge_tb * u, p_b - m.tank)
                drop = p_b - m.tank
            else:
                lid = min(u, 1.3)
                g_back = orifice(root * m.edge_sb * u / (m.out_0 - m.out_1 * lid * lid), p_h - m.tank)
                drop = p_h - m.tank
            if g_back > 0.0:
                resistance = 0.0
                if m.back_turbulent > 0.0 or m.back_laminar > 0.0:
                    share = abs(q_back) / FULL_FLOW
                    resistance += (m.back_turbulent * share**0.75 + m.back_laminar) / FULL_FLOW
                if lifting:
                    resistance += spear(m.stroke - stroke, m)
                elif m.kink > 0.0:
                    resistance += m.kink * abs(q_back) / (1.0 + exp((q - m.kink_angle) / 0.03))
                if resistance > 0.0:
                    g_back = 1.0 / (1.0 / g_back + resistance)
                q_back = 0.5 * (q_back + g_back * drop)
            drop = p_h - p_a
            if drop >= 0.0:
                d = drop / BAR
                g_a = (m.hbv_11 + m.hbv_12 / sqrt(d + m.hbv_knee)) * LPM / BAR
                goal = m.hbv_21 * LPM / BAR
            else:
                goal = limited(drop, m)
                g_a = goal
            if m.poppet_frequency > 0.0:
                poppet_rate += h * m.poppet_frequency * (m.poppet_frequency * (goal - poppet) - 2.0 * poppet_rate)
                poppet += h * poppet_rate
                poppet = max(poppet, 0.0)
                if drop < 0.0:
                    g_a = poppet
            if drop < 0.0 and m.spear_resistance > 0.0:
                g_a = 1.0 / (1.0 / max(g_a, 1e-14) + spear(stroke, m))
            leak = orifice(m.seal_gap, p_a - p_b)
            c_a = (m.dead_a + stroke * m.area_a) * stiffness(p_a, m)
            c_b = (m.dead_b + (m.stroke - stroke) * m.area_b) * stiffness(p_b, m)
            c_h = m.hose * stiffness(p_h, m)
            # ---- accumulators: an empty one gives nothing
            g_1, g_2 = orifice(k_1, p_h - p_1), orifice(k_2, p_h - p_2)
            if m.clogged_viscous > 0.0:
                g_1, g_2 = 1.0 / (1.0 / g_1 + m.clogged_viscous), 1.0 / (1.0 / g_2 + m.clogged_viscous)
            if p_h < p_1:
                g_1 *= min(1.0, max(0.0, m.gas - v_1) / 1.0e-7)
            if p_h < p_2:
                g_2 *= min(1.0, max(0.0, m.gas - v_2) / 1.0e-7)
            c_1 = max(m.gas - v_1, 0.0) / m.bulk + v_1 / (m.kappa * p_1)
            c_2 = max(m.gas - v_2, 0.0) / m.bulk + v_2 / (m.kappa * p_2)
            # ---- all pressures at once; the accumulators are eliminated, then p_a
            share_1, share_2 = h * g_1 / (c_1 + h * g_1), h * g_2 / (c_2 + h * g_2)
            gap_a = leak * h
            a_hh = c_h + h * g_a + h * g_1 * (1.0 - share_1) + h * g_2 * (1.0 - share_2)
            b_h = c_h * p_h + h * g_1 * (1.0 - share_1) * p_1 + h * g_2 * (1.0 - share_2) * p_2
            a_bb, b_b = c_b + gap_a, c_b * p_b + gap_a * p_a + h * m.area_b * velocity
            if lifting:
                b_h += h * fed
                a_bb += h * g_back
                b_b += h * g_back * m.tank
            else:
                b_b += h * fed
                a_hh += h * g_back
                b_h += h * g_back * m.tank
            if p_b < m.refill_opens:
                g = orifice(root * m.refill, m.refill_opens - p_b)
                a_bb += h * g
                b_b += h * g * m.refill_opens
            if p_h < m.refill_opens:
                g = orifice(root * m.refill, m.refill_opens - p_h)
                a_hh += h * g
                b_h += h * g * m.refill_opens
            a_aa = c_a + h * g_a + gap_a
            b_a = c_a * p_a + gap_a * p_b - h * m.area_a * velocity
            couple = h * g_a
            new_h = (b_h * a_aa + couple * b_a) / (a_hh * a_aa - couple * couple)
            new_a = (b_a + couple * new_h) / a_aa
            new_b = b_b / a_bb
            q_valve = fed if lifting else -g_back * (new_h - m.tank)
            new_1, new_2 = p_1 + share_1 * (new_h - p_1), p_2 + share_2 * (new_h - p_2)
            v_1 = min(m.gas, v_1 - v_1 / (m.kappa * p_1) * (new_1 - p_1))
            v_2 = min(m.gas, v_2 - v_2 / (m.kappa * p_2) * (new_2 - p_2))
            if m.wall_rate > 0.0:  # temperatures as p V, gas to wall, wall to air ten times slower
                heat_1, heat_2 = new_1 * v_1 - wall_1, new_2 * v_2 - wall_2
                rate_1 = m.wall_rate * (1.0 + 3.0 * abs(heat_1) / wall_1)
                rate_2 = m.wall_rate * (1.0 + 3.0 * abs(heat_2) / wall_2)
                new_1 -= h * rate_1 * heat_1 / v_1
                new_2 -= h * rate_2 * heat_2 / v_2
                wall_1 += h * (rate_1 * heat_1 - 0.1 * m.wall_rate * (wall_1 - warm_1)) / m.wall_size
                wall_2 += h * (rate_2 * heat_2 - 0.1 * m.wall_rate * (wall_2 - warm_2)) / m.wall_size
            p_a, p_h, p_b, p_1, p_2 = new_a, new_h, new_b, new_1, new_2
            # ---- mechanics
            coulomb = m.coulomb_up if w >= 0.0 else m.coulomb_down
            if m.stiction > 0.0:
                coulomb += m.stiction / (1.0 + (w / m.stiction_rate) ** 2)
            if m.tight > 0.0:
                away = q - m.tight_angle
                reach = m.tight_above if away > 0.0 else m.tight_below
                if abs(away) < reach:
                    coulomb *= 1.0 + m.tight * 0.5 * (1.0 + cos(pi * away / reach))
            rub_torque = (1.0 - m.slider_share) * coulomb * tanh(w / m.slip)
            if m.slider_share > 0.0:
                for k in range(SLIDERS):
                    bound = m.slider_share * coulomb * (0.4 - 0.1 * k)
                    slider[k] += m.slider_share * m.slider_stiffness * (0.1 + 0.2 * k) / 1.6 * w * h
                    slider[k] = min(max(slider[k], -bound), bound)
                    rub_torque += slider[k]
            rub_torque += (m.viscous_up if w >= 0.0 else m.viscous_down) * w
            drive_torque = lever * (p_a * m.area_a - p_b * m.area_b) - rub_torque * warmth[i]
            up = q + rock
            c, d = cos(up), sin(up)
            x_tip, y_tip = tip_x * c - tip_y * d, tip_x * d + tip_y * c
            torque = drive_torque - m.gravity * (moment_x * c - moment_y * d + mass * x_tip)
            if moves:
                height = moment_x * d + moment_y * c + mass * y_tip
                twice = square_re * 2.0 * c * d + square_im * (c * c - d * d)
                torque -= pushed + carried * w + whirl * (shaft * height + 0.5 * twice)
            if q < m.rest_angle:
                torque += max(0.0, m.rest_stiffness * (m.rest_angle - q) - 0.02 * m.rest_stiffness * w)
            effective = total
            if swings:
                reach = x_tip * cos(swing) + y_tip * sin(swing)
                rope = m.pendulum_length * swing_rate**2 + m.gravity * cos(swing)
                rope += w * w * (x_tip * sin(swing) - y_tip * cos(swing))
                torque -= m.pendulum_mass * reach * rope
                effective += m.pendulum_mass * reach * reach
            if bends:
                back = 0.3 * m.bend_share
                own = omega_b * omega_b * bend
                own += 2.0 * m.bend_loss * omega_b * bend_rate * (1.0 + abs(bend_rate) / 0.05)
                acc = (torque / effective + back * own) / (1.0 - back * m.bend_share)
                bend_rate += h * (-m.bend_share * acc - own)
                bend += h * bend_rate
            else:
                acc = torque / effective
            if rocking:
                size = 1.0 / (m.rock_compliance * omega_r * omega_r)
                pull = -drive_torque - rock / m.rock_compliance - 2.0 * m.rock_loss * omega_r * size * rock_rate
                shake = pull / size
                rock_rate += h * shake
                rock += h * rock_rate
                acc -= shake
            if swings:
                tip_ax, tip_ay = -y_tip * acc - x_tip * w * w, x_tip * acc - y_tip * w * w
                angular = -(tip_ax * cos(swing) + (m.gravity + tip_ay) * sin(swing)) / m.pendulum_length
                drag = 2.0 * m.pendulum_drag * sqrt(m.gravity / m.pendulum_length) * swing_rate
                swing_rate += h * (angular - drag * (0.5 + abs(swing_rate) / 0.2))
                swing += h * swing_rate
            w += h * acc
            q += h * w
        if not (-1.0e5 < p_b < 1.0e8 and -1.0e5 < p_h < 1.0e8 and p_a > -1.0e5):
            return out
        out[i, 0], out[i, 1] = q + bend + rock, w + bend_rate + rock_rate
        out[i, 2], out[i, 3], out[i, 4], out[i, 5] = p_h, p_b, p_a, s
        out[i, 6], out[i, 7], out[i, 8], out[i, 9] = p_1, p_2, q_valve, acc
    return out
