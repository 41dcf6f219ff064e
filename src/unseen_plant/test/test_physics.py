"""Balances of mass and energy, the body of the boom, and the integrator against itself."""

from pathlib import Path

import numpy as np
import pytest

from unseen_plant import running
from unseen_plant.hydraulics import stiffness
from unseen_plant.layout import (
    ANGLE,
    E_AIR,
    E_BEND,
    E_CAVITY,
    E_SWING,
    P_A,
    P_B,
    P_H,
    P_O1,
    P_O2,
    RATE,
    SLOTS,
    STEP,
    SWING,
    SWING_RATE,
    WIDTH,
)  # fmt: skip
from unseen_plant.machine import LockedPose, Owner, body, crane
from unseen_plant.mechanics import linkage
from unseen_plant.running import Machinery, rest, run

MACHINE = Path(__file__).parents[3] / "src" / "boom_model" / "boom_model" / "machines" / "tz17.yaml"
OWNER = Owner.read(MACHINE)
STRETCHED = LockedPose(0.28, 2.2)


def kicked(m, seconds=3.0, **values):
    """A crane with closed valves that is kicked at rest: states from the kick on."""
    start = rest(m, 0.5, 20e5)
    start[RATE] = 0.05
    states = run(m, start, np.zeros((round(seconds / STEP), 2)))
    return np.concatenate([start[None], states])


def strokes(states, c):
    return np.array([linkage(float(y[ANGLE]), c) for y in states]).T


def test_oil_is_neither_made_nor_lost_between_closed_valves():
    c = crane(OWNER, STRETCHED)._replace(A_ac=0.0)
    states = kicked(Machinery(c))
    stroke, _ = strokes(states, c)
    rod = np.log(c.V_b + (c.stroke - stroke) * c.A_b) + states[:, P_B] / c.beta
    assert np.ptp(states[:, P_B]) > 5e5
    assert np.ptp(rod) < 2e-7
    gas = [c.V_g * np.minimum((p / states[:, k]) ** (1.0 / c.kappa), 1.0) for k, p in ((P_O1, c.p_1), (P_O2, c.p_2))]
    held = (c.V_a + stroke * c.A_a) * np.exp(states[:, P_A] / c.beta) + c.V_h * np.exp(states[:, P_H] / c.beta)
    held += sum((c.V_g - v) * np.exp(states[:, k] / c.beta) for k, v in ((P_O1, gas[0]), (P_O2, gas[1])))
    assert np.ptp(stroke) * c.A_a > 5e-6
    assert np.ptp(held) < 1e-7


def energy(states, c, swing=None, bend=None):
    """Kinetic and potential energy of everything that moves [J]."""
    q, w = states[:, ANGLE], states[:, RATE]
    lift = c.S_x * np.sin(q) + c.S_y * np.cos(q)
    total = 0.5 * c.inertia * w**2 + c.g * lift
    if swing is not None:
        mass, length = swing
        a, v = states[:, SWING], states[:, SWING_RATE]
        x, h = np.cos(q) * c.tip_x - np.sin(q) * c.tip_y, np.sin(q) * c.tip_x + np.cos(q) * c.tip_y
        vx, vy = -h * w + length * v * np.cos(a), x * w + length * v * np.sin(a)
        total += 0.5 * mass * (vx**2 + vy**2) + mass * c.g * (h - length * np.cos(a))
    return total


@pytest.mark.parametrize("swing", [None, (400.0, 1.7)])
def test_the_cylinder_does_all_the_work_that_the_body_gains(swing):
    c = crane(OWNER, STRETCHED)._replace(tau_up=0.0, tau_down=0.0, k_up=0.0, k_down=0.0)
    e, moving = np.zeros((SLOTS, WIDTH)), ()
    if swing:
        e[E_SWING, :6] = 1.0, *swing, 0.0, 0.0, 0.0
        moving = (SWING, SWING_RATE)
    states = kicked(Machinery(c, e, moving=moving))
    _, lever = strokes(states, c)
    power = (states[:, P_A] * c.A_a - states[:, P_B] * c.A_b) * lever * states[:, RATE]
    done = np.concatenate([[0.0], np.cumsum(0.5 * STEP * (power[1:] + power[:-1]))])
    gained = energy(states, c, swing)
    assert np.ptp(gained) > 30.0
    assert np.abs(gained - gained[0] - done).max() < 0.02 * np.ptp(gained)


