"""Samples that are not to be believed, and sensors that fall silent."""

from __future__ import annotations

import math

import numpy as np
import pytest

from boom_controller.supervision.sensor_set import SensorSet
from boom_controller.supervision.sensors import Agreement, Range, SupervisedSensor


def sensor() -> SupervisedSensor:
    return SupervisedSensor("hose pressure", (Range("hose pressure", "Pa", -1e5, 6e7),))


def test_a_sensor_that_never_came_counts_as_gone() -> None:
    finding = sensor().finding(0.0, 0.05, 3)
    assert finding is not None
    assert finding.reason == "sensor_old"
    assert "no hose pressure yet" in finding.text


def test_a_good_sample_grows_old() -> None:
    made = sensor()
    assert made.take((5e6,), 1.0, 10.0)
    assert made.finding(10.045, 0.05, 3) is None
    finding = made.finding(10.06, 0.05, 3)
    assert finding is not None and "60 ms old" in finding.text


def test_the_same_stamp_again_makes_nothing_younger() -> None:
    made = sensor()
    made.take((5e6,), 1.0, 10.0)
    assert not made.take((5e6,), 1.0, 10.5)
    assert made.finding(10.5, 0.05, 3) is not None


@pytest.mark.parametrize(
    ("value", "reason"),
    [(math.nan, "sensor_not_a_number"), (math.inf, "sensor_not_a_number"), (9e7, "sensor_out_of_range")],
)
def test_one_bad_sample_is_left_out_and_three_in_a_row_are_a_reason(value: float, reason: str) -> None:
    made = sensor()
    made.take((5e6,), 1.0, 10.0)
    for k in range(2):
        assert not made.take((value,), 1.01 + 0.01 * k, 10.01 + 0.01 * k)
    assert made.values == (5e6,)
    assert made.finding(10.02, 0.05, 3) is None
    made.take((value,), 1.03, 10.03)
    finding = made.finding(10.03, 0.05, 3)
    assert finding is not None and finding.reason == reason
    made.take((5e6,), 1.04, 10.04)
    assert made.finding(10.04, 0.05, 3) is None


@pytest.mark.parametrize(("step", "said"), [(0.5, "forward by 0.5 s"), (-3600.0, "back by 3.6e+03 s")])
def test_a_clock_that_was_set_is_told_for_a_second_and_its_new_stamps_count(step: float, said: str) -> None:
    made = sensor()
    made.take((5e6,), 1.0, 10.0)
    for k in range(1, 5):  # the first may have been overtaken, or two clocks read at different times
        made.take((5e6 + k,), 1.0 + step + 0.01 * k, 10.0 + 0.01 * k)
    assert made.values == (5e6 + 4,)
    finding = made.finding(10.04, 0.05, 3)
    assert finding is not None and finding.reason == "clock_set" and said in finding.text
    for k in range(5, 120):
        made.take((5e6,), 1.0 + step + 0.01 * k, 10.0 + 0.01 * k)
    assert made.finding(11.2, 0.05, 3) is None


def test_samples_that_were_overtaken_are_no_clock_that_was_set() -> None:
    made = sensor()
    for k in range(1, 20):
        made.take((5e6,), 0.01 * k, 10.0 + 0.01 * k)
        for late in range(1, 4):
            assert not made.take((4e6,), 0.01 * (k - late), 10.0 + 0.01 * (k - late))
    assert made.finding(10.19, 0.05, 3) is None


def test_what_the_boom_did_while_no_sample_came_is_no_disagreement_and_a_jump_of_the_angle_is_told() -> None:
    agreement = Agreement(10.0)
    agreement.update(0.0, 0.3, 0.2)
    assert agreement.update(2.0, 0.3, 0.0) == 0.0
    assert agreement.jump(2.03, 0.335, 0.0, 0.01) == pytest.approx(0.035)
    assert agreement.jump(2.4, 0.335, 0.0, 0.4) == 0.0  # the boom may have done that
    assert agreement.jump(2.01, 0.302, 0.2, 0.01) == pytest.approx(0.001)
    assert agreement.jump(1.97, 0.29, 0.2, 0.01) == 0.0  # overtaken


def test_stamps_of_a_clock_that_runs_in_steps_are_no_clock_that_was_set_where_that_is_known() -> None:
    made = SensorSet()
    made.trust_no_clock()
    for k in range(400):
        stamp = round(0.01 * k / 0.025) * 0.025 + 1e-6 * k
        made.take_hose(5e6, stamp, 0.01 * k)
    assert made.hose.finding(4.0, 0.05, 3) is None


