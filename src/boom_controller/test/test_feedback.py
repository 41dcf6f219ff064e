"""Gains: the poles are where they are wanted, and integral states go on without a jump."""

from __future__ import annotations

from dataclasses import replace
from math import exp

import numpy as np
import pytest

from boom_controller.blocks.position_feedback import ackermann, feedback_torque, integral_for, position_gains
from boom_controller.blocks.state_feedback import FeedbackGains, gains, predicted_force
from boom_controller.controller import Settings

T = 0.01


def test_ackermann_places_the_three_poles_of_the_position_loop() -> None:
    phi = np.array([[1.0, T, 0.0], [0.0, 1.0, 0.0], [T, 0.0, 1.0]])
    gamma = np.array([T * T / 2, T, 0.0])
    wanted = [exp(-3.0 * T), exp(-4.0 * T), exp(-5.0 * T)]
    k = ackermann(phi, gamma, wanted)
    assert np.sort(np.linalg.eigvals(phi + np.outer(gamma, k)).real) == pytest.approx(np.sort(wanted), abs=1e-9)


def test_an_uncontrollable_pair_is_refused() -> None:
    with pytest.raises(np.linalg.LinAlgError):
        ackermann(np.eye(2), np.array([1.0, 0.0]), [0.5, 0.5])


def test_the_integral_holds_a_torque_and_keeps_it_when_the_pole_changes() -> None:
    k = position_gains(-3.0, T)
    integral = integral_for(1234.0, k, 0.0, 0.0, 5000.0)
    assert feedback_torque(k, 0.0, 0.0, integral, 5000.0) == pytest.approx(1234.0)
    before = feedback_torque(k, 0.01, -0.02, integral, 5000.0)
    other = position_gains(-5.0, T)
    assert feedback_torque(other, 0.01, -0.02, integral, 5000.0) != pytest.approx(before)
    integral = integral_for(before, other, 0.01, -0.02, 5000.0)
    assert feedback_torque(other, 0.01, -0.02, integral, 5000.0) == pytest.approx(before)


def test_an_error_of_the_position_and_its_integral_are_worked_against() -> None:
    k = position_gains(-3.0, T)
    assert feedback_torque(k, 0.1, 0.0, 0.0, 1.0) < 0
    assert feedback_torque(k, 0.0, 0.0, 0.1, 1.0) < 0


@pytest.mark.parametrize(("stiffness", "mass"), [(5e6, 4e4), (2e6, 1e5), (1e6, 3e5)])
def test_the_boom_on_its_oil_spring_gets_the_poles_that_are_wanted(stiffness: float, mass: float) -> None:
    s = replace(Settings(), largest_damping=60.0, feedback_damping=0.7, feedback_pole=-5.0)
    g = FeedbackGains(*map(float, gains(stiffness, mass, 0.0, 0.0, s)))
    polynomial = [1.0, stiffness * g.force, stiffness / mass * (1 + g.velocity), stiffness / mass * g.position]
    w = max((stiffness / mass) ** 0.5, s.slowest_frequency)
    assert polynomial == pytest.approx(np.polymul([1.0, 5.0], [1.0, 2 * 0.7 * w, w * w]))


def test_the_limit_of_the_damping_leaves_a_stable_loop() -> None:
    s = replace(Settings(), largest_damping=8.0)
    g = FeedbackGains(*map(float, gains(2e7, 4e4, 0.0, 0.0, s)))
    assert 2e7 * g.force == pytest.approx(8.0)
    ratio = 2e7 / 4e4
    assert np.all(np.roots([1.0, 8.0, ratio * (1 + g.velocity), ratio * g.position]).real < 0)


def test_the_force_is_predicted_as_the_oscillator_moves() -> None:
    stiffness, frequency = 4e6, 10.0
    assert predicted_force(100.0, 0.0, stiffness, frequency, np.pi / frequency) == pytest.approx(-100.0)
    small = predicted_force(0.0, 1e-3, stiffness, frequency, 1e-3)
    assert small == pytest.approx(stiffness * 1e-3 * 1e-3, rel=1e-3)


def test_a_dead_time_takes_the_damping_from_a_stiff_spring_first_and_the_safe_set_is_slow() -> None:
    def damping(stiffness: float, dead_time: float, safe: float = 0.0) -> float:
        return stiffness * float(gains(stiffness, 1.5e5, dead_time, safe, Settings()).force)

    soft, stiff = 1.5e7, 4e8  # 10 and 52 rad/s
    assert damping(soft, 0.06) > 0.5 * damping(soft, 0.0)
    assert damping(stiff, 0.06) < 0.4 * damping(stiff, 0.0)
    safe = gains(stiff, 1.5e5, 0.0, 1.0, Settings())
    assert (float(safe.position), float(safe.velocity)) == (1.0, 0.0)
    assert damping(stiff, 0.0, 1.0) == pytest.approx(5.0)