def test_a_bending_boom_rings_at_its_own_frequency():
    c = crane(OWNER, STRETCHED)
    e = np.zeros((SLOTS, WIDTH))
    share, stiff = 0.05, 3.0e6
    e[E_BEND, :6] = 1.0, stiff, 0.0, 0.002, share, 0.02
    stiff_oil = c._replace(beta=5e10, burst=0.0, gas=0.0)
    y = kicked(Machinery(stiff_oil, e, moving=(13, 14)), 8.0)
    bend = y[400:, 13] - y[400:, 13].mean()
    crossings = np.flatnonzero((bend[1:] > 0) & (bend[:-1] <= 0))
    rung = (len(crossings) - 1) / ((crossings[-1] - crossings[0]) * STEP)
    assert rung == pytest.approx(np.sqrt(stiff / ((1 - share) * c.inertia)) / (2 * np.pi), rel=0.03)


@pytest.mark.parametrize("form", [1.0, 2.0, 3.0, 4.0, 5.0])
def test_air_and_vapour_soften_the_oil_and_pressure_hardens_it(form):
    c, e = crane(OWNER, STRETCHED), np.zeros((SLOTS, WIDTH))
    assert stiffness(10e5, 0.0, e, c) == c.beta
    e[E_AIR, :5] = form, 0.01, 1.2, 30e5, 0.0
    assert stiffness(2e5, 0.0, e, c) < stiffness(10e5, 0.0, e, c) < c.beta
    e[E_AIR] = 0.0
    e[E_CAVITY, :4] = min(form, 4.0), 50.0, 1e5, 0.5
    assert stiffness(-0.5e5, 1.0, e, c) < 0.2 * c.beta < stiffness(5e5, 1.0, e, c)


def test_the_lever_is_the_slope_of_the_stroke_for_both_linkages():
    c = crane(OWNER, STRETCHED)
    triangle = c._replace(bars=0.0, side_a=1.8, side_b=0.44, corner=1.0)
    for each in (c, triangle):
        for q in (-0.6, 0.0, 0.7, 1.4):
            slope = (linkage(q + 1e-6, each)[0] - linkage(q - 1e-6, each)[0]) / 2e-6
            assert linkage(q, each)[1] == pytest.approx(slope, rel=1e-7)


@pytest.mark.parametrize(("q3", "q4", "told"), [
    (4.59, 0.0, (5287.8, 2148.8, 426.4)), (0.28, 2.2, (30204.5, 4549.7, -2851.3)), (0.28, 2.8, (33818.1, 4633.6, -3142.9)),
])  # fmt: skip
def test_the_locked_body_is_that_of_the_machine_notes(q3, q4, told):
    configs = {name: {**entry, "q3": -9.0} for name, entry in OWNER.document["rigid_body"]["configs"].items()}
    computed = Owner({**OWNER.document, "rigid_body": {**OWNER.document["rigid_body"], "configs": configs}}, "x")
    inertia, moments, _ = body(computed, LockedPose(q3, q4))
    assert (inertia, *moments) == pytest.approx(told, rel=1e-4)


def test_ten_times_finer_steps_change_next_to_nothing(monkeypatch):
    m = Machinery(crane(OWNER, STRETCHED))
    start = rest(m, 0.4, 10e5)
    currents = np.zeros((2000, 2))
    currents[200:700, 1], currents[900:1500, 0] = 0.5, 0.55
    usual = running.seen(run(m, start, currents))
    monkeypatch.setattr(running, "TOLERANCE", running.TOLERANCE / 10.0)
    finer = running.seen(run(m, start, currents))
    assert np.abs(usual - finer).max(axis=0) == pytest.approx(0.0, abs=0.3e5)
    assert np.abs(usual - finer)[:, 0].max() < 5e-5
    assert np.sqrt(np.mean((usual - finer) ** 2, axis=0))[2:].max() < 0.03e5