def test_a_clock_that_begins_again_is_believed_and_told_and_what_is_late_is_not() -> None:
    """A bag that is played in a loop, and a simulator that is reset."""
    made = SensorSet()
    made.trust_no_clock()
    stamps = [10.0 + 0.01 * k for k in range(50)]
    stamps[20:22] = stamps[15:17]  # overtaken
    for k, stamp in enumerate(stamps):
        made.take_hose(5e6, stamp, 0.01 * k)
    assert made.hose.finding(0.5, 0.05, 3) is None
    for k in range(50):
        made.take_hose(5e6, 0.01 * k, 0.5 + 0.01 * k)
    assert made.hose.stamp == pytest.approx(0.49)
    finding = made.hose.finding(1.0, 0.05, 3)
    assert finding is not None and finding.reason == "clock_set"
    assert "went back by 10.5 s" in finding.text and "did the bag or the simulation begin again?" in finding.text
    for k in range(50, 120):
        made.take_hose(5e6, 0.01 * k, 0.5 + 0.01 * k)
    assert made.hose.finding(1.7, 0.05, 3) is None


def test_a_clock_that_begins_again_is_told_for_a_second_though_samples_precede_it() -> None:
    """They seem 5 s old by a /clock that has not heard of it yet, and the telling was over before it began."""
    made = SensorSet()
    made.trust_no_clock()
    for k in range(60):
        stamp = 0.01 * k if k < 50 else 0.01 * (k - 50) - 5.0
        old = 5.5 if 50 <= k < 53 else 0.0
        made.take_hose(5e6, stamp, 0.01 * k - old)
    finding = made.hose.finding(0.6, 0.05, 3)
    assert finding is not None and finding.reason == "clock_set" and "back by 5.48 s" in finding.text


@pytest.mark.parametrize(("apart", "burst"), [(0.001, True), (0.01, False)])
def test_a_fifo_that_is_read_every_100_ms_is_a_burst_and_one_loss_is_none(apart: float, burst: bool) -> None:
    made, stamp = sensor(), 0.0
    for k in range(45):
        made.take((5e6,), stamp, 10.0 + stamp)
        stamp += 0.1 - 9 * apart if burst and k % 10 == 9 else 0.3 if not burst and k == 40 else apart
    assert (made.burst > 0.05) == burst
    assert made.spacing == pytest.approx(5.5 * apart if burst else apart, rel=0.2)


def test_samples_that_come_in_bursts_are_told_as_that() -> None:
    made = sensor()
    for k in range(60):
        stamp = (k // 5) * 0.1 + 0.01 * (k % 5)
        made.take((5e6,), stamp, 10.0 + stamp)
    assert made.spacing == pytest.approx(0.02, abs=0.004) and made.burst == pytest.approx(0.06)
    for k in range(60):
        made.take((5e6,), 1.3 + 0.02 * k, 11.3 + 0.02 * k)
    assert made.spacing == pytest.approx(0.02) and made.burst == 0.0


def test_one_sample_whose_clocks_were_read_apart_is_left_out_and_stops_nothing() -> None:
    made = sensor()
    for k in range(20):
        made.take((5e6,), 0.01 * k + (0.012 if k == 10 else 0.0), 10.0 + 0.01 * k)
    assert made.finding(10.19, 0.05, 3) is None and made.clock_set == 0.0


def drive(agreement: Agreement, rates: np.ndarray, shown: np.ndarray, measured: np.ndarray) -> float:
    """Largest |r| while angle and rate are shown as given."""
    return max(abs(agreement.update(0.01 * k, a, w)) for k, (a, w) in enumerate(zip(shown, measured, strict=True)))


def test_noisy_sensors_that_agree_do_not_drift_apart() -> None:
    rng = np.random.default_rng(0)
    t = np.arange(6000) * 0.01
    rate = 0.35 * np.cos(1.3 * t)
    angle = 0.4 + 0.35 / 1.3 * np.sin(1.3 * t)
    quantum = 2 * math.pi / 2**14
    worst = drive(Agreement(), rate, np.round(angle / quantum) * quantum, rate + rng.normal(0, 1.5e-3, len(t)))
    assert worst < 0.005


def test_a_frozen_angle_and_a_dead_gyro_are_found_while_the_boom_moves() -> None:
    t = np.arange(300) * 0.01
    rate = np.full(300, 0.2)
    angle = 0.3 + 0.2 * t
    assert drive(Agreement(), rate, np.full(300, 0.3), rate) > 0.05
    assert drive(Agreement(), rate, angle, np.zeros(300)) > 0.05
    assert drive(Agreement(), rate, angle, -rate) > 0.1


def test_a_gyro_that_is_five_percent_off_is_no_reason() -> None:
    t = np.arange(600) * 0.01
    assert drive(Agreement(), t, 0.3 + 0.3 * t, np.full(600, 0.3 * 1.05)) < 0.05
